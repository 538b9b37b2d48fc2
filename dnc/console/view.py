"""The operator's screen as rows: pure, from what is known of job and machine at one moment.

80 columns and 24 rows hold it; more of either shows more of the program and of the alarms. What is not known is shown
as `--`, what is old carries its age, and a rehearsal says SIMULATED across the whole width.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from dnc.console.alarms import AlarmLine
from dnc.console.forecast import Forecast
from dnc.console.rows import Row, Span, Tone, beside, fitted, row
from dnc.status.job import JobReading
from dnc.status.ledger import MachineStatus, Quality

COLUMNS, ROWS = 80, 24
_LEFT = 46
_JOB_STALE_S = 2.0
_BROKEN = ("ABORTED", "FAULTED")
_OVER = ("SENT", *_BROKEN)
_STATE_TONES = {
    "SENDING": Tone.RUNS,
    "DRAINING": Tone.RUNS,
    "PAUSED": Tone.ASKS,
    "ARMED": Tone.ASKS,
    "ABORTED": Tone.ABNORMAL,
    "FAULTED": Tone.FAULT,
}
_EXECUTION_TONES = {
    "ACTIVE": Tone.RUNS,
    "PROGRAM_STOPPED": Tone.ASKS,
    "OPTIONAL_STOP": Tone.ASKS,
    "INTERRUPTED": Tone.ASKS,
    "FEED_HOLD": Tone.ASKS,
    "STOPPED": Tone.ABNORMAL,
}
_ZONES = {"executed": " ", "doubt": "?", "sent": ">", "next": " "}
KEYS = "F1 help  F5 resume  F6 hold  F8 abort  F9 acknowledge  F10 leave"
HELP = (
    "F6 or space   hold: the job pauses at the end of a block",
    "F5 then Enter resume a paused job",
    "F8 then A     abort: stops at once, may cut a block; the control then needs a reset",
    "F9            acknowledge alarms",
    "F10 or q      leave this screen; the job goes on",
    "F1 or ?       this help",
    "",
    "No key here is an emergency stop. Hold and abort stop the data, not the axes:",
    "the control goes on with what it has received.",
    "Letters do what their function key does: H hold, R resume, X abort, K acknowledge.",
)


@dataclass(frozen=True, slots=True)
class Known:
    """What is known at one moment; `clock` is the time of day, `question` waits for a second key."""

    clock: str
    end_clock: str = ""
    machine_name: str = ""
    job: JobReading | None = None
    machine: MachineStatus | None = None
    forecast: Forecast | None = None
    alarms: tuple[AlarmLine, ...] = field(default_factory=tuple)
    question: str = ""
    notice: str = ""
    is_help: bool = False


def screen(known: Known, columns: int, rows: int) -> list[Row]:
    """The whole screen, exactly `rows` rows of exactly `columns` columns."""
    if columns < COLUMNS or rows < ROWS:
        small = [row(f"too small: {columns}x{rows}, needs {COLUMNS}x{ROWS}"), row(_state_word(known)[0])]
        return [fitted(one, columns) for one in (small + [row()] * rows)[:rows]]
    head = [_title(known, columns), _banner(known, columns), _state(known, columns), _progress(known, columns)]
    foot = [_ask(known, columns), row(Span(f" {KEYS}", Tone.QUIET))]
    middle = _help() if known.is_help else _middle(known, columns, rows - len(head) - len(foot))
    body = [*head, *middle]
    body += [row()] * (rows - len(body) - len(foot))
    return [fitted(one, columns) for one in [*body[: rows - len(foot)], *foot]]


def planned(known: Known) -> tuple[float, float] | None:
    """Planned seconds done and in all; None without a forecast, or when all is sent and nobody reads the machine."""
    if known.forecast is None or known.job is None:
        return None
    is_seen = known.machine is not None and known.machine.value("execution") is not None
    if known.job.snapshot.get("state") == "SENT" and not is_seen:
        return None
    doubt = known.job.snapshot.get("in_doubt")
    block = known.machine.value("block") if known.machine is not None else None
    number = int(block) if isinstance(block, int) and block > 0 else None
    done_s = known.forecast.done_s(doubt[0] if doubt else None, number)
    if known.machine is not None and known.machine.value("execution") == "PROGRAM_COMPLETED":
        done_s = known.forecast.total_s
    return None if done_s is None else (done_s, known.forecast.total_s)


def span_of_time(seconds: float) -> str:
    """Minutes and seconds, hours where there are any.

    >>> span_of_time(3725.4), span_of_time(65), span_of_time(0.4)
    ('1:02:05', '1:05', '0:00')
    """
    whole = int(seconds)
    hours, minutes, rest = whole // 3600, whole // 60 % 60, whole % 60
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def _title(known: Known, columns: int) -> Row:
    mode = _value(known, "controller_mode")
    overrides = "  ".join(
        f"{label} {_value(known, name)} %"
        for label, name in (("FEED", "feed_override_percent"), ("SPINDLE", "spindle_override_percent"))
    )
    left = row(" ", Span(known.machine_name, Tone.STRONG), f"   {mode}")
    return beside(left, row(f"{overrides}     {known.clock} "), columns)


def _banner(known: Known, columns: int) -> Row:
    if known.job is not None and known.job.snapshot.get("simulated"):
        return row(Span(" SIMULATED: the virtual mill, no real machine ".center(columns, "="), Tone.SIMULATED))
    return row()


def _state_word(known: Known) -> tuple[str, Tone]:
    if known.job is None:
        return "NO JOB", Tone.QUIET
    state = str(known.job.snapshot.get("state"))
    if state not in _OVER and not known.job.is_attached:
        return "LOST", Tone.FAULT
    return state, _STATE_TONES.get(state, Tone.PLAIN)


def _state(known: Known, columns: int) -> Row:
    word, tone = _state_word(known)
    detail = ""
    if known.job is not None:
        snapshot = known.job.snapshot
        if word == "HELD":
            detail = f" by the control {span_of_time(snapshot.get('held_now_s') or 0.0)}"
        elif word == "LOST":
            detail = " the sending process has gone without a word"
        elif word == "SENT":
            detail = " to the control; not: done"
        elif snapshot.get("is_pausing"):
            detail = " until the block ends"
    left = row(" ", Span(f"### {word} ###", tone if tone is not Tone.PLAIN else Tone.STRONG), detail)
    return beside(left, (*_job_link(known), Span("   "), *_machine_link(known), Span(" ")), columns)


def _job_link(known: Known) -> Row:
    if known.job is None or not known.job.is_attached:
        return row()
    link = str(known.job.snapshot.get("link", "OPEN"))
    if known.job.age_s > _JOB_STALE_S:
        return row(Span(f"job {known.job.age_s:.0f} s old", Tone.ABNORMAL))
    return row(Span(f"link {link}", Tone.FAULT if link == "LOST" else Tone.PLAIN))


def _machine_link(known: Known) -> Row:
    status = known.machine
    reading = status.readings.get("execution") if status is not None else None
    if status is None or reading is None or reading.age_s is None:
        return row(Span("modbus UNAVAILABLE", Tone.QUIET))
    if reading.quality is Quality.GOOD:
        return row(f"modbus {reading.age_s:.1f} s")
    return row(Span(f"modbus {reading.quality.value} {reading.age_s:.0f} s", Tone.ABNORMAL))


def _progress(known: Known, columns: int) -> Row:
    if known.job is None:
        return row(" dnc send publishes its job here as soon as it runs")
    name = str(known.job.snapshot.get("program", "")).rpartition("/")[2]
    plan = planned(known)
    if plan is not None and plan[1] > 0:
        share, unit = min(1.0, plan[0] / plan[1]), "of the time"
        right = f" left {span_of_time(max(0.0, plan[1] - plan[0]))}"
        right += f"  end {known.end_clock}" if known.end_clock else ""
        right = "" if known.job.snapshot.get("state") in _BROKEN else right
    else:
        sent, total = known.job.snapshot.get("bytes_sent") or 0, known.job.snapshot.get("bytes_total") or 1
        share, unit, right = min(1.0, sent / total), "of the bytes sent", ""
    head = f" {name[:20]:<20} {share:4.0%} {unit} "
    room = columns - len(head) - len(right) - 3
    filled = round(share * room)
    return row(head, "[", Span("=" * filled, Tone.STRONG), Span("." * (room - filled), Tone.QUIET), "]", right)


def _middle(known: Known, columns: int, height: int) -> list[Row]:
    alarms = _alarms(known, max(4, height // 4))
    dro = _dro(known)
    block_rows = max(len(dro), height - len(alarms) - 4)
    window = _window(known, block_rows)
    left_width = max(_LEFT, columns - 34)
    both = [
        (
            *fitted(window[place] if place < len(window) else row(), left_width),
            *(dro[place] if place < len(dro) else row()),
        )
        for place in range(block_rows)
    ]
    return [_doubt(known), *both, _line_health(known), _buffer(known), row(), *alarms]


def _doubt(known: Known) -> Row:
    if known.job is None:
        return row()
    snapshot = known.job.snapshot
    doubt = snapshot.get("in_doubt")
    sent = f" sent to line {snapshot.get('line_sent') or '--'}"
    between = f"   in doubt {doubt[0]}..{doubt[1]}" if doubt else ""
    return row(sent, between, f"   control at {_block(known)}")


def _block(known: Known) -> str:
    """The last block number that the control has passed; a control shows 0 before the first."""
    shown = _value(known, "block")
    return "--" if shown in ("--", "0") else f"N{shown}"


def _window(known: Known, height: int) -> list[Row]:
    """The blocks about the end of what was sent, the one the control cuts marked with `*`."""
    if known.job is None:
        return []
    block = known.machine.value("block") if known.machine is not None else None
    lines: list[dict[str, Any]] = list(known.job.snapshot.get("window") or [])
    centre = next((place for place, one in enumerate(lines) if one.get("zone") == "sent"), 0)
    first = min(max(0, centre - height // 2), max(0, len(lines) - height))
    shown: list[Row] = []
    for one in lines[first : first + height]:
        zone, text = str(one.get("zone")), str(one.get("text", ""))
        is_cut = bool(block) and re.match(rf"\s*N0*{block}(?!\d)", text) is not None
        tone = {"executed": Tone.QUIET, "next": Tone.QUIET, "sent": Tone.STRONG}.get(zone, Tone.PLAIN)
        mark = "*" if is_cut else _ZONES.get(zone, " ")
        shown.append(row(f" {mark} {one.get('line', ''):>6} ", Span(text[:80], tone)))
    return shown


def _dro(known: Known) -> list[Row]:
    """Position, distance to go, feed, spindle, tool: the machine's own words, with age where they are old."""
    execution = _value(known, "execution")
    axes = [
        row(
            Span(f" {axis.upper()} {_number(known, f'{axis}_mm', 3):>11}", Tone.STRONG),
            f"  go {_number(known, f'to_go_{axis}_mm', 3):>10}",
        )
        for axis in "xyz"
    ]
    tone = _EXECUTION_TONES.get(execution, Tone.PLAIN)
    return [
        row(" ", Span(execution if execution != "--" else "UNAVAILABLE", tone)),
        *axes,
        row(f" F {_number(known, 'feed_mm_min', 1):>11}  mm/min"),
        row(f" S {_number(known, 'spindle_rpm', 0):>11}  T {_value(known, 'tool')}"),
    ]


def _line_health(known: Known) -> Row:
    if known.job is None:
        return row()
    snapshot = known.job.snapshot
    elapsed_s, held_s = snapshot.get("elapsed_s") or 0.0, snapshot.get("held_s") or 0.0
    share = held_s / elapsed_s if elapsed_s > 0 else 0.0
    worst, most = snapshot.get("inflight_at_xoff_bytes_max"), snapshot.get("inflight_max_bytes")
    return row(
        f" line {snapshot.get('baud')} baud, {snapshot.get('utilisation') or 0.0:.0%} used;",
        f" held {share:.0%} in {snapshot.get('xoff_count')} stops; beyond recall {worst} of {most}",
    )


def _buffer(known: Known) -> Row:
    fill, overrun = _value(known, "buffer_fill_percent"), _value(known, "overrun_bytes")
    parts = [Span(f" control's buffer {fill} % full, {overrun} bytes lost")]
    if overrun not in ("--", "0"):
        parts = [Span(f" CONTROL LOST {overrun} BYTES: its program is damaged", Tone.FAULT)]
    elif fill == "0" and _value(known, "execution") == "ACTIVE" and _state_word(known)[0] == "SENDING":
        parts.append(Span("   EMPTY: the line may be too slow for this feed", Tone.ABNORMAL))
    plan = planned(known)
    if plan is not None and known.forecast is not None and known.job is not None:
        doubt = known.job.snapshot.get("in_doubt")
        stop_s = known.forecast.next_stop_s(doubt[0] if doubt else None)
        if stop_s is not None:
            parts.append(Span(f"   next stop in {span_of_time(max(0.0, stop_s - plan[0]))}"))
    return tuple(parts)


def _alarms(known: Known, most: int) -> list[Row]:
    if not known.alarms:
        return [row(" alarms: none")]
    shown: list[Row] = []
    for alarm in known.alarms[: most - 1]:
        mark = " " if alarm.is_acknowledged else "!"
        tone = {"alarm": Tone.FAULT, "warning": Tone.ABNORMAL}.get(alarm.severity, Tone.PLAIN)
        shown.append(row(" ", Span(f"{mark} {alarm.severity.upper()} {alarm.id}", tone), f" {alarm.text}"))
        if alarm.remedy:
            shown.append(row(f"     -> {alarm.remedy}"))
    hidden = len(known.alarms) - (most - 1)
    return [*shown, row(f"   and {hidden} more")] if hidden > 0 else shown


def _ask(known: Known, columns: int) -> Row:
    if known.question:
        return row(Span(f" {known.question}".ljust(columns), Tone.ASKS))
    return row(f" {known.notice}") if known.notice else row()


def _help() -> list[Row]:
    return [row(), *(row(f"   {line}") for line in HELP)]


def _value(known: Known, name: str) -> str:
    """A value as text: `--` without one, its age after it when it is not fresh."""
    reading = known.machine.readings.get(name) if known.machine is not None else None
    if reading is None or reading.value is None:
        return "--"
    if reading.quality is Quality.GOOD:
        return str(reading.value)
    return f"{reading.value} ({reading.age_s or 0.0:.0f} s old)"


def _number(known: Known, name: str, decimals: int) -> str:
    value = known.machine.value(name) if known.machine is not None else None
    return "--" if value is None or isinstance(value, str) else f"{value:.{decimals}f}"
