"""Where a ball cannot go: patches that are singular, face away, are tighter than the ball, or stand in its own way.

Checked over the whole patch before anything is traced, each complaint with patch and (u, v).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from planner.errors import InputRejected
from planner.path.offset import OffsetSurface
from planner.surface.creases import normals_across
from planner.surface.curvature import Survey, least_curvature, lowest, regularity, upwardness
from planner.surface.patch import NurbsPatch

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def tool_side(survey: Survey, *, steepest_deg: float = 85.0, least_area: float = 1e-6) -> int:
    """+1 if Qu x Qv points up over the whole patch, -1 if down.

    Raises InputRejected where the patch is singular (a parameter cell shrinks to `least_area` of the mean one) or
    steeper than `steepest_deg`, where a ball held along +Z cannot follow it.
    """
    name = survey.patch.name
    mean_area = float(np.mean(regularity(survey.points)))
    least = lowest(survey, regularity, rounds=3)
    if not least.value > least_area * mean_area:
        what = f"{name} is singular at {least.place}"
        raise InputRejected(what, remedy="move the control points apart or trim the patch before that place")
    side = 1 if float(np.mean(upwardness(survey.points))) >= 0 else -1
    steepest = lowest(survey, lambda points: side * upwardness(points), rounds=3)
    if steepest.value < np.cos(np.radians(steepest_deg)):
        angle_deg = float(np.degrees(np.arccos(np.clip(steepest.value, -1.0, 1.0))))
        what = f"{name} is {angle_deg:.1f} degrees steep at {steepest.place}"
        raise InputRejected(what, remedy=f"turn the part so that it stays below {steepest_deg:g} degrees")
    return side


def check_creases(patch: NurbsPatch, *, largest_rad: float = 1e-4) -> None:
    """Raises InputRejected where the normal jumps by more than `largest_rad` across a knot that allows it.

    Across a crease the offset surface has a gap or crosses itself, so no pass can be traced over it.
    """
    for axis, knot, before, after in normals_across(patch):
        jump_rad = 2 * float(np.arcsin(np.linalg.norm(after - before, axis=0).max() / 2))
        if jump_rad > largest_rad:
            what = f"{patch.name} has a crease along {'uv'[axis]} = {knot:g}, of {np.degrees(jump_rad):.3g} degrees"
            raise InputRejected(what, remedy="split the patch there and plan both parts")


def check_radius(survey: Survey, side: int, radius_mm: float, stock_mm: float = 0.0) -> None:
    """Raises InputRejected where the patch is concave with a radius at or below the ball's and the stock's together."""
    tightest = lowest(survey, lambda points: least_curvature(points, side), rounds=4)
    if tightest.value * (radius_mm + stock_mm) <= -1.0:
        concave_mm = -1 / tightest.value
        what = f"{survey.patch.name} has a concave radius of {concave_mm:.3f} mm at {tightest.place}"
        if stock_mm > 0 and concave_mm > radius_mm:
            remedy = f"leave less than {concave_mm - radius_mm:.3f} mm of stock, or use a smaller tool"
            raise InputRejected(what, remedy=remedy, key=("operation", 0, "stock_to_leave_mm"))
        remedy = f"the ball's is {radius_mm:g} mm: use a tool of less than {2 * concave_mm:.3f} mm diameter"
        raise InputRejected(what, remedy=remedy)


def check_reach(surface: OffsetSurface, parameters: Array, tolerance_mm: float) -> float:
    """How deep a ball that touches one of these places (2, m), or its shank, cuts into another of them, mm.

    Balls and places are exact, so a depth that is found is real; one between places can be missed by the square of
    their distance over 8 R. Raises InputRejected where the depth exceeds `tolerance_mm`.
    """
    found = surface.evaluate(parameters[0], parameters[1])
    return _check_cuts(surface, (found.centre, parameters), (found.contact, parameters), tolerance_mm)


def check_beyond(surface: OffsetSurface, on_passes: Array, parameters: Array, tolerance_mm: float) -> float:
    """How deep balls `on_passes` (2, k), or their shanks, cut into these places (2, m) from past the border, mm.

    There they touch the patch as it would go on, which may come near another part of it. Raises InputRejected where the
    depth exceeds `tolerance_mm`.
    """
    (u_low, u_high), (v_low, v_high) = surface.patch.domain
    u, v = on_passes
    beyond = on_passes[:, (u < u_low) | (u > u_high) | (v < v_low) | (v > v_high)]
    if not beyond.shape[1]:
        return 0.0
    balls = surface.evaluate(beyond[0], beyond[1]).centre, beyond
    return _check_cuts(
        surface, balls, (surface.evaluate(parameters[0], parameters[1]).contact, parameters), tolerance_mm
    )


def _check_cuts(
    surface: OffsetSurface, balls: tuple[Array, Array], places: tuple[Array, Array], tolerance_mm: float
) -> float:
    """The deepest cut of tools into places, mm; both as points (3, ...) with their parameters (2, ...).

    Raises InputRejected where it exceeds `tolerance_mm`.
    """
    depth_mm, ball, place, is_shank = _deepest_cut(balls[0], places[0], surface.radius_mm)
    if depth_mm > tolerance_mm:
        (u, v), (hit_u, hit_v) = balls[1][:, ball], places[1][:, place]
        what = (
            f"{surface.patch.name}: {'the shank above ' if is_shank else ''}the ball that touches "
            f"(u, v) = ({u:.4g}, {v:.4g}) cuts {depth_mm:.3f} mm into ({hit_u:.4g}, {hit_v:.4g})"
        )
        raise InputRejected(what, remedy="use a smaller tool or cut the parts of the patch as patches of their own")
    return depth_mm


def _deepest_cut(centres: Array, places: Array, radius_mm: float) -> tuple[float, int, int, bool]:
    """Depth, ball, place of the deepest cut, 0 for none, and whether the shank makes it.

    The shank is as thick as the ball and stands upon its centre (3, m): to a place (3, n) higher than that only the
    distance in XY counts.
    """
    deepest, ball, place, is_shank = 0.0, 0, 0, False
    for near, under in _near_pairs(centres[:2], places[:2], radius_mm):
        away = centres[:, near] - places[:, under]
        is_higher = away[2] < 0
        away[2] = np.maximum(away[2], 0.0)
        depth = radius_mm - np.sqrt((away**2).sum(axis=0))
        worst = int(np.argmax(depth))
        if depth[worst] > deepest:
            deepest, ball, place, is_shank = (
                float(depth[worst]),
                int(near[worst]),
                int(under[worst]),
                bool(is_higher[worst]),
            )
    return deepest, ball, place, is_shank


def _near_pairs(balls: Array, places: Array, reach_mm: float, most: int = 400_000) -> Iterator[tuple[Indices, Indices]]:
    """Index pairs of balls (2, m) and places (2, n) that may lie within `reach_mm` in XY, about `most` at a time."""
    low = np.minimum(balls.min(axis=1), places.min(axis=1))[:, None] - reach_mm
    cell_of_place = ((places - low) / reach_mm).astype(np.intp)
    rows = int(cell_of_place[1].max()) + 3
    key = cell_of_place[0] * rows + cell_of_place[1]
    order = np.argsort(key, kind="stable")
    key = key[order]
    cell_of_ball = ((balls - low) / reach_mm).astype(np.intp)
    for column in (-1, 0, 1):
        first_key = (cell_of_ball[0] + column) * rows + cell_of_ball[1]
        first = np.searchsorted(key, first_key - 1, side="left")
        counts = np.searchsorted(key, first_key + 1, side="right") - first
        groups = np.cumsum(counts) // most
        for group in range(int(groups[-1]) + 1):
            chosen = np.flatnonzero(groups == group)
            owner = np.repeat(chosen, counts[chosen])
            if len(owner):
                starts = np.cumsum(counts[chosen]) - counts[chosen]
                rank = np.arange(len(owner)) - np.repeat(starts, counts[chosen])
                yield owner, order[first[owner] + rank]
