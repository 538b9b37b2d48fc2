"""Passes kept on the part's own fold of the extended offset surface, where Newton's method went astray beyond it.

The extended patch may bend back on itself not far outside its border. A guess from the raster then leads to another
fold, or nowhere; going on step by step from what is on the part does not. EQUATIONS.md, section 3.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from planner.path.newton import CurveSamples, solve_on_planes
from planner.path.offset import OffsetSurface

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

STEPS = 8  # of a walk between two neighbouring nodes
ASTRAY = 0.25  # of a step: no further off its middle lies the middle of its parameters, unless it leaps
PAST_ENDS = (1.0, 0.5, 0.25, 0.125)  # shares of what a short curve runs on past its ends, tried in turn
ROUNDING_MM = 1e-6  # of places at which balls were found to stand


def walk_out(surface: OffsetSurface, owner: Indices, offsets_mm: Array, nodes: CurveSamples, is_found: Flags) -> Flags:
    """Solve anew, in place, what lies outside the part on every curve that has lost nodes, outward from the part.

    `owner` (m,) is the curve of each node, `offsets_mm` the plane of each curve. Returns which nodes (m,) are found.
    """
    is_astray = np.isin(owner, owner[~is_found])
    is_good = ~is_astray | (_is_held(surface, owner, nodes, is_found) & is_found)
    open_ = np.flatnonzero(~is_good)
    to_behind, to_ahead = _to_held(owner, open_, np.flatnonzero(is_good))
    rank, before = np.minimum(to_behind, to_ahead), np.where(to_behind <= to_ahead, open_ - 1, open_ + 1)
    for turn in np.unique(rank[rank < len(owner)]).tolist():
        chosen = np.flatnonzero(rank == turn)
        chosen = chosen[is_good[before[chosen]]]
        at, start = open_[chosen], before[chosen]
        if len(at):
            guess = nodes.parameters[start].T
            found, is_reached = walk(surface, offsets_mm[owner[at]], nodes.points[start, 0], guess, nodes.points[at, 0])
            is_good[at] = is_reached
            _put(nodes, at, found, is_reached)
    return is_good


def walk(
    surface: OffsetSurface, offsets_mm: Array, from_mm: Array, guess: Array, to_mm: Array, steps: int = STEPS
) -> tuple[CurveSamples, Flags]:
    """Solve places w `to_mm` (k,) in short `steps` from places `from_mm` (k,) with parameters (2, k).

    Returns the last samples, and which are reached without a fold, and without a leap to another sheet: of every step
    the middle of the parameters lies near its middle.
    """
    is_reached, step_mm = np.ones(len(to_mm), dtype=bool), (to_mm - from_mm) / steps
    for step in range(1, steps + 1):
        w_mm = to_mm if step == steps else from_mm + step * step_mm
        found, is_found = solve_on_planes(surface, offsets_mm, w_mm, guess)
        after = found.parameters.T.copy()
        at, middle = surface.evaluate(after[0], after[1]), surface.evaluate(*((guess + after) / 2)).centre
        turn = at.centre_u[0] * at.centre_v[1] - at.centre_u[1] * at.centre_v[0]
        off_mm = np.hypot(middle[0] - w_mm + step_mm / 2, middle[1] - offsets_mm)
        is_reached &= is_found & (surface.side * turn > 0) & (off_mm <= ASTRAY * np.abs(step_mm) + ROUNDING_MM)
        guess = after
    return found, is_reached


def keep_sheet(
    surface: OffsetSurface, owner: Indices, offsets_mm: Array, nodes: CurveSamples, ends: tuple[Array, Array]
) -> None:
    """Find nodes (m,) anew, in place, of curves that stand on another sheet than the balls at their ends.

    Beside a narrow slot the patch as it would go on from one side lies over the other, and guesses from the raster may
    stand on either. `ends` are places (k, 2) on the curves and parameters (2, k, 2). A curve that cannot be followed
    from one end to the other is left as it is.
    """
    x, parameters = ends
    w_mm = nodes.points[:, 0]
    starts = np.searchsorted(owner, np.arange(len(offsets_mm) + 1))
    first, last = w_mm[starts[:-1], None], w_mm[starts[1:] - 1, None]
    share = np.clip((x - first) / (last - first), 0.0, 1.0)
    near = starts[:-1, None] + np.rint(share * (np.diff(starts) - 1)[:, None]).astype(np.intp)
    ahead, places = np.moveaxis(nodes.parameters[near], 2, 0), w_mm[near]
    is_same = [
        _is_one_sheet(surface, offsets_mm, (x[:, i], parameters[..., i]), (places[:, i], ahead[..., i])) for i in (0, 1)
    ]
    for row in np.flatnonzero(~(is_same[0] & is_same[1])).tolist():
        _follow(
            surface, offsets_mm[row : row + 1], nodes, slice(starts[row], starts[row + 1]), (x[row], parameters[:, row])
        )


def _follow(
    surface: OffsetSurface, offset_mm: Array, nodes: CurveSamples, of_curve: slice, ends: tuple[Array, Array]
) -> None:
    """Solve the nodes of one curve in short steps from the first end on, and back, if that leads to the last end.

    What it runs on past its ends is cut down where it meets a fold there.
    """
    w_mm, (x, parameters) = nodes.points[of_curve, 0].copy(), ends
    for share in PAST_ENDS:
        begin, stop = x[0] - share * (x[0] - w_mm[0]), x[1] + share * (w_mm[-1] - x[1])
        places = begin + (w_mm - w_mm[0]) / (w_mm[-1] - w_mm[0]) * (stop - begin)
        found = _walked(surface, offset_mm, places, (x[:1], parameters[:, :1]))
        last = min(int(np.searchsorted(places, x[1])), len(places) - 1)
        if len(found) < len(places):
            continue
        arrived = places[last : last + 1], found[last].parameters.T
        if _is_one_sheet(surface, offset_mm, (x[1:], parameters[:, 1:]), arrived).all():
            for at, sample in found.items():
                _put(nodes, np.array([of_curve.start + at]), sample, np.array([True]))
            return


def _walked(
    surface: OffsetSurface, offset_mm: Array, places: Array, begin: tuple[Array, Array]
) -> dict[int, CurveSamples]:
    """The samples at places (n,) of one plane, in short steps on and back from a place (1,) and parameters (2, 1).

    Those beyond one that is not reached are missing.
    """
    first = int(np.searchsorted(places, begin[0][0]))
    found: dict[int, CurveSamples] = {}
    for way in (range(first, len(places)), range(first - 1, -1, -1)):
        place, guess = begin
        for at in way:
            sample, is_reached = walk(surface, offset_mm, place, guess, places[at : at + 1])
            if not is_reached.all():
                return found
            found[at], place, guess = sample, places[at : at + 1], sample.parameters.T.copy()
    return found


def _is_one_sheet(
    surface: OffsetSurface, offsets_mm: Array, here: tuple[Array, Array], there: tuple[Array, Array]
) -> Flags:
    """Whether balls at places x (k,) of planes, with parameters (2, k), stand on one sheet: their middle tells."""
    middle = surface.evaluate(*((here[1] + there[1]) / 2)).centre
    off_mm = np.hypot(middle[0] - (here[0] + there[0]) / 2, middle[1] - offsets_mm)
    return np.asarray(off_mm <= ASTRAY * np.abs(there[0] - here[0]) + ROUNDING_MM)


def call_back(surface: OffsetSurface, owner: Indices, offsets_mm: Array, nodes: CurveSamples, wide: Indices) -> None:
    """Bring nodes (m,) that Newton found on another fold of the extended surface back to the curve, in place.

    A gap that stays wide however it is halved jumps from fold to fold. Of its two ends the one further from the part
    is at fault, and is solved anew from where the curve goes on from the other.
    """
    held = np.flatnonzero(_is_held(surface, owner, nodes, np.ones(len(owner), dtype=bool)))
    to_behind, _ = _to_held(owner, wide, held)
    _, to_ahead = _to_held(owner, wide + 1, held)
    is_first = to_behind > to_ahead
    bad, good = np.where(is_first, wide, wide + 1), np.where(is_first, wide + 1, wide)
    rest = np.clip(2 * good - bad, 0, len(owner) - 1)
    is_known = (owner[bad] == owner[good]) & (owner[rest] == owner[good]) & (to_behind != to_ahead)
    bad, good, rest = bad[is_known], good[is_known], rest[is_known]
    w_mm = nodes.points[:, 0]
    share = ((w_mm[bad] - w_mm[good]) / (w_mm[good] - w_mm[rest]))[:, None]
    guess = nodes.parameters[good] + share * (nodes.parameters[good] - nodes.parameters[rest])
    found, is_found = solve_on_planes(surface, offsets_mm[owner[bad]], w_mm[bad], guess.T.copy())
    _put(nodes, bad, found, is_found)


def _is_held(surface: OffsetSurface, owner: Indices, nodes: CurveSamples, is_found: Flags) -> Flags:
    """What (m,) is on the part, or nearest to it where a whole curve runs outside: that is where it should be."""
    low, high = np.array(surface.patch.domain).T
    outside = np.maximum(np.maximum(low - nodes.parameters, nodes.parameters - high), 0.0) / (high - low)
    far = np.where(is_found, outside.max(axis=1), np.inf)
    starts = np.flatnonzero(np.append(True, owner[1:] != owner[:-1]))
    return np.asarray(far <= np.repeat(np.minimum.reduceat(far, starts), np.diff(np.append(starts, len(owner)))))


def _to_held(owner: Indices, at: Indices, held: Indices) -> tuple[Indices, Indices]:
    """How many nodes lie from `at` (k,) back and on to a held one: more than there are where its curve has none."""
    if not len(held):
        return np.full(len(at), len(owner)), np.full(len(at), len(owner))
    behind = held[np.maximum(np.searchsorted(held, at, side="right") - 1, 0)]
    ahead = held[np.minimum(np.searchsorted(held, at), len(held) - 1)]
    to_behind = np.where((owner[behind] == owner[at]) & (behind <= at), at - behind, len(owner))
    return to_behind, np.where((owner[ahead] == owner[at]) & (ahead >= at), ahead - at, len(owner))


def _put(nodes: CurveSamples, at: Indices, found: CurveSamples, is_found: Flags) -> None:
    """Found samples (k,) in the place of nodes `at` (k,), where they are found."""
    for field in fields(nodes):
        getattr(nodes, field.name)[at[is_found]] = getattr(found, field.name)[is_found]
