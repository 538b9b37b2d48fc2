"""Straight moves for controls without splines: the fewest that stay within a tolerance of the curve.

The curve and its tolerance make a tube; a link is the longest line inside it that starts from the window where the
line before it leaves. Going on so gives the fewest links of any polyline in the tube, equation (F16).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.path.curve import CurveTable, ExactCurve
from planner.path.model import Array, Polyline

SECTIONS_A_LINK = 12
LARGEST_TURN_RAD = 1.0


@dataclass(frozen=True, slots=True)
class Line:
    """The line y = height + slope (x - at)."""

    at: float
    height: float
    slope: float

    def value(self, x: float) -> float:
        """Height at x."""
        return self.height + self.slope * (x - self.at)

    def meets(self, other: Line) -> float:
        """The x where two lines meet."""
        return self.at + (other.value(self.at) - self.height) / (self.slope - other.slope)


def lean_polyline(
    curve: ExactCurve, tolerance_mm: float, closer: int = 1, *, ends_on_curve: bool = False
) -> tuple[Polyline, float]:
    """The polyline with the fewest vertices within the tolerance of the curve, and its largest distance from it, mm.

    Vertices may lie off the curve, both ends only if `ends_on_curve` does not forbid it. Where the curve turns by more
    than a radian it is cut there, on the curve. Sections stand `closer` times as close as usual.
    """
    arc = _sections(curve, tolerance_mm, closer)
    points, tangents = (found[:, :, 0].T for found in CurveTable([curve]).read(np.array([0]), arc[:, None]))
    vertices: list[Array] = []
    deviation_mm = 0.0
    for first, last in _stretches(tangents):
        ahead = points[last] - points[first]
        ahead = ahead / np.hypot(ahead[0], ahead[1])
        turn = np.array([ahead, [-ahead[1], ahead[0]]])
        local = (points[first : last + 1] - points[first]) @ turn.T
        steep = 1.0 / (tangents[first : last + 1] @ ahead)
        width = 0.97 * tolerance_mm * steep
        # The ends are as near as the tolerance straight across, and stretches meet on the curve itself.
        width[0] *= (first == 0 and not ends_on_curve) / steep[0]
        width[-1] *= (last == len(points) - 1 and not ends_on_curve) / steep[-1]
        found = _links(local[:, 0], local[:, 1], width)
        heights = np.interp(local[:, 0], found[:, 0], found[:, 1])
        deviation_mm = max(deviation_mm, float((np.abs(heights - local[:, 1]) / steep).max()))
        work = found @ turn + points[first]
        vertices.append(work if not vertices else work[1:])
    # Between two sections the curve leaves its chord by at most this much, (F16).
    return Polyline(np.concatenate(vertices)), deviation_mm + 0.03 * tolerance_mm


def _sections(curve: ExactCurve, tolerance_mm: float, closer: int) -> Array:
    """Arc lengths so close that the curve between two leaves its chord by less than 3 % of the tolerance."""
    arc = curve.arc_mm - curve.arc_mm[0]
    bend = np.abs(curve.curvatures)
    near = np.pad(bend, 1, mode="edge")
    bend = np.maximum(np.maximum(near[:-2], near[2:]), bend)
    density = np.maximum(np.sqrt(bend / (0.16 * tolerance_mm)), SECTIONS_A_LINK / arc[-1])
    rising = np.append(0.0, np.cumsum(closer * np.maximum(density[1:], density[:-1]) * np.diff(arc)))
    return np.asarray(np.interp(np.linspace(0.0, rising[-1], int(np.ceil(rising[-1])) + 2), rising, arc))


def _stretches(tangents: Array) -> list[tuple[int, int]]:
    """First and last section of stretches that turn by at most a radian."""
    angle = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))
    parts, first = [], 0
    while first < len(angle) - 1:
        off = np.flatnonzero(np.abs(angle[first:] - angle[first]) > LARGEST_TURN_RAD)
        last = first + int(off[0]) if len(off) else len(angle) - 1
        parts.append((first, last))
        first = last
    return parts


def _links(x: Array, y: Array, width: Array) -> Array:
    """Vertices (k, 2) of the fewest links through all vertical sections y - width ... y + width at x.

    The first and the last vertex lie in the first and the last section.
    """
    low, high = y - width, y + width
    link, lines = _Link([(x[0], low[0])], [(x[0], high[0])]), []
    at = 1
    while at < len(x):
        line = link.stopped_by(x[at], low[at], high[at])
        if line is None:
            link.pass_through(x[at], low[at], high[at])
            at += 1
            continue
        lines.append(line)
        climbs = line is link.steepest
        # The line leaves through the lower border if the tube climbs away from it, else through the upper one.
        border, other = (low, high) if climbs else (high, low)
        before, after = border[at - 1] - line.value(x[at - 1]), border[at] - line.value(x[at])
        exit_x = float(x[at - 1] + (x[at] - x[at - 1]) * before / (before - after))
        passed = np.flatnonzero((x[:at] >= line.at) & (x[:at] <= exit_x))
        window = [(exit_x, line.value(exit_x))], [(float(x[i]), float(other[i])) for i in passed]
        link = _Link(*window) if climbs else _Link(window[1], window[0])
        if climbs:
            link.flattest = _tightest(*window[0][0], link.upper, most=True)
        else:
            link.steepest = _tightest(*window[0][0], link.lower, most=False)
    lines.append(link.middle())
    inner = [(line.meets(following), line) for line, following in pairwise(lines)]
    vertices = [(x[0], lines[0].value(x[0])), *((place, line.value(place)) for place, line in inner)]
    return np.array([*vertices, (x[-1], lines[-1].value(x[-1]))])


@dataclass(slots=True)
class _Link:
    """The lines still possible for one link: above the points `lower`, below the points `upper`, left to right."""

    lower: list[tuple[float, float]]
    upper: list[tuple[float, float]]
    steepest: Line | None = None
    flattest: Line | None = None

    def stopped_by(self, x: float, low: float, high: float) -> Line | None:
        """The last line that got so far, if none passes this section; None if some does."""
        if self.steepest is not None and low > self.steepest.value(x):
            return self.steepest
        if self.flattest is not None and high < self.flattest.value(x):
            return self.flattest
        return None

    def pass_through(self, x: float, low: float, high: float) -> None:
        """Keep only the lines through this section."""
        if self.steepest is None or high < self.steepest.value(x):
            self.steepest = _tightest(x, high, self.lower, most=False)
        if self.flattest is None or low > self.flattest.value(x):
            self.flattest = _tightest(x, low, self.upper, most=True)
        self.lower.append((x, low))
        self.upper.append((x, high))

    def middle(self) -> Line:
        """A line in the middle of those possible."""
        assert self.steepest is not None
        assert self.flattest is not None
        slope = 0.5 * (self.steepest.slope + self.flattest.slope)
        same = self.steepest.slope == self.flattest.slope
        at = self.steepest.at if same else self.steepest.meets(self.flattest)
        return Line(at, self.steepest.value(at), slope)


def _tightest(x: float, y: float, others: list[tuple[float, float]], *, most: bool) -> Line | None:
    """The line through a new border point and the earlier point of the other border that limits its slope."""
    slopes = [(y - other_y) / (x - other_x) for other_x, other_y in others if other_x < x]
    if not slopes:
        return None
    return Line(x, y, max(slopes) if most else min(slopes))
