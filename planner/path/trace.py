"""Exact CL curves: the offset surface cut by driving planes, all planes solved together.

A ball-end mill comes from above, so the offset surface is a height over the XY plane wherever the tool can be: each
point of a plane (its place w along the plane) belongs to one parameter pair (u, v), found by Newton's method on two
equations. Marching point by point is not needed. Derivation: EQUATIONS.md, section 3.

Frame: the surface is turned so that passes run along +x and planes are y = const; w is x, the plane's offset y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from planner.errors import InputRejected
from planner.path.arc_length import lengths_between, quintic, wide_gaps
from planner.path.model import DrivingPlane
from planner.path.offset import OffsetPoints, OffsetSurface
from planner.path.seeds import Seeds

Array = NDArray[np.float64]

PATIENCE = 4  # halvings before a gap that stays wide is looked into


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


@dataclass(frozen=True, slots=True)
class TracedCurve:
    """One branch of offset surface and driving plane, running in +w, at nodes dense enough to start Newton anywhere.

    `arc_mm` (m,) from 0; `points` (m, 2) exact (w, z), mm; `tangents` (m, 2) unit; `curvatures` (m,) signed
    d(angle)/ds, 1/mm; `parameters` (m, 2) of (u, v); `surface` is the offset surface it lies on, in the passes' frame.
    """

    plane: DrivingPlane
    arc_mm: Array
    points: Array
    tangents: Array
    curvatures: Array
    parameters: Array
    surface: OffsetSurface

    @property
    def length_mm(self) -> float:
        """The length of the curve."""
        return float(self.arc_mm[-1])

    def refine(self, arc_mm: Array) -> CurveSamples:
        """The exact curve at any arc lengths (k,) within [0, length_mm]."""
        return refine_many([self], [arc_mm])[0]

    def halved(self) -> TracedCurve:
        """The same curve with one more node in the middle of every gap."""
        middle, before = (self.arc_mm[1:] + self.arc_mm[:-1]) / 2, np.arange(1, len(self.arc_mm))
        nodes = CurveSamples(self.points, self.tangents, self.curvatures, self.parameters)
        nodes = nodes.with_more(before, self.refine(middle))
        arc_mm = np.insert(self.arc_mm, before, middle)
        columns = (nodes.points, nodes.tangents, nodes.curvatures, nodes.parameters)
        return TracedCurve(self.plane, arc_mm, *columns, self.surface)


def refine_many(curves: Sequence[TracedCurve], arcs_mm: Sequence[Array]) -> list[CurveSamples]:
    """The exact curves at these arc lengths, one array a curve, all solved in the same blocks.

    All curves must lie on one surface. An arc length between nodes is known to about 1e-4 of their distance; the
    points themselves are on plane and offset surface to rounding.
    """
    starts = [_between_nodes(curve, arc) for curve, arc in zip(curves, arcs_mm, strict=True)]
    w_mm = np.concatenate([start[0] for start in starts])
    guess = np.concatenate([start[1] for start in starts], axis=1)
    counts = [len(arc) for arc in arcs_mm]
    owner = np.repeat(np.arange(len(curves)), counts)
    offsets = np.array([curve.plane.offset_mm for curve in curves])[owner]
    samples = solve_on_planes(curves[0].surface, offsets, w_mm, guess)[0]
    cuts = np.cumsum(counts)[:-1]
    fields = (samples.points, samples.tangents, samples.curvatures, samples.parameters)
    return [CurveSamples(*parts) for parts in zip(*(np.split(field, cuts) for field in fields), strict=True)]


def trace(
    surface: OffsetSurface,
    seeds: Seeds,
    planes: Sequence[DrivingPlane],
    w_mm: Array,
    *,
    spacing_mm: float,
    accuracy_mm: float,
    rounds: int = 12,
) -> list[TracedCurve]:
    """One curve a plane, from w_mm[k, 0] to w_mm[k, 1], with nodes at most `spacing_mm` apart and at least 9.

    Gaps are halved until the curve is read between nodes within `accuracy_mm`, (11), at most `rounds` times.
    Raises InputRejected, naming patch and place, where the extended surface does not reach that far or bends too
    sharply.
    """
    counts = np.maximum(np.ceil((w_mm[:, 1] - w_mm[:, 0]) / spacing_mm), 8).astype(np.intp) + 1
    owner = np.repeat(np.arange(len(planes)), counts)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    place = w_mm[owner, 0] + rank / (counts[owner] - 1) * (w_mm[owner, 1] - w_mm[owner, 0])
    offsets = np.array([plane.offset_mm for plane in planes])
    nodes = _solve_all(surface, offsets[owner], place, seeds.near(np.stack([place, offsets[owner]])))
    for turn in range(rounds):
        is_wide = wide_gaps(owner, nodes.points, nodes.tangents, nodes.curvatures, accuracy_mm=accuracy_mm)
        wide = np.flatnonzero(is_wide)
        if not len(wide):
            break
        if turn >= PATIENCE:
            _call_back(surface, owner, offsets, nodes, wide)
        middle = (nodes.points[wide, 0] + nodes.points[wide + 1, 0]) / 2
        guess = (nodes.parameters[wide] + nodes.parameters[wide + 1]).T / 2
        more = _solve_all(surface, offsets[owner[wide]], middle, guess)
        nodes = nodes.with_more(wide + 1, more)
        owner = np.insert(owner, wide + 1, owner[wide])
    else:
        where = f"{nodes.points[wide[0], 0]:.3f} mm along the pass at {offsets[owner[wide[0]]]:.3f} mm"
        what = f"{surface.patch.name} bends too sharply for path_mm ({where})"
        raise InputRejected(what, remedy="give a larger path_mm or a surface without that edge")
    cuts = np.searchsorted(owner, np.arange(1, len(planes)))
    columns = (nodes.points, nodes.tangents, nodes.curvatures, nodes.parameters)
    parts = zip(*(np.split(field, cuts) for field in columns), strict=True)
    return [
        TracedCurve(plane, _arc_lengths(points, tangents, bends), points, tangents, bends, parameters, surface)
        for plane, (points, tangents, bends, parameters) in zip(planes, parts, strict=True)
    ]


def _call_back(
    surface: OffsetSurface, owner: NDArray[np.intp], offsets_mm: Array, nodes: CurveSamples, wide: NDArray[np.intp]
) -> None:
    """Bring nodes (m,) that Newton found on another fold of the extended surface back to the curve, in place.

    A gap that stays wide however it is halved jumps from fold to fold. Of its two ends the one further from the part
    is at fault, and is solved anew from where the curve goes on from the other.
    """
    low, high = np.array(surface.patch.domain).T
    outside = np.maximum(np.maximum(low - nodes.parameters, nodes.parameters - high), 0.0) / (high - low)
    far = outside.max(axis=1)
    starts = np.flatnonzero(np.append(True, owner[1:] != owner[:-1]))
    # What is on the part, or nearest to it where a whole curve runs outside, is where it should be.
    is_held = far <= np.repeat(np.minimum.reduceat(far, starts), np.diff(np.append(starts, len(owner))))
    held = np.flatnonzero(is_held)
    to_behind = _distance(owner, wide, held[np.searchsorted(held, wide, side="right") - 1])
    to_ahead = _distance(owner, wide + 1, held[np.minimum(np.searchsorted(held, wide + 1), len(held) - 1)])
    is_first = to_behind > to_ahead
    bad, good = np.where(is_first, wide, wide + 1), np.where(is_first, wide + 1, wide)
    rest = np.clip(2 * good - bad, 0, len(owner) - 1)
    is_known = (owner[bad] == owner[good]) & (owner[rest] == owner[good]) & (to_behind != to_ahead)
    bad, good, rest = bad[is_known], good[is_known], rest[is_known]
    w_mm = nodes.points[:, 0]
    share = ((w_mm[bad] - w_mm[good]) / (w_mm[good] - w_mm[rest]))[:, None]
    guess = nodes.parameters[good] + share * (nodes.parameters[good] - nodes.parameters[rest])
    found, is_found = solve_on_planes(surface, offsets_mm[owner[bad]], w_mm[bad], guess.T.copy())
    for field in fields(nodes):
        getattr(nodes, field.name)[bad[is_found]] = getattr(found, field.name)[is_found]


def _distance(owner: NDArray[np.intp], from_: NDArray[np.intp], to: NDArray[np.intp]) -> NDArray[np.intp]:
    """How many nodes lie between, more than there are where both are not of one curve."""
    return np.where(owner[from_] == owner[to], np.abs(from_ - to), len(owner))


def _solve_all(surface: OffsetSurface, offsets_mm: Array, w_mm: Array, guess: Array) -> CurveSamples:
    """`solve_on_planes`, every point found; raises InputRejected with the first that is not."""
    samples, is_found = solve_on_planes(surface, offsets_mm, w_mm, guess)
    if not is_found.all():
        lost = int(np.argmin(is_found))
        where = f"{w_mm[lost]:.3f} mm along the pass at {offsets_mm[lost]:.3f} mm"
        what = f"{surface.patch.name} cannot be carried on far enough to cut its border ({where})"
        raise InputRejected(what, remedy="give the patch a smoother border or another angle_deg")
    return samples


def _arc_lengths(points: Array, tangents: Array, curvatures: Array) -> Array:
    """Arc length (m,) at the nodes from the first, (9)."""
    ends = (tangents[:-1], tangents[1:]), (curvatures[:-1], curvatures[1:])
    return np.append(0.0, np.cumsum(lengths_between(np.diff(points[:, 0]), *ends)))


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


def _between_nodes(curve: TracedCurve, arc_mm: Array) -> tuple[Array, Array]:
    """Guesses of w (k,) and (u, v) (2, k) at arc lengths, from the nodes on either side."""
    after = np.clip(np.searchsorted(curve.arc_mm, arc_mm), 1, len(curve.arc_mm) - 1)
    left, right = after - 1, after
    span = curve.arc_mm[right] - curve.arc_mm[left]
    share = np.clip((arc_mm - curve.arc_mm[left]) / span, 0.0, 1.0)
    w_mm = quintic(
        share,
        span,
        [curve.points[left, 0], curve.tangents[left, 0], -curve.tangents[left, 1] * curve.curvatures[left]],
        [curve.points[right, 0], curve.tangents[right, 0], -curve.tangents[right, 1] * curve.curvatures[right]],
    )
    share_w = (w_mm - curve.points[left, 0]) / (curve.points[right, 0] - curve.points[left, 0])
    guess = curve.parameters[left] + share_w[:, None] * (curve.parameters[right] - curve.parameters[left])
    return w_mm, guess.T.copy()


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
