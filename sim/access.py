"""Accessibility: probes that the cutter cannot touch without cutting the design elsewhere.

A ball that touches a point from outside has its centre one radius along the normal. It may stay there if no other
point of the design lies inside the ball or beside the shank above it, and if the design bends toward the tool less
sharply than the ball. A cutter with a flat end touches with its rounded edge, or on level ground with any point of its
end; it is tried in these places against the points of a net of an eighth of its radius.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter
from scipy.spatial import cKDTree

from sim.grid import Net, net_of
from sim.tool import Tool

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


def accessible(nets: Sequence[Net], tool: Tool, depth_mm: float) -> list[Flags]:
    """For every net, (n, m): whether the cutter can touch the probe, to within `depth_mm` of interference."""
    if tool.flat_mm > 0:
        return _to_blunt(nets, tool, depth_mm)
    return _to_ball(nets, tool.corner_mm, depth_mm)


def _to_ball(nets: Sequence[Net], radius_mm: float, depth_mm: float) -> list[Flags]:
    """The probes that a ball can touch.

    A coarse net (a quarter of the radius) finds the neighbourhoods where something may be in the way; only there every
    probe is tried against all others.
    """
    coarse = [net_of(net.patch, max(net.pitch_mm, radius_mm / 4)) for net in nets]
    rough = np.concatenate([net.points.reshape(-1, 3) for net in coarse])
    normals = np.concatenate([net.normals.reshape(-1, 3) for net in coarse])
    bends = np.concatenate([net.patch.grid_concave_curvature(net.u, net.v) for net in coarse])
    is_suspect = (bends > 0.5 / radius_mm) | ~_is_free(rough, normals, rough, rough, radius_mm, depth_mm)
    suspects = rough[is_suspect & np.isfinite(rough).all(axis=1)]
    everything = np.concatenate([net.points.reshape(-1, 3) for net in nets])
    return [_of_net(net, suspects, everything, rough, radius_mm, depth_mm) for net in nets]


def _of_net(net: Net, suspects: Floats, everything: Floats, rough: Floats, radius_mm: float, depth_mm: float) -> Flags:
    points, normals = net.points.reshape(-1, 3), net.normals.reshape(-1, 3)
    is_free = np.isfinite(normals).all(axis=1) & (normals[:, 2] > 0)
    if len(suspects):
        known = np.flatnonzero(is_free)
        distance, _ = cKDTree(suspects).query(points[known], distance_upper_bound=2 * radius_mm, workers=-1)
        near = known[np.isfinite(distance)]
        is_free[near] = _is_free(points[near], normals[near], everything, rough, radius_mm, depth_mm)
        is_free[near] &= net.patch.concave_curvature(_parameters(net)[near]) <= 1.0 / radius_mm
    return np.asarray(is_free.reshape(net.area_mm2.shape))


def _parameters(net: Net) -> Floats:
    return np.stack(np.meshgrid(net.u, net.v, indexing="ij"), axis=-1).reshape(-1, 2)


def _is_free(
    points: Floats, normals: Floats, design: Floats, rough: Floats, radius_mm: float, depth_mm: float
) -> Flags:
    """Whether the ball that touches each point keeps clear of the design's points, and the shank of the rough ones."""
    is_free = np.array(np.isfinite(normals).all(axis=1))
    design = design[np.isfinite(design).all(axis=1)]
    centres = points[is_free] + radius_mm * normals[is_free]
    distance, _ = cKDTree(design).query(centres, distance_upper_bound=radius_mm - depth_mm, workers=-1)
    is_clear = np.array(np.isinf(distance))
    rough = rough[np.isfinite(rough).all(axis=1)]
    low = np.flatnonzero(centres[:, 2] < rough[:, 2].max())
    if len(low):
        is_clear[low] &= _is_beside(centres[low], rough, radius_mm - depth_mm)
    result = is_free.copy()
    result[is_free] = is_clear
    return result


def _is_beside(centres: Floats, design: Floats, radius_mm: float) -> Flags:
    """Whether no point of the design higher than the centre stands within the shank's radius in plan.

    The highest point of every square of the plan settles most centres; the others look at the points themselves.
    """
    cell_mm = radius_mm / 8
    corner = design[:, :2].min(axis=0) - 10 * cell_mm
    at = ((design[:, :2] - corner) / cell_mm).astype(np.int64)
    tops = np.full(tuple(at.max(axis=0) + 11), -np.inf)
    np.maximum.at(tops, (at[:, 0], at[:, 1]), design[:, 2])
    i, j = (np.abs(steps) for steps in np.ogrid[-9:10, -9:10])
    place = np.clip(((centres[:, :2] - corner) / cell_mm).astype(np.int64), 0, np.array(tops.shape) - 1)
    outer, inner = (
        maximum_filter(tops, footprint=disc, mode="constant", cval=-np.inf)[place[:, 0], place[:, 1]]
        for disc in (np.hypot(i - 1, j - 1) <= 8, np.hypot(i + 1, j + 1) <= 8)
    )
    is_clear = outer <= centres[:, 2]
    open_cases = np.flatnonzero(~is_clear & (inner <= centres[:, 2]))
    if len(open_cases):
        asked = centres[open_cases]
        high = design[design[:, 2] > asked[:, 2].min()]
        lists = cKDTree(high[:, :2]).query_ball_point(asked[:, :2], radius_mm, workers=-1)
        is_clear[open_cases] = [
            not (high[found, 2] > centre[2]).any() for found, centre in zip(lists, asked, strict=True)
        ]
    return np.asarray(is_clear)


def _to_blunt(nets: Sequence[Net], tool: Tool, depth_mm: float) -> list[Flags]:
    """The probes that a cutter with a flat end can touch.

    Probes an eighth of its radius apart are tried first, and between those that differ every one.
    """
    eighth_mm = (tool.corner_mm + tool.flat_mm) / 8
    coarse = [net_of(net.patch, max(net.pitch_mm, eighth_mm)) for net in nets]
    design = np.concatenate([net.points.reshape(-1, 3) for net in coarse])
    obstacles = _Obstacles(design[np.isfinite(design).all(axis=1)], tool, depth_mm)
    result = []
    for net in nets:
        stride = max(1, int(eighth_mm / net.pitch_mm))
        rows, columns = (np.unique([*range(0, count, stride), count - 1]) for count in net.area_mm2.shape)
        at = np.ix_(rows, columns)
        tried = obstacles.let_touch(net.points[at].reshape(-1, 3), net.normals[at].reshape(-1, 3))
        tried = tried.reshape(len(rows), len(columns))
        i, j = (
            np.minimum(np.searchsorted(nodes, np.arange(count), side="right") - 1, len(nodes) - 2)
            for nodes, count in ((rows, net.area_mm2.shape[0]), (columns, net.area_mm2.shape[1]))
        )
        corners = np.array([tried[np.ix_(i + down, j + right)] for down, right in ((0, 0), (0, 1), (1, 0), (1, 1))])
        is_free: Flags = np.asarray(corners.all(axis=0))
        differ = corners.any(axis=0) & ~is_free
        is_free[differ] = obstacles.let_touch(net.points[differ], net.normals[differ])
        result.append(is_free)
    return result


@dataclass(frozen=True, slots=True)
class _Obstacles:
    """Points of the design, (n, 3), in which a cutter with a flat end may sink no deeper than `depth_mm`."""

    design: Floats
    tool: Tool
    depth_mm: float

    def let_touch(self, points: Floats, normals: Floats) -> Flags:
        """Whether the cutter can touch each point: with its edge on a slope, anywhere with its end on level ground."""
        tree = cKDTree(self.design[:, :2])
        level = np.hypot(normals[:, 0], normals[:, 1])
        is_free = np.zeros(len(points), dtype=bool)
        slanting = np.flatnonzero((normals[:, 2] > 0) & (level > 1e-6))
        aside = self.tool.flat_mm * normals[slanting] / level[slanting, None] * (1.0, 1.0, 0.0)
        centres = points[slanting] + self.tool.corner_mm * normals[slanting] + aside
        is_free[slanting] = self._is_clear(centres, tree)
        even = np.flatnonzero((normals[:, 2] > 0) & (level <= 1e-6))
        for x, y in _rim(self.tool.flat_mm):
            still = even[~is_free[even]]
            is_free[still] = self._is_clear(points[still] + (x, y, self.tool.corner_mm), tree)
        return is_free

    def _is_clear(self, centres: Floats, tree: cKDTree) -> Flags:
        """Whether no obstacle lies too deep in the cutter standing at each place."""
        tool, is_clear = self.tool, np.ones(len(centres), dtype=bool)
        for begin in range(0, len(centres), 5000):
            part = centres[begin : begin + 5000]
            lists = np.asarray(
                tree.query_ball_point(part[:, :2], tool.corner_mm + tool.flat_mm, workers=-1), dtype=object
            )
            counts = np.fromiter(map(len, lists), dtype=np.int64, count=len(part))
            which = np.repeat(np.arange(len(part)), counts)
            if not len(which):
                continue
            away = self.design[np.concatenate(lists).astype(np.int64)] - part[which]
            out, down = np.hypot(away[:, 0], away[:, 1]) - tool.flat_mm, -away[:, 2]
            beside = np.hypot(np.maximum(out, 0.0), np.maximum(down, 0.0))
            depth = np.where(beside > 0, tool.corner_mm - beside, tool.corner_mm - np.maximum(out, down))
            is_clear[begin + which[depth > self.depth_mm]] = False
        return is_clear


def _rim(flat_mm: float) -> list[tuple[float, float]]:
    """Where the tool's axis may stand from a point of level ground that its flat end touches: over it, and around."""
    turns = np.arange(16) * np.pi / 8
    return [(0.0, 0.0), *((flat_mm * float(np.cos(turn)), flat_mm * float(np.sin(turn))) for turn in turns)]
