"""The unit a program is written in: a tool path in inches is the same path with every length divided by 25.4."""

from __future__ import annotations

from dataclasses import replace

from planner.path.model import ArcChain, Pass, PlaneSpline, Polyline, Shape, ToolPath

INCH_MM = 25.4


def in_unit(tool_path: ToolPath, unit_mm: float) -> ToolPath:
    """The tool path with lengths in units of `unit_mm`; the names with `_mm` then count in that unit.

    Knots keep their values: only their ratios matter to a curve.
    """
    if unit_mm == 1.0:
        return tool_path
    passes = tuple(_pass_in_unit(one, unit_mm) for one in tool_path.passes)
    return replace(tool_path, passes=passes, radius_mm=tool_path.radius_mm / unit_mm)


def _pass_in_unit(one: Pass, unit_mm: float) -> Pass:
    plane = replace(one.plane, offset_mm=one.plane.offset_mm / unit_mm)
    return replace(one, plane=plane, shape=_shape_in_unit(one.shape, unit_mm), deviation_mm=one.deviation_mm / unit_mm)


def _shape_in_unit(shape: Shape, unit_mm: float) -> Shape:
    if isinstance(shape, PlaneSpline):
        return replace(shape, control_points=shape.control_points / unit_mm)
    if isinstance(shape, Polyline):
        return Polyline(shape.points / unit_mm)
    assert isinstance(shape, ArcChain)
    return replace(shape, points=shape.points / unit_mm, centres=shape.centres / unit_mm)
