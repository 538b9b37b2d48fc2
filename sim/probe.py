"""Rays along nominal normals against the way of the cutter: the height at which the material ends, exact per probe."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim import probe_pure
from sim.bins import Bins, Strands, bins_of, strands_of
from sim.sweep import Sweep
from sim.tool import Tool

try:
    from sim.probe_fast import heights as fast_heights
except ImportError:
    fast_heights = probe_pure.heights

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Heights:
    """Result of n probes: height_mm (n,), + material left, - cut too deep, inf not reached.

    piece (n,), or -1, is the piece of the sweep that cut there, parameter (n,) the place on it, in [0, 1].
    """

    height_mm: Floats
    piece: Ints
    parameter: Floats


@dataclass(frozen=True, slots=True)
class Probes:
    """A sweep made ready for probing: pieces, chords (begin, vector, sag), strands, bins in plan.

    `is_compiled` chooses the compiled probes; without numba, or when False, the same figures come from numpy.
    """

    sweep: Sweep
    chords: Floats
    strands: Strands
    bins: Bins
    tool: Tool
    reach_mm: float
    margin_mm: float
    is_compiled: bool = True

    def measure(self, points: Floats, normals: Floats) -> Heights:
        """Heights along unit normals (n, 3) from points (n, 3); probes with a nan normal are not reached."""
        found = Heights(np.full(len(points), np.inf), np.full(len(points), -1, dtype=np.int64), np.zeros(len(points)))
        known = np.flatnonzero(np.isfinite(normals).all(axis=1))
        parts = np.array_split(known, max(1, min(64, len(known) // 4000)))
        if len(parts) == 1:
            self._measure(points, normals, known, found)
        else:
            with ThreadPoolExecutor(os.cpu_count()) as threads:
                list(threads.map(lambda part: self._measure(points, normals, part, found), parts))
        return found

    def _measure(self, points: Floats, normals: Floats, part: Ints, found: Heights) -> None:
        height, piece, parameter = np.empty(len(part)), np.empty(len(part), dtype=np.int64), np.empty(len(part))
        bins = self.bins
        heights = fast_heights if self.is_compiled else probe_pure.heights
        heights(
            points[part],
            normals[part],
            (self.strands.chords, self.strands.firsts, self.chords, self.sweep.coefficients, bins.items),
            bins.starts,
            (bins.x0_mm, bins.y0_mm, bins.cell_mm, *bins.shape),
            (self.tool.corner_mm, self.tool.flat_mm) if self.tool.flat_mm > 0 else (self.tool.corner_mm,),
            self.reach_mm,
            self.margin_mm,
            height,
            piece,
            parameter,
        )
        found.height_mm[part], found.piece[part], found.parameter[part] = height, piece, parameter

    def centres(self, found: Heights) -> Floats:
        """Where the tool's reference stood when it cut each probe, (n, 3), mm; any point where none did."""
        if not len(self.sweep.coefficients):
            return np.zeros((len(found.piece), 3))
        powers = found.parameter[:, None] ** np.arange(4)
        return np.asarray(np.einsum("nk,nkx->nx", powers, self.sweep.coefficients[found.piece]))

    def spokes(self, found: Heights, points: Floats) -> Floats:
        """Vectors (n, 3) square to the cutter's skin where it cut each probe, `points` (n, 3) being the places cut."""
        away = points - self.centres(found)
        corner_mm, flat_mm = self.tool.corner_mm, self.tool.flat_mm
        if flat_mm == 0:
            return away
        rho = np.linalg.norm(away[:, :2], axis=1)
        out, down = np.maximum(rho - flat_mm, 0.0), np.minimum(away[:, 2], 0.0)
        if corner_mm == 0:
            is_floor = away[:, 2] < 1e-9
            out, down = np.where(is_floor, 0.0, 1.0), np.where(is_floor, -1.0, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            level = np.where(out > 0, out / rho, 0.0)
            return np.column_stack([level[:, None] * away[:, :2], down])


def probes_of(sweep: Sweep, tool: Tool, *, reach_mm: float) -> Probes:
    """A sweep with its bins; heights beyond `reach_mm` are not looked for."""
    radius_mm = tool.corner_mm + tool.flat_mm
    margin_mm = radius_mm / 16
    chords = np.concatenate([sweep.coefficients[:, 0], sweep.ends - sweep.coefficients[:, 0], sweep.sag_mm[:, None]], 1)
    strands = strands_of(sweep, sag_mm=radius_mm / 100, length_mm=radius_mm / 2)
    bins = bins_of(strands, reach_mm=radius_mm + margin_mm, cell_mm=radius_mm / 2)
    return Probes(sweep, np.ascontiguousarray(chords), strands, bins, tool, reach_mm, margin_mm)
