"""The operator's screen as rows: pure, from what is known of job and machine at one moment.

80 columns and 24 rows hold it. More of either shows more of the program and of the alarms; less of either leaves the
state, what is asked and the alarms. What is not known is shown as `--`, what is old carries its age, and a rehearsal
says SIMULATED across the whole width.
"""

from __future__ import annotations

import re
import textwrap
from typing import Any

from dnc.console.alarm_rows import alarm_rows, small_alarm_rows, urgent_first
from dnc.console.alarms import AlarmLine
from dnc.console.known import Known, aged, fresh, number, planned, span_of_time
from dnc.console.rows import Row, Span, Tone, beside, fitted, row
from dnc.console.state import BROKEN, state_bar, state_word, to_do
from dnc.status.text import harmless

COLUMNS, ROWS = 80, 24
_LEFT = 46
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
    "F8 then A     abort: stops at once, may cut a block; reset the control then",
    "F9            acknowledge the alarms that are shown; others move up",
    "F10 or q      leave this screen; the job goes on",
    "F1 or ?       this help",
    "",
    "No key here is an emergency stop. Hold and abort stop the data, not the",
    "axes: the control goes on with what it has received.",
    "",
    "Letters too: H hold, R resume, X abort, K acknowledge.",
    "Before a line: ? sent, perhaps not executed yet   > the last one sent",
    "               * the control cuts it",
)


def screen(known: Known, columns: int, rows: int) -> list[Row]:
    """The whole screen, exactly `rows` rows of exactly `columns` columns."""
    return _screen(known, columns, rows)[0]


def shown_alarms(known: Known, columns: int, rows: int) -> list[AlarmLine]:
    """The alarms that the same screen shows in full: what an operator can have seen."""
    return urgent_first(known.alarms)[: _screen(known, columns, rows)[1]]


def _screen(known: Known, columns: int, rows: int) -> tuple[list[Row], int]:
    """The rows, and how many alarms they show."""
    if columns < COLUMNS or rows < ROWS:
        return _small(known, columns, rows)
    top = [_title(known, columns), _banner(known, columns)]
    head = [*top, *state_bar(known, columns, rows), _progress(known, columns)]
    foot = [_ask(known, columns), row(f" {KEYS}")]
    middle, shown = (_help(), 0) if known.is_help else _middle(known, columns, rows - len(head) - len(foot))
    body = [*head, *middle]
    body += [row()] * (rows - len(body) - len(foot))
    return [fitted(one, columns) for one in [*body[: rows - len(foot)], *foot]], shown


def _small(known: Known, columns: int, rows: int) -> tuple[list[Row], int]:
    """What a terminal below the size still shows, the most urgent first: state, question, alarms, keys if they fit."""
    mark = "  SIMULATED" if _is_job_simulated(known) or known.is_machine_simulated else ""
    state = Span(f"{state_word(known)}{mark}", Tone.STRONG)
    head = [row(f"too small: {columns}x{rows}, needs {COLUMNS}x{ROWS}"), row(state)]
    asked = known.question or known.notice or "".join(span.text for span in to_do(known))
    head += [row(Span(line, Tone.ASKS if known.question else Tone.PLAIN)) for line in _filled(asked, columns)]
    room = rows - len(head)
    keys = [row(part) for part in _filled(KEYS, columns)]
    keys = keys if len(keys) <= room else []
    if known.is_help:
        body, shown = [row(part) for line in HELP for part in _filled(line, columns)], 0
    else:
        body, shown = small_alarm_rows(known.alarms, columns, room - len(keys))
        if known.alarms and shown == 0:  # the keys give way to the first of them
            keys = []
            body, shown = small_alarm_rows(known.alarms, columns, room)
    body = body[: max(0, room - len(keys))]
    whole = [*head, *body, *[row()] * (room - len(body) - len(keys)), *keys]
    return [fitted(one, columns) for one in [*whole, *[row()] * rows][:rows]], shown


def _filled(text: str, columns: int) -> list[str]:
    return textwrap.wrap(harmless(text.strip()), columns)


def _is_job_simulated(known: Known) -> bool:
    return known.job is not None and bool(known.job.snapshot.get("simulated"))


def _title(known: Known, columns: int) -> Row:
    mode = fresh(known, "controller_mode")
    overrides = "  ".join(
        f"{label} {fresh(known, name)} %"
        for label, name in (("FEED", "feed_override_percent"), ("SPINDLE", "spindle_override_percent"))
    )
    left = row(" ", Span(known.machine_name, Tone.STRONG), f"   {mode}")
    return beside(left, row(f"{overrides}     {known.clock} "), columns)


def _banner(known: Known, columns: int) -> Row:
    is_job = _is_job_simulated(known)
    is_machine_seen = known.machine is not None and known.machine.is_available
    if not (is_job or known.is_machine_simulated):
        return row()
    text = " SIMULATED: the virtual mill, no real machine "
    if is_job and is_machine_seen and not known.is_machine_simulated:
        text = " SIMULATED: the job, NOT the machine's values "
    elif known.job is not None and not is_job:
        text = " SIMULATED: the machine's values, NOT the job "
    return row(Span(text.center(columns, "="), Tone.SIMULATED))


def _progress(known: Known, columns: int) -> Row:
    if known.job is None:
        return row(" dnc send publishes its job here as soon as it runs")
    name = _name_of(known, columns - COLUMNS + 20)
    plan = planned(known)
    if plan is not None and plan[1] > 0:
        share, unit = min(1.0, plan[0] / plan[1]), "of the time"
        right = f" left {span_of_time(max(0.0, plan[1] - plan[0]))}"
        right += f"  end {known.end_clock}" if known.end_clock else ""
        right = "" if known.job.snapshot.get("state") in BROKEN else right
    else:
        sent, total = known.job.snapshot.get("bytes_sent") or 0, known.job.snapshot.get("bytes_total") or 1
        share, unit, right = min(1.0, sent / total), "of the bytes sent", ""
    head = f" {name} {share:4.0%} {unit} "
    room = columns - len(head) - len(right) - 3
    filled = round(share * room)
    return row(head, "[", Span("=" * filled, Tone.STRONG), Span("." * (room - filled), Tone.QUIET), "]", right)


def _name_of(known: Known, width: int) -> str:
    """The program's name in at most so many columns; of a long one begin and end, as names often differ at the end."""
    name = str(known.job.snapshot.get("program", "")).rpartition("/")[2] if known.job is not None else ""
    return f"{name:<20}" if len(name) <= width else f"{name[: width - 13]}~{name[-12:]}"


def _middle(known: Known, columns: int, height: int) -> tuple[list[Row], int]:
    """Program, axes and line above the alarms, and how many of these are shown."""
    dro = _dro(known)
    alarms, shown = alarm_rows(known.alarms, columns, height - len(dro) - 4)
    block_rows = height - len(alarms) - 4
    left_width = max(_LEFT, columns - 34)
    window = _window(known, block_rows, left_width - 12)
    both = [
        (
            *fitted(window[place] if place < len(window) else row(), left_width),
            *(dro[place] if place < len(dro) else row()),
        )
        for place in range(block_rows)
    ]
    return [_doubt(known), *both, _line_health(known), _buffer(known), row(), *alarms], shown


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
    shown = aged(known, "block")
    return "--" if shown in ("--", "0") else f"N{shown}"


def _window(known: Known, height: int, width: int) -> list[Row]:
    """The blocks about the end of what was sent, cut visibly at so many columns; the one the control cuts has a `*`."""
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
        shown.append(
            row(
                f" {mark} {one.get('line') or '':>6} ",
                Span(text if len(text) <= width else f"{text[: width - 1]}~", tone),
            )
        )
    return shown


def _dro(known: Known) -> list[Row]:
    """Position, distance to go, feed, spindle, tool: the machine's own words, with age where they are old."""
    axes = [
        row(
            Span(f" {axis.upper()} {number(known, f'{axis}_mm', 3):>10} mm", Tone.STRONG),
            f"  to go {number(known, f'to_go_{axis}_mm', 3):>9}",
        )
        for axis in "xyz"
    ]
    return [
        row(" ", _execution(known)),
        *axes,
        row(f" F {number(known, 'feed_mm_min', 1):>10} mm/min"),
        row(f" S {number(known, 'spindle_rpm', 0):>10} 1/min    T {fresh(known, 'tool')}"),
    ]


def _execution(known: Known) -> Span:
    """What the machine does; an open chain of the emergency stop goes before everything."""
    execution = aged(known, "execution")
    if fresh(known, "emergency_stop_ok") == "False" and execution not in ("--", "UNAVAILABLE"):
        return Span("EMERGENCY STOP", Tone.FAULT)
    return Span(execution if execution != "--" else "UNAVAILABLE", _EXECUTION_TONES.get(execution, Tone.PLAIN))


def _line_health(known: Known) -> Row:
    if known.job is None:
        return row()
    snapshot = known.job.snapshot
    elapsed_s, held_s = snapshot.get("elapsed_s") or 0.0, snapshot.get("held_s") or 0.0
    share = held_s / elapsed_s if elapsed_s > 0 else 0.0
    worst, most = snapshot.get("inflight_at_xoff_bytes_max") or 0, snapshot.get("inflight_max_bytes")
    return row(
        f" {snapshot.get('baud')} baud, {snapshot.get('utilisation') or 0.0:.0%} used;",
        f" {snapshot.get('xoff_count')} stops, held {share:.0%}; {worst} of {most} B beyond recall",
    )


def _buffer(known: Known) -> Row:
    fill, overrun = fresh(known, "buffer_fill_percent"), fresh(known, "overrun_bytes")
    parts = [Span(f" control's buffer {fill} % full, {overrun} bytes lost")]
    if overrun not in ("--", "0"):
        parts = [Span(f" CONTROL LOST {overrun} BYTES: its program is damaged", Tone.FAULT)]
    elif fill == "0" and fresh(known, "execution") == "ACTIVE" and state_word(known) == "SENDING":
        parts = [Span(" control's buffer EMPTY: the line may be too slow for this feed", Tone.ABNORMAL)]
    plan = planned(known)
    if plan is not None and known.forecast is not None and known.job is not None:
        doubt = known.job.snapshot.get("in_doubt")
        stop_s = known.forecast.next_stop_s(doubt[0] if doubt else None)
        if stop_s is not None and stop_s > plan[0]:
            parts.append(Span(f"   next stop in {span_of_time(stop_s - plan[0])}"))
    return tuple(parts)


def _ask(known: Known, columns: int) -> Row:
    if known.question:
        return row(Span(f" {known.question}".ljust(columns), Tone.ASKS))
    return row(f" {known.notice}") if known.notice else to_do(known)


def _help() -> list[Row]:
    return [row(), *(row(f"   {line}") for line in HELP)]
