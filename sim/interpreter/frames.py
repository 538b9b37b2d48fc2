"""Programmable frames: TRANS, ROT, SCALE, MIRROR and their additive forms as affine maps.

A frame maps programmed coordinates p to A p + b, mm. Additive forms act in the frame that stands: new = old after op.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from sim.interpreter.canon import Vector

Matrix = tuple[Vector, Vector, Vector]
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ORIGIN: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Frame:
    """p to A p + coarse + fine; TRANS sets the coarse part, G58 and G59 replace the parts axis by axis."""

    matrix: Matrix = IDENTITY
    coarse: Vector = ORIGIN
    fine: Vector = ORIGIN

    @property
    def shift(self) -> Vector:
        """The whole translation b."""
        return add(self.coarse, self.fine)

    @property
    def is_identity_matrix(self) -> bool:
        """Whether the frame only shifts."""
        return self.matrix == IDENTITY

    def point(self, p: Vector) -> Vector:
        """A p + b."""
        shift = self.shift
        return add(p, shift) if self.is_identity_matrix else add(times(self.matrix, p), shift)

    def direction(self, p: Vector) -> Vector:
        """A p."""
        return p if self.is_identity_matrix else times(self.matrix, p)

    def inverse_point(self, q: Vector) -> Vector:
        """The p with A p + b = q; A is invertible because SCALE by 0 is refused."""
        moved = subtract(q, self.shift)
        return moved if self.is_identity_matrix else solve(self.matrix, moved)

    def arc_scale(self, axes: tuple[int, ...]) -> float | None:
        """The factor of lengths along these axes, or None where circles in their plane do not stay circles."""
        columns = list(zip(*self.matrix, strict=True))
        lengths = [math.sqrt(dot(columns[axis], columns[axis])) for axis in axes]
        skew = max(abs(dot(columns[i], columns[j])) for i, j in ((0, 1), (0, 2), (1, 2)))
        spread = max(lengths) - min(lengths)
        return lengths[0] if spread < 1e-12 * lengths[0] and skew < 1e-12 * lengths[0] ** 2 else None

    @property
    def handedness(self) -> float:
        """+1, or -1 where the frame mirrors."""
        a, b, c = self.matrix
        return math.copysign(1.0, dot(a, cross(b, c)))

    def translated(self, by: Vector) -> Frame:
        """ATRANS: shift in the frame that stands."""
        return replace(self, fine=add(self.fine, self.direction(by)))

    def turned(self, by: Matrix) -> Frame:
        """AROT, ASCALE, AMIRROR: a linear map in the frame that stands."""
        return replace(self, matrix=product(self.matrix, by))


def rotation_about(axis: int, angle_rad: float) -> Matrix:
    """Right-hand rotation about X, Y or Z (0, 1, 2); exact at quarter turns."""
    sine, cosine = exact_sine(angle_rad), exact_sine(angle_rad + math.pi / 2)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    rows = [[1.0 if row == column else 0.0 for column in range(3)] for row in range(3)]
    rows[i][i], rows[i][j], rows[j][i], rows[j][j] = cosine, -sine, sine, cosine
    return (_vector(rows[0]), _vector(rows[1]), _vector(rows[2]))


def exact_sine(angle_rad: float) -> float:
    """sin, exact at multiples of a quarter turn.

    >>> exact_sine(math.pi), exact_sine(-math.pi / 2)
    (0.0, -1.0)
    """
    quarter = angle_rad / (math.pi / 2)
    if abs(quarter - round(quarter)) < 1e-13:
        return (0.0, 1.0, 0.0, -1.0)[round(quarter) % 4]
    return math.sin(angle_rad)


def diagonal(x: float, y: float, z: float) -> Matrix:
    """A scaling by axis."""
    return ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z))


def add(a: Vector, b: Vector) -> Vector:
    """The sum."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    """The difference of a and b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scaled(a: Vector, factor: float) -> Vector:
    """The vector a times a factor."""
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a: Vector, b: Vector) -> float:
    """The inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product, right hand."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Vector) -> float:
    """|a|."""
    return math.sqrt(dot(a, a))


def times(matrix: Matrix, p: Vector) -> Vector:
    """A p."""
    return (dot(matrix[0], p), dot(matrix[1], p), dot(matrix[2], p))


def product(a: Matrix, b: Matrix) -> Matrix:
    """A B."""
    columns = list(zip(*b, strict=True))
    rows = [[dot(row, column) for column in columns] for row in a]
    return (_vector(rows[0]), _vector(rows[1]), _vector(rows[2]))


def solve(matrix: Matrix, q: Vector) -> Vector:
    """The p with A p = q, by cross products of the rows."""
    a, b, c = matrix
    volume = dot(a, cross(b, c))
    parts = (scaled(cross(b, c), q[0]), scaled(cross(c, a), q[1]), scaled(cross(a, b), q[2]))
    return scaled(add(add(parts[0], parts[1]), parts[2]), 1.0 / volume)


def _vector(values: list[float]) -> Vector:
    return (values[0], values[1], values[2])
