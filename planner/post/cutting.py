"""The cutting blocks of a SINUMERIK program: every pass as the job wants it written, or in the shortest way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from planner.errors import InputRejected
from planner.job import Job, Operation
from planner.path.model import ArcChain, Array, Pass, PlaneSpline, Polyline, ToolPath
from planner.post.arcs import arc_passes
from planner.post.bspline import bspline_passes
from planner.post.digits import Digits
from planner.post.heights import heights_passes, is_heights
from planner.post.linear import linear_passes
from planner.post.numbers import decimals_within
from planner.post.passtext import PassText
from planner.post.poly import poly_passes
from planner.post.units import INCH_MM, in_unit
from planner.post.written import ControlLimits, rounding_budgets_mm

_FINEST_DECIMALS = 8
_REFININGS = 3


def pass_texts(job: Job, operation: Operation, tool_path: ToolPath, control: ControlLimits) -> list[PassText]:
    """The cutting blocks of every pass, in the way the job asks for, in the control's unit."""
    unit_mm = INCH_MM if control.is_inch else 1.0
    texts = _texts(job, operation.path_mm / unit_mm, in_unit(tool_path, unit_mm), control)
    return [replace(text, rounding_mm=text.rounding_mm * unit_mm) for text in texts]


def _texts(job: Job, path_mm: float, tool_path: ToolPath, control: ControlLimits) -> list[PassText]:
    drop_z_mm = tool_path.radius_mm if job.post.reference == "tip" else 0.0
    budgets_mm = rounding_budgets_mm(path_mm, tool_path)
    most = most_decimals(control)
    shapes = {type(one.shape) for one in tool_path.passes}
    fine = np.minimum(decimals_within(budgets_mm), most)
    if shapes == {Polyline}:
        return linear_passes(tool_path.passes, drop_z_mm, budgets_mm, fine, most)
    if shapes == {ArcChain}:
        return arc_passes(tool_path.passes, drop_z_mm, budgets_mm, fine, most)
    if shapes != {PlaneSpline} or job.post.blocks not in ("auto", "poly", "bspline"):
        raise InputRejected(
            f'post.blocks "{job.post.blocks}" cannot be written for {job.post.control}',
            remedy='use "auto", "poly", "bspline", "arcs" or "linear"',
            key=("post", "blocks"),
        )
    if job.post.blocks == "bspline":
        return _bsplines(tool_path, drop_z_mm, budgets_mm, fine, most, control)
    poly = _polys(tool_path, drop_z_mm, budgets_mm, fine, most)
    has_heights = any(is_heights(one) for one in tool_path.passes)
    if job.post.blocks == "poly" or has_heights or not control.knot_rule_verified:
        return poly
    bspline = _bsplines(tool_path, drop_z_mm, budgets_mm, fine, most, control)
    return min(poly, bspline, key=_size_bytes)


def _polys(tool_path: ToolPath, drop_z_mm: float, budgets_mm: Array, fine: Digits, most: int) -> list[PassText]:
    """Every pass in POLY blocks, heights of degree 5 or free cubics."""
    texts: dict[int, PassText] = {}
    by_kind = np.array([is_heights(one) for one in tool_path.passes])
    for kind, write in ((True, heights_passes), (False, poly_passes)):
        rows = np.flatnonzero(by_kind == kind)
        passes = [tool_path.passes[row] for row in rows]
        written = _refined(write, passes, drop_z_mm, budgets_mm[rows], fine[rows], most)
        texts.update(zip(rows.tolist(), written, strict=True))
    return [texts[row] for row in range(len(tool_path.passes))]


def _refined(
    write: Callable[[Sequence[Pass], float, Array, Digits, int], list[PassText]],
    passes: Sequence[Pass],
    drop_z_mm: float,
    budgets_mm: Array,
    fine: Digits,
    most: int,
) -> list[PassText]:
    """Every pass written; where the digits of its ends alone cost more than its budget, with more of them."""
    texts = write(passes, drop_z_mm, budgets_mm, fine, most)
    for finer in range(1, _REFININGS + 1):
        is_over = np.array([text.rounding_mm for text in texts]) > budgets_mm
        rows = np.flatnonzero(is_over & (fine + finer <= most)).tolist()
        again = write([passes[row] for row in rows], drop_z_mm, budgets_mm[rows], fine[rows] + finer, most)
        for row, text in zip(rows, again, strict=True):
            texts[row] = min(texts[row], text, key=lambda one: one.rounding_mm)
    return texts


def _bsplines(
    tool_path: ToolPath, drop_z_mm: float, budgets_mm: Array, fine: Digits, most: int, control: ControlLimits
) -> list[PassText]:
    return bspline_passes(
        tool_path.passes,
        drop_z_mm,
        budgets_mm,
        fine,
        most,
        knot_rule=control.knot_rule,
        min_blocks=control.min_spline_blocks,
    )


def most_decimals(control: ControlLimits) -> int:
    """The most decimals of a written coordinate."""
    return _FINEST_DECIMALS if control.decimals is None else min(control.decimals, _FINEST_DECIMALS)


def _size_bytes(texts: Sequence[PassText]) -> int:
    return sum(len(block) + 1 for text in texts for block in text.blocks)
