"""Points of driving planes on the offset surface, one by one and all together: Newton's method in two unknowns.

Each point of a plane (its place w along the plane) belongs to one parameter pair (u, v). EQUATIONS.md, section 3.
Frame: passes run along +x and planes are y = const; w is x, the plane's offset y.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from planner.path.offset import OffsetPoints, OffsetSurface

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CurveSamples:
    """Points of a CL curve: `points` (k, 2) of (w, z), `tangents` (k, 2), `curvatures` (k,), `parameters` (k, 2)."""

    points: Array
    tangents: Array
    curvatures: Array
    parameters: Array

    def with_more(self, before: NDArray[np.intp], more: CurveSamples) -> CurveSamples:
        """These points with others put in before the points of these indices."""
        names = (field.name for field in fields(self))
        return CurveSamples(*(np.insert(getattr(self, name), before, getattr(more, name), axis=0) for name in names))


def solve_on_planes(
    surface: OffsetSurface, offsets_mm: Array, w_mm: Array, guess: Array
) -> tuple[CurveSamples, NDArray[np.bool_]]:
    """The curve points at places w (k,) in the planes at these offsets (k,), from guesses (2, k) of (u, v).

    Returns the samples and, per point, whether Newton's method found it. What whole steps leap over again and again,
    as they may where the surface changes its curvature, half steps get to.
    """
    target = np.stack([w_mm, offsets_mm])
    parameters, found, is_found = locate(surface, target, guess, residual_mm=1e-11, steps=40)
    if not is_found.all():
        parameters, found, is_found = locate(surface, target, guess, residual_mm=1e-11, steps=80, share=0.5)
    return _samples(found, parameters, w_mm), is_found


def locate(
    surface: OffsetSurface, target_xy: Array, guess: Array, *, residual_mm: float, steps: int, share: float = 1.0
) -> tuple[Array, OffsetPoints, NDArray[np.bool_]]:
    """The parameters (2, k) whose ball centres stand at XY `target_xy` (2, k), eq. (6), with the points there.

    Damped by limiting a step to a quarter of the domain; at most `steps` steps, each on the points still open and of
    this `share` of Newton's. The last step, from a residual below sqrt(residual_mm) / 4, is carried into centre and
    normal by their derivatives: what it leaves is of the order of its square.
    """
    (u_low, u_high), (v_low, v_high) = surface.patch.domain
    limit = 0.25 * np.array([[u_high - u_low], [v_high - v_low]])
    parameters = guess.copy()
    found = surface.evaluate(parameters[0], parameters[1])
    near_mm = max(np.sqrt(residual_mm) / 4, residual_mm)
    for _ in range(steps):
        short = target_xy - found.centre[:2]
        is_far = ~(np.abs(short).max(axis=0) <= near_mm)
        if not is_far.any():
            break
        chosen = np.flatnonzero(is_far)
        step = _solve_2x2(found.centre_u[:2, chosen], found.centre_v[:2, chosen], short[:, chosen])
        parameters[:, chosen] += share * np.clip(np.where(np.isfinite(step), step, 0.0), -limit, limit)
        part = surface.evaluate(parameters[0, chosen], parameters[1, chosen])
        found = part if len(chosen) == len(is_far) else _replace(found, part, chosen)
    short = target_xy - found.centre[:2]
    is_found = np.abs(short).max(axis=0, initial=0.0) <= near_mm
    last = np.where(is_found, _solve_2x2(found.centre_u[:2], found.centre_v[:2], short), 0.0)
    centre = found.centre + found.centre_u * last[0] + found.centre_v * last[1]
    normal = found.normal + found.normal_u * last[0] + found.normal_v * last[1]
    return parameters + last, replace(found, centre=centre, normal=normal), is_found


def _samples(found: OffsetPoints, parameters: Array, w_mm: Array) -> CurveSamples:
    """Slope and curvature of the plane curve from the offset surface's normal, eqs. (7) and (8)."""
    length = np.hypot(found.normal[0], found.normal[2])
    cosine, sine = found.normal[2] / length, -found.normal[0] / length
    step_u, step_v = _solve_2x2(found.centre_u[:2], found.centre_v[:2], np.stack([cosine, np.zeros_like(cosine)]))
    turn = step_u * found.normal_u + step_v * found.normal_v
    return CurveSamples(
        points=np.stack([w_mm, found.centre[2]], axis=1),
        tangents=np.stack([cosine, sine], axis=1),
        curvatures=-(turn[0] * cosine + turn[2] * sine) / length,
        parameters=parameters.T.copy(),
    )


def _solve_2x2(column_u: Array, column_v: Array, right: Array) -> Array:
    """Solutions (2, k) of column_u x + column_v y = right, each (2, k); not finite where singular."""
    determinant = column_u[0] * column_v[1] - column_u[1] * column_v[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack(
            [
                (right[0] * column_v[1] - right[1] * column_v[0]) / determinant,
                (column_u[0] * right[1] - column_u[1] * right[0]) / determinant,
            ]
        )


def _replace(found: OffsetPoints, part: OffsetPoints, chosen: NDArray[np.intp]) -> OffsetPoints:
    """The same points with the chosen columns renewed."""
    for name in OffsetPoints.__slots__:
        getattr(found, name)[:, chosen] = getattr(part, name)
    return found
