"""The operator's screen as text, from values."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnc.console.alarms import AlarmLine
from dnc.console.forecast import Forecast
from dnc.console.known import Known, planned
from dnc.console.rows import Tone, length, text_of
from dnc.console.view import COLUMNS, HELP, ROWS, screen
from dnc.status.job import JobReading
from dnc.status.ledger import Ledger, MachineStatus, Trust
from dnc.status.registers import VIRTUAL_MILL
from sim.control import Execution
from sim.panel import Panel, discrete_inputs, input_registers

SNAPSHOT: dict[str, Any] = {
    "job": "20261122T000000-1",
    "state": "SENDING", "program": "/programs/FINISH_A.MPF", "sha256": "0" * 64, "link": "OPEN", "baud": 9600,
    "simulated": False, "bytes_total": 4000, "bytes_sent": 1000, "line_sent": 30, "in_doubt": [5, 30],
    "window": [
        {"line": line, "text": f"N{line}G1X{line}", "zone": zone}
        for line, zone in enumerate(["doubt"] * 10 + ["sent"] + ["next"] * 6, start=20)
    ],
    "held_s": 6.0, "held_now_s": 4.2, "xoff_count": 3, "inflight_at_xoff_bytes_max": 2, "inflight_max_bytes": 3,
    "utilisation": 0.991, "elapsed_s": 10.0, "alarms": [],
}  # fmt: skip
PANEL = Panel(
    execution=Execution.ACTIVE, block=27, position_mm=(12.402, 40.1, -3.222), distance_to_go_mm=(0.079, 0.0, -0.008),
    feed_mm_min=820.0, spindle_rpm=1000.0, tool=2, buffer_fill_percent=62.0, feed_override_percent=85.0,
)  # fmt: skip


def machine(panel: Panel = PANEL, age_s: float = 0.4) -> MachineStatus:
    ledger = Ledger(VIRTUAL_MILL, Trust(stale_s=0.9, lost_s=10.0, heartbeat_s=30.0))
    words = {(4, address): word for address, word in enumerate(input_registers(panel, 1))}
    ledger.answered(words | {(2, at): int(bit) for at, bit in enumerate(discrete_inputs(panel))}, {}, 100.0)
    return ledger.status(100.0 + age_s)


def job(**changes: object) -> JobReading:
    return JobReading({**SNAPSHOT, **changes}, age_s=0.1, is_attached=True)


def known(**changes: object) -> Known:
    whole = Known(clock="14:22:07", machine_name="MILL-2", job=job(), machine=machine())
    return dataclasses.replace(whole, **changes)  # type: ignore[arg-type]


def shown(value: Known, columns: int = COLUMNS, rows: int = ROWS) -> str:
    return text_of(screen(value, columns, rows))


def tones(value: Known) -> set[Tone]:
    return {span.tone for one in screen(value, COLUMNS, ROWS) for span in one}


def test_one_screen_in_full() -> None:
    """(2.2): what an operator reads while it runs."""
    text = shown(known())
    assert text.splitlines()[:5] == [
        " MILL-2   AUTOMATIC                       FEED 85 %  SPINDLE 100 %     14:22:07",
        "",
        " ### SENDING ###                                       link OPEN   modbus 0.4 s",
        " FINISH_A.MPF          25% of the bytes sent [========........................]",
        " sent to line 30   in doubt 5..30   control at N27",
    ]
    for part in (
        " *     27 N27G1X27", " >     30 N30G1X30", "ACTIVE", "X     12.402 mm  to go     0.079", "Z     -3.222 mm  to",
        "F      820.0 mm/min", "S       1000 1/min    T 2", "3 stops, held 60%; 2 of 3 B beyond recall",
        "buffer 62 % full, 0 bytes lost", "alarms: none", "F1 help",
    ):  # fmt: skip
        assert part in text


@given(st.integers(1, 200), st.integers(1, 60), st.booleans(), st.booleans())
def test_it_always_fills_exactly_the_screen(columns: int, rows: int, has_job: bool, has_machine: bool) -> None:
    """(2.2, O2)"""
    value = known(job=job() if has_job else None, machine=machine() if has_machine else None)
    face = screen(value, columns, rows)
    assert len(face) == rows
    assert {length(one) for one in face} == {columns}


def test_simulated_is_a_banner_over_the_whole_width() -> None:
    """(2.2, O7)"""
    value = known(job=job(simulated=True))
    line = shown(value).splitlines()[1]
    assert len(line) == COLUMNS
    assert "SIMULATED" in line
    assert Tone.SIMULATED in tones(value)
    assert Tone.SIMULATED not in tones(known())


@pytest.mark.parametrize(
    ("is_job", "is_machine", "says"),
    [
        (True, True, " SIMULATED: the virtual mill, no real machine "),
        (True, False, " SIMULATED: the job, NOT the machine's values "),
        (False, True, " SIMULATED: the machine's values, NOT the job "),
    ],
)
def test_the_banner_says_which_half_is_simulated(*, is_job: bool, is_machine: bool, says: str) -> None:
    """(2.2, O7) A real machine beside a rehearsal, or a rehearsal's values beside a real job, must not be mixed up."""
    value = known(job=job(simulated=is_job), is_machine_simulated=is_machine)
    assert says in shown(value).splitlines()[1]


def test_the_virtual_mill_is_labelled_without_a_job() -> None:
    """(2.2, O7)"""
    assert "SIMULATED" in shown(known(job=None, is_machine_simulated=True)).splitlines()[1]


def test_held_is_normal_and_quiet() -> None:
    """(2.2): held by the control is how drip-feed works, not a warning."""
    value = known(job=job(state="HELD"))
    assert "### HELD ### by the control 0:04" in shown(value)
    assert tones(value).isdisjoint({Tone.ABNORMAL, Tone.FAULT})


def test_a_job_whose_process_has_gone_is_lost_not_sending() -> None:
    """(2.2)"""
    gone = JobReading(SNAPSHOT, age_s=3.0, is_attached=False)
    assert "### LOST ### the sender has gone without a word" in shown(known(job=gone))
    ended = JobReading({**SNAPSHOT, "state": "SENT"}, age_s=300.0, is_attached=False)
    assert "### SENT ### to the control, not yet done" in shown(known(job=ended))
    completed = machine(dataclasses.replace(PANEL, execution=Execution.PROGRAM_COMPLETED))
    assert "### SENT ### and ended by the control" in shown(known(job=ended, machine=completed))


def test_old_values_say_their_age_and_old_positions_are_not_shown() -> None:
    """(2.2, M1)"""
    text = shown(known(machine=machine(age_s=4.0)))
    assert "modbus STALE 4 s" in text
    assert "ACTIVE (4 s old)" in text
    assert "12.402" not in text
    assert "FEED -- %  SPINDLE -- %" in text
    assert "modbus UNAVAILABLE" in shown(known(machine=None))


def test_bytes_lost_by_the_control_are_red_words() -> None:
    """(2.2, L3)"""
    value = known(machine=machine(dataclasses.replace(PANEL, overrun_bytes=4)))
    assert "CONTROL LOST 4 BYTES" in shown(value)
    assert Tone.FAULT in tones(value)


def test_an_old_count_of_lost_bytes_is_no_loss() -> None:
    """(2.2, L3): it cried CONTROL LOST 0 (5 s old) BYTES whenever Modbus was late."""
    value = known(machine=machine(age_s=5.0))
    assert "LOST" not in shown(value)
    assert Tone.FAULT not in tones(value)


def test_an_open_emergency_stop_goes_before_what_the_machine_does() -> None:
    """(2.2)"""
    value = known(machine=machine(dataclasses.replace(PANEL, is_emergency_stop=True)))
    assert "EMERGENCY STOP" in shown(value)
    assert "ACTIVE" not in shown(value)


def bar_of(value: Known, rows: int = ROWS) -> list[set[Tone]]:
    """The tones of each row of the state bar."""
    face = screen(value, COLUMNS, rows)
    return [{span.tone for span in one if span.tone is not Tone.PLAIN} for one in face[2 : 5 if rows >= 30 else 3]]


def test_the_state_is_a_bar_of_the_worst_colour() -> None:
    """(2.2): read from across the shop; held for a moment stays green, so that it does not flicker."""
    assert bar_of(known()) == [{Tone.RUNS}]
    assert bar_of(known(job=job(state="HELD"))) == [{Tone.RUNS}]
    assert bar_of(known(job=job(state="HELD", held_now_s=60.0))) == [{Tone.STRONG}]
    assert bar_of(known(job=job(state="PAUSED"))) == [{Tone.ASKS}]
    assert bar_of(known(job=JobReading(SNAPSHOT, age_s=5.0, is_attached=True))) == [{Tone.ABNORMAL}]
    alarm = AlarmLine("CNC-12470", "alarm", "the control shows an alarm", "read it at the control")
    assert bar_of(known(alarms=(alarm,))) == [{Tone.FAULT}]
    assert bar_of(known(alarms=(dataclasses.replace(alarm, is_acknowledged=True),))) == [{Tone.RUNS}]
    assert bar_of(known(), rows=40) == [{Tone.RUNS}] * 3


@pytest.mark.parametrize(
    "state", ["ARMED", "SENDING", "HELD", "PAUSED", "DRAINING", "SENT", "ABORTED", "FAULTED", "LOST"]
)
def test_it_tells_what_to_do_now_in_one_whole_line(state: str) -> None:
    """(2.2): nothing to do while it runs; in every other state a sentence that ends before the border."""
    reading = job(state=state, held_now_s=60.0)
    if state == "LOST":
        reading = JobReading(SNAPSHOT, age_s=3.0, is_attached=False)
    line = shown(known(job=reading)).splitlines()[-2]
    if state in ("SENDING", "DRAINING"):
        assert line == ""
    else:
        assert line.endswith((".", "?"))


def test_an_empty_buffer_in_cycle_is_abnormal() -> None:
    """(2.2, C8)"""
    value = known(machine=machine(dataclasses.replace(PANEL, buffer_fill_percent=0.0)))
    assert "EMPTY: the line may be too slow for this feed" in shown(value)


def test_progress_is_by_planned_time_where_there_is_a_plan() -> None:
    """(2.2): by the block the machine shows, else by the first line in doubt."""
    plan = Forecast(
        lines=(1, 5, 27, 30), starts_s=(0.0, 100.0, 270.0, 300.0), blocks={27: 270.0}, total_s=360.0, stops=(30,)
    )
    value = known(forecast=plan, end_clock="15:34")
    assert planned(value) == (270.0, 360.0)
    text = shown(value)
    assert "75% of the time" in text
    assert "left 1:30  end 15:34" in text
    assert "next stop in 0:30" in text
    assert "left" not in shown(known(forecast=plan, job=job(state="FAULTED")))
    assert planned(known(forecast=plan, machine=None)) == (100.0, 360.0)
    assert planned(known(forecast=plan, machine=None, job=job(state="SENT"))) is None
    completed = machine(dataclasses.replace(PANEL, execution=Execution.PROGRAM_COMPLETED))
    assert planned(known(forecast=plan, machine=completed)) == (360.0, 360.0)


def test_nothing_from_outside_can_act_on_the_terminal() -> None:
    """(2.2, N7)"""
    evil = "\x1b[2J[red]\u202e\x9b31m"
    window = [{"line": 1, "text": evil, "zone": "sent"}]
    text = shown(known(job=job(program=evil, window=window), alarms=(AlarmLine("X", "alarm", evil, evil),)), 100, 30)
    assert not {"\x1b", "\u202e", "\x9b"} & set(text)
    assert "<1B>[2J[red]<202E><9B>31m" in text


def test_a_long_name_of_a_program_is_cut_where_one_sees_it() -> None:
    """(2.2) Names often differ at their end only."""
    value = known(job=job(program="/programs/FINISH_PART_LEFT_SIDE_2.MPF"))
    assert " FINISH_~T_SIDE_2.MPF  25%" in shown(value)
    assert " FINISH_PART_LEFT_SIDE_2.MPF " in shown(value, 100)


@pytest.mark.parametrize("columns", [80, 120])
def test_a_long_block_does_not_run_into_the_axes(columns: int) -> None:
    """(2.2) One read `PO[Z]=(1.9488,-13.684,1 X     14.625 mm`, the axis as a word of the block."""
    window = [{"line": 64, "text": "POLY X50.0418 PO[Z]=(1.9488,-13.684,1.25) " * 4, "zone": "sent"}]
    line = next(line for line in shown(known(job=job(window=window)), columns).splitlines() if "POLY" in line)
    assert line.endswith("~   ACTIVE")


def test_figures_of_the_line_are_not_cut_at_the_border() -> None:
    """(2.2) `4096 of 40` stood there."""
    large = {"baud": 4_000_000, "xoff_count": 99_999, "inflight_at_xoff_bytes_max": 4096, "inflight_max_bytes": 4096}
    assert "4096 of 4096 B beyond recall" in shown(known(job=job(**large, utilisation=1.0, held_s=10.0)))


def test_the_help_is_whole() -> None:
    """(2.2)"""
    text = shown(known(is_help=True))
    for line in HELP:
        assert line in text


@pytest.mark.parametrize("columns", [80, 132])
def test_a_question_and_the_help_have_their_place(columns: int) -> None:
    """(2.2)"""
    assert shown(known(question="ABORT?"), columns).splitlines()[-2].strip() == "ABORT?"
    assert "No key here is an emergency stop" in shown(known(is_help=True), columns)
