"""How far straight moves and arcs can be from their exact curves: bounds over whole passes, both ways, ends included.

At exact nodes the distance from a move is known; between them its second derivative is at most the difference of two
curvatures, and the change of the curve's is enclosed over the patch. (F22) of EQUATIONS-fitting.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.path.curve import exact_at
from planner.path.model import ArcChain, Array, Polyline
from planner.path.plane_spline import Index
from planner.path.slope_range import PatchSlopes
from planner.path.slope_table import SlopeTable
from planner.path.trace import TracedCurve

FOOT_STEPS = 4
ROUNDS = 4
AS_GOOD_AS_NONE_MM = 1e-6  # of a straight pass every share of its distance would be too much to leave open


@dataclass(frozen=True, slots=True)
class _Links:
    """All moves of all shapes: `start` (2, m), unit `ahead` (2, m) of lines, `centre` (2, m), `radius` (m,) of arcs.

    `bend` (m,) is the signed curvature, 0 for lines. `rows` (m,) are the shapes, `begin`, `end` (m,) the arc lengths on
    the curve opposite to the ends.
    """

    start: Array
    ahead: Array
    centre: Array
    radius: Array
    bend: Array
    rows: Index
    begin: Array
    end: Array

    def gaps(self, at: Index, points: Array, tangents: Array) -> tuple[Array, Array]:
        """Distance (k,) of points (k, 2) from the lines or circles of links `at`, and its slope along tangents."""
        away, spoke = points.T - self.start[:, at], points.T - self.centre[:, at]
        far = np.hypot(spoke[0], spoke[1])
        out = spoke / far
        ahead = self.ahead[:, at]
        is_line = self.bend[at] == 0
        gap = np.where(is_line, ahead[0] * away[1] - ahead[1] * away[0], far - self.radius[at])
        across = ahead[0] * tangents[:, 1] - ahead[1] * tangents[:, 0]
        slope = np.where(is_line, across, out[0] * tangents[:, 0] + out[1] * tangents[:, 1])
        return np.abs(gap), np.abs(slope)


@dataclass(frozen=True, slots=True)
class _Stretches:
    """Stretches (k,) between following nodes: `rows` of their curves, `begin` and `step` in arc length, and distances.

    `gap` is the larger one at their two nodes, `rest` what it may grow by between these, `reached` the bound of both.
    """

    rows: Index
    begin: Array
    step: Array
    gap: Array
    rest: Array
    reached: Array


def bound_links(
    curves: Sequence[TracedCurve],
    shapes: Sequence[Polyline | ArcChain],
    table: SlopeTable,
    share: float = 0.02,
    halvings: int = 2,
) -> Array:
    """Upper bounds (p,), mm, on the distance between shapes and exact curves of one patch; infinite where not known.

    Nodes are added until what may hide between them stays below this share of the distance at nodes, (F22). Where they
    stand too far apart for the curvature to be enclosed, those of the curve are halved, `halvings` times at most.
    """
    links = _links(curves, shapes)
    source = PatchSlopes(curves, table)
    rows = np.concatenate([links.rows, np.repeat(np.arange(len(curves)), [len(curve.arc_mm) for curve in curves])])
    places = np.concatenate([links.begin, *(curve.arc_mm for curve in curves)])
    for _ in range(ROUNDS):
        rows, places = _sorted(rows, places)
        found = _stretches(links, curves, source, rows, places)
        seen_mm = np.maximum.reduceat(found.gap, np.searchsorted(found.rows, np.arange(len(curves))))
        known = np.maximum(seen_mm, AS_GOOD_AS_NONE_MM)[found.rows]
        is_loose = np.isfinite(found.rest) & (found.rest > share * known) & (found.reached > (1 - share) * known)
        if not is_loose.any():
            break
        parts = np.clip(np.ceil(np.sqrt(found.rest[is_loose] / (share * known[is_loose]))), 2, 16).astype(np.intp)
        owner = np.repeat(np.flatnonzero(is_loose), parts - 1)
        rank = np.arange(len(owner)) - np.repeat(np.cumsum(parts - 1) - parts, parts - 1)
        rows = np.append(rows, found.rows[owner])
        places = np.append(places, found.begin[owner] + rank / np.repeat(parts, parts - 1) * found.step[owner])
    bounds = _end_gaps(curves, shapes)
    np.maximum.at(bounds, found.rows, found.reached)
    # Feet that do not follow each other leave some of a link without its piece of the curve.
    np.maximum.at(bounds, links.rows, np.where(links.end > links.begin, 0.0, np.inf))
    open_ = np.flatnonzero(np.isinf(bounds)).tolist() if halvings else []
    if open_:
        closer = [curves[row].halved() for row in open_]
        bounds[open_] = bound_links(closer, [shapes[row] for row in open_], table, share, halvings - 1)
    return bounds


def seen_gaps(
    curves: Sequence[TracedCurve], shapes: Sequence[Polyline | ArcChain], a_node: int = 4, a_link: int = 32
) -> Array:
    """Largest distances (p,), mm, between shapes and exact curves at so many places from node to node and along links.

    A line leaves its curve furthest at its ends and half-way, where no node of the curve need stand.
    """
    links = _links(curves, shapes)
    along = np.arange(a_link) / a_link
    of_links = (links.begin[:, None] + along * (links.end - links.begin)[:, None]).ravel()
    shares = np.arange(a_node) / a_node
    arcs = [curve.arc_mm for curve in curves]
    of_curves = [np.append((arc[:-1, None] + shares * np.diff(arc)[:, None]).ravel(), arc[-1]) for arc in arcs]
    owners = np.repeat(np.arange(len(curves)), [len(arc) for arc in of_curves])
    owners = np.append(owners, np.repeat(links.rows, a_link))
    rows, places = _sorted(owners, np.concatenate([*of_curves, of_links]))
    exact = exact_at(curves, rows, places)
    gaps, slopes = links.gaps(_link_of(links, rows, places), exact.points, exact.tangents)
    seen = np.maximum.reduceat(gaps * np.sqrt(1 + slopes**2), np.searchsorted(rows, np.arange(len(curves))))
    return np.maximum(seen, _end_gaps(curves, shapes))


def _stretches(
    links: _Links, curves: Sequence[TracedCurve], source: PatchSlopes, rows: Index, places: Array
) -> _Stretches:
    """What is known between these nodes (sorted), (F22)."""
    exact = exact_at(curves, rows, places)
    left = np.flatnonzero(rows[1:] == rows[:-1])
    step = places[left + 1] - places[left]
    at = _link_of(links, rows[left], places[left] + step / 2)
    ends = [links.gaps(at, exact.points[side], exact.tangents[side]) for side in (left, left + 1)]
    low, high, jumps = source.enclose(rows[left], places[left], places[left + 1])
    circle = np.abs(links.bend[at])
    drift = np.maximum(*(np.abs(exact.curvatures[side] - links.bend[at]) for side in (left, left + 1)))
    with np.errstate(invalid="ignore"):
        pull = drift + np.maximum(np.abs(low), np.abs(high)) * step / 2 + jumps
        gap, slope = np.maximum(ends[0][0], ends[1][0]), np.maximum(ends[0][1], ends[1][1]) + pull * step
        pull = pull + circle * (slope**2 + 2 * circle * (gap + slope * step))
        # 1.001 is for arc lengths that are wrong by 1e-4 of a step.
        rest = 1.001 * pull * step**2 / 8
        reached = (gap + rest) * np.sqrt(1 + slope**2)
        # Circles about the same centre are nearly the link's own only as long as all this is small.
        is_known = np.isfinite(reached) & (circle * (gap + slope * step) < 0.1)
    return _Stretches(
        rows[left], places[left], step, gap, np.where(is_known, rest, np.inf), np.where(is_known, reached, np.inf)
    )


def _links(curves: Sequence[TracedCurve], shapes: Sequence[Polyline | ArcChain]) -> _Links:
    """All moves, with the feet of their ends on the curves; a pass begins and ends where its curve does."""
    counts = np.array([len(shape.points) for shape in shapes])
    rows = np.repeat(np.arange(len(shapes)), counts)
    points = np.concatenate([shape.points for shape in shapes])
    longest = np.array([curve.length_mm for curve in curves])[rows]
    pairs = zip(curves, shapes, strict=True)
    feet = np.concatenate([np.interp(shape.points[:, 0], curve.points[:, 0], curve.arc_mm) for curve, shape in pairs])
    for _ in range(FOOT_STEPS):
        exact = exact_at(curves, rows, feet)
        feet = np.clip(feet + ((points - exact.points) * exact.tangents).sum(axis=1), 0.0, longest)
    firsts, lasts = np.cumsum(counts) - counts, np.cumsum(counts) - 1
    feet[firsts], feet[lasts] = 0.0, longest[lasts]
    begin = np.setdiff1d(np.arange(len(points)), lasts)
    chord = (points[begin + 1] - points[begin]).T
    centres = [shape.centres if isinstance(shape, ArcChain) else shape.points[:-1] - 1.0 for shape in shapes]
    turns = [shape.turns if isinstance(shape, ArcChain) else np.zeros(len(shape.points) - 1) for shape in shapes]
    turn = np.concatenate(turns).astype(np.float64)
    centre = np.where(turn == 0, points[begin].T - 1.0, np.concatenate(centres).T)
    radius = np.hypot(*(points[begin].T - centre))
    return _Links(
        points[begin].T,
        chord / np.hypot(*chord),
        centre,
        radius,
        turn / radius,
        rows[begin],
        feet[begin],
        feet[begin + 1],
    )


def _link_of(links: _Links, rows: Index, places: Array) -> Index:
    """The link (k,) opposite to each place of a curve."""
    step = float(links.end.max()) + 1.0
    found = np.searchsorted(links.rows * step + links.begin, rows * step + places, side="right") - 1
    return np.asarray(found, dtype=np.intp)


def _sorted(rows: Index, places: Array) -> tuple[Index, Array]:
    """Rows and places in order, each place once."""
    order = np.lexsort((places, rows))
    rows, places = rows[order], places[order]
    is_new = np.append(True, (rows[1:] != rows[:-1]) | (places[1:] > places[:-1]))
    return rows[is_new], places[is_new]


def _end_gaps(curves: Sequence[TracedCurve], shapes: Sequence[Polyline | ArcChain]) -> Array:
    """The larger distance (p,) between the ends of shape and curve."""
    gaps = [shape.points[[0, -1]] - curve.points[[0, -1]] for curve, shape in zip(curves, shapes, strict=True)]
    return np.asarray(np.hypot(*np.array(gaps).transpose(2, 0, 1)).max(axis=1))
