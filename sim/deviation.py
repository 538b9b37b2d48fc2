"""The verdict: what the cutter left and took, compared with the design.

Deviation is the height along the nominal normal at which the material ends: + material left, - gouge. What counts as
scallop, as gouge and as covered stands in `sim/MODEL.md`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.grid import Net, net_of
from sim.interpreter.canon import Motion
from sim.nominal import Nominal
from sim.probe import Probes, probes_of
from sim.sweep import sweep_of
from sim.tool import Tool

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class PatchMap:
    """Deviation over one patch: height_mm (n, m), inf where not reached; motion (n, m), -1 there."""

    net: Net
    height_mm: Floats
    motion: Ints

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
    reach_mm: float
    probe_pitch_mm: float

    @property
    def scallop_mm(self) -> float:
        """Highest summit of material left, mm, at least 0."""
        return max([0.0, *(place.deviation_mm for place in self.scallops)])

    @property
    def gouge_mm(self) -> float:
        """Deepest cut below the design, mm, at least 0."""
        return max([0.0, *(-place.deviation_mm for place in self.gouges)])

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

    `reference` says what a programmed point is: "tip" or "centre" of the ball. A probe is covered when less than
    `reach_mm` (a quarter of the tool's radius unless given) of material stands on it.
    """
    radius_mm = tool.corner_mm + tool.flat_mm
    reach_mm = radius_mm / 4 if reach_mm is None else reach_mm
    lift_mm = tool.corner_mm if reference == "tip" else 0.0
    sweep = sweep_of(motions, lift_mm, sag_mm=radius_mm / 800, length_mm=radius_mm / 3, fit_mm=1e-7)
    probes = probes_of(sweep, tool, reach_mm=reach_mm)
    maps = tuple(_map(net_of(patch, probe_pitch_mm), probes) for patch in nominal.patches)
    scallops = [place for index, each in enumerate(maps) for place in _places(index, each, motions, 1)]
    gouges = [place for index, each in enumerate(maps) for place in _places(index, each, motions, -1)]
    scallops.sort(key=lambda place: -place.deviation_mm)
    gouges.sort(key=lambda place: place.deviation_mm)
    whole = sum(float(each.net.area_mm2.sum()) for each in maps)
    covered = sum(float(each.net.area_mm2[each.is_covered].sum()) for each in maps)
    return Verdict(maps, tuple(scallops), tuple(gouges), covered / whole, reach_mm, probe_pitch_mm)


def _map(net: Net, probes: Probes) -> PatchMap:
    found = probes.measure(net.points.reshape(-1, 3), net.normals.reshape(-1, 3))
    shape = net.area_mm2.shape
    motion = np.where(found.piece >= 0, probes.sweep.motion[found.piece], -1)
    return PatchMap(net, found.height_mm.reshape(shape), motion.reshape(shape))


def _places(index: int, mapped: PatchMap, motions: Sequence[Motion], sign: int) -> list[Place]:
    """Summits (sign 1) or pits (sign -1) of the probed heights, one for each place no neighbour exceeds."""
    heights = sign * mapped.height_mm
    at = np.argwhere(_summits(heights) & (heights > 0) & np.isfinite(heights))
    places = []
    for i, j in at:
        motion = motions[mapped.motion[i, j]]
        point = mapped.net.points[i, j]
        places.append(
            Place(
                float(mapped.height_mm[i, j]),
                (float(point[0]), float(point[1]), float(point[2])),
                index,
                (float(mapped.net.u[i]), float(mapped.net.v[j])),
                motion.line,
                motion.block,
            )
        )
    return places


def _summits(heights: Floats) -> Flags:
    """(n, m): whether no neighbour is higher; the border has no neighbours outside."""
    padded = np.pad(heights, 1, constant_values=-np.inf)
    n, m = heights.shape
    found = np.ones((n, m), dtype=bool)
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2)):
        found &= heights >= padded[i : i + n, j : j + m]
    return found


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
