"""TRANS, ROT, SCALE, MIRROR, their additive forms, G58, G59 and the working-area limits G25, G26."""

from __future__ import annotations

import math
from dataclasses import replace

from planner.gcode import ModalGroup
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Vector
from sim.interpreter.frames import Frame, Matrix, diagonal, product, rotation_about
from sim.interpreter.request import Request
from sim.interpreter.state import INCH_MM, State


def program_frame(code: str, request: Request, state: State) -> None:
    """Set or extend the programmable frame; a substituting code replaces all that stood, bare it clears it."""
    is_additive = code.startswith("A")
    base = state.frame if is_additive or code in ("G58", "G59") else Frame()
    kind = code.removeprefix("A")
    factor = INCH_MM if state.is_inch else 1.0
    values = {index: coordinate.value for index, coordinate in request.axes.items()}
    if any(coordinate.is_absolute is not None for coordinate in request.axes.values()):
        raise ControlAlarm(
            AlarmNumber.FRAME, f"{code} takes plain values, not AC or IC", request.column_of(ModalGroup.FRAME)
        )
    request.axes.clear()
    if kind == "TRANS":
        shift = _vector(values, factor)
        state.frame = base.translated(shift) if is_additive else Frame(coarse=shift)
    elif kind in ("G58", "G59"):
        part = base.coarse if kind == "G58" else base.fine
        new = [values[index] * factor if index in values else part[index] for index in range(3)]
        moved = (new[0], new[1], new[2])
        state.frame = replace(base, coarse=moved) if kind == "G58" else replace(base, fine=moved)
    else:
        state.frame = base.turned(_linear(kind, values, request, state))


def _linear(kind: str, values: dict[int, float], request: Request, state: State) -> Matrix:
    if kind == "ROT":
        return _rotation(values, request.take("RPL"), state)
    if kind == "SCALE":
        factors = [values.get(index, 1.0) for index in range(3)]
        if any(abs(factor) < 1e-6 for factor in factors):
            raise ControlAlarm(AlarmNumber.FRAME, "SCALE by 0 leaves no space; a factor other than 0 is expected")
        return diagonal(*factors)
    return diagonal(*(-1.0 if index in values else 1.0 for index in range(3)))


def _rotation(values: dict[int, float], plane_angle_deg: float | None, state: State) -> Matrix:
    """RPL turns the plane; X, Y, Z are RPY angles: about Z, then the new Y, then the new X."""
    if plane_angle_deg is not None:
        if values:
            raise ControlAlarm(AlarmNumber.FRAME, "ROT takes RPL or axes, not both")
        return rotation_about(state.plane_axes[2], math.radians(plane_angle_deg))
    angles = [math.radians(values.get(index, 0.0)) for index in range(3)]
    about_z, about_y, about_x = (rotation_about(index, angles[index]) for index in (2, 1, 0))
    return product(product(about_z, about_y), about_x)


def program_limits(code: str, request: Request, state: State) -> None:
    """G25 lower, G26 upper limits: of the working area by axis, of the spindle by S."""
    factor = INCH_MM if state.is_inch else 1.0
    speed = request.take("S")
    if speed is not None:
        if code == "G25":
            state.spindle_min_rpm = speed
        else:
            state.spindle_max_rpm = speed
    values = {index: coordinate.value * factor for index, coordinate in request.axes.items()}
    if not values and speed is None:
        raise ControlAlarm(AlarmNumber.PARAMETERS, f"{code} limits nothing; axes or S are expected")
    request.axes.clear()
    old = state.area_min_mm if code == "G25" else state.area_max_mm
    new = (values.get(0, old[0]), values.get(1, old[1]), values.get(2, old[2]))
    if code == "G25":
        state.area_min_mm = new
    else:
        state.area_max_mm = new


def _vector(values: dict[int, float], factor: float) -> Vector:
    return (values.get(0, 0.0) * factor, values.get(1, 0.0) * factor, values.get(2, 0.0) * factor)
