"""The border of a patch as a closed ring of samples, dense enough that a pick feed is never stepped over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.path.offset import OffsetPoints, OffsetSurface
from planner.path.scallop import Held
from planner.surface.curvature import span_places

Array = NDArray[np.float64]
Domain = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Border:
    """Ring samples: `parameters` (2, m); the stretch from sample j to j + 1 (the last to 0) runs on one side.

    `held` (m,) says which parameter is fixed there (Held.U or Held.V), `value` (m,) its value. `points` are the
    surface and ball centres at the samples.
    """

    parameters: Array
    held: NDArray[np.intp]
    value: Array
    points: OffsetPoints

    def after(self, samples: NDArray[np.intp]) -> NDArray[np.intp]:
        """The next sample of the ring."""
        return np.asarray((samples + 1) % len(self.value), dtype=np.intp)


def border_of(surface: OffsetSurface, *, spacing_mm: float, domain: Domain | None = None, a_span: int = 6) -> Border:
    """The border sampled so that ball centres (XY) are about `spacing_mm` apart and every span has `a_span` samples.

    `domain`, not smaller than the patch's, asks for the ring about that domain instead.
    """
    patch = surface.patch
    (u_low, u_high), (v_low, v_high) = domain or patch.domain
    u = np.unique(np.concatenate([[u_low], span_places(patch.basis_u, a_span), [u_high]]))
    v = np.unique(np.concatenate([[v_low], span_places(patch.basis_v, a_span), [v_high]]))
    sides = (
        (np.stack([u, np.full_like(u, v_low)]), Held.V, v_low),
        (np.stack([np.full_like(v, u_high), v]), Held.U, u_high),
        (np.stack([u[::-1], np.full_like(u, v_high)]), Held.V, v_high),
        (np.stack([np.full_like(v, u_low), v[::-1]]), Held.U, u_low),
    )
    dense = [_spread(surface, side, spacing_mm) for side, _, _ in sides]
    counts = [side.shape[1] for side in dense]
    parameters = np.concatenate(dense, axis=1)
    held = np.repeat([kind.value for _, kind, _ in sides], counts)
    value = np.repeat([fixed for _, _, fixed in sides], counts)
    return Border(parameters, held, value, surface.evaluate(parameters[0], parameters[1]))


def _spread(surface: OffsetSurface, side: Array, spacing_mm: float) -> Array:
    """A side with each stretch divided until neighbours are near enough; without its last sample (the next corner)."""
    centres = surface.evaluate(side[0], side[1]).centre[:2]
    run = np.linalg.norm(np.diff(centres, axis=1), axis=0)
    parts = np.maximum(np.ceil(run / spacing_mm), 1).astype(np.intp)
    start = np.repeat(np.arange(len(run)), parts)
    share = (np.arange(len(start)) - np.repeat(np.cumsum(parts) - parts, parts)) / np.repeat(parts, parts)
    return np.asarray(side[:, start] + share * (side[:, start + 1] - side[:, start]))
