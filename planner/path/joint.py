"""Pieces of a pass, end to end in one plane, as one pass: their shapes keep their places, joints included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.path.model import ArcChain, Method, Pass, PlaneSpline, Polyline, Shape


def joined(pieces: Sequence[Pass]) -> Pass:
    """The pass that runs through these pieces in turn; its bound is the largest, sampled if one is."""
    if len(pieces) == 1:
        return pieces[0]
    is_proved = all(piece.method is Method.PROVED for piece in pieces)
    return replace(
        pieces[0],
        shape=_chained([piece.shape for piece in pieces]),
        deviation_mm=max(piece.deviation_mm for piece in pieces),
        method=Method.PROVED if is_proved else Method.SAMPLED,
        break_points=np.concatenate([piece.break_points for piece in pieces]),
        length_mm=sum(piece.length_mm for piece in pieces),
    )


def _chained(shapes: Sequence[Shape]) -> Shape:
    """One shape from shapes of one kind, each beginning where the one before it ends.

    Two clamped cubics become one with three equal knots at the joint, where a control point stands on the curve.
    """
    first = shapes[0]
    if isinstance(first, Polyline):
        return Polyline(_end_to_end([shape.points for shape in shapes if isinstance(shape, Polyline)]))
    if isinstance(first, ArcChain):
        chains = [shape for shape in shapes if isinstance(shape, ArcChain)]
        return ArcChain(
            _end_to_end([chain.points for chain in chains]),
            np.concatenate([chain.centres for chain in chains]),
            np.concatenate([chain.turns for chain in chains]),
        )
    splines = [shape for shape in shapes if isinstance(shape, PlaneSpline)]
    knots = splines[0].knots
    for spline in splines[1:]:
        onward = spline.knots[spline.degree + 1 :] - spline.knots[0] + knots[-1]
        knots = np.concatenate([knots[:-1], onward])
    return PlaneSpline(first.degree, knots, _end_to_end([spline.control_points for spline in splines]))


def _end_to_end(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Points of parts (k, 2) that share their ends, each shared point once."""
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
