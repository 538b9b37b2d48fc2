"""Rays along nominal normals against the way of the cutter: the height at which the material ends, exact per probe."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim import probe_fast
from sim.bins import Bins, Strands, bins_of, strands_of
from sim.sweep import Sweep
from sim.tool import Tool

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Heights:
    """Result of n probes: height_mm (n,), + material left, - cut too deep, inf not reached; piece (n,) or -1."""

    height_mm: Floats
    piece: Ints


@dataclass(frozen=True, slots=True)
class Probes:
    """A sweep made ready for probing: pieces, chords (begin, vector, sag), strands, bins in plan."""

    sweep: Sweep
    chords: Floats
    strands: Strands
    bins: Bins
    tool: Tool
    reach_mm: float
    margin_mm: float

    def measure(self, points: Floats, normals: Floats) -> Heights:
        """Heights along unit normals (n, 3) from points (n, 3); probes with a nan normal are not reached."""
        height, piece = np.full(len(points), np.inf), np.full(len(points), -1, dtype=np.int64)
        known = np.flatnonzero(np.isfinite(normals).all(axis=1))
        parts = np.array_split(known, max(1, min(64, len(known) // 2000)))
        with ThreadPoolExecutor(os.cpu_count()) as threads:
            list(threads.map(lambda part: self._measure(points, normals, part, height, piece), parts))
        return Heights(height, piece)

    def _measure(self, points: Floats, normals: Floats, part: Ints, height: Floats, piece: Ints) -> None:
        out, owners = np.empty(len(part)), np.empty(len(part), dtype=np.int64)
        bins = self.bins
        probe_fast.heights(
            np.ascontiguousarray(points[part]),
            np.ascontiguousarray(normals[part]),
            (self.strands.chords, self.strands.firsts, self.chords, self.sweep.coefficients, bins.items),
            bins.starts,
            (bins.x0_mm, bins.y0_mm, bins.cell_mm, *bins.shape),
            self.tool.corner_mm,
            self.reach_mm,
            self.margin_mm,
            out,
            owners,
        )
        height[part], piece[part] = out, owners


def probes_of(sweep: Sweep, tool: Tool, *, reach_mm: float) -> Probes:
    """A sweep with its bins; heights beyond `reach_mm` are not looked for."""
    radius_mm = tool.corner_mm + tool.flat_mm
    margin_mm = radius_mm / 16
    chords = np.concatenate([sweep.coefficients[:, 0], sweep.ends - sweep.coefficients[:, 0], sweep.sag_mm[:, None]], 1)
    strands = strands_of(sweep, sag_mm=radius_mm / 200, length_mm=radius_mm / 2)
    bins = bins_of(strands, reach_mm=radius_mm + margin_mm, cell_mm=radius_mm / 3)
    return Probes(sweep, np.ascontiguousarray(chords), strands, bins, tool, reach_mm, margin_mm)
