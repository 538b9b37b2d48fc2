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
        is_reached &= is_found & (surface.side * turn > 0) & (off_mm <= ASTRAY * np.abs(step_mm))
        guess = after
    return found, is_reached


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
