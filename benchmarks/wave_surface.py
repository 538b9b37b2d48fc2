"""Writes configs/surfaces/wave.toml: 300 x 300 mm, 60 x 60 control points on z = 5 sin(x / 20) cos(y / 15).

Run: python benchmarks/wave_surface.py configs/surfaces/wave.toml
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

COUNT, SIZE_MM, DEGREE = 60, 300.0, 3


def wave_text() -> str:
    """The file's text: uniform clamped knots, control points at the Greville abscissae."""
    knots = np.concatenate([np.zeros(DEGREE), np.linspace(0, 1, COUNT - DEGREE + 1), np.ones(DEGREE)])
    places = SIZE_MM * np.array([knots[i + 1 : i + 1 + DEGREE].mean() for i in range(COUNT)])
    knot_text = ", ".join(f"{knot:.12g}" for knot in knots)
    rows = []
    for y in places:
        points = (f"[{x:.6f}, {y:.6f}, {5 * np.sin(x / 20) * np.cos(y / 15):.6f}]" for x in places)
        rows.append("  [" + ", ".join(points) + "],")
    return "\n".join(
        [
            "# A gentle wave, 300 x 300 mm, for speed tests; made by benchmarks/wave_surface.py.",
            "# u runs along y, v along x, as in thesis.toml.",
            f"degree = [{DEGREE}, {DEGREE}]",
            f"knots_u = [{knot_text}]",
            f"knots_v = [{knot_text}]",
            "control_points = [",
            *rows,
            "]",
            "",
        ]
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(wave_text())
