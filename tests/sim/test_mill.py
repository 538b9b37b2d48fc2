"""A whole program without a line, and its log."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.interpreter.canon import Alarm, ChangeTool, Line
from sim.interpreter.run import Interpreter, interpret
from sim.mill import rehearse, settings_of
from sim.motion.values import Samples
from sim.motion_log import MotionLog, Peaks
from tests.sim.cable import PROFILE

PROGRAM = b"%_N_A_MPF\nN10 G90 G64 F600\nN20 G0 X10 Y0\n\nN30 M0\nN40 G1 X20\nN50 M30\nN60 G1 X99\n"


def test_it_runs_through_stops_to_the_end() -> None:
    """(1.4)"""
    recording = rehearse(PROGRAM, PROFILE)
    assert recording.is_completed
    assert recording.alarms == []
    assert recording.blocks == 5
    assert recording.travelled[-1].end == (20.0, 0.0, 500.0)
    assert recording.starved == []
    assert recording.samples.position_mm[-1].tolist() == [20.0, 0.0, 500.0]
    assert np.all(np.diff(recording.samples.t_s) > 0)


def test_an_alarm_ends_it_with_what_was_cut_before() -> None:
    """(1.4)"""
    recording = rehearse(b"N10 G1 X10 F600\nN20 G777\nN30 G1 X20\n", PROFILE)
    assert not recording.is_completed
    assert [(alarm.line, alarm.block) for alarm in recording.alarms] == [(2, 20)]
    assert recording.travelled[-1].end[0] == 10.0
    assert recording.blocks == 2


def test_what_the_manuals_leave_open_comes_from_the_profile() -> None:
    """The alarm of a jump back while fed, and what G28 does (6.4)."""
    profile = replace(PROFILE, backward_jump_alarm=14013, g28="alarm")
    fed = settings_of(profile, is_drip_fed=True)
    for text, number in ((b"AGAIN: G4 F1\nGOTOB AGAIN\n", 14013), (b"G28 X0\n", 12470)):
        last = list(interpret(text, fed))[-1]
        assert isinstance(last, Alarm)
        assert last.number == number


def test_the_machine_is_inch_and_has_no_changer_where_its_profile_says_so() -> None:
    """(6.2, 6.8)"""
    profile = replace(PROFILE, is_inch=True, has_tool_changer=False)
    commands = list(interpret(b"T3\nG1 X1 F10\n", settings_of(profile, is_drip_fed=True)))
    assert ChangeTool(1, None, 3) in commands
    assert commands[-1] == Line(2, None, (0.0, 0.0, 500.0), (25.4, 0.0, 500.0), 254.0)


def test_subprograms_are_found_in_the_folder(tmp_path: Path) -> None:
    """(6.4) PROC with arguments, called by a whole program and by one that is fed."""
    (tmp_path / "POCKET.spf").write_bytes(b"PROC POCKET(REAL WIDTH)\nG1 X=WIDTH*2 F600\nM17\n")
    recording = rehearse(b"POCKET(5)\nM30\n", PROFILE, subprogram_folder=tmp_path)
    assert recording.alarms == []
    assert recording.travelled[-1].end[0] == 10.0
    assert rehearse(b"POCKET(5)\nM30\n", PROFILE).alarms[0].number == 12550


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("G54 G0 Z50\nG1 X990 F9999\nX1001\n", 3),
        ("G500 G0 Z50\nG1 X501 F9999\n", 2),
        ("G54 G0 Z50\nG0 SUPA Z501\n", 2),
        ("G54 G0 Z50\nG2 I900 F9999\n", 2),
        ("G54 G0 Z50\nPOLY PO[X]=(10) PO[Y]=(0,-9000) F9999\n", 2),
        ("G54 G0 Z50\nBSPLINE X2 Y9 F9999\nX4 Y1900\nX6 Y1900\nX8 Y1900\nX9 Y0\nG1 X10\n", 4),
        ("G54 G0 Z50\nG1 F9999\n" + "".join(f"X{90 * step}\n" for step in range(40)), 15),
    ],
    ids=["line", "machine's zero", "SUPA", "arc", "POLY", "spline", "run of plain blocks"],
)
def test_a_move_beyond_the_travel_is_refused(text: str, line: int) -> None:
    """(1.3) As a software limit switch does it; the mill drove X to 99 m. Alike in bulk and block by block."""
    recording = rehearse(f"{text}M30\n".encode(), PROFILE)
    assert [(alarm.number, alarm.line) for alarm in recording.alarms] == [(10720, line)]
    settings = settings_of(PROFILE, is_drip_fed=True)
    interpreter = Interpreter(settings)
    lines = enumerate(text.encode().splitlines(), 1)
    found = [command for number, raw in lines for command in interpreter.block(raw, number)]
    assert [one.line for one in found if isinstance(one, Alarm)] == [line]


def test_within_what_some_zero_point_reaches_nothing_is_refused() -> None:
    """(1.3) Where the zero point lies is the setter's; a start outside may be left."""
    cuts = "".join(f"X{-50 * step}\n" for step in range(20))
    assert rehearse(f"G54 G0 Z-300\nG1 F9999\n{cuts}G0 SUPA Z0\nM30\n".encode(), PROFILE).alarms == []
    low = replace(PROFILE, axes=tuple(replace(axis, min_mm=-90.0, max_mm=90.0) for axis in PROFILE.axes))
    assert rehearse(b"G500 G0 Z90\nM30\n", low).alarms == []


def test_override_slows_the_rehearsal() -> None:
    half = rehearse(PROGRAM, PROFILE, override_percent=50.0)
    assert half.machining_time_s > 1.4 * rehearse(PROGRAM, PROFILE).machining_time_s


def test_the_log_says_where_the_axes_stood_before_the_first_motion() -> None:
    """(1.6): a change of tool before the first move must not look like a jump from zero."""
    recording = rehearse(b"T2\nM6\nG1 X10 F600\nM30\n", PROFILE)
    assert recording.samples.position_mm[0].tolist() == [0.0, 0.0, 500.0]


def samples(t_s: list[float], x_mm: list[float]) -> Samples:
    n = len(t_s)
    position_mm = np.zeros((n, 3))
    position_mm[:, 0] = x_mm
    blocks = np.array([-1, *range(n - 1)])
    return Samples(np.array(t_s), position_mm, np.full(n, 60.0), np.arange(n) + 1, blocks)


def test_rows_of_the_log_are_tips_and_appear_whole(tmp_path: Path) -> None:
    """(1.6)"""
    path = tmp_path / "motion.csv"
    log = MotionLog(path, tip_below_mm=4.0)
    log.add(samples([0.004, 0.008], [1.0, 2.0]))
    assert not path.exists()
    log.close()
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert rows[0] == {
        "t_s": "0.0040", "x_mm": "1.000000", "y_mm": "0.000000", "z_mm": "-4.000000", "feed_mm_min": "60.0000",
        "line": "1", "block": "",
    }  # fmt: skip
    assert rows[1]["block"] == "0"


@pytest.mark.parametrize("cut", [1, 2, 5, 9])
def test_peaks_do_not_depend_on_how_the_log_is_cut(cut: int) -> None:
    """(1.5)"""
    t_s = [step * 0.1 for step in range(10)]
    x_mm = [t**3 for t in t_s]
    whole, parts = Peaks(), Peaks()
    whole.add(samples(t_s, x_mm))
    for first in range(0, 10, cut):
        parts.add(samples(t_s[first : first + cut], x_mm[first : first + cut]))
    assert whole.jerk_mm_s3 == pytest.approx(6.0)
    assert parts.jerk_mm_s3 == pytest.approx(whole.jerk_mm_s3)
    assert parts.acceleration_mm_s2 == pytest.approx(whole.acceleration_mm_s2)
