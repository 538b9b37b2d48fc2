"""How far rounded numbers move a written curve: bounds that hold everywhere along a span, not only at its ends."""

from __future__ import annotations

import numpy as np

from planner.path.model import Array

_PIECES = 4


def _bezier_of_pieces() -> Array:
    """Matrix (16, 4) from power coefficients on [0, 1] to the Bezier points of four equal pieces."""
    rows = []
    for piece in range(_PIECES):
        start, width = piece / _PIECES, 1.0 / _PIECES
        # f(start + width q) = sum c_k q^k, then cubic Bezier points of that polynomial in q
        shift = np.zeros((4, 4))
        for power in range(4):
            for inner in range(power + 1):
                binomial = [[1, 0, 0, 0], [1, 1, 0, 0], [1, 2, 1, 0], [1, 3, 3, 1]][power][inner]
                shift[inner, power] = binomial * start ** (power - inner) * width**inner
        to_bezier = np.array([[1, 0, 0, 0], [1, 1 / 3, 0, 0], [1, 2 / 3, 1 / 3, 0], [1, 1, 1, 1]])
        rows.append(to_bezier @ shift)
    return np.concatenate(rows)


_TO_BEZIER = _bezier_of_pieces()


def curve_bound_mm(coefficients: Array) -> Array:
    """Upper bound of |e(p)|, p in [0, 1], for each cubic error curve e given by (m, 4, 3) coefficients of p^k, in mm.

    The curve lies in the convex hull of its Bezier points, here those of four equal pieces.
    """
    hull = np.einsum("bk,mkd->mbd", _TO_BEZIER, coefficients)
    return np.asarray(np.sqrt((hull**2).sum(axis=2).max(axis=1)))


def poly_error(start_error: Array, end_error: Array, square_error: Array, cube_error: Array) -> Array:
    """Coefficients (m, 4, 3) of the error curve of POLY spans, from the errors (m, 3) of the numbers written.

    The control computes the linear coefficient from both ends, so it absorbs what the others leave:
    e(p) = e0 (1 - p) + e1 p + d2 (p^2 - p) + d3 (p^3 - p).
    """
    linear = end_error - start_error - square_error - cube_error
    return np.stack([start_error, linear, square_error, cube_error], axis=1)
