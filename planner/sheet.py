"""The setup sheet: one page for the person at the machine, printable, with its picture inside and nothing from outside.

`SheetFacts` is what a sheet says; a plan knows all of it, a bare program less. `render_sheet` makes the page.
"""

from __future__ import annotations

import html
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.job import Tool
from planner.path.model import Array, Pass
from planner.path.spans import in_work, points_along
from planner.sketch import Lines, side_view, top_view

if TYPE_CHECKING:
    from planner.plan import Planned

_STYLE = Path(__file__).with_name("sheet.css")
_FROM_ABOVE = "From above, X to the right, Y up: cutting moves (blue), zero point (red), where the cut begins (green)"
_FROM_FRONT = "From the front, X to the right, Z up: the first, the middle and the last cut"


@dataclass(frozen=True, slots=True)
class SheetTool:
    """One tool as the person must find and measure it."""

    number: int
    words: str
    stick_out: str


@dataclass(frozen=True, slots=True)
class SheetFacts:
    """What a setup sheet says; lengths mm, times s. Points are the programmed ones, in work coordinates.

    `lines` are cutting moves as point rows (n, 3); `rows` are further names and values in their order; `warnings` are
    sentences to read before the start.
    """

    title: str
    sha256: str
    reference: str
    work_offset: str
    origin: str
    tools: tuple[SheetTool, ...]
    stock_box_mm: tuple[Array, Array] | None
    low_mm: Array
    high_mm: Array
    cutting_s: float
    air_s: float
    rows: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    lines: Lines


def plan_sheet(planned: Planned) -> str:
    """The sheet of a planned operation, as HTML."""
    return render_sheet(_plan_facts(planned))


def render_sheet(facts: SheetFacts) -> str:
    """The page: warnings first, then zero point and tools, then figures, then both views."""
    rows = [
        ("Work offset", facts.work_offset),
        ("Zero point", facts.origin or "not given"),
        ("Programmed point", facts.reference),
        *_extent_rows(facts),
        ("Cutting time", _clock(facts.cutting_s)),
        ("Air time", _clock(facts.air_s)),
        *facts.rows,
        ("sha256", facts.sha256),
    ]
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f"<title>Setup sheet {_safe(facts.title)}</title>",
        f"<style>{_STYLE.read_text()}</style></head><body>",
        f"<h1>Setup sheet: {_safe(facts.title)}</h1>",
        _warning_box(facts.warnings),
        "<section><h2>Tools</h2><table><thead>",
        "<tr><th>T</th><th>Tool</th><th>Out of the holder</th><th>Length</th></tr></thead><tbody>",
        *(_tool_row(tool) for tool in facts.tools),
        "</tbody></table></section>",
        "<section><h2>Setup</h2><table><tbody>",
        *(f"<tr><th>{_safe(name)}</th><td>{_safe(value)}</td></tr>" for name, value in rows),
        "</tbody></table></section>",
        "<section class=views><figure>",
        top_view(facts.lines, facts.stock_box_mm),
        f"<figcaption>{_FROM_ABOVE}</figcaption></figure><figure>",
        side_view(facts.lines, facts.stock_box_mm),
        f"<figcaption>{_FROM_FRONT}</figcaption></figure></section>",
        "<footer>No key of this program is an emergency stop. Set up by: ______________ Date: ____________</footer>",
        "</body></html>",
    ]
    return "\n".join(part for part in parts if part)


def _extent_rows(facts: SheetFacts) -> list[tuple[str, str]]:
    low, high = facts.low_mm, facts.high_mm
    names = [(f"{axis} of the cut", f"{low[i]:.3f} to {high[i]:.3f} mm") for i, axis in enumerate("XYZ")]
    stock = facts.stock_box_mm
    text = "not given"
    if stock is not None:
        text = " x ".join(f"{stock[0][i]:g} to {stock[1][i]:g}" for i in range(3)) + " mm"
    return [*names, ("Lowest Z", f"{low[2]:.3f} mm"), ("Stock", text)]


def sheet_tool(tool: Tool) -> SheetTool:
    """A tool of the job file in words."""
    stick_out = "not given" if tool.length_mm is None else f"at least {tool.length_mm:g} mm"
    words = f"{tool.kind}, diameter {tool.diameter_mm:g} mm, {tool.flutes} flutes, edge D{tool.edge}"
    return SheetTool(tool.number, words, stick_out)


def _warning_box(warnings: tuple[str, ...]) -> str:
    if not warnings:
        return ""
    items = "".join(f"<li>{_safe(warning)}</li>" for warning in warnings)
    return f"<section class=warnings><h2>Read before the start</h2><ul>{items}</ul></section>"


def _tool_row(tool: SheetTool) -> str:
    cells = (f"T{tool.number}", tool.words, tool.stick_out, "____________")
    return "<tr>" + "".join(f"<td>{_safe(cell)}</td>" for cell in cells) + "</tr>"


def _safe(text: str) -> str:
    """Text for the page; of a name that is no UTF-8 the strange bytes become question marks."""
    return html.escape(text.encode("utf-8", "replace").decode("utf-8"), quote=True)


def _clock(time_s: float) -> str:
    """Seconds as h:mm:ss.

    >>> _clock(3725.4)
    '1:02:05'
    """
    whole = round(time_s)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def _plan_facts(planned: Planned) -> SheetFacts:
    job, report, path = planned.job, planned.report, planned.tool_path
    operation = job.operation[0]
    drop_mm = path.radius_mm if job.post.reference == "tip" else 0.0
    lines = [_points(one, drop_mm) for one in path.passes]
    every = np.concatenate(lines)
    cutting_s = 60.0 * report["cut_length_mm"] / operation.cut_mm_min
    box = job.setup.stock_box_mm
    return SheetFacts(
        title=job.post.name,
        sha256=planned.sidecar["sha256"],
        reference=f"{job.post.reference} of the ball: tool length measured to the {job.post.reference}",
        work_offset=job.setup.work_offset,
        origin=job.setup.origin,
        tools=(sheet_tool(job.tool_of(operation)),),
        stock_box_mm=None if box is None else (np.array(box[0]), np.array(box[1])),
        low_mm=every.min(axis=0),
        high_mm=every.max(axis=0),
        cutting_s=cutting_s,
        air_s=max(report["machining_time_s"] - cutting_s, 0.0),
        rows=(
            ("Control", job.post.control),
            ("Clearance, safe Z", f"{job.setup.clearance_z_mm:g}, {job.setup.safe_z_mm:g} mm"),
            ("Spindle", f"{operation.spindle_rpm:g} rpm, coolant {operation.coolant}"),
            ("Feed", f"{operation.cut_mm_min:g} mm/min, plunge {operation.plunge_mm_min:g} mm/min"),
            ("Passes", f"{report['passes']}, scallop {1000 * report['scallop_mm']:.1f} µm"),
            *_edge_rows(job.operation[0].edge),
            ("Program", f"{report['blocks']} blocks, {report['bytes']} bytes"),
            ("Feed limit of the line", _feed_limits(report)),
        ),
        warnings=planned.warnings,
        lines=lines,
    )


def _edge_rows(edge: str) -> list[tuple[str, str]]:
    """What the person who clamps must know of the strip beside the part."""
    if edge != "roll-over":
        return []
    return [
        (
            "Edge",
            "roll-over: the ball goes down beside the part, about one pick feed out; keep clamps clear of that strip",
        )
    ]


def _feed_limits(report: dict[str, Any]) -> str:
    texts = []
    for baud in ("9600", "19200", "115200"):
        limit = report["feed_limit_mm_min"][baud]["120"]
        texts.append(f"{baud} baud: " + ("no limit" if limit is None else f"{limit:.0f} mm/min"))
    return "at 120 % override, " + ", ".join(texts)


def _points(one: Pass, drop_mm: float) -> Array:
    """Points (n, 3) along a pass, fine enough for a picture, its highest and lowest among them."""
    return in_work(one.plane, points_along(one.shape), drop_mm)
