"""Exact CL curves: the offset surface cut by driving planes, all planes solved together.

A ball-end mill comes from above, so the offset surface is a height over the XY plane wherever the tool can be: each
point of a plane (its place w along the plane) belongs to one parameter pair (u, v), found by Newton's method on two
equations. Marching point by point is not needed. Derivation: EQUATIONS.md, section 3.

Frame: the surface is turned so that passes run along +x and planes are y = const; w is x, the plane's offset y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.errors import InputRejected
from planner.path.arc_length import lengths_between, quintic, wide_gaps
from planner.path.folds import call_back, keep_sheet, walk_out
from planner.path.model import DrivingPlane
from planner.path.newton import CurveSamples, solve_on_planes
from planner.path.offset import OffsetSurface
from planner.path.seeds import Seeds

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

REMEDY = "carry the surface on past that border, or give a smaller tool, pick feed or scallop, or another angle_deg"
OTHER_PART = 100.0  # of a gap's length: further off its middle lies the middle of parameters that are no neighbours
SEAM = 0.5  # of the domain: parameters further apart than that are no neighbours, but for a closed patch
PATIENCE = 4  # halvings before a gap that stays wide is looked into


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
    ends: tuple[Array, Array] | None = None,
) -> list[TracedCurve]:
    """One curve a plane, from w_mm[k, 0] to w_mm[k, 1], with nodes at most `spacing_mm` apart and at least 9.

    Gaps are halved until the curve is read between nodes within `accuracy_mm`, (11), at most `rounds` times. `ends`,
    places (k, 2) on the curves and the parameters (2, k, 2) there, say on which sheet of the extended patch they run.
    Raises InputRejected, naming patch and place, where the extended surface does not reach that far or bends too
    sharply.
    """
    owner, place = _first_places(w_mm, spacing_mm)
    offsets = np.array([plane.offset_mm for plane in planes])
    start = seeds.near(np.stack([place, offsets[owner]]))
    nodes, is_found = solve_on_planes(surface, offsets[owner], place, start)
    _find_lost(surface, owner, offsets, nodes, is_found)
    if ends is not None:
        keep_sheet(surface, owner, offsets, nodes, ends)
    for turn in range(rounds + 1):
        is_wide = wide_gaps(owner, nodes.points, nodes.tangents, nodes.curvatures, accuracy_mm=accuracy_mm)
        wide = np.flatnonzero(is_wide)
        if not len(wide):
            break
        if turn == rounds:
            raise _never_read(surface, nodes, wide, offsets[owner[wide]])
        if turn == 2 * PATIENCE:
            _find_lost(surface, owner, offsets, nodes, ~np.isin(np.arange(len(owner)), np.append(wide, wide + 1)))
        elif turn >= PATIENCE:
            call_back(surface, owner, offsets, nodes, wide)
        middle = (nodes.points[wide, 0] + nodes.points[wide + 1, 0]) / 2
        guess = _parameters_between(
            surface, nodes.parameters[wide], nodes.parameters[wide + 1], np.full(len(wide), 0.5)
        )
        more, is_more = solve_on_planes(surface, offsets[owner[wide]], middle, guess)
        is_found = np.insert(np.ones(len(owner), dtype=bool), wide + 1, is_more)
        nodes = nodes.with_more(wide + 1, more)
        owner = np.insert(owner, wide + 1, owner[wide])
        _find_lost(surface, owner, offsets, nodes, is_found)
    return _curves(surface, planes, owner, nodes)


def _first_places(w_mm: Array, spacing_mm: float) -> tuple[Indices, Array]:
    """Of every curve's first nodes, evenly spread over w_mm[k]: the curve's row, and the place along it, mm."""
    counts = np.maximum(np.ceil((w_mm[:, 1] - w_mm[:, 0]) / spacing_mm), 8).astype(np.intp) + 1
    owner = np.repeat(np.arange(len(w_mm)), counts)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    return owner, w_mm[owner, 0] + rank / (counts[owner] - 1) * (w_mm[owner, 1] - w_mm[owner, 0])


def _curves(
    surface: OffsetSurface, planes: Sequence[DrivingPlane], owner: Indices, nodes: CurveSamples
) -> list[TracedCurve]:
    """The curves that own these nodes, one a plane."""
    cuts = np.searchsorted(owner, np.arange(1, len(planes)))
    columns = (nodes.points, nodes.tangents, nodes.curvatures, nodes.parameters)
    parts = zip(*(np.split(field, cuts) for field in columns), strict=True)
    return [
        TracedCurve(plane, _arc_lengths(points, tangents, bends), points, tangents, bends, parameters, surface)
        for plane, (points, tangents, bends, parameters) in zip(planes, parts, strict=True)
    ]


def _never_read(surface: OffsetSurface, nodes: CurveSamples, wide: Indices, offsets_mm: Array) -> InputRejected:
    """What to say of gaps (k,) that stay wide however often they are halved, between each node and the next.

    `offsets_mm` (k,) are those of their planes. Of a jump the gaps beside it are wide too: the one is told between
    whose nodes the parameters lead furthest astray.
    """
    x, x_next = nodes.points[wide, 0], nodes.points[wide + 1, 0]
    u, v = (nodes.parameters[wide] + nodes.parameters[wide + 1]).T / 2
    away = surface.evaluate(u, v).centre[:2] - [(x + x_next) / 2, offsets_mm]
    astray = np.nan_to_num(np.hypot(*away) / (x_next - x), nan=np.inf)
    worst = int(np.argmax(astray))
    where = f"{x[worst]:.3f} mm along the pass at {offsets_mm[worst]:.3f} mm"
    # Between neighbours on one sheet the parameters' middle is near; between two parts it is somewhere else.
    if astray[worst] > OTHER_PART:
        what = f"two parts of {surface.patch.name} lie too near side by side for passes that run past both ({where})"
        remedy = "give a smaller pick feed or scallop, another angle_deg, or cut these parts as patches of their own"
    else:
        what = f"{surface.patch.name} bends too sharply for path_mm ({where})"
        remedy = "give a larger path_mm or a surface without that edge"
    return InputRejected(what, remedy=remedy)


def _find_lost(
    surface: OffsetSurface, owner: Indices, offsets_mm: Array, nodes: CurveSamples, is_found: NDArray[np.bool_]
) -> None:
    """Find lost nodes (m,) in place, outward from the part; raises InputRejected for what stays lost."""
    if is_found.all():
        return
    is_found = walk_out(surface, owner, offsets_mm, nodes, is_found)
    if not is_found.all():
        lost = int(np.argmin(is_found))
        where = f"{nodes.points[lost, 0]:.3f} mm along the pass at {offsets_mm[owner[lost]]:.3f} mm"
        what = f"{surface.patch.name} folds too near its border for passes to run past it ({where})"
        raise InputRejected(what, remedy=REMEDY)


def _arc_lengths(points: Array, tangents: Array, curvatures: Array) -> Array:
    """Arc length (m,) at the nodes from the first, (9)."""
    ends = (tangents[:-1], tangents[1:]), (curvatures[:-1], curvatures[1:])
    return np.append(0.0, np.cumsum(lengths_between(np.diff(points[:, 0]), *ends)))


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
    return w_mm, _parameters_between(curve.surface, curve.parameters[left], curve.parameters[right], share_w)


def _parameters_between(surface: OffsetSurface, left: Array, right: Array, share: Array) -> Array:
    """Guesses (2, k) of the parameters at shares (k,) of the way from nodes `left` (k, 2) to nodes `right`.

    Across the seam of a closed patch the way leads once around: the nearer node's own are taken there.
    """
    is_seam = (np.abs(right - left) > SEAM * np.ptp(surface.patch.domain, axis=1)).any(axis=1)
    share = np.where(is_seam, np.rint(share), share)
    return np.ascontiguousarray((left + share[:, None] * (right - left)).T)
