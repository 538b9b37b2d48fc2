"""Design surfaces of known shape for tests of the verdict."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import NdBSpline

from sim.nominal import CutterData, Nominal
from sim.nominal_patch import NominalPatch

Floats = NDArray[np.float64]


def nominal_of(*patches: NominalPatch, radius_mm: float = 4.0) -> Nominal:
    return Nominal(patches, CutterData("ball", radius_mm, radius_mm), "centre", None)


def bilinear(corners: Floats) -> NominalPatch:
    """Patch over four corners (2, 2, 3), u along the first index; the normal is turned up."""
    knots = np.array([0.0, 0.0, 1.0, 1.0])
    a, b, c = (corners[k] - corners[0, 0] for k in ((1, 0), (0, 1), (1, 1)))
    sign = 1.0 if np.cross(a, b)[2] + np.cross(a, c)[2] > 0 else -1.0
    return NominalPatch(NdBSpline((knots, knots), np.asarray(corners, dtype=float), (1, 1)), False, sign, 0.0)


def plane(*, size: float = 20.0, slope_x: float = 0.0, slope_y: float = 0.0) -> NominalPatch:
    """The square (0, 0) to (size, size) of the plane z = slope_x x + slope_y y."""
    return bilinear(np.array([[[x, y, slope_x * x + slope_y * y] for y in (0.0, size)] for x in (0.0, size)]))


def cylinder(radius_mm: float, *, half_angle_rad: float, length_mm: float, is_concave: bool = False) -> NominalPatch:
    """Exact circular cylinder about the line y = 0, z = 0 (concave: seen from inside), along x; u along x, v around.

    Convex: z = sqrt(r^2 - y^2); concave: z = -sqrt(r^2 - y^2).
    """
    side = -1.0 if is_concave else 1.0
    s, c = math.sin(half_angle_rad), math.cos(half_angle_rad)
    arc = np.array([[-s, c], [0.0, 1.0 / c], [s, c]]) * radius_mm
    weights = np.array([1.0, c, 1.0])
    net = np.array(
        [[[x * w, y * w, side * z * w, w] for (y, z), w in zip(arc, weights, strict=True)] for x in (0.0, length_mm)]
    )
    knots = (np.array([0.0, 0.0, 1.0, 1.0]), np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
    return NominalPatch(NdBSpline(knots, net, (1, 2)), True, 1.0, 0.0)


def sphere_cap(radius_mm: float, *, half_angle_rad: float) -> NominalPatch:
    """Exact band of a sphere about the origin: latitude v about the equator of the x axis, turned so that +Z is inside.

    Revolution about the y axis of the arc |latitude| <= half angle, longitude |u| <= half angle about +Z.
    """
    s, c = math.sin(half_angle_rad), math.cos(half_angle_rad)
    weights = np.array([1.0, c, 1.0])
    around = np.array([[-s, c], [0.0, 1.0 / c], [s, c]])
    net = np.array(
        [
            [
                [
                    radius_mm * px * qx * wu * wv,
                    radius_mm * qy * wu * wv,
                    radius_mm * pz * qx * wu * wv,
                    wu * wv,
                ]
                for (qy, qx), wv in zip(around, weights, strict=True)
            ]
            for (px, pz), wu in zip(around, weights, strict=True)
        ]
    )
    knots = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    return NominalPatch(NdBSpline((knots, knots), net, (2, 2)), True, 1.0, 0.0)
