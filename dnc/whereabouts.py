"""What a program leaves to the control while it runs: where axes stand, the work offset, values that it reads.

A restart is computed from blocks alone, so nothing may be taken for known that only the control can tell.
"""

from __future__ import annotations

from collections.abc import Iterable

from planner.gcode import GROUP_OF, Block, Call, ModalGroup, Word, code_of
from sim.interpreter import canon
from sim.interpreter.run import Interpreter
from sim.interpreter.values import Variables

_IN_MACHINE = frozenset({ModalGroup.SUPPRESSION, ModalGroup.ONE_SHOT})
"""Codes in whose blocks X, Y and Z are no places in the program's own coordinates; those of frames move nothing."""
_OF_PLACES = frozenset({"$AA_IW", "$P_EP"})
_OF_THE_CONTROL = frozenset({"$AA_IM", "$P_TOOLR"})


class Whereabouts:
    """Which axes stand where only the control can tell: it alone knows its work offsets, and where it began.

    Those are axes that were moved in machine coordinates (SUPA, G53, reference points) or before the work offset
    changed, until a dimension in the program's own coordinates moves them again. `untold` are those that no such
    dimension has moved yet: they stand where the operator left them. What is read of `counters` moves nothing.
    """

    def __init__(self, *, are_offsets_known: bool, counters: frozenset[int] = frozenset()) -> None:
        self._are_offsets_known = are_offsets_known
        self._counters = {f"R{number}" for number in counters}
        self._moved: set[int] = set()
        self._unsure: set[int] = set()
        self._is_offset_named = False
        self._read = ""
        self._calls = 0
        self.untold = frozenset(range(3))

    @property
    def obstacle(self) -> str | None:
        """Why no restart can begin here, or None; what `untold` axes ask for is not looked at."""
        if self._unsure and not self._are_offsets_known:
            where = f"where {names(self._unsure)} stands depends on work offsets"
            return f"{where} that only the control knows (SUPA, G53, another offset)"
        if not self._is_offset_named:
            return "no work offset is named before, and only the control knows which one is in force then"
        if self._read:
            return f"the program reads {self._read} before, and only the control knows that value"
        return None

    def note(
        self,
        block: Block | None,
        commands: Iterable[canon.Command],
        offset_before: str,
        interpreter: Interpreter,
        *,
        is_run: bool,
    ) -> None:
        """A block, `is_run` for sure; what it commanded; the work offset before it; the interpreter behind it."""
        after, frames = interpreter.modal, interpreter.frames
        self._note_reading(interpreter.variables)
        if after.work_offset != offset_before:
            self._unsure |= self._moved
        words = block.words if block else ()
        groups = {GROUP_OF.get(code) for code in map(code_of, words) if code}
        is_elsewhere = not groups.isdisjoint(_IN_MACHINE)
        for one in commands:
            if isinstance(one, canon.Motion):
                axes = {axis for axis in range(3) if one.start[axis] != one.end[axis]}
                self._moved |= axes
                self._unsure |= axes if is_elsewhere else set()
        if is_elsewhere:  # also where the axis seems to stand there already
            self._unsure |= {axis for axis, name in enumerate("XYZ") if any(word.address[0] == name for word in words)}
        self._moved |= frames.machine_axes
        self._unsure |= frames.machine_axes
        if frames.offsets - {after.work_offset}:  # a subprogram went there and came back
            self._unsure |= self._moved
        frames.clear()
        self._is_offset_named |= (is_run and ModalGroup.WORK_OFFSET in groups) or after.work_offset != "G500"
        is_call, self._calls = interpreter.calls != self._calls, interpreter.calls
        if block is None or not is_run or is_elsewhere or is_call or ModalGroup.FRAME in groups:
            return  # what a call names is moved before the subprogram, and that may move it again
        self._moved |= {axis for axis, name in enumerate("XYZ") if any(word.address == name for word in words)}
        if after.dimension == "G90":
            told = dimensions(block)
            self._unsure -= told
            self.untold -= told

    def _note_reading(self, variables: Variables) -> None:
        read = variables.unset_read - self._counters
        is_place_unsure = bool(self.untold or (self._unsure and not self._are_offsets_known))
        read |= variables.system_read & (_OF_PLACES if is_place_unsure else frozenset())
        read |= variables.system_read & (frozenset() if self._are_offsets_known else _OF_THE_CONTROL)
        variables.system_read.clear()
        self._read = self._read or min(read, default="")


def dimensions(block: Block) -> set[int]:
    """The axes whose end a block says, by a number or an expression: all but those that IC() moves, or a curve of PO().

    >>> from planner.gcode import read_block
    >>> dimensions(read_block("G1 X2 Y=R1+5 Z=IC(3)"))
    {0, 1}
    """
    named = {word.address: word for word in block.words}
    return {axis for axis, name in enumerate("XYZ") if name in named and _is_absolute(named[name])}


def _is_absolute(word: Word) -> bool:
    """Whether the value of an axis is the place itself where G90 is in force."""
    return word.value is not None and not (isinstance(word.value, Call) and word.value.name in ("IC", "PO"))


def names(axes: Iterable[int]) -> str:
    """Axes as an operator reads them.

    >>> names({2, 0})
    'X, Z'
    """
    return ", ".join("XYZ"[axis] for axis in sorted(axes))
