"""Where the probes stand: a net over each patch, no step longer than the pitch, with the area each probe speaks for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.errors import InputRejected
from sim.nominal_patch import Frames, NominalPatch

Floats = NDArray[np.float64]
MOST_PROBES = 20_000_000


@dataclass(frozen=True, slots=True)
class Net:
    """Probes of one patch: u (n,), v (m,); points and normals (n, m, 3), mm; area_mm2 (n, m).

    `frames` has the same in rows (n m, 3), with tangents.
    """

    patch: NominalPatch
    pitch_mm: float
    u: Floats
    v: Floats
    points: Floats
    normals: Floats
    area_mm2: Floats
    frames: Frames

    def nearest(self, uv: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Row and column of the node nearest to each of the parameters (n, 2)."""
        rows, columns = (
            np.searchsorted((nodes[1:] + nodes[:-1]) / 2, values)
            for nodes, values in ((self.u, uv[:, 0]), (self.v, uv[:, 1]))
        )
        return rows, columns


def net_of(patch: NominalPatch, pitch_mm: float) -> Net:
    """The net of a patch: nodes so dense that no step along u or v is longer than `pitch_mm`, borders included.

    Raises InputRejected for more probes than fit into memory.
    """
    u, v = _divided(patch, pitch_mm)
    fine = patch.grid_frames(u, v)
    shape = (len(u), len(v))
    weights = np.outer(_widths(u), _widths(v))
    return Net(
        patch,
        pitch_mm,
        u,
        v,
        fine.points.reshape(*shape, 3),
        fine.normals.reshape(*shape, 3),
        fine.areas.reshape(shape) * weights,
        fine,
    )


def check_pitch(patches: Iterable[NominalPatch], pitch_mm: float, diameter_mm: float) -> None:
    """Raises InputRejected, as `net_of` does, before anything is cut that could not be measured then.

    Probes farther apart than the cutter is wide step over whole ridges, and over ground that was never cut.
    """
    if pitch_mm > diameter_mm:
        what = (
            f"a probe pitch of {pitch_mm:g} mm is wider than the cutter, {diameter_mm:g} mm: what it leaves is missed"
        )
        raise InputRejected(what, remedy=f"give a smaller pitch, such as {diameter_mm / 80:g}")
    for patch in patches:
        _divided(patch, pitch_mm)


def _divided(patch: NominalPatch, pitch_mm: float) -> tuple[Floats, Floats]:
    """Nodes along u and v."""
    (u0, u1), (v0, v1) = patch.domain
    frames = patch.grid_frames(np.linspace(u0, u1, 65), np.linspace(v0, v1, 65))
    speed_u = np.linalg.norm(frames.along_u, axis=1).reshape(65, 65).max(axis=1)
    speed_v = np.linalg.norm(frames.along_v, axis=1).reshape(65, 65).max(axis=0)
    u, v = _nodes(u0, u1, speed_u, pitch_mm), _nodes(v0, v1, speed_v, pitch_mm)
    if len(u) * len(v) > MOST_PROBES:
        what = f"a probe pitch of {pitch_mm:g} mm takes {len(u) * len(v):,} probes, and {MOST_PROBES:,} are the most"
        raise InputRejected(what, remedy="give a larger pitch")
    return u, v


def _nodes(begin: float, end: float, speed: Floats, pitch_mm: float) -> Floats:
    """Parameters at equal steps of the longest isoparametric curve's length, by the trapezoidal rule on its speed."""
    at = np.linspace(begin, end, len(speed))
    length = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(at))])
    count = max(2, int(np.ceil(length[-1] / pitch_mm)) + 1)
    return np.asarray(np.interp(np.linspace(0.0, length[-1], count), length, at))


def _widths(nodes: Floats) -> Floats:
    """The interval of the parameter that each node speaks for."""
    steps = np.diff(nodes)
    return np.asarray((np.concatenate([steps, [0.0]]) + np.concatenate([[0.0], steps])) / 2)
