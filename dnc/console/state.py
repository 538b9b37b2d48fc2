"""The bar that tells the state of the job across the shop, and the line that tells what to do now. Pure."""

from __future__ import annotations

from dnc.console.known import Known, fresh, span_of_time
from dnc.console.rows import Row, Span, Tone, beside, fitted, row
from dnc.status.ledger import Quality

BROKEN = ("ABORTED", "FAULTED")
_OVER = ("SENT", *BROKEN)
_JOB_STALE_S = 2.0
_LONG_HOLD_S = 10.0
_TONES = {
    "NO JOB": Tone.QUIET,
    "LOST": Tone.FAULT,
    "SENDING": Tone.RUNS,
    "DRAINING": Tone.RUNS,
    "PAUSED": Tone.ASKS,
    "ARMED": Tone.ASKS,
    "ABORTED": Tone.ABNORMAL,
    "FAULTED": Tone.FAULT,
}
_TO_DO = {
    "ARMED": "The control has not asked yet: start external execution there.",
    "PAUSED": "Paused. F5 then Enter goes on, F8 then A gives the job up.",
    "SENT": "All bytes have left. Stay until the control has ended the program.",
    "ABORTED": "Look at the tool, reset the control. dnc send --resume proposes a restart.",
    "FAULTED": "Look at the tool, then at the alarm. dnc send --resume proposes a restart.",
    "LOST": "Look at the tool. dnc jobs tells what was sent; dnc send --resume goes on.",
}


def state_word(known: Known) -> str:
    """The state of the job, NO JOB without one, LOST when its process has gone in the middle."""
    if known.job is None:
        return "NO JOB"
    state = str(known.job.snapshot.get("state"))
    return "LOST" if state not in _OVER and not known.job.is_attached else state


def state_bar(known: Known, columns: int, rows: int) -> list[Row]:
    """The state over the whole width in the colour of the worst that is known; three rows high where there is room."""
    tone = _tone(known)
    word = row(Span(f" ### {state_word(known)} ###", tone if tone is not Tone.PLAIN else Tone.STRONG))
    told = (*_job_link(known), Span("   "), *_machine_link(known), Span(" "))
    room = columns - sum(len(span.text) for span in told) - 1
    left = (*word, Span(_detail(known).ljust(room)[: max(0, room - len(word[0].text))], tone))
    bar = beside(left, told, columns)
    edge = fitted((Span(" " * room, tone),), columns)
    return [edge, bar, edge] if rows >= 30 else [bar]


def to_do(known: Known) -> Row:
    """What the operator can do now; empty where nothing is asked of anybody."""
    word = state_word(known)
    if word == "SENT" and _is_completed(known):
        return row(" The control has ended the program.")
    if word == "HELD":
        is_long = _held_s(known) >= _LONG_HOLD_S
        return row(" The control takes nothing: feed hold, override 0, M0 or a tool change?") if is_long else row()
    text = _TO_DO.get(word, "")
    return row(Span(f" {text}", Tone.STRONG)) if text else row()


def _tone(known: Known) -> Tone:
    word = state_word(known)
    if any(alarm.severity == "alarm" and not alarm.is_acknowledged for alarm in known.alarms):
        return Tone.FAULT
    if _is_stale(known):
        return Tone.ABNORMAL
    if word == "HELD" and _held_s(known) < _LONG_HOLD_S:
        return Tone.RUNS  # drip feed is held many times a minute: the bar must not flicker
    return _TONES.get(word, Tone.PLAIN)


def _detail(known: Known) -> str:
    """What stands behind the state's word."""
    word = state_word(known)
    if known.job is None:
        return ""
    if word == "LOST":
        return " the sender has gone without a word"
    if _is_stale(known):
        return " when last heard of"
    if word == "HELD":
        return f" by the control {span_of_time(_held_s(known))}"
    if word == "SENT":
        return " and ended by the control" if _is_completed(known) else " to the control, not yet done"
    return " until the block ends" if known.job.snapshot.get("is_pausing") else ""


def _held_s(known: Known) -> float:
    return float(known.job.snapshot.get("held_now_s") or 0.0) if known.job is not None else 0.0


def _is_stale(known: Known) -> bool:
    return known.job is not None and known.job.is_attached and known.job.age_s > _JOB_STALE_S


def _is_completed(known: Known) -> bool:
    return fresh(known, "execution") == "PROGRAM_COMPLETED"


def _job_link(known: Known) -> Row:
    if known.job is None or not known.job.is_attached:
        return row()
    if _is_stale(known):
        return row(Span(f"job {known.job.age_s:.0f} s old", Tone.ABNORMAL))
    link = str(known.job.snapshot.get("link", "OPEN"))
    return row(Span(f"link {link}", Tone.FAULT if link == "LOST" else Tone.PLAIN))


def _machine_link(known: Known) -> Row:
    status = known.machine
    reading = status.readings.get("execution") if status is not None else None
    if status is None or reading is None or reading.age_s is None:
        return row(Span("modbus UNAVAILABLE", Tone.QUIET))
    if reading.quality is Quality.GOOD:
        return row(f"modbus {reading.age_s:.1f} s")
    return row(Span(f"modbus {reading.quality.value} {reading.age_s:.0f} s", Tone.ABNORMAL))
