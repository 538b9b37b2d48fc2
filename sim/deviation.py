"""The verdict: what the cutter left and took, compared with the design.

Deviation is the height along the nominal normal at which the material ends: + material left, - gouge. What counts as
scallop, as gouge and as covered stands in `sim/MODEL.md`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.access import accessible
from sim.grid import Net, net_of
from sim.interpreter.canon import Motion
from sim.nominal import Nominal
from sim.probe import Heights, Probes, probes_of
from sim.refine import Extremes, Refiner
from sim.seeds import cusp_seeds, pit_seeds
from sim.sweep import sweep_of
from sim.tool import Tool

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class PatchMap:
    """Deviation over one patch: what the probes of its net found; `motions` (k,) is the motion of every piece.

    `is_accessible` (n, m) says which probes the cutter can touch without cutting the design elsewhere.
    """

    net: Net
    found: Heights
    motions: Ints
    is_accessible: Flags

    @property
    def height_mm(self) -> Floats:
        """(n, m): + material left, - gouge, inf where the cutter did not come within reach."""
        return self.found.height_mm.reshape(self.net.area_mm2.shape)

    @property
    def motion(self) -> Ints:
        """(n, m): index of the motion that cut there; -1 where not reached."""
        owners = self.motions[self.found.piece] if len(self.motions) else np.full_like(self.found.piece, -1)
        return np.where(self.found.piece >= 0, owners, -1).reshape(self.net.area_mm2.shape)

    @property
    def is_covered(self) -> Flags:
        """(n, m): whether the cutter came within the reach asked for."""
        return np.isfinite(self.height_mm)


@dataclass(frozen=True, slots=True)
class Place:
    """One place of the part: deviation there, and the block that cut it."""

    deviation_mm: float
    position_mm: tuple[float, float, float]
    patch: int
    uv: tuple[float, float]
    line: int
    block: int | None


@dataclass(frozen=True, slots=True)
class Verdict:
    """All that was measured; `scallops` and `gouges` are the worst places, worst first."""

    maps: tuple[PatchMap, ...]
    scallops: tuple[Place, ...]
    gouges: tuple[Place, ...]
    coverage: float
    inaccessible: float
    reach_mm: float
    probe_pitch_mm: float
    probes: Probes

    @property
    def scallop_mm(self) -> float:
        """Highest summit of material left, mm, at least 0."""
        return max([0.0, *(place.deviation_mm for place in self.scallops)])

    @property
    def gouge_mm(self) -> float:
        """Deepest cut below the design, mm, at least 0."""
        return max([0.0, *(-place.deviation_mm for place in self.gouges)])

    @property
    def scale_mm(self) -> float:
        """What the colours of a picture span to either side: scallop or gouge, at least 1 um."""
        return max(self.scallop_mm, self.gouge_mm, 1e-3)

    def report(self, worst: int = 10) -> dict[str, Any]:
        """The keys of a `simulate` report that come from measuring; lengths mm."""
        heights, areas = _covered(self.maps)
        largest = max([self.scallop_mm, *heights[-1:]]) if len(heights) else None
        return {
            "scallop_mm": self.scallop_mm,
            "gouge_mm": self.gouge_mm,
            "deviation_mm": {
                "max": largest,
                "mean": float(np.average(heights, weights=areas)) if len(heights) else None,
                "p95": _quantile(heights, areas, 0.95) if len(heights) else None,
            },
            "coverage": self.coverage,
            "inaccessible": self.inaccessible,
            "probe_pitch_mm": self.probe_pitch_mm,
            "probes": sum(each.height_mm.size for each in self.maps),
            "reach_mm": self.reach_mm,
            "worst_scallops": [_row(place) for place in self.scallops[:worst]],
            "worst_gouges": [_row(place) for place in self.gouges[:worst]],
        }


def judge(
    nominal: Nominal,
    tool: Tool,
    motions: Sequence[Motion],
    *,
    reference: str,
    probe_pitch_mm: float,
    reach_mm: float | None = None,
) -> Verdict:
    """Measure what these motions leave of the nominal surface.

    `reference` says what a programmed point is: "tip", or "centre" of ball or corner. A probe is covered when less than
    `reach_mm` (a quarter of the tool's radius unless given) of material stands on it.
    """
    radius_mm = tool.corner_mm + tool.flat_mm
    reach_mm = radius_mm / 4 if reach_mm is None else reach_mm
    lift_mm = tool.corner_mm if reference == "tip" else 0.0
    sweep = sweep_of(motions, lift_mm, sag_mm=radius_mm / 800, length_mm=radius_mm / 3, fit_mm=1e-7)
    probes = probes_of(sweep, tool, reach_mm=reach_mm)
    nets = [net_of(patch, probe_pitch_mm) for patch in nominal.patches]
    free = accessible(nets, tool, 1e-6)
    maps = tuple(_map(net, probes, is_free) for net, is_free in zip(nets, free, strict=True))
    touched = range(len(maps)) if len(sweep.motion) else ()
    scallops = [place for index in touched for place in _scallops(index, maps[index], probes, motions)]
    gouges = [place for index in touched for place in _gouges(index, maps[index], probes, motions)]
    whole = sum(float(each.net.area_mm2.sum()) for each in maps)
    open_area = sum(float(each.net.area_mm2[each.is_accessible].sum()) for each in maps)
    covered = sum(float(each.net.area_mm2[each.is_accessible & each.is_covered].sum()) for each in maps)
    return Verdict(
        maps=maps,
        scallops=_apart(scallops, radius_mm / 4),
        gouges=_apart(gouges, radius_mm / 4),
        coverage=covered / open_area if open_area > 0 else 0.0,
        inaccessible=1.0 - open_area / whole,
        reach_mm=reach_mm,
        probe_pitch_mm=probe_pitch_mm,
        probes=probes,
    )


def _map(net: Net, probes: Probes, is_accessible: Flags) -> PatchMap:
    found = probes.measure(net.points.reshape(-1, 3), net.normals.reshape(-1, 3))
    return PatchMap(net, found, probes.sweep.motion, is_accessible)


def _scallops(index: int, mapped: PatchMap, probes: Probes, motions: Sequence[Motion]) -> list[Place]:
    """Summits of material left on one patch, followed to their exact place."""
    refiner, pitch_mm = Refiner(mapped.net.patch, probes, 1.0), mapped.net.pitch_mm
    seeds = cusp_seeds(mapped.net, mapped.found, probes, mapped.is_accessible, 2000)
    first = refiner.crossed(seeds.uv, pitch_mm)
    order = np.argsort(-np.where(np.isfinite(first.found.height_mm), first.found.height_mm, -np.inf))
    best = refiner.climbed(first.uv[order[:100]], step_mm=1.5 * pitch_mm, stop_mm=pitch_mm / 50, trials=40)
    i, j = mapped.net.nearest(best.uv)
    return [
        place
        for place, is_open in zip(_places(index, best, probes, motions), mapped.is_accessible[i, j], strict=True)
        if is_open and 0 < place.deviation_mm < probes.reach_mm
    ]


def _gouges(index: int, mapped: PatchMap, probes: Probes, motions: Sequence[Motion]) -> list[Place]:
    """Pits of one patch, followed to their exact floor."""
    refiner, pitch_mm = Refiner(mapped.net.patch, probes, -1.0), mapped.net.pitch_mm
    seeds = pit_seeds(mapped.net, mapped.found, probes, 100)
    best = refiner.climbed(seeds.uv, step_mm=pitch_mm, stop_mm=pitch_mm / 50, trials=40)
    return [place for place in _places(index, best, probes, motions) if place.deviation_mm < 0]


def _places(index: int, extremes: Extremes, probes: Probes, motions: Sequence[Motion]) -> list[Place]:
    """The extremes as places; one that the cutter did not reach has deviation inf and line 0."""
    places = []
    for k, height in enumerate(extremes.found.height_mm):
        piece = extremes.found.piece[k]
        motion = motions[probes.sweep.motion[piece]] if piece >= 0 else None
        x, y, z = (float(value) for value in extremes.points[k])
        u, v = (float(value) for value in extremes.uv[k])
        line, block = (motion.line, motion.block) if motion is not None else (0, None)
        places.append(Place(float(height), (x, y, z), index, (u, v), line, block))
    return places


def _apart(places: list[Place], distance_mm: float) -> tuple[Place, ...]:
    """Places in order of their size, leaving out those nearer than `distance_mm` to a greater one."""
    kept: list[Place] = []
    for place in sorted(places, key=lambda each: -abs(each.deviation_mm)):
        if all(math.dist(place.position_mm, other.position_mm) >= distance_mm for other in kept):
            kept.append(place)
    return tuple(kept)


def _covered(maps: Sequence[PatchMap]) -> tuple[Floats, Floats]:
    """Heights of all covered probes, rising, with the area of each."""
    heights = np.concatenate([each.height_mm[each.is_covered] for each in maps])
    areas = np.concatenate([each.net.area_mm2[each.is_covered] for each in maps])
    order = np.argsort(heights)
    return heights[order], areas[order]


def _quantile(heights: Floats, areas: Floats, share: float) -> float:
    """The height that this share of the area does not exceed."""
    return float(heights[np.searchsorted(np.cumsum(areas), share * areas.sum())])


def _row(place: Place) -> dict[str, Any]:
    return {
        "deviation_mm": place.deviation_mm,
        "position_mm": list(place.position_mm),
        "patch": place.patch,
        "uv": list(place.uv),
        "line": place.line,
        "block": place.block,
    }
