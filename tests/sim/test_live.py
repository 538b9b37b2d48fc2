"""The control and its machine, joined to their serial interface in memory, on a clock of the test's own."""

from __future__ import annotations

import dataclasses

import pytest

from sim.control import TABLE, Control, Execution, Happening
from sim.live import EMERGENCY_STOP_ALARM, OVERRUN_ALARM
from sim.motion.values import StopReason
from tests.sim.cable import HEAD, PROFILE, PROGRAM, Cable, alarm_numbers


def test_a_program_runs_through_a_small_buffer() -> None:
    """(1.4)"""
    cable = Cable(PROGRAM).run(60.0)
    assert cable.names == ["ACTIVE", "PROGRAM_COMPLETED"]
    assert cable.mill.blocks == 42
    assert cable.uart.receiver.overrun_bytes == 0
    assert cable.heard.count(b"\x13") == cable.heard.count(b"\x11") > 2
    assert cable.mill.machine.snapshot().position_mm == (10.0, 1.0, 500.0)
    panel = cable.mill.panel()
    assert panel is not None
    assert panel.program == "TEST_MPF"


@pytest.mark.parametrize("xon_fill_bytes", [0, 1, 10])
def test_a_control_that_goes_on_when_its_buffer_is_empty(xon_fill_bytes: int) -> None:
    """(5.8) Half a block stayed in the ring, which was never empty: no DC1 came, and the job hung for ever."""
    profile = dataclasses.replace(PROFILE, xon_fill_bytes=xon_fill_bytes)
    cable = Cable(PROGRAM, profile=profile).run(60.0)
    assert cable.is_completed
    assert cable.uart.receiver.xoff_sent >= 3
    assert cable.uart.receiver.fill_bytes == 0
    assert cable.mill.alarms == []


def test_a_leader_longer_than_the_buffer_is_passed_over() -> None:
    """(5.4) Blank tape is read, not kept: the mill held for ever with its buffer full of NULs."""
    leader = b"\0" * (3 * PROFILE.receive_buffer_bytes)
    cable = Cable(leader + PROGRAM).run(60.0)
    assert cable.names == ["ACTIVE", "PROGRAM_COMPLETED"]
    assert cable.mill.blocks == 42


def test_a_number_passed_between_two_looks_at_the_panel_is_shown() -> None:
    """(2.2) Where only the short block at the start of a pass has a number, nobody may happen to look during it."""
    cable = Cable(b"N7 G1 G90 X1 Y0 Z500 F3000\nX100 F60\nM30\n").run(5.0)
    panel = cable.mill.panel()
    assert panel is not None
    assert panel.position_mm[0] > 1.0
    assert panel.block == 7


def test_compensation_takes_the_radius_it_was_given_and_says_where_to_name_it() -> None:
    """(6.2)"""
    program = b"T1 M6\nD1 G90 G0 X0 Y9 Z500\nG1 G41 X10 Y0 F3000\nX20\nG40 X30 Y9\nM30\n"
    refused = Cable(program).run(30.0)
    assert alarm_numbers(refused) == [10750]
    assert "--nominal" in refused.mill.alarms[0][1].text
    cut = Cable(program, tool_radii_mm={1: 4.0}).run(30.0)
    assert alarm_numbers(cut) == []
    assert cut.is_completed
    named = Cable(program.replace(b"T1", b'T="MILL1"'), tool_radii_mm={1: 4.0}).run(30.0)
    assert "MILL1" in named.mill.alarms[0][1].text
    assert any((move.end[0], move.end[1]) == pytest.approx((20.0, 4.0), abs=0.2) for move in cut.mill.machine.travelled)


def test_the_same_program_and_seed_give_the_same_log() -> None:
    """(5.8)"""

    def log(seed_fault: str) -> tuple[bytes, list[float], list[tuple[float, str]]]:
        cable = Cable(PROGRAM, (seed_fault, "stop-answer=0.5", "feed-hold=200b+0.3")).run(60.0)
        history = [(at_s, happening.name) for at_s, happening, _ in cable.mill.control.history]
        return cable.heard, [float(t) for samples in cable.samples for t in samples.t_s], history

    assert log("noise=20") == log("noise=20")


def test_a_host_that_does_not_listen_overruns_and_the_control_alarms() -> None:
    """(1.4, 5.8, L3)"""
    cable = Cable(PROGRAM, is_deaf=True).run(10.0)
    assert cable.uart.receiver.overrun_bytes > 0
    assert alarm_numbers(cable) == [OVERRUN_ALARM]
    assert cable.names[-1] == "STOPPED"
    assert b"\x13\x15" in cable.heard


def test_a_lost_dc3_overruns() -> None:
    """(5.8, L3)"""
    cable = Cable(PROGRAM, ("lose-xoff=1",)).run(10.0)
    assert alarm_numbers(cable) == [OVERRUN_ALARM]


def test_a_lost_dc1_starves_the_machine_for_ever() -> None:
    """(5.8, L2)"""
    cable = Cable(PROGRAM, ("lose-xon=1",)).run(20.0)
    assert cable.names == ["ACTIVE"]
    assert cable.mill.machine.stands[-1].reason is StopReason.STARVED


def test_a_block_the_control_does_not_know_alarms_with_dc3_and_nak() -> None:
    """(5.8, C2)"""
    cable = Cable(HEAD + b"N20 G1 X10\nN30 G777 X3\nN40 G1 X99\nM30\n").run(10.0)
    ((_, alarm),) = cable.mill.alarms
    assert (alarm.line, alarm.block) == (4, 30)
    assert cable.names[-1] == "STOPPED"
    assert [happening for _, happening, _ in cable.mill.control.history].count(Happening.ALARM) == 1
    assert cable.heard[-2:] == b"\x13\x15"
    assert cable.mill.machine.snapshot().position_mm[0] == 10.0


def test_reset_breaks_off_with_dc3_and_syn() -> None:
    """(5.8, C1)"""
    cable = Cable(PROGRAM, ("reset=300b",)).run(20.0)
    assert cable.names == ["ACTIVE", "STOPPED"]
    assert b"\x13\x16" in cable.heard
    assert cable.mill.machine.snapshot().feed_mm_min == 0.0
    taken = cable.mill.blocks
    assert cable.run(5.0).mill.blocks == taken


def test_emergency_stop_alarms_and_shows() -> None:
    """(5.8, C2)"""
    cable = Cable(PROGRAM, ("alarm=1.0",)).run(5.0)
    assert alarm_numbers(cable) == [EMERGENCY_STOP_ALARM]
    panel = cable.mill.panel()
    assert panel is not None
    assert panel.is_emergency_stop
    assert (panel.execution, panel.alarm_number) == (Execution.STOPPED, EMERGENCY_STOP_ALARM)


def test_power_cycle_is_silent_and_comes_back_with_dc1_but_does_not_go_on() -> None:
    """(5.8, C9)"""
    cable = Cable(PROGRAM, ("power-cycle=1.0+2.0",)).run(2.0)
    assert cable.names[-1] == "UNAVAILABLE"
    assert cable.mill.panel() is None
    cable.program = b""
    cable.run(3.0)
    assert cable.names[-1] == "READY"
    assert cable.heard[-1:] == b"\x11"
    blocks = cable.mill.blocks
    assert cable.run(5.0).mill.blocks == blocks


def test_feed_hold_stands_and_goes_on() -> None:
    """(5.8, C7)"""
    cable = Cable(PROGRAM, ("feed-hold=300b+3",)).run(60.0)
    assert cable.names == ["ACTIVE", "FEED_HOLD", "ACTIVE", "PROGRAM_COMPLETED"]
    held = [one.duration_s for one in cable.mill.machine.stands if one.reason.name == "FEED_HOLD"]
    assert held == [pytest.approx(3.0, abs=0.3)]


def test_m0_waits_for_the_operator() -> None:
    """(5.8, C6)"""
    cable = Cable(HEAD + b"N20 G1 X10\nN30 M0\nN40 G1 X20\nM30\n", ("stop-answer=2",)).run(30.0)
    assert cable.names == ["ACTIVE", "PROGRAM_STOPPED", "ACTIVE", "PROGRAM_COMPLETED"]


def test_a_tool_change_is_a_wait() -> None:
    """(5.8): WAIT while the changer works, ACTIVE again afterwards."""
    cable = Cable(HEAD + b"N15 T2 M6\nN20 G1 X10\nN40 G1 X20\nM30\n").run(60.0)
    assert cable.names == ["ACTIVE", "WAIT", "ACTIVE", "PROGRAM_COMPLETED"]


@pytest.mark.parametrize(("switch", "stops"), [("yes", True), ("no", False)])
def test_m1_waits_only_with_its_switch(switch: str, stops: bool) -> None:
    """(5.8)"""
    cable = Cable(HEAD + b"N20 G1 X10\nN30 M1\nN40 G1 X20\nM30\n", (f"optional-stop={switch}",)).run(30.0)
    assert ("OPTIONAL_STOP" in cable.names) is stops
    assert cable.is_completed


def test_single_block_stops_after_every_block_until_it_ends() -> None:
    """(5.8)"""
    cable = Cable(PROGRAM, ("single-block=0.5+4", "stop-answer=0.2")).run(60.0)
    assert cable.names.count("INTERRUPTED") > 3
    assert cable.is_completed


def test_override_slows_the_machine() -> None:
    """(5.8)"""
    slow = Cable(PROGRAM, ("override=20",)).run(200.0)
    fast = Cable(PROGRAM).run(200.0)
    assert slow.now_s > 2 * fast.now_s


def test_slow_drain_starves_the_machine() -> None:
    """(5.8, C8)"""
    cable = Cable(PROGRAM, ("slow-drain=200",)).run(200.0)
    assert cable.is_completed
    assert sum(one.duration_s for one in cable.mill.machine.starved) > 1.0


def test_m30_may_leave_the_trailer_unread() -> None:
    """(5.8, C5)"""
    cable = Cable(PROGRAM + bytes(300), ("end-stops-reading=yes",))
    cable.run(60.0)
    assert cable.is_completed
    cable.is_completed = False
    cable.run(2.0)
    assert cable.is_held
    assert cable.program != b""
    reading = Cable(PROGRAM + bytes(300)).run(60.0)
    reading.is_completed = False
    assert reading.run(2.0).program == b""


def test_start_by_dc1_after_cycle_start() -> None:
    """(5.8, C3)"""
    cable = Cable(PROGRAM, ("start=xon", "cycle-start=1.5"))
    cable.run(1.4)
    assert (cable.names, cable.heard) == (["READY"], b"")
    assert cable.run(60.0).is_completed


def test_nothing_is_taken_before_cycle_start() -> None:
    """(5.8)"""
    cable = Cable(PROGRAM, ("cycle-start=2",)).run(1.9)
    assert cable.mill.blocks == 0
    assert cable.uart.receiver.is_held


def test_a_gap_in_the_line_is_starvation_with_its_place() -> None:
    """(1.4, 7.4)"""
    slow = dataclasses.replace(PROFILE, baud=300)
    cable = Cable(PROGRAM, profile=slow).run(200.0)
    starved = cable.mill.machine.starved
    assert starved
    assert all(one.block is not None for one in starved)


def test_the_table_knows_every_state_and_only_power_leaves_unavailable() -> None:
    """(5.8)"""
    assert {state for state, _ in TABLE} == set(Execution)
    assert [happening for state, happening in TABLE if state is Execution.UNAVAILABLE] == [Happening.POWER_ON]


def test_cycle_start_is_refused_while_an_alarm_stands() -> None:
    """(5.8)"""
    control = Control()
    assert control.happens(Happening.CYCLE_START, 0.0)
    assert not control.happens(Happening.CYCLE_START, 0.1)
    assert control.raise_alarm(12470)
    assert not control.raise_alarm(1)
    assert control.happens(Happening.ALARM, 0.2)
    assert not control.happens(Happening.CYCLE_START, 0.3)
    assert control.happens(Happening.RESET, 0.4)
    assert control.alarm_number == 0
    assert control.happens(Happening.CYCLE_START, 0.5)
