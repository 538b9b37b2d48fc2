"""The way of the cutter as short cubic pieces: what the probes are measured against.

Lines, polynomials up to degree three and their parts are exact; arcs, rational and higher curves become cubic Hermite
pieces within `fit_mm` of the true curve, proved for polynomials up to degree five. Every piece knows how far it strays
from its chord (`sag_mm`), a bound that lets the probes pass over most pieces; the pieces that remain are solved on the
curve itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Arc, Line, Motion, Polynomial, Rapid

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Curve = Callable[[Floats], tuple[Floats, Floats]]


@dataclass(frozen=True, slots=True)
class Sweep:
    """n cubic pieces c(s) = sum coefficients[:, k] s^k, s in [0, 1], of the tool's reference, work coordinates, mm.

    coefficients (n, 4, 3); ends (n, 3) is c(1); sag_mm (n,) bounds the distance of a piece from its chord;
    motion (n,) is the index of the canonical motion that a piece belongs to.
    """

    coefficients: Floats
    ends: Floats
    sag_mm: Floats
    motion: Ints


def sweep_of(motions: Sequence[Motion], lift_mm: float, *, sag_mm: float, length_mm: float, fit_mm: float) -> Sweep:
    """All motions, rapids included, as pieces no longer than about `length_mm`, no further than `sag_mm` off chord.

    `lift_mm` raises the programmed point to the tool's reference (R where a ball is programmed by its tip).
    """
    parts = [
        _straight(motions, length_mm),
        _cubic(motions, sag_mm, length_mm),
        _higher(motions, sag_mm, length_mm, fit_mm),
        _general(motions, sag_mm, length_mm, fit_mm),
    ]
    coefficients = np.concatenate([part[0] for part in parts])
    coefficients[:, 0, 2] += lift_mm
    motion = np.concatenate([part[1] for part in parts])
    order = np.argsort(motion, kind="stable")
    coefficients, motion = np.ascontiguousarray(coefficients[order]), motion[order]
    bend = np.maximum(
        np.linalg.norm(coefficients[:, 2], axis=1), np.linalg.norm(coefficients[:, 2] + 3 * coefficients[:, 3], axis=1)
    )
    return Sweep(coefficients, coefficients.sum(axis=1), bend / 4, motion)


def _straight(motions: Sequence[Motion], length_mm: float) -> tuple[Floats, Ints]:
    at = np.array([i for i, each in enumerate(motions) if isinstance(each, Line | Rapid)], dtype=np.int64)
    starts = np.array([motions[i].start for i in at], dtype=np.float64).reshape(-1, 3)
    ends = np.array([motions[i].end for i in at], dtype=np.float64).reshape(-1, 3)
    coefficients = np.zeros((len(at), 4, 3))
    coefficients[:, 0], coefficients[:, 1] = starts, ends - starts
    counts = np.maximum(1, np.ceil(np.linalg.norm(ends - starts, axis=1) / length_mm)).astype(np.int64)
    return _split(coefficients, counts), np.repeat(at, counts)


def _cubic(motions: Sequence[Motion], sag_mm: float, length_mm: float) -> tuple[Floats, Ints]:
    at = np.array([i for i, each in enumerate(motions) if _is_cubic(each)], dtype=np.int64)
    coefficients = np.zeros((len(at), 4, 3))
    for row, i in enumerate(at):
        motion = motions[i]
        assert isinstance(motion, Polynomial)
        scale = motion.length ** np.arange(len(motion.coefficients)) / motion.denominator[0]
        coefficients[row, : len(scale)] = np.array(motion.coefficients) * scale[:, None]
    counts = _counts(coefficients, sag_mm, length_mm)
    return _split(coefficients, counts), np.repeat(at, counts)


def _higher(motions: Sequence[Motion], sag_mm: float, length_mm: float, fit_mm: float) -> tuple[Floats, Ints]:
    """Polynomials of degree 4 and 5, all at once: a cubic Hermite piece errs by width^4 / 384 fourth derivatives."""
    at = np.array([i for i, each in enumerate(motions) if _is_polynomial(each) and not _is_cubic(each)], dtype=np.int64)
    curves = np.zeros((len(at), 6, 3))
    for row, i in enumerate(at):
        motion = motions[i]
        assert isinstance(motion, Polynomial)
        scale = motion.length ** np.arange(len(motion.coefficients)) / motion.denominator[0]
        curves[row, : len(scale)] = np.array(motion.coefficients) * scale[:, None]
    slope, bend, fourth = _derivative(curves, 1), _derivative(curves, 2), _derivative(curves, 4)
    wanted = np.maximum(np.sqrt(_reach(bend) / (8 * sag_mm)), _reach(slope) / length_mm)
    wanted = np.maximum(wanted, (_reach(fourth) / (384 * fit_mm)) ** 0.25)
    counts = np.maximum(1, np.ceil(wanted)).astype(np.int64)
    which = np.repeat(np.arange(len(at)), counts)
    width = (1.0 / counts[which])[:, None]
    begin = (np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts))[:, None] * width
    points = _at(curves[which], begin), _at(curves[which], begin + width)
    slopes = width * _at(slope[which], begin), width * _at(slope[which], begin + width)
    return _hermite_cubics(*points, *slopes), at[which]


def _derivative(curves: Floats, order: int) -> Floats:
    """The coefficients (n, k - order, 3) of a derivative of polynomials (n, k, 3)."""
    for _ in range(order):
        curves = curves[:, 1:] * np.arange(1, curves.shape[1])[:, None]
    return curves


def _reach(curves: Floats) -> Floats:
    """A bound on the length of each polynomial vector over [0, 1]: that of its longest Bezier point."""
    degree = curves.shape[1] - 1
    points = np.zeros((degree + 1, len(curves), 3))
    for i in range(degree + 1):
        for j in range(i + 1):
            points[i] += math.comb(i, j) / math.comb(degree, j) * curves[:, j]
    return np.asarray(np.linalg.norm(points, axis=2).max(axis=0))


def _at(curves: Floats, places: Floats) -> Floats:
    """Polynomials (n, k, 3) at one place each (n, 1)."""
    value = np.zeros_like(curves[:, 0])
    for order in range(curves.shape[1] - 1, -1, -1):
        value = value * places + curves[:, order]
    return value


def _hermite_cubics(p0: Floats, p1: Floats, m0: Floats, m1: Floats) -> Floats:
    return np.stack([p0, m0, 3 * (p1 - p0) - 2 * m0 - m1, 2 * (p0 - p1) + m0 + m1], axis=1)


def _is_polynomial(motion: Motion) -> bool:
    """Not rational, and of degree five at most."""
    if not isinstance(motion, Polynomial) or len(motion.coefficients) > 6:
        return False
    return all(value == 0 for value in motion.denominator[1:])


def _is_cubic(motion: Motion) -> bool:
    return isinstance(motion, Polynomial) and _is_polynomial(motion) and len(motion.coefficients) <= 4


def _counts(coefficients: Floats, sag_mm: float, length_mm: float) -> Ints:
    """Into how many parts each cubic must be split: sag falls with the square of the count, length with the count."""
    second = 2 * coefficients[:, 2], 2 * coefficients[:, 2] + 6 * coefficients[:, 3]
    bend = np.maximum(*(np.linalg.norm(each, axis=1) for each in second))
    speed = np.linalg.norm(coefficients[:, 1:], axis=2) @ np.array([1.0, 2.0, 3.0])
    counts = np.maximum(np.sqrt(bend / (8 * sag_mm)), speed / length_mm)
    return np.asarray(np.maximum(1, np.ceil(counts)), dtype=np.int64)


def _split(coefficients: Floats, counts: Ints) -> Floats:
    """Each cubic cut into `counts` parts of equal parameter width, each part again over [0, 1]."""
    which = np.repeat(np.arange(len(counts)), counts)
    width = 1.0 / counts[which]
    begin = (np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)) * width
    c0, c1, c2, c3 = (coefficients[which, k] for k in range(4))
    t, h = begin[:, None], width[:, None]
    parts = [
        c0 + t * (c1 + t * (c2 + t * c3)),
        h * (c1 + t * (2 * c2 + 3 * t * c3)),
        h**2 * (c2 + 3 * t * c3),
        h**3 * c3,
    ]
    return np.stack(parts, axis=1)


def _general(motions: Sequence[Motion], sag_mm: float, length_mm: float, fit_mm: float) -> tuple[Floats, Ints]:
    pieces: list[Floats] = [np.empty((0, 4, 3))]
    owners: list[Ints] = [np.empty(0, dtype=np.int64)]
    for i, motion in enumerate(motions):
        if isinstance(motion, Arc):
            curve = _arc(motion)
        elif isinstance(motion, Polynomial) and not _is_polynomial(motion):
            curve = _rational(motion)
        else:
            continue
        fitted = _hermite(curve, sag_mm, length_mm, fit_mm)
        pieces.append(fitted)
        owners.append(np.full(len(fitted), i, dtype=np.int64))
    return np.concatenate(pieces), np.concatenate(owners)


def _hermite(curve: Curve, sag_mm: float, length_mm: float, fit_mm: float) -> Floats:
    """Cubic pieces of equal parameter width, doubled in number until they follow the curve at five points inside."""
    count = 4
    inside = np.arange(1, 6) / 6.0
    while True:
        nodes = np.linspace(0.0, 1.0, count + 1)
        points, slopes = curve(nodes)
        p0, p1, m0, m1 = points[:-1], points[1:], slopes[:-1] / count, slopes[1:] / count
        cubic = _hermite_cubics(p0, p1, m0, m1)
        true, _ = curve(np.ravel((np.arange(count)[:, None] + inside) / count))
        made = np.einsum("sk,nkx->nsx", inside[:, None] ** np.arange(4), cubic)
        error = np.abs(made - true.reshape(made.shape)).max()
        needed = int(_counts(cubic, sag_mm, length_mm).max())
        if (error <= fit_mm and needed <= 1) or count >= 1 << 20:
            return cubic
        count *= 2


def _arc(arc: Arc) -> Curve:
    start, end, centre, axis = (np.array(each) for each in (arc.start, arc.end, arc.centre, arc.axis))
    rise = np.dot(end - start, axis) * axis
    spoke = start - centre - np.dot(start - centre, axis) * axis
    across = np.cross(axis, spoke)
    radius_change = (
        np.linalg.norm(end - rise - centre - np.dot(start - centre, axis) * axis) / np.linalg.norm(spoke) - 1
    )

    def curve(s: Floats) -> tuple[Floats, Floats]:
        angle = arc.sweep_rad * s[:, None]
        turn = np.cos(angle) * spoke + np.sin(angle) * across
        turned = arc.sweep_rad * (np.cos(angle) * across - np.sin(angle) * spoke)
        growth = 1 + radius_change * s[:, None]
        base = centre + np.dot(start - centre, axis) * axis
        return base + growth * turn + s[:, None] * rise, growth * turned + radius_change * turn + rise

    return curve


def _rational(motion: Polynomial) -> Curve:
    above = np.array(motion.coefficients) * (motion.length ** np.arange(len(motion.coefficients)))[:, None]
    below = np.array(motion.denominator) * motion.length ** np.arange(len(motion.denominator))

    def curve(s: Floats) -> tuple[Floats, Floats]:
        top, bottom = np.polynomial.polynomial.polyval(s, above).T, np.polynomial.polynomial.polyval(s, below)
        top_slope = np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(above)).T
        bottom_slope = np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(below))
        point = top / bottom[:, None]
        return point, (top_slope - bottom_slope[:, None] * point) / bottom[:, None]

    return curve
