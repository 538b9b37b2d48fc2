"""Curves by arc length: the interpolator's view of arcs and polynomials.

Every shape answers with points and with the first three derivatives by arc length, from which the limits of speed,
acceleration and jerk follow (`sim.motion.limits`). Points lie on the programmed curve exactly; only the place along it
comes from a table, whose speed error is an argument.
"""

from __future__ import annotations

import copy
import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Arc, Line, Motion, Polynomial, Rapid

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


class Shape(Protocol):
    """A curve in space, from 0 to `length_mm` of arc."""

    length_mm: float

    def points(self, arc_mm: Array) -> Array:
        """Points (n, 3), mm, at these arc lengths (n,)."""
        ...

    def derivatives(self, arc_mm: Array) -> tuple[Array, Array, Array]:
        """First, second, third derivative by arc length, each (n, 3): 1, 1/mm, 1/mm2."""
        ...

    def part(self, from_mm: float, to_mm: float) -> Motion:
        """The canonical motion of this stretch."""
        ...


class LineShape:
    """A straight move."""

    def __init__(self, motion: Line | Rapid) -> None:
        self._motion = motion
        self._start = np.array(motion.start)
        step = np.array(motion.end) - self._start
        self.length_mm = float(np.linalg.norm(step))
        self._direction = step / self.length_mm

    def points(self, arc_mm: Array) -> Array:
        """Points (n, 3), mm."""
        return np.asarray(self._start + arc_mm[:, None] * self._direction)

    def derivatives(self, arc_mm: Array) -> tuple[Array, Array, Array]:
        """A constant direction; no curvature."""
        zero = np.zeros((len(arc_mm), 3))
        return zero + self._direction, zero, zero

    def part(self, from_mm: float, to_mm: float) -> Motion:
        """The stretch as the same kind of move."""
        motion, start, end = self._motion, self._motion.start, self._motion.end
        if from_mm > 0.0:
            start = _vector(self._start + from_mm * self._direction)
        if to_mm < self.length_mm:
            end = _vector(self._start + to_mm * self._direction)
        if isinstance(motion, Rapid):
            return Rapid(motion.line, motion.block, start, end)
        return Line(motion.line, motion.block, start, end, motion.feed_mm_min)


class ArcShape:
    """A circular or helical arc; a written end that misses the circle is approached evenly along it."""

    def __init__(self, motion: Arc) -> None:
        self._motion = motion
        start, centre = np.array(motion.start), np.array(motion.centre)
        self._axis = np.array(motion.axis)
        radial = start - centre
        self._base = centre + (radial @ self._axis) * self._axis
        self._e1 = start - self._base
        self._e2 = np.cross(self._axis, self._e1)
        self._radius = float(np.linalg.norm(self._e1))
        self._rise = float((np.array(motion.end) - start) @ self._axis)
        self._sweep = motion.sweep_rad
        self._drift = np.array(motion.end) - self._ideal(np.array([1.0]))[0]
        self.length_mm = math.hypot(self._radius * self._sweep, self._rise)

    def _ideal(self, share: Array) -> Array:
        angle = (share * self._sweep)[:, None]
        return np.asarray(
            self._base
            + np.cos(angle) * self._e1
            + np.sin(angle) * self._e2
            + (share * self._rise)[:, None] * self._axis
        )

    def points(self, arc_mm: Array) -> Array:
        """Points (n, 3), mm."""
        share = arc_mm / self.length_mm
        return np.asarray(self._ideal(share) + share[:, None] * self._drift)

    def derivatives(self, arc_mm: Array) -> tuple[Array, Array, Array]:
        """Of the ideal helix; the drift is a matter of the last digit."""
        rate = self._sweep / self.length_mm
        angle = (arc_mm * rate)[:, None]
        outward = np.cos(angle) * self._e1 + np.sin(angle) * self._e2
        along = np.cos(angle) * self._e2 - np.sin(angle) * self._e1
        first = rate * along + self._rise / self.length_mm * self._axis
        return first, -(rate**2) * outward, -(rate**3) * along

    def part(self, from_mm: float, to_mm: float) -> Motion:
        """The stretch as an arc about the same centre."""
        motion = self._motion
        start, end = self.points(np.array([from_mm, to_mm]))
        return Arc(
            motion.line,
            motion.block,
            motion.start if from_mm <= 0.0 else _vector(start),
            motion.end if to_mm >= self.length_mm else _vector(end),
            motion.centre,
            motion.axis,
            self._sweep * (to_mm - from_mm) / self.length_mm,
            motion.feed_mm_min,
        )


class PolynomialShape:
    """A polynomial or rational curve with a table of its parameter at equal steps of arc length.

    Between entries the parameter is a cubic in arc length that keeps speed at the entries; the table is refined until
    the speed half-way between is within `speed_error` of even.
    """

    def __init__(self, motion: Polynomial, speed_error: float) -> None:
        self.motion = motion
        self._numerator = np.array(motion.coefficients, dtype=float)
        self._denominator = np.array(motion.denominator, dtype=float)
        self._tops = _derivatives(self._numerator, 3)
        self._bottoms = _derivatives(self._denominator[:, None], 3)
        self._is_rational = bool(np.any(self._denominator[1:])) or self._denominator[0] != 1.0
        fine = np.linspace(0.0, motion.length, 65)
        arcs = np.concatenate([[0.0], np.cumsum(self._arc(fine[:-1], fine[1:]))])
        self.length_mm = float(arcs[-1])
        intervals = 8
        while True:
            self._tabulate(fine, arcs, intervals)
            middles = (np.arange(intervals) + 0.5) * self.length_mm / intervals
            if intervals >= 512 or self.length_mm == 0.0 or self._unevenness(middles) <= speed_error:
                return
            intervals *= 2

    def renamed(self, motion: Polynomial) -> PolynomialShape:
        """The same curve for a motion that differs in source and feed only."""
        twin = copy.copy(self)
        twin.motion = motion
        return twin

    def _tabulate(self, fine: Array, arcs: Array, intervals: int) -> None:
        """Parameters and their rates at intervals + 1 equal steps of arc length, by Newton from the fine grid."""
        wanted = np.linspace(0.0, self.length_mm, intervals + 1)
        cell = np.clip(np.searchsorted(arcs, wanted, side="right") - 1, 0, len(fine) - 2)
        span = np.maximum(arcs[cell + 1] - arcs[cell], 1e-300)
        parameter = fine[cell] + (wanted - arcs[cell]) / span * (fine[cell + 1] - fine[cell])
        for _ in range(6):
            error = arcs[cell] + self._arc(fine[cell], parameter) - wanted
            if np.abs(error).max() <= 1e-13 * self.length_mm:
                break
            parameter = np.clip(parameter - error / self._speed(parameter), fine[cell], fine[cell + 1])
        self._parameters, self._rates = parameter, 1.0 / self._speed(parameter)

    def _unevenness(self, arc_mm: Array) -> float:
        parameter, rate = self._place(arc_mm)
        return float(np.max(np.abs(self._speed(parameter) * rate - 1.0)))

    def _arc(self, low: Array, high: Array) -> Array:
        """Arc length between parameters, (n,), by 8-point Gauss rules."""
        half = (high - low) / 2.0
        at = (low + half)[:, None] + half[:, None] * _NODES
        speed = np.linalg.norm(self._derive(at.ravel(), 1)[1], axis=1).reshape(at.shape)
        return np.asarray(half * (speed @ _WEIGHTS))

    def _speed(self, parameter: Array) -> Array:
        """|dc/dp|, kept off zero so that a cusp costs accuracy and not a division."""
        floor = 1e-9 * self.length_mm / self.motion.length if self.length_mm > 0.0 else 1e-300
        return np.asarray(np.maximum(np.linalg.norm(self._derive(parameter, 1)[1], axis=1), floor))

    def _place(self, arc_mm: Array) -> tuple[Array, Array]:
        """Parameter and its rate per mm at these arc lengths."""
        intervals = len(self._parameters) - 1
        h = self.length_mm / intervals
        cell = np.clip((arc_mm / h).astype(np.int64), 0, intervals - 1)
        t = arc_mm / h - cell
        p0, p1 = self._parameters[cell], self._parameters[cell + 1]
        m0, m1 = self._rates[cell] * h, self._rates[cell + 1] * h
        rise = p1 - p0
        c2, c3 = 3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise
        return p0 + t * (m0 + t * (c2 + t * c3)), (m0 + t * (2.0 * c2 + t * 3.0 * c3)) / h

    def _derive(self, parameter: Array, order: int) -> list[Array]:
        """The curve and its derivatives by the parameter up to `order`, each (n, 3)."""
        top = [_horner(coefficients, parameter) for coefficients in self._tops[: order + 1]]
        if not self._is_rational:
            return top
        bottom = [_horner(coefficients, parameter) for coefficients in self._bottoms[: order + 1]]
        curve: list[Array] = []
        for k in range(order + 1):
            rest = sum((math.comb(k, i) * bottom[i] * curve[k - i] for i in range(1, k + 1)), np.zeros((1, 1)))
            curve.append((top[k] - rest) / bottom[0])
        return curve

    def points(self, arc_mm: Array) -> Array:
        """Points (n, 3), mm."""
        return np.asarray(self._derive(self._place(arc_mm)[0], 0)[0])

    def derivatives(self, arc_mm: Array) -> tuple[Array, Array, Array]:
        """By the chain rule from the derivatives by the parameter."""
        _, c1, c2, c3 = self._derive(self._place(arc_mm)[0], 3)
        speed = np.maximum(np.linalg.norm(c1, axis=1), 1e-12)[:, None]
        r1 = c1 / speed
        speed1 = np.sum(r1 * c2, axis=1)[:, None]
        r2 = (c2 - speed1 * r1) / speed**2
        speed2 = (np.sum(c2 * c2 + c1 * c3, axis=1)[:, None] - speed1**2) / speed
        return r1, r2, (c3 - speed2 * r1 - 3.0 * speed * speed1 * r2) / speed**3

    def part(self, from_mm: float, to_mm: float) -> Motion:
        """The stretch as a polynomial that begins at parameter 0."""
        motion = self.motion
        if from_mm <= 0.0 and to_mm >= self.length_mm:
            return motion
        low, high = self._place(np.array([from_mm, to_mm]))[0]
        low = 0.0 if from_mm <= 0.0 else float(low)
        high = motion.length if to_mm >= self.length_mm else float(high)
        start, end = self._derive(np.array([low, high]), 0)[0]
        return Polynomial(
            motion.line,
            motion.block,
            motion.start if from_mm <= 0.0 else _vector(start),
            motion.end if to_mm >= self.length_mm else _vector(end),
            tuple(_vector(row) for row in _shifted(self._numerator, low)),
            tuple(float(value) for value in _shifted(self._denominator[:, None], low)[:, 0]),
            high - low,
            motion.feed_mm_min,
        )


def shape_of(motion: Motion, speed_error: float) -> Shape:
    """The arc-length form of a canonical motion; its length may be zero only for curves."""
    if isinstance(motion, Arc):
        return ArcShape(motion)
    if isinstance(motion, Polynomial):
        return PolynomialShape(motion, speed_error)
    return LineShape(motion)


def _horner(coefficients: Array, at: Array) -> Array:
    value = np.zeros((len(at), coefficients.shape[1]))
    for row in coefficients[::-1]:
        value = value * at[:, None] + row
    return value


def _derivatives(coefficients: Array, order: int) -> list[Array]:
    """The coefficients (n, k) of a polynomial and of its derivatives up to `order`."""
    found = [coefficients]
    for _ in range(order):
        last = found[-1]
        found.append(last[1:] * np.arange(1.0, len(last))[:, None] if len(last) > 1 else np.zeros_like(last))
    return found


def _shifted(coefficients: Array, by: float) -> Array:
    """Coefficients of q(p) = c(p + by)."""
    size = len(coefficients)
    return np.array(
        [
            sum(
                (math.comb(i, k) * by ** (i - k) * coefficients[i] for i in range(k, size)),
                np.zeros(coefficients.shape[1]),
            )
            for k in range(size)
        ]
    )


def _vector(row: Array) -> tuple[float, float, float]:
    return (float(row[0]), float(row[1]), float(row[2]))
