"""First guesses for Newton: a raster over XY that knows, for every cell, parameters of a ball centre nearby."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.path.offset import OffsetSurface
from planner.surface.curvature import span_places
from planner.surface.patch import NurbsPatch

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Seeds:
    """Sampled ball centres of a surface and its surroundings.

    `parameters` (2, m) with `centres` (2, m), XY mm; `cells` (n_x, n_y) holds for each raster cell the index of a
    sample in or near it; `low` (2, 1) and `cell_mm` (2, 1) place the raster.
    """

    parameters: Array
    centres: Array
    cells: NDArray[np.intp]
    low: Array
    cell_mm: Array

    def near(self, target_xy: Array) -> Array:
        """Parameters (2, k) of samples near these XY places (2, k)."""
        limit = np.array(self.cells.shape)[:, None] - 1
        at = np.clip(((target_xy - self.low) / self.cell_mm).astype(np.intp), 0, limit)
        return self.parameters[:, self.cells[at[0], at[1]]]

    def within(self, domain: tuple[tuple[float, float], tuple[float, float]]) -> Array:
        """The parameters of the samples on the patch itself."""
        (u_low, u_high), (v_low, v_high) = domain
        u, v = self.parameters
        return self.parameters[:, (u >= u_low) & (u <= u_high) & (v >= v_low) & (v <= v_high)]


def sow(surface: OffsetSurface, *, reach_mm: float, a_span: int) -> Seeds:
    """Seeds over the patch and about `reach_mm` beyond its borders, as far as the extended patch stays a surface."""
    patch = surface.patch
    u = _with_reach(span_places(patch.basis_u, a_span), reach_mm / mean_speed(patch, 0))
    v = _with_reach(span_places(patch.basis_v, a_span), reach_mm / mean_speed(patch, 1))
    grid = np.stack([part.ravel() for part in np.meshgrid(u, v, indexing="ij")])
    found = surface.evaluate(grid[0], grid[1])
    turn = found.centre_u[0] * found.centre_v[1] - found.centre_u[1] * found.centre_v[0]
    (u_low, u_high), (v_low, v_high) = patch.domain
    is_inside = (grid[0] >= u_low) & (grid[0] <= u_high) & (grid[1] >= v_low) & (grid[1] <= v_high)
    centres = found.centre[:2]
    inside = centres[:, is_inside]
    past = np.maximum(inside.min(axis=1) - centres.T, centres.T - inside.max(axis=1)).max(axis=1)
    is_near = past <= 2 * reach_mm  # a patch with weights may have poles beyond its border
    is_usable = (surface.side * turn > 0) & (found.normal[2] > 0) & is_near
    grid, centres, is_inside = grid[:, is_usable], centres[:, is_usable], is_inside[is_usable]
    order = np.argsort(is_inside, kind="stable")
    grid, centres = grid[:, order], centres[:, order]
    low = centres.min(axis=1, keepdims=True)
    shape = max(int(np.sqrt(centres.shape[1])), 2)
    cell_mm = np.maximum((centres.max(axis=1, keepdims=True) - low) / shape, np.finfo(np.float64).tiny)
    cells = np.full((shape + 1, shape + 1), -1, dtype=np.intp)
    at = ((centres - low) / cell_mm).astype(np.intp)
    cells[at[0], at[1]] = np.arange(centres.shape[1])
    return Seeds(grid, centres, _filled(cells), low, cell_mm)


def mean_speed(patch: NurbsPatch, axis: int) -> float:
    """Mean length of the derivative along u (0) or v (1), mm a unit of the parameter."""
    u, v = (part.ravel() for part in np.meshgrid(patch.basis_u.starts, patch.basis_v.starts, indexing="ij"))
    found = patch.evaluate(u, v)
    return float(np.mean(np.linalg.norm((found.du, found.dv)[axis], axis=0)))


def _with_reach(places: Array, reach: float) -> Array:
    """Parameter places with the same spacing carried on by `reach` at both ends, at most half the domain."""
    reach = min(reach, 0.5 * float(places[-1] - places[0]))
    steps = np.linspace(reach / 6, reach, 6)
    return np.concatenate([places[0] - steps[::-1], places, places[-1] + steps])


def _filled(cells: NDArray[np.intp]) -> NDArray[np.intp]:
    """Empty cells (-1) take the index of a neighbour, ring by ring."""
    cells = cells.copy()
    for _ in range(sum(cells.shape)):
        if (cells >= 0).all():
            break
        for axis in (0, 1):
            for step in (1, -1):
                moved = np.roll(cells, step, axis=axis)
                edge = (slice(None),) * axis + (0 if step == 1 else -1,)
                moved[edge] = -1
                cells = np.where(cells < 0, moved, cells)
    return cells
