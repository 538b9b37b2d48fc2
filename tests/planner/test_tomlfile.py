"""Lines of keys, and the sentence for every kind of bad file."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from planner.errors import InputRejected
from planner.job import Job, load_job
from planner.tomlfile import key_lines, load

THESIS = Path(__file__).parents[2] / "configs/jobs/thesis.toml"


def test_lines_of_nested_keys() -> None:
    text = 'a = "x # no"\n[b]\nc = [[1, 2],\n [3]]\n[[t]]\nk = {p = 1, q = [\n2]}\n[[t]]\n"k" = """\n\n"""\nz = 1\n'
    lines = key_lines(text)
    assert lines["a",] == 1
    assert lines["b", "c", 1, 0] == 4
    assert lines["t", 0, "k", "q", 0] == 7
    assert lines["t", 1] == 8
    assert lines["t", 1, "z"] == 12


def test_line_ends_of_every_kind_are_counted_alike(tmp_path: Path) -> None:
    """CR CR LF, as a text converted twice has it, was an internal fault."""
    text = THESIS.read_bytes().replace(b"scallop_mm", b"scalop_mm")
    path = tmp_path / "job.toml"
    for end in (b"\n", b"\r\n", b"\r\r\n"):
        path.write_bytes(text.replace(b"\n", end))
        with pytest.raises(InputRejected, match=r"job\.toml:25: unknown key scalop_mm"):
            load_job(path)


def test_thesis_job_loads() -> None:
    job = load_job(THESIS)
    assert job.tool_of(job.operation[0]).radius_mm == 4.0
    assert job.operation[0].scallop_mm == 0.08


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("scallop_mm = 0.08", "scalop_mm = 0.08", "job.toml:25: unknown key scalop_mm; did you mean scallop_mm?"),
        ("safe_z_mm = 50.0", "scallop_mm = 1.0", "job.toml:10: unknown key scallop_mm; it belongs in another table"),
        ("scallop_mm = 0.08", "scallop_mm = nan", "job.toml:25: operation.0.scallop_mm is nan"),
        ("scallop_mm = 0.08", "scallop_mm = 4.0", "job.toml:25: scallop_mm 4 is not below the ball radius 4"),
        (
            "scallop_mm = 0.08",
            'scallop_mm = "a"',
            "job.toml:25: operation.0.scallop_mm: is text in quotes; write a number",
        ),
        (
            "scallop_mm = 0.08",
            "scallop_mm = -1",
            "job.toml:25: operation.0.scallop_mm: is out of range; write a number > 0",
        ),
        ('"ball"', '"drill"', "job.toml:14: tool.0.kind: 'drill' is no choice; write one of ball, bull, flat"),
        (
            "angle_deg = 0.0",
            'angle_deg = "x"',
            "job.toml:22: operation.0.angle_deg: 'x' is no choice; write one of auto, a number",
        ),
        ("scallop_mm = 0.08", "", "job.toml:19: needs either scallop_mm or pick_feed_mm"),
        ("tool = 2", "tool = 3", "job.toml:20: tool 3 is not in the job"),
        ("[setup]", "[setup", "job.toml:5:"),
        (
            "spindle_rpm = 1000.0",
            "spindle_rpm = 1e-320",
            "job.toml:29: operation.0.spindle_rpm: is out of range; write a",
        ),
        (
            "[[operation]]",
            '[[tool]]\nnumber = 2\nkind = "ball"\ndiameter_mm = 2.0\n[[operation]]',
            "job.toml:19: tool 2 is described twice, and an operation names no edge; ",
        ),
        (
            'kind = "ball"',
            'kind = "ball"\ncorner_radius_mm = 1.0',
            "job.toml:15: corner_radius_mm goes with a bull-nose tool; leave it out, ",
        ),
        ("safe_z_mm = 50.0", "safe_z_mm = 1e308", "job.toml:10: setup.safe_z_mm: is out of range; write a number <="),
        ("length_mm = 60.0", "length_mm = true", "tool.0.length_mm: is true or false; write a number"),
        ("length_mm = 60.0", "length_mm = 1979-05-27", "tool.0.length_mm: is a date; write a number"),
        ("[[0, 0, -20], ", "[", "job.toml:8: setup.stock_box_mm: is a list of 1; write a list of 2"),
        ("safe_z_mm = 50.0", "", "job.toml:5: safe_z_mm is missing in setup"),
        ("[setup]", "a = " + 2000 * "[" + 2000 * "]" + "\n[setup]", "job.toml: is nested too deep; "),
        ("[setup]", ".".join(3000 * ["a"]) + " = 1\n[setup]", "job.toml: is nested too deep; "),
        ("[setup]", "a = " + 5000 * "9" + "\n[setup]", "job.toml: holds a whole number of thousands of digits; "),
        ("[setup]", '"a\\"b" = 1\n[setup]', 'job.toml:5: unknown key a"b; '),
        ("[setup]", '"a\\nb" = 1\n[setup]', "job.toml:5: unknown key a\\nb; "),
    ],
)
def test_bad_job_is_one_sentence_with_its_line(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    path = tmp_path / "job.toml"
    path.write_text(THESIS.read_text().replace(old, new, 1))
    with pytest.raises(InputRejected) as caught:
        load_job(path)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_toml(tmp_path: Path) -> None:
    fifo, empty, utf16, mark = (tmp_path / name for name in ("fifo", "empty", "utf16", "mark"))
    os.mkfifo(fifo)
    empty.write_bytes(b"")
    utf16.write_bytes("a = 1".encode("utf-16"))
    mark.write_bytes(b"\xef\xbb\xbfa = 1")
    binary = tmp_path / "binary"
    binary.write_bytes(b"a = 1\n\xff\x00")
    for path, words in [
        (tmp_path, "is a directory"),
        (fifo, "not a regular file"),
        (empty, "is empty"),
        (utf16, "UTF-16"),
        (mark, "byte order mark"),
        (binary, "binary:2: is not UTF-8"),
        (tmp_path / "absent", "No such file"),
        (tmp_path / "nul\0", "nul.x00' is no name of a file"),
    ]:
        with pytest.raises(InputRejected, match=words):
            load(path, Job)
