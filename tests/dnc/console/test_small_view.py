"""The operator's screen in a terminal below 80 x 24."""

from __future__ import annotations

import pytest

from dnc.console.alarms import AlarmLine
from dnc.console.view import screen
from tests.dnc.console.test_view import job, known, shown


def test_a_small_terminal_is_told_and_still_shows_the_state() -> None:
    """(2.2, O2)"""
    assert shown(known(), 40, 5).splitlines()[:2] == ["too small: 40x5, needs 80x24", "SENDING"]


def test_a_small_terminal_still_asks_and_alarms() -> None:
    """(2.2, O2) A second key was waited for, and alarms stood, where nothing showed them; nor did SIMULATED."""
    alarm = AlarmLine(
        "DNC-L3", "alarm", "the control lost 12 bytes: its program is damaged", "stop the control, reset it"
    )
    value = known(
        job=job(simulated=True), question="ABORT? It may cut a block; reset the control then. A: yes", alarms=(alarm,)
    )
    text = shown(value, 40, 12)
    assert "SENDING  SIMULATED" in text
    assert "ABORT? It may cut a block" in text
    assert "A: yes" in text
    assert "DNC-L3" in text
    assert "its program is damaged" in " ".join(text.split())
    assert "F6 hold" in text
    told = shown(known(job=job(state="PAUSED")), 60, 20)
    assert "Paused. F5 then Enter goes on" in told


@pytest.mark.parametrize("rows", range(1, 24))
def test_in_a_small_terminal_the_question_goes_before_the_alarms(rows: int) -> None:
    """(2.2, O2) However low it is."""
    alarms = tuple(AlarmLine(f"CNC-{number}", "alarm", "the control shows an alarm", "read it") for number in range(9))
    text = shown(known(question="ABORT? A: yes, any other: no", alarms=alarms), 79, rows)
    assert len(screen(known(question="ABORT?", alarms=alarms), 79, rows)) == rows
    assert rows < 3 or "ABORT? A: yes" in text
