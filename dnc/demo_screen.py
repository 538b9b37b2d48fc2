"""The demo's one screen: what was planned beside what was measured, as plain text from the report's values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

Report = dict[str, Any]

_UM = 1000.0


def demo_screen(report: Report, folder: Path) -> str:
    """The screen for a terminal of 80 columns; `report` has the objects of the demo's report.json."""
    return "\n".join([*_head(report), "", *_part(report), "", *_line(report), "", *_files(folder)]) + "\n"


def _head(report: Report) -> list[str]:
    plan, send = report["plan"], report["send"]
    agree = "=" if send["sha256"] == report["mill"]["sha256"] else "DIFFERS FROM"
    return [
        "SIMULATED: a virtual mill behind a pseudo-terminal. No machine moved.",
        "",
        (
            f"  program   {plan['bytes']} bytes, {plan['blocks']} blocks, {len(plan['pick_feed_mm']) + 1} passes,"
            f" {plan['spans']} spline spans"
        ),
        f"  sha256    sent {send['sha256'][:12]} {agree} received {report['mill']['sha256'][:12]}",
    ]


def _part(report: Report) -> list[str]:
    plan, simulate = report["plan"], report["simulate"]
    deviation = simulate["deviation_mm"]
    rows = [
        ("scallop height", f"{plan['scallop_mm'] * _UM:9.2f} um", f"{simulate['scallop_mm'] * _UM:9.2f} um"),
        ("gouge", f"{plan['gouge_mm'] * _UM:9.2f} um", f"{simulate['gouge_mm'] * _UM:9.2f} um"),
        ("path deviation", f"{plan['path_deviation_mm'] * _UM:9.2f} um", ""),
        ("mean material left", "", f"{deviation['mean'] * _UM:9.2f} um"),
        ("surface covered", "", f"{simulate['coverage'] * 100:9.2f} % "),
        ("machining time", _clock(plan["machining_time_s"]), _clock(simulate["machining_time_s"])),
        ("cut, air", f"{plan['cut_length_mm']:.0f} + {plan['air_length_mm']:.0f} mm", ""),
    ]
    lines = [f"  {'':<20}{'planned':>15}{'measured':>17}"]
    lines += [f"  {name:<20}{planned:>15}{measured:>17}" for name, planned, measured in rows]
    return [*lines, "  planned scallop: between exact passes; what the paths deviate may come on top"]


def _disturbed(mill: Report) -> list[str]:
    """What the computer itself did to the overshoot, where it did: a late mill is not a late sender."""
    if mill["overshoot_bytes_max"] <= 3 or mill["hold_up_s_max"] < 1e-3:
        return []
    return [f"    this computer was busy: the mill itself was late by up to {1000 * mill['hold_up_s_max']:.0f} ms"]


def _line(report: Report) -> list[str]:
    window, mill = report["window"], report["mill"]
    send, window_mill = window["send"], window["mill"]
    return [
        f"  line at {send['baud']} baud, true speed, {send['elapsed_s']:.1f} s (window)",
        f"    held {send['xoff_count']} times, {send['held_s']:.1f} s; {100 * send['utilisation']:.1f} % used else",
        f"    at most {window_mill['overshoot_bytes_max']} bytes arrived after a stop began",
        *_disturbed(window_mill),
        f"    feed override {window['feed_override_percent']:g} %, so that the control asks often",
        f"  whole program, {mill['time_scale']:g} times as fast as life (scaled figures)",
        f"    {mill['bytes_received']} bytes received, {mill['overrun_bytes']} lost, {mill['xoff_sent']} stops",
        f"    starved {mill['starved_s']:.1f} s, alarms {len(mill['alarms'])}",
    ]


def _files(folder: Path) -> list[str]:
    return [
        f"  in {folder}/",
        "    part.mpf  report.json  motion.csv  paths.png  deviation.png",
    ]


def _clock(time_s: float) -> str:
    minutes, seconds = divmod(round(time_s), 60)
    return f"{minutes}:{seconds:02d} min"
