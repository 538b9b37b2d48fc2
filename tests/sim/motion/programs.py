"""Random programs for the limit checks, reproducible from a seed."""

from __future__ import annotations

import itertools
import math
import random

import numpy as np

from sim.interpreter import canon
from sim.interpreter.canon import PathMode, Vector


def random_program(seed: int, kinds: tuple[str, ...], mode: PathMode) -> list[canon.Command]:
    """Lines, rapids, arcs, helices and cubics end to end, with exact stops and dwells strewn in."""
    source = random.Random(seed)
    program: list[canon.Command] = [canon.SetPathMode(0, None, mode, source.choice([None, 0.001, 0.01, 0.1]))]
    at: Vector = (0.0, 0.0, 0.0)
    scale = 10 ** source.uniform(-2.0, 1.2)
    for line in range(1, source.randint(3, 12)):
        feed = 10 ** source.uniform(2.0, 4.0)
        if source.random() < 0.1:
            program.append(canon.ExactStopOnce(line, None))
        if source.random() < 0.05:
            program.append(canon.Dwell(line, None, 0.02))
        motion = _motion(source, source.choice(kinds), line, at, scale, feed)
        program.append(motion)
        at = motion.end
    return program


def dense_program(seed: int, mode: PathMode) -> list[canon.Command]:
    """300 short cuts along a wave as a CAM system writes them: rounded to 1 um, so that gentle bends change sides."""
    source = random.Random(seed)
    step, amplitude, wave = 10 ** source.uniform(-1.3, -0.2), source.uniform(0.0, 3.0), source.uniform(2.0, 30.0)
    points = [(0.0, 0.0, 0.0)]
    for k in range(1, 301):
        x = k * step
        y, z = amplitude * math.sin(x / wave), 0.3 * amplitude * math.cos(x / wave) - 0.3 * amplitude
        points.append((round(x, 3), round(y, 3), round(z, 3)))
    feed = 10 ** source.uniform(2.3, 3.8)
    cuts = [canon.Line(line, None, *ends, feed) for line, ends in enumerate(itertools.pairwise(points), start=1)]
    return [canon.SetPathMode(0, None, mode, source.choice([None, 0.001, 0.01])), *cuts]


def _motion(
    source: random.Random, kind: str, line: int, at: Vector, scale: float, feed: float
) -> canon.Rapid | canon.Line | canon.Arc | canon.Polynomial:
    size = scale * 10 ** source.uniform(-1.0, 0.5)
    end = (at[0] + source.gauss(0, size), at[1] + source.gauss(0, size), at[2] + source.gauss(0, size))
    if kind == "rapid":
        return canon.Rapid(line, None, at, end)
    if kind == "line":
        return canon.Line(line, None, at, end, feed)
    if kind == "arc":
        sweep, rise = source.uniform(0.1, 6.0), source.choice([0.0, source.gauss(0, size)])
        centre = (at[0] - size, at[1], at[2])
        end = (centre[0] + size * math.cos(sweep), centre[1] + size * math.sin(sweep), at[2] + rise)
        return canon.Arc(line, None, at, end, centre, (0.0, 0.0, 1.0), sweep, feed)
    step = np.subtract(end, at)
    bow = [np.array([source.gauss(0, 0.4 * size) for _ in range(3)]) for _ in range(2)]
    rows = [np.array(at), step + bow[0], bow[1], -bow[0] - bow[1]]
    coefficients = tuple((float(x), float(y), float(z)) for x, y, z in rows)
    last = np.sum(rows, axis=0)
    target = (float(last[0]), float(last[1]), float(last[2]))
    return canon.Polynomial(line, None, at, target, coefficients, (1.0,), 1.0, feed)
