"""Scallops: the height left between two passes, exactly, for many places in one block.

Frame: passes run along +x, pass A lies in the plane y = a, pass B in y = b; +Z is the tool axis. A cusp is the point
Q(u, v) + h N(u, v) at distance R from both CL curves: the line of cusps is the intersection of the two pipes that the
ball sweeps (eqs. 3.10-3.12 of the thesis), and h its height over the surface. Derivation: EQUATIONS.md, section 4.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from planner.path.offset import OffsetPoints, OffsetSurface, cross_product, dot
from planner.surface.patch import BLOCK

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Held(Enum):
    """What stays fixed while a cusp is solved; the value is the code used in arrays."""

    PLACE = 0  # the x of the ball centre over the cusp's foot
    U = 1
    V = 2


@dataclass(frozen=True, slots=True)
class Cusps:
    """Solved cusps: every array ends in m.

    `foot` (2, m) is (u, v) of the surface point below the cusp, `height_mm` (m,) its height along N; `on_a`, `on_b`
    (2, m) the parameters of the balls that touch it, `x_a`, `x_b` (m,) where they stand; `x` (m,) the place of the
    centre over the foot. `slope` is d height / d held value, `by_a`, `by_b` d height / d plane offset.
    """

    foot: Array
    height_mm: Array
    on_a: Array
    on_b: Array
    x: Array
    x_a: Array
    x_b: Array
    slope: Array
    by_a: Array
    by_b: Array
    is_found: Flags

    def take(self, chosen: NDArray[np.intp] | Flags) -> Cusps:
        """The chosen cusps only."""
        return Cusps(*(getattr(self, field.name)[..., chosen] for field in fields(self)))


@dataclass(frozen=True, slots=True)
class Reaches:
    """Heights left by one pass over given surface points: `height_mm` (m,), the ball's `x` (m,) and parameters.

    `by_plane` is d height / d plane offset; `along` (2, m) d height / d (u, v) of the surface point.
    """

    height_mm: Array
    on_pass: Array
    x: Array
    by_plane: Array
    along: Array
    is_found: Flags

    def take(self, chosen: slice) -> Reaches:
        """The chosen heights only."""
        return Reaches(*(getattr(self, field.name)[..., chosen] for field in fields(self)))

    def replaced(self, chosen: NDArray[np.intp], other: Reaches) -> Reaches:
        """These heights with the chosen ones renewed."""
        renewed = {}
        for field in fields(self):
            renewed[field.name] = getattr(self, field.name).copy()
            renewed[field.name][..., chosen] = getattr(other, field.name)
        return Reaches(**renewed)


@dataclass(frozen=True, slots=True)
class CuspGuess:
    """Where Newton starts: the same quantities as in Cusps."""

    foot: Array
    height_mm: Array
    on_a: Array
    on_b: Array


@dataclass(frozen=True, slots=True)
class _Contact:
    """A ball of one pass seen from a point: the foot improved by one Newton step, and the distance after it."""

    step: Array
    toward: Array
    distance_mm: Array
    plane_error_mm: Array
    foot_error_mm: Array
    lift: Array
    x: Array


# A guess that runs away overflows on its way out; it ends as not found.
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def solve_cusps(
    surface: OffsetSurface,
    planes_mm: tuple[Array, Array],
    held: NDArray[np.intp],
    value: Array,
    guess: CuspGuess,
    *,
    residual_mm: float = 1e-10,
    steps: int = 16,
) -> Cusps:
    """Cusps (m,) between planes y = a and y = b, one unknown held: eq. (12), Newton on (u, v, h) and two feet.

    `held` codes (Held) say what keeps `value`: the place x, or the parameter u or v on a border. At most `steps`
    steps. The step taken when all residuals are below sqrt(residual_mm R) is the last, as the next residual is of the
    order of the square; `is_found` says which cusps came that far.
    """
    blocks = [slice(at, at + BLOCK) for at in range(0, max(len(value), 1), BLOCK)]
    parts = [
        _solve_block(
            surface,
            (planes_mm[0][block], planes_mm[1][block]),
            held[block],
            value[block],
            CuspGuess(*(getattr(guess, field.name)[..., block] for field in fields(CuspGuess))),
            residual_mm=residual_mm,
            steps=steps,
        )
        for block in blocks
    ]
    return Cusps(*(np.concatenate([getattr(part, f.name) for part in parts], axis=-1) for f in fields(Cusps)))


def _solve_block(
    surface: OffsetSurface,
    planes_mm: tuple[Array, Array],
    held: NDArray[np.intp],
    value: Array,
    guess: CuspGuess,
    *,
    residual_mm: float,
    steps: int,
) -> Cusps:
    """`solve_cusps` for as many cusps as stay in the processor's cache."""
    count, slack = len(value), np.sqrt(residual_mm * surface.radius_mm)
    foot, height = guess.foot.copy(), guess.height_mm.copy()
    on_a, on_b = guess.on_a.copy(), guess.on_b.copy()
    for _ in range(steps + 1):
        both = surface.evaluate(*(np.concatenate([p[i] for p in (foot, on_a, on_b)]) for i in (0, 1)))
        under, at_a, at_b = (both.take(slice(i * count, (i + 1) * count)) for i in range(3))
        cusp = under.contact + height * under.normal
        touch_a, touch_b = _touch(at_a, cusp, planes_mm[0]), _touch(at_b, cusp, planes_mm[1])
        row, short = _held_row(under, foot, held, value)
        right = np.stack([surface.reach_mm - touch_a.distance_mm, surface.reach_mm - touch_b.distance_mm, short])
        worst = np.max(
            np.abs(np.concatenate([right, [touch_a.plane_error_mm, touch_b.plane_error_mm]])), axis=0, initial=0.0
        )
        is_found = (worst <= slack) & (np.maximum(touch_a.foot_error_mm, touch_b.foot_error_mm) <= 50 * slack)
        moves = _moves(under, height)
        inverse = _inverse([_row(touch_a.toward, moves), _row(touch_b.toward, moves), row])
        change = sum(inverse[:, i] * right[i] for i in range(3))
        move = under.contact_u * change[0] + under.contact_v * change[1]
        damp = np.minimum(1.0, 0.5 * surface.radius_mm / np.maximum(np.sqrt(dot(move, move)), 1e-300))
        change = _finite(change * damp)
        foot += change[:2]
        height += change[2]
        on_a += touch_a.step
        on_b += touch_b.step
        if is_found.all():
            break
    by_a, by_b = inverse[2, 0] * touch_a.lift, inverse[2, 1] * touch_b.lift
    is_sound = is_found & (height > -surface.radius_mm) & (height < surface.radius_mm)
    return Cusps(foot, height, on_a, on_b, under.centre[0], touch_a.x, touch_b.x, inverse[2, 2], by_a, by_b, is_sound)


# A guess that runs away overflows on its way out; it ends as not found.
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def solve_reaches(
    surface: OffsetSurface,
    under: OffsetPoints,
    planes_mm: Array,
    guess: Array,
    *,
    residual_mm: float = 1e-10,
    steps: int = 12,
) -> Reaches:
    """Heights (m,) over the surface points `under` that the pass in plane y = planes_mm leaves, eq. (13).

    `guess` (2, m) are parameters of balls of that pass near the points. Beyond a fold of the extended patch, where a
    pass would turn back, there is no ball of it.
    """
    on_pass, height = guess.copy(), np.zeros(len(planes_mm))
    for _ in range(steps + 1):
        at = surface.evaluate(on_pass[0], on_pass[1])
        touch = _touch(at, under.contact + height * under.normal, planes_mm)
        facing = dot(touch.toward, under.normal)
        short = surface.reach_mm - touch.distance_mm
        worst = np.maximum(np.abs(short), touch.plane_error_mm)
        slack = np.sqrt(residual_mm * surface.radius_mm)
        is_found = (worst <= slack) & (touch.foot_error_mm <= 50 * slack)
        limit = 0.5 * surface.radius_mm
        height += np.clip(_finite(short / facing), -limit, limit)
        on_pass += touch.step
        if is_found.all():
            break
    slope_u = -dot(touch.toward, under.contact_u + height * under.normal_u) / facing
    slope_v = -dot(touch.toward, under.contact_v + height * under.normal_v) / facing
    by_plane = touch.lift / facing
    turn = at.centre_u[0] * at.centre_v[1] - at.centre_u[1] * at.centre_v[0]
    is_sound = is_found & (facing < 0) & (np.abs(height) < 2 * surface.radius_mm) & (surface.side * turn > 0)
    return Reaches(height, on_pass, touch.x, by_plane, np.stack([slope_u, slope_v]), is_sound)


def _touch(at: OffsetPoints, seen_from: Array, plane_mm: Array) -> _Contact:
    """The ball of a pass nearest to a point: one Newton step on plane and foot, and the distance it leads to."""
    away = seen_from - at.centre
    plane_error = plane_mm - at.centre[1]
    foot_error = away[0] * at.normal[2] - away[2] * at.normal[0]
    foot_u, foot_v = (
        -centre[0] * at.normal[2] + away[0] * normal[2] + centre[2] * at.normal[0] - away[2] * normal[0]
        for centre, normal in ((at.centre_u, at.normal_u), (at.centre_v, at.normal_v))
    )
    determinant = at.centre_u[1] * foot_v - at.centre_v[1] * foot_u
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.stack(
            [
                (plane_error * foot_v + foot_error * at.centre_v[1]) / determinant,
                (-foot_error * at.centre_u[1] - plane_error * foot_u) / determinant,
            ]
        )
    step = _finite(step)
    away = away - at.centre_u * step[0] - at.centre_v * step[1]
    distance = np.sqrt(dot(away, away))
    toward = away / np.maximum(distance, 1e-300)
    lift = toward[1] - toward[2] * at.normal[1] / at.normal[2]
    x = at.centre[0] + at.centre_u[0] * step[0] + at.centre_v[0] * step[1]
    return _Contact(step, toward, distance, np.abs(plane_error), np.abs(foot_error), lift, x)


def _held_row(under: OffsetPoints, foot: Array, held: NDArray[np.intp], value: Array) -> tuple[Array, Array]:
    """The third equation: its row (3, m) over (u, v, h) and how much is missing (m,)."""
    is_place, is_u = held == Held.PLACE.value, held == Held.U.value
    row = np.stack(
        [
            np.where(is_place, under.centre_u[0], is_u),
            np.where(is_place, under.centre_v[0], held == Held.V.value),
            np.zeros(len(value)),
        ]
    )
    now = np.where(is_place, under.centre[0], np.where(is_u, foot[0], foot[1]))
    return row, value - now


def _moves(under: OffsetPoints, height: Array) -> tuple[Array, Array, Array]:
    """How the cusp moves with (u, v, h), (3, m) each."""
    return under.contact_u + height * under.normal_u, under.contact_v + height * under.normal_v, under.normal


def _row(toward: Array, moves: tuple[Array, Array, Array]) -> Array:
    """How the distance to a pass grows with (u, v, h) of the cusp: (3, m)."""
    return np.stack([dot(toward, move) for move in moves])


def _inverse(rows: list[Array]) -> Array:
    """Inverses (3, 3, m) of the matrices with these rows (3, m), by Cramer's rule."""
    columns = [cross_product(rows[1], rows[2]), cross_product(rows[2], rows[0]), cross_product(rows[0], rows[1])]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack(columns, axis=1) / dot(rows[0], columns[0])


def _finite(values: Array) -> Array:
    """The values, 0 where they are not finite (a step that cannot be computed is not taken)."""
    return np.where(np.isfinite(values), values, 0.0)
