"""A patch with its edge: beyond the border the ball rolls over the edge, as over a wire, instead of going on.

There the contact stays on the border while the normal swings outward across it; past a corner it swings across both
sides. The ball centres so found join those over the patch with one tangent plane. EQUATIONS.md, section 8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.path.border import Domain
from planner.path.offset import OffsetPoints, OffsetSurface, cross_product, dot
from planner.path.seeds import mean_speed

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

STEEPEST_SINE = 0.999


@dataclass(frozen=True, slots=True)
class RolledSurface(OffsetSurface):
    """Ball centres over a patch and around its border; parameters beyond the patch's are swings about the edge.

    Over a whole swing the sine of the normal's tilt across the edge grows to `swing`, or where the patch's own normal
    leans outward by nearly as much, as far as there is room up to 1, (20). A swing takes `widths` of the parameters
    beyond the patch's. `facing` is the least cosine between the patch's normal at the edge and where its swing ends.
    """

    swing: float = 0.0
    widths: tuple[float, float] = (1.0, 1.0)
    facing: float = 1.0

    @property
    def rim(self) -> Domain:
        """The domain with whole swings about its edges."""
        (u_low, u_high), (v_low, v_high) = self.patch.domain
        return (u_low - self.widths[0], u_high + self.widths[0]), (v_low - self.widths[1], v_high + self.widths[1])

    def evaluate(self, u: Array, v: Array) -> OffsetPoints:
        """Centres, contacts and first derivatives at parameters u, v (m,): (4) on the patch, (19) to (22) beyond it."""
        low, high = (np.array(end)[:, None] for end in zip(*self.patch.domain, strict=True))
        at = np.stack([u, v])
        on_patch = np.clip(at, low, high)
        found = OffsetSurface.evaluate(self, on_patch[0], on_patch[1])
        past = (at - on_patch) / np.array(self.widths)[:, None]
        is_past = past != 0
        for axis in (0, 1):
            beside = np.flatnonzero(is_past[axis] & ~is_past[1 - axis])
            if len(beside):
                self._beside(found, axis, on_patch[:, beside], past[axis, beside], beside)
        corners = np.flatnonzero(is_past.all(axis=0))
        if len(corners):
            self._at_corners(found, on_patch[:, corners], past[:, corners], corners)
        return found

    def _beside(self, found: OffsetPoints, axis: int, edge: Array, past: Array, chosen: Indices) -> None:
        """Renew points past one edge, at places (2, k) of it and shares (k,) of a swing, below 0 at the low end."""
        swung = _swing_over(self, edge, axis, past)
        turns = (swung.across / self.widths[axis], swung.along)
        _put(self, found, chosen, swung.normal, turns if axis == 0 else turns[::-1], axis)

    def _at_corners(self, found: OffsetPoints, corner: Array, past: Array, chosen: Indices) -> None:
        """Renew points past two edges: the normal lies between the swings over both, (22)."""
        over = [_swing_over(self, corner, axis, past[axis]) for axis in (0, 1)]
        total = over[0].normal + over[1].normal - found.normal[:, chosen]
        length = np.sqrt(dot(total, total))
        normal = total / length
        turns = []
        for axis in (0, 1):
            turn = over[axis].across / self.widths[axis]
            turns.append((turn - dot(turn, normal) * normal) / length)
        _put(self, found, chosen, normal, (turns[0], turns[1]), None)


@dataclass(frozen=True, slots=True)
class _Swung:
    """Normals (3, k) swung over an edge and their derivatives: by the share of the swing, and along the edge."""

    normal: Array
    across: Array
    along: Array


def rolled(surface: OffsetSurface, *, out_mm: float) -> RolledSurface:
    """The same ball on the same patch with its edge; whole swings take it about `out_mm` past the edge."""
    patch, reach_mm = surface.patch, surface.radius_mm + surface.stock_mm
    widths = (out_mm / mean_speed(patch, 0), out_mm / mean_speed(patch, 1))
    parts = patch, surface.radius_mm, surface.side, surface.stock_mm
    return RolledSurface(*parts, swing=out_mm / reach_mm, widths=widths)


def _put(
    surface: RolledSurface,
    found: OffsetPoints,
    chosen: Indices,
    normal: Array,
    turns: tuple[Array, Array],
    across: int | None,
) -> None:
    """Write normals, their derivatives by u and v, and the contacts and centres that follow.

    The contact stays on the edge: its derivative by the parameter `across` is 0, by both (None) at a corner.
    """
    stock, radius = surface.stock_mm, surface.radius_mm
    for axis, name in enumerate("uv"):
        contact_by = getattr(found, f"contact_{name}")
        on_edge = contact_by[:, chosen] - stock * getattr(found, f"normal_{name}")[:, chosen]
        if across is None or across == axis:
            on_edge = np.zeros_like(on_edge)
        contact_by[:, chosen] = on_edge + stock * turns[axis]
        getattr(found, f"centre_{name}")[:, chosen] = on_edge + (stock + radius) * turns[axis]
        getattr(found, f"normal_{name}")[:, chosen] = turns[axis]
    edge = found.contact[:, chosen] - stock * found.normal[:, chosen]
    found.contact[:, chosen] = edge + stock * normal
    found.centre[:, chosen] = edge + (stock + radius) * normal
    found.normal[:, chosen] = normal


def _swing_over(surface: RolledSurface, edge: Array, axis: int, past: Array) -> _Swung:
    """Normals over an edge where parameter `axis` ends, at places (2, k) of it and signed shares (k,), (19) to (21)."""
    ground = surface.patch.evaluate(edge[0], edge[1])
    still = OffsetSurface.evaluate(surface, edge[0], edge[1])
    run, bend = (ground.dv, ground.dvv) if axis == 0 else (ground.du, ground.duu)
    turn = still.normal_v if axis == 0 else still.normal_u
    sign = np.sign(past)
    speed = np.sqrt(dot(run, run))
    tangent = run / speed
    tangent_by = (bend - dot(bend, tangent) * tangent) / speed
    # The direction across the edge that is nearest to the tool axis, and the horizontal one pointing outward.
    lean = -tangent[2] * tangent
    lean[2] += 1
    steep = np.sqrt(dot(lean, lean))
    up = lean / steep
    lean_by = -tangent_by[2] * tangent - tangent[2] * tangent_by
    up_by = (lean_by - dot(lean_by, up) * up) / steep
    outward = sign * surface.side * (1 if axis == 0 else -1)
    out = outward * cross_product(tangent, up)
    out_by = outward * (cross_product(tangent_by, up) + cross_product(tangent, up_by))
    own, own_by = dot(still.normal, out), dot(turn, out) + dot(still.normal, out_by)
    # The swing ends at the sine `swing`, or where the normal leans outward further on by that, but never beyond 1.
    power, lean_out = 1 / surface.swing, np.clip(own, 0.0, 1.0)
    growth = np.where(own < 0, surface.swing - own, surface.swing * (1 - lean_out**power))
    sine = own + np.abs(past) * growth
    sine_by = own_by * (1 - np.abs(past) * np.where(own < 0, 1.0, lean_out ** (power - 1)))
    sine = np.clip(sine, -STEEPEST_SINE, STEEPEST_SINE)
    cosine = np.sqrt(1 - sine**2)
    swing = out - sine / cosine * up
    normal = cosine * up + sine * out
    return _Swung(normal, sign * growth * swing, sine_by * swing + cosine * up_by + sine * out_by)
