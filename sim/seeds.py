"""Where the highest scallops and the deepest gouges may be, so that few places need an exact search.

Scallops: between two neighbouring probes cut by different passes the two cuts meet in a cusp, its place estimated by a
parabola from each side and probed there: a third pass may run between. Gouges: the cutter's foot on the design, for
begin and middle of every piece of the way and its end. Seeds only choose places; every figure is measured anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sim.grid import Net
from sim.nominal_patch import Frames
from sim.probe import Heights, Probes
from sim.tool import Tool

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Seeds:
    """n places on one patch, uv (n, 2), with the deviation expected there, expected_mm (n,)."""

    uv: Floats
    expected_mm: Floats


def cusp_seeds(net: Net, found: Heights, probes: Probes, is_counted: Flags, limit: int) -> Seeds:
    """The most promising summits of material left: probes no neighbour exceeds, and cusps between neighbours.

    `is_counted` (n, m) leaves out probes that the cutter cannot touch; at most `limit` seeds, highest first.
    """
    n, m = net.area_mm2.shape
    radius_mm = probes.tool.corner_mm + probes.tool.flat_mm
    heights = found.height_mm.reshape(n, m)
    usable = is_counted & np.isfinite(heights)
    i, j = np.nonzero(_summits(np.where(is_counted, heights, -np.inf)) & usable)
    places, cells = [_uv(net, i, j, i, j, 0.0)], [_block(i, j)]
    piece = found.piece.reshape(n, m)
    spokes = probes.spokes(found, _cut(net, found)).reshape(n, m, 3)
    centres = probes.centres(found).reshape(n, m, 3)
    ways = probes.chords[found.piece, 3:6].reshape(n, m, 3)
    for down, right in ((1, 0), (0, 1)):
        is_other = np.abs(piece[: n - down, : m - right] - piece[down:, right:]) > 1
        a, b = np.nonzero(is_other & usable[: n - down, : m - right] & usable[down:, right:])
        share = _cusps(net, heights, spokes, centres, ways, (a, b), (a + down, b + right), radius_mm)
        at = np.flatnonzero(np.isfinite(share))
        a, b = a[at], b[at]
        places.append(_uv(net, a, b, a + down, b + right, share[at]))
        cells.append(_block(a, b))
    uv = np.concatenate(places)
    frames = net.patch.frames(uv)
    reached = probes.measure(frames.points, frames.normals).height_mm
    reached = np.where(np.isfinite(reached), reached, -np.inf)
    kept = _highest(reached, np.concatenate(cells), limit)
    return Seeds(uv[kept], reached[kept])


def pit_seeds(net: Net, found: Heights, probes: Probes, limit: int) -> Seeds:
    """The most promising gouges: probes no neighbour undercuts, and feet of the cutter all along the way."""
    n, m = net.area_mm2.shape
    heights = found.height_mm.reshape(n, m)
    i, j = np.nonzero(_summits(-heights) & (heights < 0))
    probed, expected, cells = _uv(net, i, j, i, j, 0.0), -heights[i, j], _block(i, j)
    powers = np.array([0.0, 0.5])[:, None] ** np.arange(4)
    ways = np.einsum("sk,nkx->nsx", powers, probes.sweep.coefficients).reshape(-1, 3)
    ways = np.concatenate([ways, probes.sweep.ends[-1:]])
    if not len(ways):
        kept = _highest(expected, cells, limit)
        return Seeds(probed[kept], -expected[kept])
    near = _nodes_near(net, found.piece, ways, probes.tool)
    i, j = np.divmod(near, m)
    feet, depth = _feet(net, net.frames.rows(near), _uv(net, i, j, i, j, 0.0), ways, probes.tool)
    uv, expected = np.concatenate([probed, feet]), np.concatenate([expected, depth])
    kept = _highest(expected, np.concatenate([cells, _block(i, j)]), limit)
    uv, way = uv[kept], kept - len(probed)
    for _ in range(4):
        k = np.flatnonzero(way >= 0)
        uv[k], _ = _feet(net, net.patch.frames(uv[k]), uv[k], ways[way[k]], probes.tool)
    return Seeds(uv, -expected[kept])


def _nodes_near(net: Net, owner: Ints, ways: Floats, tool: Tool) -> Ints:
    """For begin and middle of every piece of the way, and its end, a node of the net where the foot may be.

    It is a node that the piece cut, or that a piece next to it in the program cut; where that is out of the cutter's
    reach, the nearest of a coarse net.
    """
    unique = np.unique(owner, return_index=True)
    begin = 1 if len(unique[0]) > 1 and unique[0][0] < 0 else 0
    owners, nodes = (np.asarray(each)[begin:] for each in unique)
    pieces = np.arange(len(ways)) // 2
    right = np.clip(np.searchsorted(owners, pieces), 0, len(owners) - 1)
    left = np.maximum(right - 1, 0)
    chosen = np.where(pieces - owners[left] < owners[right] - pieces, left, right)
    near: Ints = nodes[chosen]
    radius_mm = tool.corner_mm + tool.flat_mm
    far = np.flatnonzero(~(np.linalg.norm(ways - net.frames.points[near], axis=1) < 1.5 * radius_mm))
    stride = max(1, int(radius_mm / (4 * net.pitch_mm)))
    coarse: Ints = np.arange(net.area_mm2.size).reshape(net.area_mm2.shape)[::stride, ::stride].reshape(-1)
    coarse = coarse[np.isfinite(net.frames.points[coarse]).all(axis=1)]
    distance, which = cKDTree(net.frames.points[coarse]).query(ways[far], distance_upper_bound=2 * radius_mm)
    is_within = np.isfinite(distance)
    near[far[is_within]] = coarse[np.asarray(which)[is_within]]
    return near


def _cusps(
    net: Net,
    heights: Floats,
    spokes: Floats,
    centres: Floats,
    ways: Floats,
    one: tuple[Ints, Ints],
    two: tuple[Ints, Ints],
    radius: float,
) -> Floats:
    """Share of the way from probe one to two at which the cuts of two passes cross; nan where they do not."""
    step = net.points[two] - net.points[one]
    length = np.linalg.norm(step, axis=1)
    toward = step / length[:, None]
    slope_one, slope_two = (_slope(net, spokes, at, toward) for at in (one, two))
    bend = 1.0 / radius
    with np.errstate(divide="ignore", invalid="ignore"):
        at = heights[one] - heights[two] + slope_two * length - bend * length**2 / 2
        at = at / (slope_two - slope_one - bend * length)
        is_peak = (at > 0) & (at < length) & (slope_one + bend * at > 0) & (slope_two + bend * (at - length) < 0)
    apart = np.linalg.norm(np.cross(centres[two] - centres[one], ways[one]), axis=1)
    is_peak &= apart > 0.25 * length * np.linalg.norm(ways[one], axis=1)
    return np.where(is_peak, at / length, np.nan)


def _cut(net: Net, found: Heights) -> Floats:
    """Where the material ends over every probe, (n m, 3)."""
    with np.errstate(invalid="ignore"):
        raised = found.height_mm[:, None] * net.normals.reshape(-1, 3)
    return np.asarray(net.points.reshape(-1, 3) + raised)


def _slope(net: Net, spokes: Floats, at: tuple[Ints, Ints], toward: Floats) -> Floats:
    """Rise of the cut surface over the design at a probe, in the direction `toward`, from the cutter's skin there."""
    spoke = spokes[at]
    facing = np.einsum("ij,ij->i", spoke, net.normals[at])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(-np.einsum("ij,ij->i", spoke, toward) / facing)


def _feet(net: Net, start: Frames, uv: Floats, ways: Floats, tool: Tool) -> tuple[Floats, Floats]:
    """(uv, depth) of the design points nearest to the cutter at places of its way, one step from frames at `uv`.

    Of a flat end that point of the rim counts which faces the design. Depth is how far the edge reaches below the
    design, - above it; past the border of the patch, into its border.
    """
    level = np.hypot(start.normals[:, 0], start.normals[:, 1])
    share = np.where(level > 1e-9, tool.flat_mm / np.where(level > 1e-9, level, 1.0), 0.0)
    core = ways - share[:, None] * start.normals * (1.0, 1.0, 0.0)
    asked = uv + start.parameters_of(core - start.points)
    feet = net.patch.clipped(asked)
    away = core - net.patch.points(feet) - net.patch.offset_mm * start.normals
    gap = np.linalg.norm(away, axis=1)
    is_below = (feet == asked).all(axis=1) & (np.einsum("ij,ij->i", away, start.normals) < 0)
    return feet, tool.corner_mm - np.where(is_below, -gap, gap)


def _summits(heights: Floats) -> Flags:
    """(n, m): whether no neighbour is higher; the border has no neighbours outside."""
    padded = np.pad(heights, 1, constant_values=-np.inf)
    n, m = heights.shape
    found = np.ones((n, m), dtype=bool)
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2)):
        found &= heights >= padded[i : i + n, j : j + m]
    return found


def _uv(net: Net, i: Ints, j: Ints, p: Ints, q: Ints, share: Floats | float) -> Floats:
    """Parameters (n, 2) this share of the way from node (i, j) to node (p, q)."""
    u = net.u[i] + share * (net.u[p] - net.u[i])
    v = net.v[j] + share * (net.v[q] - net.v[j])
    return np.stack([u, v], axis=1)


def _block(i: Ints, j: Ints) -> Ints:
    """Number of the block of 8 x 8 nodes that a node is in."""
    return np.asarray((i // 8) * (1 << 32) + j // 8)


def _highest(expected: Floats, cells: Ints, limit: int) -> Ints:
    """The highest place of every block, the highest `limit` of these."""
    order = np.argsort(-expected, kind="stable")
    _, first = np.unique(cells[order], return_index=True)
    return np.asarray(order[np.sort(first)][:limit])
