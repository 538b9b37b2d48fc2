"""Ways of the cutter for tests: passes on the offset of a patch, as splines or chords, and a plunge behind them."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from sim.interpreter.canon import Line, Motion, Polynomial, Rapid
from sim.nominal_patch import NominalPatch

Floats = NDArray[np.float64]


def centres_at(patch: NominalPatch, radius_mm: float, y_mm: float, along: Floats, *, u_runs_along_y: bool) -> Floats:
    """Ball centres (n, 3) on the offset in the plane y, one for each value of the parameter that runs across y."""
    (u0, u1), (v0, v1) = patch.domain
    low, high = (u0, u1) if u_runs_along_y else (v0, v1)
    guess = np.full(len(along), 0.0)
    grid = np.linspace(low, high, 65)
    for k, value in enumerate(along):
        uv = np.column_stack([grid, np.full(65, value)] if u_runs_along_y else [np.full(65, value), grid])
        frames = patch.frames(uv)
        guess[k] = np.interp(y_mm, (frames.points + radius_mm * frames.normals)[:, 1], grid)
    for _ in range(30):
        centre, slope = _offset(patch, radius_mm, guess, along, u_runs_along_y)
        guess = guess - (centre[:, 1] - y_mm) / slope
    return _offset(patch, radius_mm, guess, along, u_runs_along_y)[0]


def _offset(
    patch: NominalPatch, radius_mm: float, across: Floats, along: Floats, u_runs_along_y: bool
) -> tuple[Floats, Floats]:
    def at(values: Floats) -> Floats:
        uv = np.column_stack([values, along] if u_runs_along_y else [along, values])
        points, du, dv = (np.asarray(patch.spline(uv, nu=order)) for order in ((0, 0), (1, 0), (0, 1)))
        normals = np.cross(du, dv) * patch.sign
        return points + radius_mm * normals / np.linalg.norm(normals, axis=1)[:, None]

    step = 1e-6
    return at(across), (at(across + step)[:, 1] - at(across - step)[:, 1]) / (2 * step)


def spline_pass(centres: Floats, line: int) -> list[Motion]:
    """Cubic polynomial motions through the centres, slopes by high-order differences of x as parameter."""
    from scipy.interpolate import make_interp_spline

    x = centres[:, 0]
    smooth = make_interp_spline(x, centres, k=7)
    slopes = smooth.derivative()(x)
    curve = CubicHermiteSpline(x, centres, slopes)
    motions: list[Motion] = []
    for k in range(len(x) - 1):
        coefficients = curve.c[::-1, k]
        motions.append(
            Polynomial(
                line,
                None,
                tuple(centres[k]),
                tuple(centres[k + 1]),
                tuple(tuple(row) for row in coefficients),
                (1.0,),
                float(x[k + 1] - x[k]),
                250.0,
            )
        )
    return motions


def chord_pass(centres: Floats, line: int) -> list[Motion]:
    """Straight motions through the centres, lines counted from `line`."""
    pairs = itertools.pairwise(centres)
    return [Line(line + k, None, tuple(a), tuple(b), 250.0) for k, (a, b) in enumerate(pairs)]


def plunged(motions: list[Motion], low: tuple[float, float, float]) -> list[Motion]:
    """The motions, then through the air to above a place, and down to it, where the program ends."""
    end, high = motions[-1].end, 30.0
    above = [(end[0], end[1], high), (low[0], low[1], high)]
    return [*motions, Rapid(800, 1, end, above[0]), Rapid(801, 2, *above), Line(900, 9, above[1], low, 100.0)]
