"""The cutter's way as cubic pieces: true to the curve within what was asked, whatever its degree (3.1)."""

from __future__ import annotations

import numpy as np
import pytest

from sim.interpreter.canon import Polynomial
from sim.sweep import Sweep, sweep_of

FIT_MM = 1e-7


def polynomial(rng: np.random.Generator, degree: int, denominator: tuple[float, ...] = (1.0,)) -> Polynomial:
    length = float(rng.uniform(0.5, 30.0))
    powers = np.arange(degree + 1)
    vectors = rng.uniform(-6.0, 6.0, (degree + 1, 3)) / length ** powers[:, None]
    end = vectors.T @ length**powers / sum(each * length**power for power, each in enumerate(denominator))
    coefficients = tuple(tuple(float(each) for each in vector) for vector in vectors)
    return Polynomial(1, None, coefficients[0], tuple(end), coefficients, denominator, length, 100.0)  # type: ignore[arg-type]


def distances(sweep: Sweep, motion: Polynomial) -> float:
    """The farthest that the pieces are from the curve at the same parameter, pieces being even in it."""
    count = len(sweep.coefficients)
    inside = np.linspace(0.0, 1.0, 41)
    made = np.einsum("sk,nkx->nsx", inside[:, None] ** np.arange(4), sweep.coefficients).reshape(-1, 3)
    at = ((np.arange(count)[:, None] + inside) / count).ravel() * motion.length
    top = np.polynomial.polynomial.polyval(at, np.array(motion.coefficients)).T
    bottom = np.polynomial.polynomial.polyval(at, np.array(motion.denominator))
    return float(np.abs(made - top / bottom[:, None]).max())


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
def test_pieces_follow_a_polynomial(degree: int) -> None:
    """(3.1) Densely sampled, never beyond the fit asked for; several at once as each alone."""
    rng = np.random.default_rng(degree)
    motions = [polynomial(rng, degree) for _ in range(20)]
    whole = sweep_of(motions, 0.0, sag_mm=0.005, length_mm=1.3, fit_mm=FIT_MM)
    for index, motion in enumerate(motions):
        alone = sweep_of([motion], 0.0, sag_mm=0.005, length_mm=1.3, fit_mm=FIT_MM)
        np.testing.assert_array_equal(alone.coefficients, whole.coefficients[whole.motion == index])
        assert distances(alone, motion) <= FIT_MM
        np.testing.assert_allclose(alone.ends[:-1], alone.coefficients[1:, 0], atol=1e-9)
        assert alone.sag_mm.max() <= 0.02


def test_pieces_follow_a_rational_curve_and_one_of_degree_six() -> None:
    """(3.1) The slow way for what the control can hardly say."""
    rng = np.random.default_rng(9)
    for motion in (polynomial(rng, 2, (1.0, 0.01)), polynomial(rng, 6)):
        assert distances(sweep_of([motion], 0.0, sag_mm=0.005, length_mm=1.3, fit_mm=FIT_MM), motion) <= 2 * FIT_MM
