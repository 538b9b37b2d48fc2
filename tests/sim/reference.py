"""A second solver for the probes, slow and independent: the tool at rest by roots of polynomials, its way sampled.

The tool is the union of two upright half-cylinders and the torus (or ball) between them. A ray enters and leaves each
in closed form. The places of the tool come from the definition of every canonical motion, many at first, then ever more
closely about the one that cuts lowest. Nothing here comes from `sim.sweep`, `sim.blunt` or the probes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Arc, Motion, Polynomial
from sim.tool import Tool

Floats = NDArray[np.float64]

_SHARES = np.linspace(0.0, 1.0, 601)


def places(motion: Motion, s: Floats) -> Floats:
    """The programmed point, (n, 3), at shares s (n,) of a motion, straight from the definition of its command."""
    s = s[:, None]
    start, end = np.array(motion.start), np.array(motion.end)
    if isinstance(motion, Polynomial):
        top = sum(np.array(c) * (s * motion.length) ** k for k, c in enumerate(motion.coefficients))
        return np.asarray(top / sum(d * (s * motion.length) ** k for k, d in enumerate(motion.denominator)))
    if isinstance(motion, Arc):
        centre, axis = np.array(motion.centre), np.array(motion.axis)
        spoke, angle = start - centre, s * motion.sweep_rad
        rise = np.dot(end - start, axis)
        return np.asarray(centre + np.cos(angle) * spoke + np.sin(angle) * np.cross(axis, spoke) + s * rise * axis)
    return np.asarray(start + s * (end - start))


def height(point: Floats, normal: Floats, motions: Sequence[Motion], tool: Tool, lift_mm: float) -> float:
    """Height at which the material ends along one ray; inf where the tool cuts nothing of it."""
    ray = _Ray(point, normal, tool, lift_mm)
    seen = np.array([ray.stretch(places(motion, _SHARES)) for motion in motions])
    enter, leave = seen[:, 0], seen[:, 1]
    if not ((enter <= 0) & (leave >= 0)).any():
        return _lowest(ray, motions, np.where(enter > 0, enter, np.inf))
    with np.errstate(invalid="ignore"):
        steps = np.nan_to_num(np.abs(np.diff(enter, axis=1)), posinf=0.0)
    step = np.pad(steps, ((0, 0), (0, 1))) + np.pad(steps, ((0, 0), (1, 0)))
    reached, before = 0.0, 1.0
    while reached < before - 1e-12:
        goes_on = (enter <= reached + 1e-12) & (leave > reached - step)
        reached, before = min(reached, _lowest(ray, motions, np.where(goes_on, enter, np.inf))), reached
    return reached


def _lowest(ray: _Ray, motions: Sequence[Motion], enter: Floats) -> float:
    """The lowest entry, from the samples of all motions: each that no neighbour is below is looked at closely."""
    beside = np.pad(enter, ((0, 0), (1, 1)), constant_values=np.inf)
    is_low = np.isfinite(enter) & (enter < beside[:, :-2]) & (enter <= beside[:, 2:]) & (enter < enter.min() + 0.2)
    return min((ray.refined(motions[i], k) for i, k in np.argwhere(is_low)), default=np.inf)


class _Ray:
    def __init__(self, point: Floats, normal: Floats, tool: Tool, lift_mm: float) -> None:
        self.point, self.n, self.corner, self.flat = point - (0.0, 0.0, lift_mm), normal, tool.corner_mm, tool.flat_mm

    def refined(self, motion: Motion, k: int) -> float:
        """The lowest entry near one sample, by sampling ever more closely about the lowest."""
        low, high = _SHARES[max(0, k - 1)], _SHARES[min(len(_SHARES) - 1, k + 1)]
        for _ in range(8):
            near = np.linspace(low, high, 21)
            enter = self.stretch(places(motion, near))[0]
            best = int(np.argmin(enter))
            low, high = near[max(0, best - 1)], near[min(20, best + 1)]
        return float(enter[best])

    def stretch(self, centres: Floats) -> tuple[Floats, Floats]:
        """(enter, leave), each (n,): where the line is in the tool at each place; (inf, -inf) where it misses."""
        q = self.point - centres
        ends = [self._cylinder(q, self.corner + self.flat, 0.0)]
        if self.flat > 0:
            ends.append(self._cylinder(q, self.flat, -self.corner))
        if self.corner > 0:
            ends.append(self._edge(q))
        return np.min([each[0] for each in ends], axis=0), np.max([each[1] for each in ends], axis=0)

    def _cylinder(self, q: Floats, radius: float, floor: float) -> tuple[Floats, Floats]:
        """The upright half-cylinder above z = floor."""
        a, b = self.n[0] ** 2 + self.n[1] ** 2, q[:, 0] * self.n[0] + q[:, 1] * self.n[1]
        outside = q[:, 0] ** 2 + q[:, 1] ** 2 - radius**2
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.sqrt(b * b - a * outside)
            low = np.where(a > 0, (-b - root) / a, np.where(outside <= 0, -np.inf, np.inf))
            high = np.where(a > 0, (-b + root) / a, np.where(outside <= 0, np.inf, -np.inf))
            if self.n[2] > 0:
                low = np.maximum(low, (floor - q[:, 2]) / self.n[2])
        misses = ~(low <= high)
        return np.where(misses, np.inf, low), np.where(misses, -np.inf, high)

    def _edge(self, q: Floats) -> tuple[Floats, Floats]:
        """The torus about the rim of the flat end (the ball, where there is none): roots of a polynomial."""
        b, square = q @ self.n, np.einsum("ij,ij->i", q, q)
        if self.flat == 0:
            with np.errstate(invalid="ignore"):
                root = np.sqrt(b * b - square + self.corner**2)
            return np.where(np.isnan(root), np.inf, -b - root), np.where(np.isnan(root), -np.inf, -b + root)
        c, f2 = square + self.flat**2 - self.corner**2, 4 * self.flat**2
        n2, qn = self.n[0] ** 2 + self.n[1] ** 2, q[:, 0] * self.n[0] + q[:, 1] * self.n[1]
        terms = [
            4 * b,
            4 * b * b + 2 * c - f2 * n2,
            4 * b * c - 2 * f2 * qn,
            c * c - f2 * (q[:, 0] ** 2 + q[:, 1] ** 2),
        ]
        companion = np.zeros((len(q), 4, 4))
        companion[:, 0, :] = -np.stack(terms, axis=1)
        companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
        roots = np.linalg.eigvals(companion)
        real = np.where(np.abs(roots.imag) < 1e-7, roots.real, np.nan)
        return np.nanmin(np.where(np.isnan(real), np.inf, real), axis=1), np.nanmax(
            np.where(np.isnan(real), -np.inf, real), axis=1
        )
