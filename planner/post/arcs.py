"""Arcs in a vertical plane as CIP blocks: end and a point between, valid in any plane.

G2 and G3 would need G18 or G19, and a SINUMERIK then takes the tool length along Y or X unless a setting datum forbids
it; CIP leaves G17 alone. The point between may lie anywhere on the arc: its coordinate along the pass is taken short.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.gcode.words import decimal_text
from planner.path.model import ArcChain, Array, DrivingPlane, Pass
from planner.path.spans import in_work
from planner.post.digits import Digits, fewest_digits
from planner.post.numbers import rounded_mm, to_units
from planner.post.passtext import AXES, PassText, Point, is_constant

_WINDOW = 0.2  # of an arc's extent along the pass, on both sides of its middle
_OUTSIDE = 1.3  # an affine function given at both ends and the middle of an arc below 180 deg grows no more
_MIDDLES = ("I1=", "J1=", "K1=")


@dataclass(frozen=True, slots=True)
class _Chain:
    """One pass: its arcs, its points (n + 1, 3) and the points between (n, 3) in work coordinates."""

    plane: DrivingPlane
    shape: ArcChain
    points: Array
    between: Array
    drop_z_mm: float

    @property
    def is_square(self) -> bool:
        """Whether the plane is square to X or Y, so that this axis stands still."""
        return bool(is_constant(self.plane).any())

    def in_plane(self, work: Array) -> Array:
        """Written work points as (w, z) of the chain's own frame."""
        return self.plane.to_plane(work + np.array([0.0, 0.0, self.drop_z_mm]))


def arc_passes(
    passes: Sequence[Pass], drop_z_mm: float, budgets_mm: Array, fine: Digits, most_decimals: int
) -> list[PassText]:
    """Every arc chain as CIP and G1 blocks with the fewest digits that keep its path within `budgets_mm`.

    The classes of digits are X and Y of ends, Z of ends, and the points between.
    """
    chains = [_chain_of(one, drop_z_mm) for one in passes]
    if not all(chain.is_square for chain in chains):
        fine = np.minimum(fine + 1, most_decimals)
    least, most = (np.tile(np.minimum(fine + margin, most_decimals)[:, None], 3) for margin in (0, 2))
    ends = fine.tolist()

    def bound_mm(digits: Digits) -> Array:
        rows = zip(chains, digits, ends, strict=True)
        return np.array([_bound_mm(chain, *_written(chain, row, end)) for chain, row, end in rows])

    digits, bounds = fewest_digits(least, most, np.array([1.0, 1.1, 1.2]), bound_mm, budgets_mm)
    return [
        _pass_text(chain, row, end, bound)
        for chain, row, end, bound in zip(chains, digits, ends, bounds.tolist(), strict=True)
    ]


def _chain_of(one: Pass, drop_z_mm: float) -> _Chain:
    shape = one.shape
    assert isinstance(shape, ArcChain)
    work = in_work(one.plane, shape.points, drop_z_mm)
    between = in_work(one.plane, _between(shape, one.plane), drop_z_mm)
    return _Chain(one.plane, shape, work, between, drop_z_mm)


def _between(shape: ArcChain, plane: DrivingPlane) -> Array:
    """A point near the middle of each arc (n, 2), its w short where the plane is square to an axis."""
    start, end, centre = shape.points[:-1], shape.points[1:], shape.centres
    chord = end - start
    arm = start - centre
    radius = np.hypot(arm[:, 0], arm[:, 1])
    across = np.stack([chord[:, 1], -chord[:, 0]], axis=1) * shape.turns[:, None]
    size = np.maximum(np.hypot(across[:, 0], across[:, 1]), 1e-300)[:, None]
    middle = np.where(shape.turns[:, None] == 0, (start + end) / 2.0, centre + across / size * radius[:, None])
    if not is_constant(plane)[:2].any():
        return middle
    width = _WINDOW * np.abs(chord[:, 0])
    scale = 10.0 ** np.ceil(-np.log10(np.maximum(2.0 * width, 1e-9)))
    short = np.rint(middle[:, 0] * scale) / scale
    under = radius**2 - (short - centre[:, 0]) ** 2
    height = centre[:, 1] + np.sign(middle[:, 1] - centre[:, 1]) * np.sqrt(np.maximum(under, 0.0))
    is_flat = (np.abs(chord[:, 0]) > np.abs(chord[:, 1])) & (under > 0.0) & (np.abs(short - middle[:, 0]) <= width)
    return np.where(is_flat[:, None], np.stack([short, height], axis=1), middle)


def _decimals(chain: _Chain, digits: Digits, fine: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    still = is_constant(chain.plane)
    ends = np.tile(np.array([digits[0], digits[0], digits[1]]), (len(chain.points), 1))
    ends[[0, -1]] = fine
    between = np.tile(np.array([digits[2], digits[2], digits[2]]), (len(chain.between), 1))
    ends[:, still] = fine
    between[:, still] = fine
    return ends, between


def _written(chain: _Chain, digits: Digits, fine: int) -> tuple[Array, Array]:
    ends, between = _decimals(chain, digits, fine)
    return rounded_mm(chain.points, ends), rounded_mm(chain.between, between)


def _as_lines(chain: _Chain, points: Array, between: Array, sine: float = 1e-10) -> NDArray[np.bool_]:
    """Which links are written as lines (n,): those that are, and arcs whose written points name no circle.

    Rounded to few digits the point between may lie in line with the ends, on one of them, or beyond: a control takes
    that for an error, or goes the other way round.
    """
    chord, arm = np.diff(points, axis=0), between - points[:-1]
    square, share = (chord**2).sum(axis=1), (arm * chord).sum(axis=1)
    aside = np.linalg.norm(np.cross(chord, arm), axis=1)
    is_between = (share > 0) & (share < square)
    is_flat = aside <= sine * np.sqrt(square) * np.linalg.norm(arm, axis=1)
    return np.asarray((chain.shape.turns == 0) | is_flat | ~is_between)


def _bound_mm(chain: _Chain, points: Array, between: Array) -> float:
    """Upper bound of the distance between the written arcs and the exact ones, mm, both ways.

    The written circle goes through three rounded points. Its distance from the exact circle is largest at its ends or
    where both centres and the point are in line; that of a line written for an arc at its ends or half-way. Where a
    joint slid along, its slide times the sine of the corner's angle, and the bend over the slide, are added; so is what
    leaves the plane.
    """
    shape = chain.shape
    ends, middle = chain.in_plane(points), chain.in_plane(between)
    start, end = ends[:-1], ends[1:]
    is_line, as_line = shape.turns == 0, _as_lines(chain, points, between)
    bulge = np.stack([start[:, 1] - end[:, 1], end[:, 0] - start[:, 0]], axis=1)
    middle = np.where(as_line[:, None], (start + end + bulge) / 2.0, middle)
    centre, radius = _circle(start, middle, end)
    exact_radius = np.hypot(*(shape.points[:-1] - shape.centres).T)
    radial = np.zeros(len(start))
    off = centre - shape.centres
    for point in (
        start,
        end,
        middle,
        *(_in_line(centre, radius, off, start, end, middle, side) for side in (1.0, -1.0)),
    ):
        radial = np.maximum(radial, np.abs(np.hypot(*(point - shape.centres).T) - exact_radius))
    straight = (start, end, (start + end) / 2.0)
    sag = np.max([np.abs(np.hypot(*(point - shape.centres).T) - exact_radius) for point in straight], axis=0)
    radial = np.where(as_line, sag, radial)
    chord = shape.points[1:] - shape.points[:-1]
    unit = chord / np.maximum(np.hypot(chord[:, 0], chord[:, 1]), 1e-300)[:, None]
    flat = np.maximum(_across(start - shape.points[:-1], unit), _across(end - shape.points[1:], unit))
    error = np.where(is_line, flat, radial)
    slide = np.hypot(*(ends - shape.points).T)
    bend = np.where(is_line, 0.0, 1.0 / np.maximum(exact_radius, 1e-9))
    corner = _corner_sines(shape, unit)
    at_joint = slide[1:-1] * corner + slide[1:-1] ** 2 * np.maximum(bend[:-1], bend[1:])
    outside = np.abs((np.concatenate([points - chain.points, between - chain.between])) @ chain.plane.normal).max()
    worst = max(float(error.max()) + float(at_joint.max(initial=0.0)), float(slide[[0, -1]].max()))
    return float(np.hypot(worst, (1.0 if chain.is_square else _OUTSIDE) * outside))


def _circle(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Centres (n, 2) and radii (n,) of the circles through three points each."""
    u, v = b - a, c - a
    cross = 2.0 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    safe = np.where(np.abs(cross) < 1e-300, 1e-300, cross)[:, None]
    u2, v2 = (u**2).sum(axis=1)[:, None], (v**2).sum(axis=1)[:, None]
    arm = (u2 * np.stack([v[:, 1], -v[:, 0]], axis=1) - v2 * np.stack([u[:, 1], -u[:, 0]], axis=1)) / safe
    return a + arm, np.hypot(arm[:, 0], arm[:, 1])


def _in_line(centre: Array, radius: Array, off: Array, start: Array, end: Array, middle: Array, side: float) -> Array:
    """The point of each written circle in line with both centres, or its start where that is not on the arc."""
    size = np.maximum(np.hypot(off[:, 0], off[:, 1]), 1e-300)[:, None]
    point = centre + side * radius[:, None] * off / size
    chord = end - start
    of_point = chord[:, 0] * (point - start)[:, 1] - chord[:, 1] * (point - start)[:, 0]
    of_middle = chord[:, 0] * (middle - start)[:, 1] - chord[:, 1] * (middle - start)[:, 0]
    return np.where((of_point * of_middle > 0.0)[:, None], point, start)


def _across(offset: Array, unit: Array) -> Array:
    return np.abs(offset[:, 0] * unit[:, 1] - offset[:, 1] * unit[:, 0])


def _corner_sines(shape: ArcChain, unit: Array) -> Array:
    """Sine of the angle between the tangents at every inner joint, (n - 1,)."""

    def tangent(at: Array) -> Array:
        arm = at - shape.centres
        size = np.maximum(np.hypot(arm[:, 0], arm[:, 1]), 1e-300)[:, None]
        turned = np.stack([-arm[:, 1], arm[:, 0]], axis=1) / size * shape.turns[:, None]
        return np.where(shape.turns[:, None] == 0, unit, turned)

    leaving, arriving = tangent(shape.points[:-1])[1:], tangent(shape.points[1:])[:-1]
    return np.abs(leaving[:, 0] * arriving[:, 1] - leaving[:, 1] * arriving[:, 0])


def _pass_text(chain: _Chain, digits: Digits, fine: int, bound_mm: float) -> PassText:
    end_decimals, between_decimals = _decimals(chain, digits, fine)
    ends = _texts(chain.points, end_decimals)
    between = _texts(chain.between, between_decimals)
    still = is_constant(chain.plane)
    as_line = _as_lines(chain, *_written(chain, digits, fine)).tolist()
    blocks, code = [], "G1"
    for number, is_line in enumerate(as_line):
        if is_line and ends[number + 1] == ends[number]:
            continue
        words = "".join(AXES[axis] + ends[number + 1][axis] for axis in range(3) if not still[axis])
        wanted = "G1" if is_line else "CIP"
        if not is_line:
            words += "".join(_MIDDLES[axis] + between[number][axis] for axis in range(3) if not still[axis])
        blocks.append(words if wanted == code else f"{wanted}{words}" if is_line else f"{wanted} {words}")
        code = wanted
    return PassText(Point.of(chain.points[0], fine), Point.of(chain.points[-1], fine), tuple(blocks), bound_mm)


def _texts(points: Array, decimals: NDArray[np.int64]) -> list[list[str]]:
    return [
        [decimal_text(unit, place) for unit, place in zip(row, places, strict=True)]
        for row, places in zip(to_units(points, decimals).tolist(), decimals.tolist(), strict=True)
    ]
