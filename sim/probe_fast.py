"""Probes against the swept cutter, compiled: one ray after the other, cell by cell, past all pieces that count.

`sim.probe_pure` gives the same figures where numba is not installed; the geometry of one piece is `sim.piece_fast`.
Scalars are mm; p is the probe's point, n its unit normal. `layers` is (chords of strands, first piece of each, chords
of pieces, cubic pieces, strands listed in the bins); a grid is (x0, y0, cell width, rows, columns); what is found is
(height, piece, parameter on the piece).
"""

from __future__ import annotations

import math

import numba  # noqa: F401  (its absence chooses sim.probe_pure)
import numpy as np
from numpy.typing import NDArray

from sim.compiled import compiled
from sim.piece_fast import Edge, Floats, Vector, contains, is_apart, piece_entry

Ints = NDArray[np.int64]
Items = NDArray[np.int32]
Layers = tuple[Floats, Ints, Floats, Floats, Items]
Found = tuple[float, int, float]
Grid = tuple[float, float, float, int, int]


@compiled
def _is_far(x: Vector, strands: Floats, k: int, room: float) -> bool:
    """Whether a ball about the middle of a strand, with all above it, is out of reach: a quick way to say no."""
    dx = x[0] - strands[k, 0] - 0.5 * strands[k, 3]
    dy = x[1] - strands[k, 1] - 0.5 * strands[k, 4]
    dz = min(0.0, x[2] - strands[k, 2] - 0.5 * strands[k, 5])
    bound = room + strands[k, 6] + strands[k, 7]
    return bool(dx * dx + dy * dy + dz * dz > bound * bound)


@compiled
def _cell(x: float, y: float, grid: Grid) -> int:
    """Number of the bin over a place in plan, or -1."""
    i = math.floor((x - grid[0]) / grid[2])
    j = math.floor((y - grid[1]) / grid[2])
    return i * grid[4] + j if 0 <= i < grid[3] and 0 <= j < grid[4] else -1


@compiled
def _outward(
    p: Vector, n: Vector, at: float, found: Found, layers: Layers, listed: tuple[int, int], edge: Edge
) -> Found:
    """The first entry above height `at` among the strands listed, or, <= 0, one that holds p."""
    strands, firsts, chords, pieces, items = layers
    best, owner, where = found
    for item in range(listed[0], listed[1]):
        middle, half = 0.5 * (at + best), 0.5 * (best - at)
        x = (p[0] + middle * n[0], p[1] + middle * n[1], p[2] + middle * n[2])
        strand = items[item]
        if _is_far(x, strands, strand, sum(edge) + half) or is_apart(x, n, half, strands, strand, edge):
            continue
        for k in range(firsts[strand], firsts[strand + 1]):
            if is_apart(x, n, half, chords, k, edge):
                continue
            entry, s = piece_entry(p, n, pieces, chords, k, edge, best)
            if entry < best and (entry > 0.0 or contains(p, pieces, chords, k, s, edge)):
                best, owner, where = entry, k, s
                if best <= 0.0:
                    return best, owner, where
    return best, owner, where


@compiled
def _inward(p: Vector, n: Vector, found: Found, layers: Layers, listed: tuple[int, int], edge: Edge) -> Found:
    """The cut followed further in through every piece that holds the point reached so far."""
    strands, firsts, chords, pieces, items = layers
    depth, owner, where = found
    for item in range(listed[0], listed[1]):
        strand = items[item]
        x = (p[0] + depth * n[0], p[1] + depth * n[1], p[2] + depth * n[2])
        if is_apart(x, n, 0.0, strands, strand, edge):
            continue
        for k in range(firsts[strand], firsts[strand + 1]):
            x = (p[0] + depth * n[0], p[1] + depth * n[1], p[2] + depth * n[2])
            if is_apart(x, n, 0.0, chords, k, edge):
                continue
            entry, s = piece_entry(p, n, pieces, chords, k, edge, depth)
            if entry < depth and contains(x, pieces, chords, k, s, edge):
                depth, owner, where = entry, k, s
    return depth, owner, where


@compiled
def _cut(
    p: Vector, n: Vector, found: Found, layers: Layers, starts: Ints, grid: Grid, edge: Edge, margin: float
) -> Found:
    """One probe: outward cell by cell to the first entry, or, where p is cut away, inward as far as the cut goes."""
    at = 0.0
    level = math.sqrt(n[0] * n[0] + n[1] * n[1])
    step = margin / level if level > 0.0 else math.inf
    while found[0] > 0.0 and at < found[0]:
        cell = _cell(p[0] + at * n[0], p[1] + at * n[1], grid)
        if cell >= 0:
            found = _outward(p, n, at, found, layers, (starts[cell], starts[cell + 1]), edge)
        at += step
    before = 1.0
    while found[0] <= 0.0 and found[0] < before:
        before = found[0]
        cell = _cell(p[0] + before * n[0], p[1] + before * n[1], grid)
        if cell >= 0:
            found = _inward(p, n, found, layers, (starts[cell], starts[cell + 1]), edge)
    return found


@compiled
def heights(
    points: Floats,
    normals: Floats,
    layers: Layers,
    starts: Ints,
    grid: Grid,
    edge: Edge,
    reach: float,
    margin: float,
    out: Floats,
    owners: Ints,
    places: Floats,
) -> None:
    """Height along every normal at which the cutter's way begins (inf beyond `reach`), the piece that cut there, its s.

    The piece of the last probe is tried first: neighbours are cut by the same one, and all others are then far.
    """
    guess = -1
    for k in range(len(points)):
        p = (points[k, 0], points[k, 1], points[k, 2])
        n = (normals[k, 0], normals[k, 1], normals[k, 2])
        found = (reach, -1, 0.0)
        if guess >= 0:
            entry, s = piece_entry(p, n, layers[3], layers[2], guess, edge, reach)
            if entry < reach and (entry > 0.0 or contains(p, layers[3], layers[2], guess, s, edge)):
                found = (entry, guess, s)
        found = _cut(p, n, found, layers, starts, grid, edge, margin)
        guess = found[1]
        out[k] = found[0] if guess >= 0 else math.inf
        owners[k] = guess
        places[k] = found[2]
