"""Two views of cutting moves as inline SVG: from above and from the front; plain text, no library."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planner.path.model import Array

Lines = Sequence[Array]
_MARGIN = 0.06
_MOST_POINTS = 6000


def top_view(lines: Lines, stock_box_mm: tuple[Array, Array] | None) -> str:
    """X to the right, Y up."""
    return _view(lines, stock_box_mm, (0, 1), "from above")


def side_view(lines: Lines, stock_box_mm: tuple[Array, Array] | None) -> str:
    """X to the right, Z up; the first, the middle and the last move only."""
    chosen = sorted({0, len(lines) // 2, len(lines) - 1})
    return _view([lines[index] for index in chosen], stock_box_mm, (0, 2), "from the front")


def _view(lines: Lines, stock_box_mm: tuple[Array, Array] | None, axes: tuple[int, int], label: str) -> str:
    flat = _thinned([np.stack([line[:, axes[0]], -line[:, axes[1]]], axis=1) for line in lines])
    corners = [np.concatenate(flat)]
    box = None
    if stock_box_mm is not None:
        low, high = ([end[axes[0]], -end[axes[1]]] for end in stock_box_mm)
        box = np.array([low, high])
        corners.append(box)
    corners.append(np.zeros((1, 2)))
    every = np.concatenate(corners)
    low_corner, high_corner = every.min(axis=0), every.max(axis=0)
    size = np.maximum(high_corner - low_corner, 1e-3)
    margin = _MARGIN * size.max()
    frame = (*(low_corner - margin), *(size + 2 * margin))
    box_text = " ".join(f"{value:.4g}" for value in frame)
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{label}" viewBox="{box_text}">']
    if box is not None:
        x, y = box.min(axis=0)
        width, height = np.ptp(box, axis=0)
        parts.append(f'<rect class="stock" x="{x:.4g}" y="{y:.4g}" width="{width:.4g}" height="{height:.4g}"/>')
    parts += [f'<polyline class="cut" points="{_text(line)}"/>' for line in flat]
    parts.append(_zero_point(margin))
    first = flat[0][0]
    parts.append(f'<circle class="start" cx="{first[0]:.5g}" cy="{first[1]:.5g}" r="{0.2 * margin:.3g}"/>')
    return "".join([*parts, "</svg>"])


def _zero_point(size: float) -> str:
    """A cross at the work origin."""
    half = 0.6 * size
    return (
        f'<path class="zero" d="M{-half:.3g} 0H{half:.3g}M0 {-half:.3g}V{half:.3g}"/>'
        f'<circle class="zero" cx="0" cy="0" r="{0.5 * half:.3g}"/>'
    )


def _text(line: Array) -> str:
    return " ".join(f"{x:.5g},{y:.5g}" for x, y in line.tolist())


def _thinned(lines: list[Array]) -> list[Array]:
    """Lines with at most some thousand points in all; the ends of each are kept."""
    total = sum(len(line) for line in lines)
    step = max(1, -(-total // _MOST_POINTS))
    return [line if len(line) < 3 else np.concatenate([line[:-1:step], line[-1:]]) for line in lines]
