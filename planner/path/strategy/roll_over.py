"""Passes carried on over the edge of a patch: longer ones, and more of them beside it, until the ball has rolled over.

A ball on the edge alone stands no higher than one on the patch as it would go on, of which the edge is a part. So the
pick feeds found for passes up to the border hold, and what was measured for them is never exceeded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from planner.errors import InputRejected
from planner.path.border import Border, border_of
from planner.path.coverage import crossings
from planner.path.offset import OffsetSurface, dot
from planner.path.peaks import Peaks
from planner.path.roll import RolledSurface, rolled
from planner.path.runs import joined_runs, runs_inside
from planner.path.trace import TracedCurve

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Rolling:
    """Driving planes `planes_mm`, and what runs in them over `surface`: pieces that meet where the curvature jumps.

    Piece i of pass `owner[i]` runs in plane `plane[i]` from `runs[i, 0]` to `runs[i, 1]` in x. `before` and `behind` of
    the planes stand outside those that passes up to the border need.
    """

    surface: RolledSurface
    planes_mm: Array
    owner: Indices
    plane: Indices
    runs: Array
    before: int
    behind: int

    def covers(self, plane: Indices, runs: Array, slack_mm: float = 1e-6) -> bool:
        """Whether runs [from, to] (k, 2) of those planes that passes up to the border need lie within the passes here.

        Then what was measured for these holds here too: a ball on the edge stands no higher.
        """
        first = np.flatnonzero(np.append(True, self.owner[1:] != self.owner[:-1]))
        whole = np.stack([self.runs[first, 0], np.maximum.reduceat(self.runs[:, 1], first)], axis=1)
        for one in np.unique(plane).tolist():
            here = whole[self.plane[first] == one + self.before]
            low, high = runs[plane == one].T
            at = np.searchsorted(here[:, 0], low + slack_mm) - 1
            if (at < 0).any() or (here[at, 1] < high - slack_mm).any():
                return False
        return True

    def peaks_of(self, within: Peaks) -> Peaks:
        """Bounds on the peaks of all planes, from those measured `within` the border.

        The first gap outside holds the strip that the first pass alone keeps as low as `first_mm`; beyond it nothing
        of the patch is left. The same goes for the last.
        """

        def padded(values: Array) -> Array:
            return np.pad(values, (*[(0, 0)] * (values.ndim - 1), (self.before, self.behind)))

        height_mm = padded(within.height_mm)
        if self.before:
            height_mm[self.before - 1] = within.first_mm
        if self.behind:
            height_mm[-self.behind] = within.last_mm
        return replace(
            within,
            height_mm=height_mm,
            by_a=padded(within.by_a),
            by_b=padded(within.by_b),
            x=padded(within.x),
            foot=padded(within.foot),
            first_mm=0.0 if self.before else within.first_mm,
            last_mm=0.0 if self.behind else within.last_mm,
        )


def roll_over(surface: OffsetSurface, planes_mm: Array, *, out_mm: float, pick_feed_mm: float | None) -> Rolling:
    """The passes in these planes and beyond them until the ball stands about `out_mm` past the edge.

    More planes go on at the fixed `pick_feed_mm`, or evenly and at most `out_mm` apart; the outermost ones pass by
    outside the edge wherever passes do not cross it. Raises InputRejected where the patch climbs to its edge so steeply
    that the ball would have to turn away from it.
    """
    over = rolled(surface, out_mm=out_mm)
    rim = border_of(over, spacing_mm=out_mm / 4, domain=over.rim)
    over = replace(over, facing=_facing(over, rim))
    y = rim.points.centre[1]
    gaps = float(planes_mm[0] - y.min()), float(y.max() - planes_mm[-1])
    if pick_feed_mm is not None:
        before, behind = (pick_feed_mm * np.arange(1.0, gap / pick_feed_mm - 1e-6) for gap in gaps)
    else:
        before, behind = (_even_steps(gap, out_mm) for gap in gaps)
    planes = np.concatenate([planes_mm[0] - before[::-1], planes_mm, planes_mm[-1] + behind])
    crossed = crossings(over, rim, planes)
    join_mm = 2 * float(np.diff(planes).max(initial=out_mm))
    runs = joined_runs(over, planes, runs_inside(*crossed), join_mm=join_mm)
    owner, pieces = _pieces(runs.owner, runs.x, *_kinks(over, planes, out_mm / 4))
    return Rolling(over, planes, owner, runs.owner[owner], pieces, len(before), len(behind))


def _facing(over: RolledSurface, rim: Border, least: float = 0.2) -> float:
    """The least cosine between the patch's normals and those at the rim; raises InputRejected below `least`."""
    low, high = np.array(over.patch.domain).T[:, :, None]
    edge = np.clip(rim.parameters, low, high)
    cosine = dot(over.evaluate(edge[0], edge[1]).normal, rim.points.normal)
    worst = int(np.argmin(cosine))
    if cosine[worst] < least:
        u, v = edge[:, worst]
        what = f"{over.patch.name} climbs too steeply to its edge at (u, v) = ({u:.4g}, {v:.4g}) to roll over it"
        raise InputRejected(what, remedy='use edge = "to-border" or a smaller pick feed')
    return float(cosine[worst])


def within_patch(curve: TracedCurve, surface: OffsetSurface, slack: float = 1e-9) -> TracedCurve:
    """The same curve over `surface`, the patch without its edge, if it lies there from end to end; else as it is."""
    low, high = np.array(surface.patch.domain).T
    room = slack * (high - low)
    is_inside = ((curve.parameters >= low - room) & (curve.parameters <= high + room)).all()
    return replace(curve, surface=surface) if is_inside else curve


def _kinks(over: RolledSurface, planes_mm: Array, spacing_mm: float) -> tuple[Indices, Array]:
    """Where passes cross from patch to edge or from edge to corner: plane (k,) and x (k,)."""
    rings = (
        border_of(over, spacing_mm=spacing_mm, domain=domain)
        for domain in ((over.patch.domain[0], over.rim[1]), (over.rim[0], over.patch.domain[1]))
    )
    found = [crossings(over, ring, planes_mm)[:2] for ring in rings]
    return np.concatenate([one[0] for one in found]), np.concatenate([one[1] for one in found])


def _pieces(plane: Indices, runs: Array, at: Indices, x: Array, least_mm: float = 0.01) -> tuple[Indices, Array]:
    """Runs (m, 2) cut at these places of their planes: run (k,) and [from, to] (k, 2), none shorter than `least_mm`."""
    owner, pieces = [], []
    for number, (one, (start, stop)) in enumerate(zip(plane.tolist(), runs.tolist(), strict=True)):
        cuts = [start]
        for place in sorted(x[at == one].tolist()):
            if cuts[-1] + least_mm < place < stop - least_mm:
                cuts.append(place)
        owner += [number] * len(cuts)
        pieces += list(pairwise([*cuts, stop]))
    return np.array(owner, dtype=np.intp), np.array(pieces)


def _even_steps(gap_mm: float, step_mm: float) -> Array:
    """Distances up to half a step short of the gap, evenly and at most `step_mm` apart; none where it is that short."""
    reach_mm = gap_mm - step_mm / 2
    count = max(int(np.ceil(reach_mm / step_mm - 1e-9)), 0)
    return np.asarray(reach_mm * np.arange(1, count + 1) / max(count, 1))
