"""From programmed coordinates to canonical ones: the frame in force plus the difference of settable offsets."""

from __future__ import annotations

from collections.abc import Mapping as Table
from dataclasses import dataclass

from sim.interpreter.canon import Vector
from sim.interpreter.frames import ORIGIN, Frame, add, scaled, subtract
from sim.interpreter.settings import Settings
from sim.interpreter.state import State


@dataclass(frozen=True, slots=True)
class Mapping:
    """canonical = frame(programmed) + shift."""

    frame: Frame
    shift: Vector

    def point(self, programmed: Vector) -> Vector:
        """The canonical point."""
        return add(self.frame.point(programmed), self.shift)

    def inverse_point(self, canonical: Vector) -> Vector:
        """The programmed point."""
        return self.frame.inverse_point(subtract(canonical, self.shift))

    @property
    def total_shift(self) -> Vector:
        """Canonical minus programmed coordinates where the frame only shifts."""
        return add(self.frame.shift, self.shift)

    def moved_to(self, position: Vector, programmed: dict[int, float]) -> tuple[Vector, Vector]:
        """Programmed and canonical end of a move from canonical `position`; axes not named stay exactly."""
        values = list(self.inverse_point(position))
        for index, value in programmed.items():
            values[index] = value
        end = (values[0], values[1], values[2])
        if not self.frame.is_identity_matrix:
            return end, self.point(end)
        total = self.total_shift
        kept = [programmed[i] + total[i] if i in programmed else position[i] for i in range(3)]
        return end, (kept[0], kept[1], kept[2])


def mapping_of(state: State, settings: Settings, *, is_suppressed: bool) -> Mapping:
    """The mapping in force; G53, G153 and SUPA suppress frame and offsets for one block (machine coordinates)."""
    base = settings.work_offsets_mm.get(settings.reference_offset, ORIGIN)
    if is_suppressed:
        return Mapping(Frame(), scaled(base, -1.0))
    active = offset_of(settings.work_offsets_mm, state.work_offset)
    return Mapping(state.frame, subtract(active, base))


def offset_of(offsets: Table[str, Vector], name: str) -> Vector:
    """The settable offset of this name; G500 is none."""
    return ORIGIN if name == "G500" else offsets.get(name, ORIGIN)
