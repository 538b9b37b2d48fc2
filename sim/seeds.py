"""Where the highest scallops and the deepest gouges may be, so that few places need an exact search.

Scallops: between two neighbouring probes cut by different passes the two cuts meet in a cusp, estimated by a parabola
from each side. Gouges: the cutter's foot on the design, estimated for begin and middle of every piece of the way.
Estimates only choose places; every figure that is reported is measured there anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.grid import Net
from sim.probe import Heights, Probes

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
    uv, expected, cells = [_uv(net, i, j, i, j, 0.0)], [heights[i, j]], [_block(i, j)]
    piece = found.piece.reshape(n, m)
    spokes = probes.spokes(found, _cut(net, found)).reshape(n, m, 3)
    centres = probes.centres(found).reshape(n, m, 3)
    ways = probes.chords[found.piece, 3:6].reshape(n, m, 3)
    for down, right in ((1, 0), (0, 1)):
        is_other = np.abs(piece[: n - down, : m - right] - piece[down:, right:]) > 1
        a, b = np.nonzero(is_other & usable[: n - down, : m - right] & usable[down:, right:])
        share, height = _cusps(net, heights, spokes, centres, ways, (a, b), (a + down, b + right), radius_mm)
        at = np.flatnonzero(np.isfinite(height))
        a, b = a[at], b[at]
        uv.append(_uv(net, a, b, a + down, b + right, share[at]))
        expected.append(height[at])
        cells.append(_block(a, b))
    return _thinned(np.concatenate(uv), np.concatenate(expected), np.concatenate(cells), limit)


def pit_seeds(net: Net, found: Heights, probes: Probes, limit: int) -> Seeds:
    """The most promising gouges: probes no neighbour undercuts, and feet of the cutter all along the way."""
    n, m = net.area_mm2.shape
    heights = found.height_mm.reshape(n, m)
    i, j = np.nonzero(_summits(-heights) & (heights < 0))
    uv, expected, cells = [_uv(net, i, j, i, j, 0.0)], [-heights[i, j]], [_block(i, j)]
    pieces = probes.sweep.coefficients
    if len(pieces):
        powers = np.array([0.0, 0.5])[:, None] ** np.arange(4)
        ways = np.einsum("sk,nkx->nsx", powers, pieces).reshape(-1, 3)
        near = np.repeat(_probe_near(found.piece, len(pieces)), 2)
        i, j = np.divmod(near, m)
        feet, gap = _feet(net, near, _core(net, near, ways, probes.tool.flat_mm))
        uv.append(feet)
        expected.append(probes.tool.corner_mm - gap)
        cells.append(_block(i, j))
    seeds = _thinned(np.concatenate(uv), np.concatenate(expected), np.concatenate(cells), limit)
    return Seeds(seeds.uv, -seeds.expected_mm)


def _probe_near(owner: Ints, count: int) -> Ints:
    """For every piece, a probe that it cut, or that the piece next to it in the program cut: where its foot may be."""
    owners, probes = np.unique(owner, return_index=True)
    owners, probes = (owners[1:], probes[1:]) if len(owners) > 1 and owners[0] < 0 else (owners, probes)
    right = np.clip(np.searchsorted(owners, np.arange(count)), 0, len(owners) - 1)
    left = np.maximum(right - 1, 0)
    is_left = np.arange(count) - owners[left] < owners[right] - np.arange(count)
    return np.asarray(probes[np.where(is_left, left, right)])


def _cusps(
    net: Net,
    heights: Floats,
    spokes: Floats,
    centres: Floats,
    ways: Floats,
    one: tuple[Ints, Ints],
    two: tuple[Ints, Ints],
    radius: float,
) -> tuple[Floats, Floats]:
    """(share of the way from probe one to two, height) where the cuts of two passes cross; -inf where they do not."""
    step = net.points[two] - net.points[one]
    length = np.linalg.norm(step, axis=1)
    toward = step / length[:, None]
    slope_one, slope_two = (_slope(net, spokes, at, toward) for at in (one, two))
    bend = 1.0 / radius
    with np.errstate(divide="ignore", invalid="ignore"):
        at = heights[one] - heights[two] + slope_two * length - bend * length**2 / 2
        at = at / (slope_two - slope_one - bend * length)
        height = heights[one] + slope_one * at + bend * at**2 / 2
        is_peak = (at > 0) & (at < length) & (slope_one + bend * at > 0) & (slope_two + bend * (at - length) < 0)
    apart = np.linalg.norm(np.cross(centres[two] - centres[one], ways[one]), axis=1)
    is_peak &= apart > 0.25 * length * np.linalg.norm(ways[one], axis=1)
    return at / length, np.where(is_peak, height, -np.inf)


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


def _core(net: Net, near: Ints, ways: Floats, flat_mm: float) -> Floats:
    """Places of the way moved to that point of the flat end's rim which faces the design near a probe."""
    normals = net.normals.reshape(-1, 3)[near]
    level = np.hypot(normals[:, 0], normals[:, 1])
    share = np.where(level > 1e-9, flat_mm / np.where(level > 1e-9, level, 1.0), 0.0)
    return ways - share[:, None] * normals * (1.0, 1.0, 0.0)


def _feet(net: Net, near: Ints, ways: Floats) -> tuple[Floats, Floats]:
    """Parameters of the design points nearest to places of the way, one step from a probe, and their distance."""
    start = net.frames.rows(near)
    i, j = np.divmod(near, len(net.v))
    uv = net.patch.clipped(_uv(net, i, j, i, j, 0.0) + start.parameters_of(ways - start.points))
    return uv, np.linalg.norm(ways - net.patch.points(uv), axis=1)


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


def _thinned(uv: Floats, expected: Floats, cells: Ints, limit: int) -> Seeds:
    """The highest seed of every block, the highest `limit` of these."""
    order = np.argsort(-expected, kind="stable")
    _, first = np.unique(cells[order], return_index=True)
    kept = order[np.sort(first)][:limit]
    return Seeds(uv[kept], expected[kept])
