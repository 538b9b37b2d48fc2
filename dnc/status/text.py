"""The status report: machine and job as one value, and the same as lines to read. Pure."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from dnc.status.job import JobReading

SCHEMA = "dripmill.status"
VERSION = 1


def status_report(machine: dict[str, Any], job: JobReading | None) -> dict[str, Any]:
    """The report of `dnc status --json`; keys as in docs/schemas/status.schema.json."""
    return {
        "schema": SCHEMA,
        "version": VERSION,
        "time": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "machine": machine,
        "job": None
        if job is None
        else {"age_s": round(job.age_s, 3), "is_attached": job.is_attached, "snapshot": job.snapshot},
    }


def status_lines(report: dict[str, Any]) -> list[str]:
    """The report as a table: what, value, age, quality; anything from outside is shown harmless.

    Where there is no value at all the head says why, once.
    """
    machine = report["machine"]
    mark = "  SIMULATED" if machine["simulated"] else ""
    place = f"{machine['host']}:{machine['port']}"
    lines = [f"machine  {machine['availability']}{mark}  {place}  {machine['problem']}".rstrip()]
    has_values = any(reading["value"] is not None for reading in machine["values"].values())
    for name, reading in machine["values"].items() if has_values else ():
        age = "-" if reading["age_s"] is None else f"{reading['age_s']:.1f} s"
        value = "-" if reading["value"] is None else harmless(str(reading["value"]))
        lines.append(f"  {name:<26} {value:>20}  {age:>8}  {reading['quality']:<5} {reading['problem']}".rstrip())
    job = report["job"]
    if job is None:
        return [*lines, "job      none"]
    snapshot = job["snapshot"]
    label = "  SIMULATED" if snapshot.get("simulated") else ""
    ended = "" if job["is_attached"] else "  (its process has ended)"
    lines.append(f"job      {snapshot.get('state')}{label}  {harmless(str(snapshot.get('program')))}{ended}")
    lines.append(
        f"  sent {snapshot.get('bytes_sent')} of {snapshot.get('bytes_total')} bytes, line {snapshot.get('line_sent')}"
    )
    return lines


def harmless(text: str) -> str:
    r"""Text from outside with everything a terminal could obey shown as its code.

    >>> harmless("N10 \x1b[2J")
    'N10 <1B>[2J'
    """
    return "".join(one if _is_plain(ord(one)) else f"<{ord(one):02X}>" for one in text)


def _is_plain(code: int) -> bool:
    is_control = code < 0x20 or 0x7F <= code < 0xA0
    is_direction_mark = code in (0x061C, 0x200E, 0x200F) or 0x202A <= code <= 0x202E or 0x2066 <= code <= 0x2069
    return not is_control and not is_direction_mark
