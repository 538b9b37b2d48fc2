"""(4.8) The feed limit of a line against a simulation of the line, block by block."""

from __future__ import annotations

import numpy as np
import pytest

from planner.feed_limit import feed_limit_mm_min


def starves(sizes: np.ndarray, cut: np.ndarray, other: np.ndarray, rate: float, feed: float, override: float) -> bool:
    """Whether some 2 s window of machine time wants more bytes than the line brings, by plain counting."""
    start = np.append(0.0, np.cumsum(60 * cut / (feed * override) + other))[:-1]
    return any(sizes[(start >= begin) & (start < begin + 2 - 1e-9)].sum() > 2 * rate * (1 + 1e-9) for begin in start)


@pytest.mark.parametrize("seed", range(8))
def test_just_below_the_limit_no_window_starves_and_just_above_one_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes, cut = rng.integers(8, 60, 400).astype(float), rng.exponential(0.8, 400)
    other = np.where(rng.random(400) < 0.05, rng.exponential(0.5, 400), 0.0)
    for rate in (120.0, 960.0):
        limit = feed_limit_mm_min(sizes, cut, other, bytes_per_s=rate, override=1.2)
        assert not starves(sizes, cut, other, rate, limit * (1 - 1e-5), 1.2)
        assert starves(sizes, cut, other, rate, limit * (1 + 1e-5), 1.2)


def test_override_divides_the_limit() -> None:
    one = np.ones(5000)
    plain = feed_limit_mm_min(20 * one, one, 0 * one, bytes_per_s=960, override=1.0)
    assert feed_limit_mm_min(20 * one, one, 0 * one, bytes_per_s=960, override=1.2) == pytest.approx(
        plain / 1.2, rel=1e-5
    )


def test_a_program_that_fits_into_one_window_never_starves() -> None:
    assert feed_limit_mm_min(np.array([30.0]), np.array([5.0]), np.zeros(1), bytes_per_s=120, override=1.0) == np.inf


def test_what_is_read_before_the_first_cut_starves_nothing() -> None:
    """A long head has all the time it wants."""
    sizes, cut = np.array([5000.0, *[20.0] * 3000]), np.array([0.0, *[1.0] * 3000])
    limit = feed_limit_mm_min(sizes, cut, np.zeros(3001), bytes_per_s=960, override=1.0)
    assert limit == pytest.approx(2880, rel=1e-5)
