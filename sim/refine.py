"""Exact places of extremes: a ridge followed to its summit, a groove to its floor.

Two directions serve at every place, along the way of the cutter that was there and across it. Across, the height has
one peak (a cusp where two passes meet), found from heights and slopes; the height of that peak changes smoothly along,
and is followed uphill by steps that grow while they gain and are halved when they do not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.nominal_patch import NominalPatch
from sim.probe import Heights, Probes

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Extremes:
    """n places on one patch: uv (n, 2), points (n, 3), mm, and what the probe found there."""

    uv: Floats
    points: Floats
    found: Heights


@dataclass(frozen=True, slots=True)
class Refiner:
    """Searches one patch; sign 1 looks for summits of material left, sign -1 for floors of gouges."""

    patch: NominalPatch
    probes: Probes
    sign: float

    def measured(self, uv: Floats) -> Extremes:
        """Probes at parameters (n, 2), brought into the patch."""
        frames = self.patch.frames(uv)
        return Extremes(self.patch.clipped(uv), frames.points, self.probes.measure(frames.points, frames.normals))

    def directions(self, uv: Floats) -> tuple[Floats, Floats]:
        """Changes of (u, v), each (n, 2), for 1 mm along the way of the cutter at a place, and across it."""
        frames = self.patch.frames(uv)
        found = self.probes.measure(frames.points, frames.normals)
        way = self.probes.chords[found.piece, 3:6]
        way = way - np.einsum("ij,ij->i", way, frames.normals)[:, None] * frames.normals
        length = np.linalg.norm(way, axis=1)
        fallback = frames.along_u / np.linalg.norm(frames.along_u, axis=1)[:, None]
        along = np.where((length > 1e-9)[:, None], way / np.where(length > 1e-9, length, 1.0)[:, None], fallback)
        return frames.parameters_of(along), frames.parameters_of(np.cross(frames.normals, along))

    def crossed(self, uv: Floats, window_mm: float) -> Extremes:
        """Each place moved across the way of the cutter to the peak within the window to either side."""
        _, across = self.directions(uv)
        return self.measured(self._peak(uv, across, np.full(len(uv), window_mm))[0])

    def climbed(self, uv: Floats, *, step_mm: float, stop_mm: float, trials: int) -> Extremes:
        """Each place followed along its ridge, in steps from `step_mm` until a step of `stop_mm` gains nothing.

        The peak across is looked for within `step_mm` to either side; at most `trials` steps are tried.
        """
        width = np.full(len(uv), step_mm)
        along, across = self.directions(uv)
        uv, value = self._peak(uv, across, width)
        step = width.copy()
        active = np.arange(len(uv))
        for _ in range(trials):
            here = active
            along, across = self.directions(uv[here])
            ahead, behind = (uv[here] + sign * step[here, None] * along for sign in (1.0, -1.0))
            tried, gain = self._peak(np.concatenate([ahead, behind]), np.tile(across, (2, 1)), np.tile(width[here], 2))
            is_ahead = gain[: len(here)] >= gain[len(here) :]
            best = np.where(is_ahead, gain[: len(here)], gain[len(here) :])
            is_better = best > value[here]
            moved = here[is_better]
            uv[moved] = np.where(is_ahead[:, None], tried[: len(here)], tried[len(here) :])[is_better]
            value[moved] = best[is_better]
            step[here] *= np.where(is_better, 1.5, 0.4)
            active = here[(step[here] > stop_mm) & np.isfinite(value[here])]
            if not len(active):
                break
        return self.measured(uv)

    def _peak(self, uv: Floats, across: Floats, width: Floats) -> tuple[Floats, Floats]:
        """(places, signed heights) of the peak of each line uv + x across that is nearest uphill, |x| <= width.

        Where the slope turns nowhere between, it is the higher end.
        """
        at, slope = self._slopes(uv, across)
        rises = slope >= 0
        outer = np.where(rises, width, -width)
        at_outer, slope_outer = self._slopes(uv + outer[:, None] * across, across)
        best, top = np.where(at_outer > at, outer, 0.0), np.fmax(at, at_outer)
        for _ in range(6):
            k = np.flatnonzero(~_is_turned(rises, slope_outer) & (top < np.inf))
            if not len(k):
                break
            outer[k] /= 4
            at_outer[k], slope_outer[k] = self._slopes(uv[k] + outer[k, None] * across[k], across[k])
        is_open = _is_turned(rises, slope_outer) & (slope != 0) & np.isfinite(at + at_outer)
        zero = np.zeros(len(uv))
        low, high = np.where(rises, zero, outer), np.where(rises, outer, zero)
        at_low, at_high = np.where(rises, at, at_outer), np.where(rises, at_outer, at)
        slope_low, slope_high = np.where(rises, slope, slope_outer), np.where(rises, slope_outer, slope)
        for turn in range(16):
            k = np.flatnonzero(is_open & (high - low > 1e-7))
            if not len(k):
                break
            x = 0.5 * (low[k] + high[k])
            if turn % 2 == 0:
                x = self._predicted(low[k], high[k], at_low[k], at_high[k], slope_low[k], slope_high[k])
            at, slope = self._slopes(uv[k] + x[:, None] * across[k], across[k])
            is_higher = at > top[k]
            best[k[is_higher]], top[k[is_higher]] = x[is_higher], at[is_higher]
            up, down = k[slope > 0], k[slope <= 0]
            low[up], at_low[up], slope_low[up] = x[slope > 0], at[slope > 0], slope[slope > 0]
            high[down], at_high[down], slope_high[down] = x[slope <= 0], at[slope <= 0], slope[slope <= 0]
        return self.patch.clipped(uv + best[:, None] * across), top

    def _predicted(
        self, low: Floats, high: Floats, at_low: Floats, at_high: Floats, slope_low: Floats, slope_high: Floats
    ) -> Floats:
        """Where the peak must be: two cuts of the cutter's bend meet in a cusp, else the slope falls evenly to zero.

        What a sharp edge cuts is straight on both sides of a cusp or of a groove.
        """
        tool, length = self.probes.tool, high - low
        bend = self.sign / (tool.corner_mm + tool.flat_mm) if tool.corner_mm > 0 else 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            cusp = (at_low - at_high + slope_high * length - bend * length**2 / 2) / (
                slope_high - slope_low - bend * length
            )
        even = slope_low / (slope_low - slope_high) * length
        is_cusp = (cusp > 0) & (cusp < length) & ((self.sign > 0) | (tool.corner_mm == 0))
        return np.asarray(low + np.where(is_cusp, cusp, even))

    def _slopes(self, uv: Floats, across: Floats) -> tuple[Floats, Floats]:
        """Signed heights at places, and their change for each mm along `across`, from the cutter's skin there."""
        frames = self.patch.frames(uv)
        found = self.probes.measure(frames.points, frames.normals)
        with np.errstate(invalid="ignore"):
            cut = frames.points + found.height_mm[:, None] * frames.normals
            spoke = self.probes.spokes(found, cut)
            toward = across[:, :1] * frames.along_u + across[:, 1:] * frames.along_v
            slope = -np.einsum("ij,ij->i", spoke, toward) / np.einsum("ij,ij->i", spoke, frames.normals)
        return self.sign * found.height_mm, np.asarray(self.sign * slope)


def _is_turned(rises: Flags, slope: Floats) -> Flags:
    """Whether a slope goes the other way than the one that rose, or fell, at the begin."""
    return np.asarray(np.where(rises, slope < 0, slope > 0))
