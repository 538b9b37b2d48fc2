"""B-spline basis functions as polynomials, one set per knot span; arrays only, no surfaces.

A surface that is evaluated a million times is best kept as polynomials of the position inside each knot span: one
gather and a Horner scheme a point. Derivation: EQUATIONS.md, section 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SpanBasis:
    """The basis functions of one knot vector, span by span.

    `starts` and `widths` (spans,) are the knot spans of positive width; `first` (spans,) the index of the first
    control point that acts there; `powers` (spans, degree + 1, degree + 1): basis function a of span s is
    sum over i of powers[s, a, i] t^i with t = (parameter - start) / width.
    """

    degree: int
    starts: Array
    widths: Array
    first: NDArray[np.intp]
    powers: Array

    @property
    def low(self) -> float:
        """The first parameter of the domain."""
        return float(self.starts[0])

    @property
    def high(self) -> float:
        """The last parameter of the domain."""
        return float(self.starts[-1] + self.widths[-1])

    def spans_of(self, parameters: Array) -> NDArray[np.intp]:
        """The span each parameter (m,) falls into; outside the domain the first or last, whose polynomial extends."""
        return np.searchsorted(self.starts[1:], parameters, side="right")


def span_basis(knots: Array, degree: int) -> SpanBasis:
    """The basis of a knot vector (n + degree + 1,) by the recursion of Cox and de Boor, eq. (1).

    >>> span_basis(np.array([0.0, 0, 1, 1]), 1).powers[0].tolist()
    [[1.0, -1.0], [0.0, 1.0]]

    Raises ValueError if no span between the end knots has a width above 0.
    """
    inner = np.arange(degree, len(knots) - degree - 1)
    spans = inner[knots[inner + 1] > knots[inner]]
    if not len(spans):
        raise ValueError("no knot span has a width")
    start, width = knots[spans], knots[spans + 1] - knots[spans]
    powers = np.zeros((len(spans), degree + 1, degree + 1))
    powers[:, degree, 0] = 1.0
    for order in range(1, degree + 1):
        raised = np.zeros_like(powers)
        for function in range(degree - order, degree + 1):
            lower = spans - degree + function
            for knot, source, sign in ((lower, function, 1.0), (lower + 1, function + 1, -1.0)):
                if source < degree - order + 1 or source > degree:
                    continue
                run = knots[knot + order] - knots[knot]
                root = knots[knot] if sign > 0 else knots[knot + order]
                scale = np.divide(sign, run, out=np.zeros_like(run), where=run > 0)
                raised[:, function] += (scale * (start - root))[:, None] * powers[:, source]
                raised[:, function, 1:] += (scale * width)[:, None] * powers[:, source, :-1]
        powers = raised
    return SpanBasis(degree, start, width, spans - degree, powers)
