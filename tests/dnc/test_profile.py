"""A machine profile whose values cannot be meant is one sentence with file and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnc.errors import SettingsRejected
from dnc.profile import load_profile
from dnc.shipped import shipped_names, shipped_path
from sim.profile import load_mill_profile

GOOD = shipped_path("machines", "sinumerik-840d").read_text()


@pytest.mark.parametrize("name", shipped_names("machines"))
def test_shipped_profiles_are_read(name: str) -> None:
    load_profile(shipped_path("machines", name))


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("xoff", "17", "xon and xoff are both 17; give two different characters"),
        ("xoff", "65", "xoff is 'A', which programs contain"),
        ("xon", "10", "xon is '\\n', which programs contain"),
        ("rapid_mm_min", "1e-308", "rapid_mm_min: "),
        ("jerk_mm_s3", "1e300", "jerk_mm_s3: "),
        ("max_mm", "-9999", "mm; write the smaller end as min_mm"),
        ("end_of_block", '"cr-lf"', ":16: tape.end_of_block 'cr-lf' ends no block; write as-is, lf"),
        ("leader", '"\\\\FOO"', "tape.leader '\\FOO': '\\FOO' is no known escape; known: "),
        ("trailer", '"\u20ac"', "no line carries '\u20ac'; leave it out"),
        ("xon_fill_bytes", "999999", "exceed receive_buffer_bytes; lower one of them"),
        ("hold_timeout_s", "1e308", "link.hold_timeout_s: is out of range"),
        ("start_timeout_s", "1e308", "link.start_timeout_s: is out of range"),
        ("hold_timeout_s", "0.0\nchar_delay_s = 1e308", "link.char_delay_s: is out of range"),
        ("hold_timeout_s", "0.0\nline_delay_s = 1e308", "link.line_delay_s: is out of range"),
        ("hold_timeout_s", "0.0\nadapter_latency_s = 1e308", "link.adapter_latency_s: is out of range"),
        ("receive_buffer_bytes", "9223372036854775808", "control.receive_buffer_bytes: is out of range"),
        ("lookahead_blocks", "9223372036854775808", "control.lookahead_blocks: is out of range"),
        ("block_cycle_s", "1e308", "control.block_cycle_s: is out of range"),
        ("block_cycle_s", "1e-320", "control.block_cycle_s: is out of range"),
        (
            "min_spline_blocks",
            "6\nretract_z_mm = 1e308",
            "retract_z_mm 1e+308 is beyond the travel of Z, -500 to 500 mm",
        ),
        (
            "min_spline_blocks",
            "6\nretract_z_mm = -501.0",
            "retract_z_mm -501 is beyond the travel of Z, -500 to 500 mm",
        ),
    ],
)
def test_values_that_cannot_be_meant_are_told(tmp_path: Path, key: str, value: str, words: str) -> None:
    """(5.3, 2.7) The file, the line of the key where the file has it, and what to do."""
    lines = GOOD.splitlines()
    number = next(number for number, line in enumerate(lines) if line.startswith(f"{key} "))
    lines[number] = f"{key} = {value}"
    path = tmp_path / "mill.toml"
    path.write_text("\n".join(lines))
    with pytest.raises(SettingsRejected) as refused:
        load_profile(path)
    assert str(refused.value).startswith(f"{path}:")
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "[axes.Y]\nmin_mm = -500.0",
            '[axes.Y]\nmin_mm = "a"',
            ":47: axes.Y.min_mm: is text in quotes; write a number",
        ),
        ("[axes.Y]\nmin_mm = -500.0", "[axes.Y]", ":46: min_mm is missing in axes.Y; add it"),
        ("[modbus]", "[modbus.register.a]\nfunction = 9\n[modbus]", ":60: modbus.register.a.function: is out of range"),
    ],
)
def test_a_wrong_value_of_a_named_table_is_told_with_its_name(tmp_path: Path, old: str, new: str, words: str) -> None:
    """(5.3) Which of the axes, which of the registers, and the line."""
    path = tmp_path / "mill.toml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(SettingsRejected) as refused:
        load_profile(path)
    assert words in str(refused.value)


def test_what_one_side_leaves_out_the_other_leaves_out_too(tmp_path: Path) -> None:
    """(5.3) A profile that `dnc check` and `dnc send` take is one that the mill can rehearse, with the same values."""
    axis = "min_mm = 0.0\nmax_mm = 9.0\nrapid_mm_min = 9.0\nacceleration_mm_s2 = 9.0\njerk_mm_s3 = 9.0\n"
    path = tmp_path / "mill.toml"
    path.write_text("[link]\n[control]\n" + "".join(f"[axes.{name}]\n{axis}" for name in "XYZ"))
    ours, mills = load_profile(path), load_mill_profile(path)
    for name in ("baud", "format", "xon", "xoff"):
        assert getattr(mills, name) == getattr(ours.link, name), name
    same = ["dialect", "knot_rule", "poly_degree", "g28", "backward_jump_alarm", "has_tool_changer", "resolution_mm"]
    same += ["receive_buffer_bytes", "xoff_free_bytes", "xon_fill_bytes", "block_cycle_s", "lookahead_blocks"]
    for name in [*same, "tool_length_reference"]:
        assert getattr(mills, name) == getattr(ours.control, name), name
