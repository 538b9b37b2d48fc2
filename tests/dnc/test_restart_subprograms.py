"""Restarts behind a call: what a subprogram does with axes and offsets counts as what the program does (6.8)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnc.errors import InputRejected
from dnc.restart import restart_at_line
from sim.interpreter.settings import Settings
from tests.dnc.restarts import HEAD, HEIGHTS


@pytest.mark.parametrize(
    ("sub", "words"),
    [
        ("G1 SUPA X5 F900", "where X stands depends on work offsets"),
        ("G53 G1 Z5 F900\nX3", "where Z stands depends on work offsets"),
        ("G0 SUPA Z5", "where Z stands depends on work offsets"),
        ("G1 SUPA X=IC(5) F900", "where X stands depends on work offsets"),
        ("POLY SUPA PO[X]=(5) F900\nG1", "where X stands depends on work offsets"),
        ("SUPA G1 X10 F900", "where X stands depends on work offsets"),
        ("G54\nG1 Y3 F900\nG55", "where X, Y, Z stands depends on work offsets"),
        ("G1 Y3 F900", None),
        ("G54\nG55\nG1 Y3 F900", None),
    ],
)
def test_what_a_subprogram_moves_elsewhere_is_not_known(tmp_path: Path, sub: str, words: str | None) -> None:
    """(6.8) A feed in machine coordinates, or under another offset, within a subprogram went unseen."""
    (tmp_path / "L10.SPF").write_text(sub + "\nM17\n")
    data = f"{HEAD}G1 Z1 F100\nX10 Y2\nL10\nG91 X1 F100\nX2\nG90\nG0 Z50\nM30\n".encode()
    line, settings = HEAD.count("\n") + 5, Settings(subprogram_folder=tmp_path, is_drip_fed=True)
    if words is None:
        assert restart_at_line(data, line, HEIGHTS, settings)
        return
    with pytest.raises(InputRejected, match=words):
        restart_at_line(data, line, HEIGHTS, settings)


@pytest.mark.parametrize("sub", ["G1 SUPA X5 F900", "G74 X1=0", "G54\nG1 X3 F900\nG55", "G90"])
@pytest.mark.parametrize("dimension", ["G90", "G91"])
def test_what_a_call_names_beside_it_is_not_where_the_axis_stands(tmp_path: Path, sub: str, dimension: str) -> None:
    """(6.8) Behind `L10 X3` X was taken to be told; the subprogram had moved it on, or G91 was in force."""
    (tmp_path / "L10.SPF").write_text(sub + "\nM17\n")
    head = HEAD.replace("G0 X0 Y0\n", "G0 Y0\n")
    data = f"{head}G1 Z1 F100\n{dimension}\nL10 X3\nG90 G1 Y2\nY3\nG0 Z50\nM30\n".encode()
    line, settings = head.count("\n") + 5, Settings(subprogram_folder=tmp_path, is_drip_fed=True)
    with pytest.raises(InputRejected, match="where X"):
        restart_at_line(data, line, HEIGHTS, settings)


@pytest.mark.parametrize(
    ("middle", "is_safe"),
    [
        ("CT X15 Y5\n@IF R1==2\nG0 Z30\nELSE\nX20\nENDIF\n", False),
        ("@IF R1==2\nG1 X30\nENDIF\nCT X20 Y9\n", False),
        ("@GOTOF ON\nG1 X30\nON:\nCT X20 Y9\n", False),
        ("@L10\nG1 X3\n", False),
        ("@X10 L10\nG1 X3\n", False),
        ("@L20\nG1 X3\n", False),
        ("@L30\nG1 X3\n", True),
        ("@X15 L10\nG1 X3\n", True),
        ("@IF R1==2\nG1 X30\nENDIF\nX20 Y9\n", True),
        ('@MSG("A")\nG1 X30\nCT X20 Y9\n', True),
    ],
)
def test_a_curve_behind_a_call_or_a_branch_may_be_the_first_move(tmp_path: Path, middle: str, is_safe: bool) -> None:
    """(6.8) It took its direction from the preamble; only blocks that stand in the program were looked at."""
    for name, text in (("L10", "CSPLINE X4 Y6\nX8\nX9 Y9\nG1 X3"), ("L20", "L10"), ("L30", "G1 X9")):
        (tmp_path / f"{name}.SPF").write_text(text + "\nM17\n")
    text = f"R1=2\n{HEAD}G1 Z1 F100\nX10\n{middle}G0 Z50\nM30\n"
    line, settings = text.split("@")[0].count("\n") + 1, Settings(subprogram_folder=tmp_path, is_drip_fed=True)
    data = text.replace("@", "").encode()
    if is_safe:
        assert restart_at_line(data, line, HEIGHTS, settings)
        return
    with pytest.raises(InputRejected, match=r"takes its direction from the (one|move) before"):
        restart_at_line(data, line, HEIGHTS, settings)
