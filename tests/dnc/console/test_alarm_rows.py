"""The alarms of the operator's screen: which are shown first, to their end, and which count as seen."""

from __future__ import annotations

import dataclasses

import pytest

from dnc.console.alarms import AlarmLine, AlarmList, present_alarms
from dnc.console.view import COLUMNS, ROWS, shown_alarms
from tests.dnc.console.test_view import PANEL, job, known, machine, shown


def test_alarms_show_meaning_and_remedy_first_out_first() -> None:
    """(2.2)"""
    alarms = tuple(
        AlarmLine(f"DNC-{n}", "alarm", f"text {n}", f"remedy {n}", is_acknowledged=n < 8) for n in range(1, 10)
    )
    text = shown(known(alarms=alarms))
    assert [line[:21] for line in text.splitlines() if "ALARM" in line] == [
        " ! ALARM DNC-8 text 8", " ! ALARM DNC-9 text 9", "   ALARM DNC-1 text 1"
    ]  # fmt: skip
    assert "-> remedy 1" in text
    assert "and 6 more" in text
    assert text.splitlines()[-1].startswith(" F1 help")


def test_what_ended_the_job_is_not_hidden_behind_older_warnings() -> None:
    """(2.2) With no room for all, warnings that came first hid the alarm that the screen told to look at."""
    warnings = tuple(AlarmLine(f"DNC-W{n}", "warning", "noise " * 20, "look " * 20) for n in range(4))
    ending = AlarmLine("DNC-A1", "alarm", "the port was lost", "plug it in")
    value = known(job=job(state="FAULTED"), alarms=(*warnings, ending))
    for columns, rows in ((COLUMNS, ROWS), (120, 40), (40, 12)):
        assert "ALARM DNC-A1 the port was lost" in shown(value, columns, rows)


@pytest.mark.parametrize(("columns", "rows"), [(COLUMNS, ROWS), (100, 30), (60, 20), (40, 10), (30, 6), (9, 3)])
def test_only_alarms_that_were_shown_count_as_seen(columns: int, rows: int) -> None:
    """(2.2) Acknowledged is what stood on the screen to its end; the others come up one after the other."""
    book = AlarmList()
    left = [AlarmLine(f"DNC-{n}", "alarm", f"text {n} " * 9, "look " * 9) for n in range(6)]
    book.update(left)
    while left and (seen := shown_alarms(known(alarms=book.lines()), columns, rows)):
        text = "".join(shown(known(alarms=book.lines()), columns, rows).split())
        assert all("".join(alarm.text.split()) in text for alarm in seen)
        assert seen[0] in left
        book.acknowledge(seen)
        left = [alarm for alarm in book.lines() if not alarm.is_acknowledged]
    assert not left or columns < 40
    assert not shown_alarms(known(alarms=book.lines(), is_help=True), columns, rows)


def test_a_long_alarm_is_told_to_its_end() -> None:
    """(2.2): names by-id are long; nothing of text and remedy is cut off at the border."""
    port = "/dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0"
    alarm = AlarmLine("DNC-A1", "alarm", f"the port {port} was lost while sending", "plug it in again, " * 6 + "end")
    text = " ".join(shown(known(alarms=(alarm,))).split())
    assert f"the port {port} was lost while sending" in text
    assert text.count("plug it in again,") == 6
    assert "end F1 help" in text.replace("-> ", "")


def test_the_alarm_list_keeps_order_and_acknowledgement() -> None:
    """(2.2)"""
    first, second = AlarmLine("A", "alarm", "a", ""), AlarmLine("B", "note", "b", "")
    book = AlarmList()
    assert book.update([first])
    assert not book.update([second, first])
    assert [alarm.id for alarm in book.lines()] == ["A", "B"]
    book.update([second])
    assert [alarm.id for alarm in book.lines()] == ["A", "B"]
    book.acknowledge(book.lines())
    book.update([second])
    assert [(alarm.id, alarm.is_acknowledged) for alarm in book.lines()] == [("B", True)]
    assert book.update([first])


def test_alarms_come_from_job_and_machine() -> None:
    """(2.2)"""
    sent = {"id": "DNC-L001", "severity": "warning", "text": "held long", "remedy": "look at the control"}
    stopped = machine(dataclasses.replace(PANEL, alarm_number=12470))
    assert [alarm.id for alarm in present_alarms(job(alarms=[sent]), stopped)] == ["DNC-L001", "CNC-12470"]
    damaged = machine(dataclasses.replace(PANEL, overrun_bytes=12))
    assert [(alarm.id, alarm.severity) for alarm in present_alarms(None, damaged)] == [("DNC-L3", "alarm")]
    assert present_alarms(None, None) == []
