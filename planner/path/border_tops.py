"""Greatest heights along the border that stand between its samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner.path.border import Border
from planner.path.offset import OffsetSurface
from planner.path.scallop import Held, Reaches, solve_reaches

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

EXACT_MM = 1e-9  # what a maximum that is looked for further would gain


def tops_between(
    surface: OffsetSurface,
    border: Border,
    stretch: Indices,
    planes_mm: Array,
    known: tuple[Array, Reaches],
    least_mm: Array,
    rounds: int = 4,
) -> tuple[Border, Reaches]:
    """Maxima of what the passes in `planes_mm` (k,) leave inside stretches (k,) of the border: places and heights.

    `known` are the heights (m,) at all samples, with their changes. Those stretches are followed whose ends promise
    `least_mm` (k,) or more: which of them is highest no sample tells.
    """
    levels, reaches = known
    axis = np.where(border.held[stretch] == Held.V.value, 0, 1)
    ends = np.stack([stretch, border.after(stretch)])
    ends = np.take_along_axis(ends, np.argsort(border.parameters[axis, ends], axis=0), axis=0)
    slopes = reaches.along[axis, ends]
    line = np.stack([border.parameters[axis, ends], levels[ends], slopes])
    top, place = hermite_top(*(value for pair in line for value in pair))
    follow = np.flatnonzero((slopes[0] > 0) & (slopes[1] < 0) & (top >= least_mm))
    axis, line, place, planes_mm = axis[follow], line[..., follow], place[follow], planes_mm[follow]
    held, value, near = border.held[stretch[follow]], border.value[stretch[follow]], reaches.on_pass[:, ends[0, follow]]
    for _ in range(rounds):
        parameters = np.where(axis == np.array([[0], [1]]), place, value)
        under = surface.evaluate(parameters[0], parameters[1])
        found = solve_reaches(surface, under, planes_mm, near)
        near = np.where(found.is_found, found.on_pass, near)
        slope = found.along[axis, np.arange(len(axis))]
        here = np.stack([place, found.height_mm, slope])
        # What is not found stays as it is.
        line[:, 0] = np.where(found.is_found & (slope > 0), here, line[:, 0])
        line[:, 1] = np.where(found.is_found & (slope <= 0), here, line[:, 1])
        top, place = hermite_top(*(value for pair in line for value in pair))
        if (np.abs(top - found.height_mm) <= EXACT_MM).all():
            break
    return Border(parameters, held, value, under), found


def hermite_top(
    x_low: Array, x_high: Array, h_low: Array, h_high: Array, slope_low: Array, slope_high: Array
) -> tuple[Array, Array]:
    """The maximum of the cubic through two points with a rising slope first and a falling one after, eq. (14)."""
    run = np.maximum(x_high - x_low, 1e-12)
    rise = (h_high - h_low) / run
    bend = 3 * (slope_low + slope_high - 2 * rise)
    mid = 3 * rise - 2 * slope_low - slope_high
    root = np.sqrt(np.maximum(mid**2 - bend * slope_low, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(slope_low / (root - mid), nan=0.5)
    share = np.clip(share, 0.0, 1.0)
    height = h_low + run * share * (slope_low + share * (mid + share * bend / 3))
    return height, x_low + share * run
