"""The order of blocks: jumps, IF, loops, repeated sections, subprograms, each bounded by the settings.

Going forward to a label or past a branch is a search that also works on blocks that have not come yet; going back needs
blocks that are held.
"""

from __future__ import annotations

from planner.gcode import Block, Expression, Name
from planner.gcode.statement import (
    Case,
    Extern,
    For,
    If,
    Jump,
    Mark,
    Marker,
    RepeatSection,
    Return,
    Statement,
    Until,
    While,
)
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.levels import Level, Opened, Search, Section, keep_track, skip
from sim.interpreter.settings import Settings
from sim.interpreter.structures import CLOSES, ENDS, glance, is_target, second_else
from sim.interpreter.values import Variables, are_equal, as_integer, as_number, evaluate, is_same


class Flow:
    """Statements of flow on one level at a time."""

    def __init__(self, settings: Settings, variables: Variables) -> None:
        self._settings, self._variables = settings, variables
        self._repeats = 0

    def count_repeat(self) -> None:
        """One more jump, or one more block that runs again; ControlAlarm beyond the limit."""
        self._repeats += 1
        if self._repeats > self._settings.max_repeats:
            limit = self._settings.max_repeats
            text = f"more than {limit} jumps and repeated blocks: the program may never end; fewer are expected"
            raise ControlAlarm(AlarmNumber.LOOP_LIMIT, text)

    def count_block(self, level: Level, index: int) -> None:
        """A block is about to run; those that run again count."""
        if level.is_repeat or index < level.furthest:
            self.count_repeat()
        else:
            level.furthest = index + 1

    def act(self, level: Level, index: int, statement: Statement) -> None:
        """Carry out a statement of flow that stands at `index`; definitions and calls are not of flow."""
        match statement:
            case Jump():
                self._jump(level, index, statement)
            case Case():
                self._case(level, index, statement)
            case If() | While() | For():
                self._open(level, index, statement)
            case Until(condition):
                self._until(level, condition)
            case Mark(marker):
                self._mark(level, index, marker)
            case RepeatSection():
                self._repeat(level, index, statement)
            case Extern() | Return():
                return
            case _:
                raise ControlAlarm(AlarmNumber.BLOCK_NOT_INTERPRETABLE, "the statement has no meaning here")

    def look(self, level: Level, index: int, block: Block) -> bool:
        """While a search runs: whether this block ends it (then it is executed if a label was looked for)."""
        search = level.search
        assert search is not None
        if search.kind == "label":
            if is_target(block, search.target):
                level.search = None
                return True
            keep_track(level, index, block.statement)
            return False
        skip(level, index, block.statement, search.kind)
        return False

    def unresolved(self, level: Level) -> None:
        """The program has ended while a search ran: GOTO looks back, GOTOC goes on, everything else is an alarm."""
        search = level.search
        assert search is not None
        level.search = None
        if search.kind != "label" or search.jump is None:
            kind = "IF" if search.kind == "else" else search.kind
            raise ControlAlarm(AlarmNumber.NESTING, f"{kind} has no end; {ENDS[kind]} is expected")
        if search.jump.keyword in ("GOTO", "GOTOC"):
            found = self._find_back(level, search.target, search.origin - 1)
            if found is not None:
                self._go_back(level, found)
                return
            if search.jump.keyword == "GOTOC":
                level.at = search.origin
                return
        raise ControlAlarm(AlarmNumber.JUMP_TARGET, f"the jump target {search.target} is not in the program")

    def require_closed(self, level: Level) -> None:
        """A program that ends must have closed what it opened."""
        if level.opened:
            kind = level.opened[-1].kind
            raise ControlAlarm(
                AlarmNumber.NESTING, f"{kind} has no end; {ENDS[kind]} before the program ends is expected"
            )

    def section_end(self, level: Level) -> None:
        """Before a block is taken: a repeated section may have come to its end."""
        while level.sections and level.at == level.sections[-1].stop:
            section = level.sections[-1]
            section.left -= 1
            if section.left > 0:
                self.count_repeat()
                level.at = section.start
                return
            level.sections.pop()
            level.at = section.resume

    def _true(self, condition: Expression) -> bool:
        return as_number(evaluate(condition, self._variables)) != 0.0

    def _jump(self, level: Level, index: int, jump: Jump) -> None:
        if jump.condition is not None and not self._true(jump.condition):
            return
        target = self._target(jump.target)
        if jump.keyword == "GOTOB":
            found = self._find_back(level, target, index)
            if found is None:
                raise ControlAlarm(AlarmNumber.JUMP_TARGET, f"the jump target {target} is not before this block")
            self._go_back(level, found)
            return
        self.count_repeat()
        level.search = Search("label", target, jump, index + 1, level.source.line(index))

    def _target(self, target: Expression) -> str:
        if isinstance(target, Name) and target.indices is None:
            cell = self._variables.find(target.name)
            return str(cell.values[0]).upper() if cell is not None and cell.type_name == "STRING" else target.name
        value = evaluate(target, self._variables)
        return value.upper() if isinstance(value, str) else f"N{as_integer(value)}"

    def _find_back(self, level: Level, target: str, before: int) -> int | None:
        self._require_held(level)
        for index in range(before, -1, -1):
            raw = level.source.text(index)
            if raw is not None and is_target(glance(raw), target):
                return index
        return None

    def _go_back(self, level: Level, index: int) -> None:
        self._require_held(level)
        self.count_repeat()
        level.at = index
        while level.opened and level.opened[-1].index >= index:
            level.opened.pop()

    def _require_held(self, level: Level) -> None:
        if self._settings.is_drip_fed and level.is_main:
            raise ControlAlarm(
                self._settings.backward_jump_alarm,
                "the program goes back to blocks that a drip-fed control no longer holds; load it to its memory",
            )

    def _case(self, level: Level, index: int, case: Case) -> None:
        selector = evaluate(case.selector, self._variables)
        for value, jump in case.branches:
            if are_equal(evaluate(value, self._variables), selector):
                self._jump(level, index, jump)
                return
        if case.default is not None:
            self._jump(level, index, case.default)

    def _open(self, level: Level, index: int, statement: If | While | For) -> None:
        match statement:
            case If(condition):
                kind, enters = "IF", self._true(condition)
            case While(condition):
                kind, enters = "WHILE", self._true(condition)
            case For():
                first = as_number(evaluate(statement.first, self._variables))
                kind, enters = "FOR", self._set_counter(statement, first)
        if enters:
            level.opened.append(Opened(kind, index, statement, level.source.line(index)))
        else:
            level.depth = 0
            kind = "else" if kind == "IF" else kind
            level.search = Search(kind, origin=index + 1, line=level.source.line(index))

    def _set_counter(self, statement: For, value: float) -> bool:
        indices = tuple(evaluate(one, self._variables) for one in statement.index or ())
        self._variables.write(statement.variable, indices, value)
        last = as_number(evaluate(statement.last, self._variables))
        return value < last or is_same(value, last)

    def _mark(self, level: Level, index: int, marker: Marker) -> None:
        if marker in (Marker.LOOP, Marker.REPEAT):
            level.opened.append(Opened(marker.value, index, Mark(marker), level.source.line(index)))
        elif marker is Marker.ELSE:
            if self._close(level, "IF", "ELSE").statement == Mark(Marker.ELSE):
                raise second_else()
            level.depth = 0
            level.search = Search("IF", origin=index + 1, line=level.source.line(index))
        else:
            self._end(level, CLOSES[marker], marker.value)

    def _close(self, level: Level, kind: str, word: str) -> Opened:
        if not level.opened or level.opened[-1].kind != kind:
            raise ControlAlarm(AlarmNumber.NESTING, f"{word} closes nothing; {kind} before it is expected")
        return level.opened.pop()

    def _end(self, level: Level, kind: str, word: str) -> None:
        opened = self._close(level, kind, word)
        statement = opened.statement
        if kind in ("WHILE", "LOOP"):
            self._go_back(level, opened.index)
        elif isinstance(statement, For):
            indices = tuple(evaluate(one, self._variables) for one in statement.index or ())
            value = as_number(self._variables.read(statement.variable, indices)) + 1.0
            if self._set_counter(statement, value):
                self._go_back(level, opened.index + 1)
                level.opened.append(opened)

    def _until(self, level: Level, condition: Expression) -> None:
        opened = self._close(level, "REPEAT", "UNTIL")
        if not self._true(condition):
            self._go_back(level, opened.index)

    def _repeat(self, level: Level, index: int, section: RepeatSection) -> None:
        count = 1 if section.count is None else as_integer(evaluate(section.count, self._variables))
        start = self._find_label(level, section.start, index)
        if section.is_single_block:
            stop = start + 1
        elif section.end is not None:
            stop = self._find_label(level, section.end, index) + 1
        else:
            stop = index
        if stop <= start:
            text = "the section to repeat ends before it starts; its labels the other way round are expected"
            raise ControlAlarm(AlarmNumber.JUMP_TARGET, text)
        if count < 1:
            return
        if len(level.sections) >= self._settings.max_call_depth:
            raise ControlAlarm(AlarmNumber.CALL_DEPTH, "repeated sections are nested too deeply")
        self._require_held(level)
        self.count_repeat()
        level.sections.append(Section(start, stop, count, index + 1))
        level.at = start

    def _find_label(self, level: Level, label: str, index: int) -> int:
        found = self._find_back(level, label, index)
        place = index
        while found is None:
            place += 1
            raw = level.source.text(place)
            if raw is None:
                raise ControlAlarm(AlarmNumber.JUMP_TARGET, f"the label {label} is not in the program")
            if is_target(glance(raw), label):
                found = place
        return found
