"""One pass over a program: every line past the text rules, every block past the word rules, every command past the
motion rules, at constant memory. After an alarm the refused block is left out and the rest is checked as well.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from dnc.check.finding import Collection, Finding, Severity
from dnc.check.motion_rules import COMMAND_RULES
from dnc.check.program_rules import END_RULES, not_checked, wrong_stamp
from dnc.check.rate import RateWindow, move_time_s, rate_findings
from dnc.check.text_rules import LINE_RULES, UTF8_MARK, UTF16_MARKS, encoding_mark, is_clean
from dnc.check.track import Limits, Track
from dnc.check.word_rules import BLOCK_RULES, NUMBER_RULES, idle_words, iso_comment
from dnc.errors import InputRejected
from dnc.restart import resumed_interpreter
from planner.gcode import Block, SyntaxProblem, read_block
from planner.post.stamp import read_stamp
from sim.interpreter import canon
from sim.interpreter.run import Interpreter
from sim.interpreter.settings import Settings

_LINE_LIMIT_BYTES = 65536
_STAMP_LINES = 10
_PLAIN = re.compile(rb"(?:N(\d{1,8}) ?)?(G0?1 ?)?(?:[XYZF]-?(?:\d+\.?\d*|\.\d+) ?)+")
_MOST_ALARMS = 100
Progress = Callable[[int], None]
Watch = Callable[[canon.Command], None]


class Check:
    """The running check of one program; give it the lines in order, then finish."""

    def __init__(self, limits: Limits, settings: Settings | None = None, watch: Watch | None = None) -> None:
        self.limits = limits
        self._watch = watch
        self.found = Collection()
        self.track = Track(limits)
        self._settings = settings or Settings(is_drip_fed=True)
        self._interpreter: Interpreter | None = Interpreter(self._settings)
        self._windows = (RateWindow(1.0), RateWindow(1.2))
        self._errors_here = False
        self._alarms = 0
        self._sizes: deque[tuple[int, int]] = deque()

    def line(self, raw: bytes, number: int) -> None:
        """Check one line, its end attached."""
        self.track.lines = number
        self._errors_here = False
        if not is_clean(raw, number, self.limits):
            for line_rule in LINE_RULES:
                self._add(line_rule(raw, number, self.limits), number, None)
        if number <= _STAMP_LINES:
            stamp = read_stamp(raw)
            if stamp is not None:
                self._add(wrong_stamp(stamp, number, self.limits), number, None)
        body = raw.rstrip(b"\r\n").removeprefix(UTF8_MARK)
        if not self._plain(body, number):
            self._block(body, number)
        if self._interpreter is None:
            return
        self._sizes.append((number, len(raw)))
        commands = self._interpreter.block(body, number)
        if commands:
            self._commands(commands)
        else:
            self._idle(body, number)

    def finish(self) -> Collection:
        """The findings, those of the whole program included."""
        if self._interpreter is not None:
            self._commands(self._interpreter.finish())
        for end_rule in END_RULES:
            self.found.add(end_rule(self.track))
        self.found.add(rate_findings(self._windows, self.limits))
        return self.found

    @property
    def need_bytes_s(self) -> float:
        """What the worst 2 s of the program need of the line at 120 % override, bytes a second."""
        return self._windows[-1].worst_bytes_s

    def _add(self, found: Iterable[Finding], line: int, block: int | None) -> None:
        for finding in found:
            self._errors_here |= finding.severity is Severity.ERROR
            self.found.keep(finding, line, block)

    def _plain(self, body: bytes, line: int) -> bool:
        """A block of plain coordinates, which only its number can make wrong; False for any other."""
        found = _PLAIN.fullmatch(body)
        if found is None or self.track.motion_code == "BSPLINE":
            return False
        number = int(found[1]) if found[1] else None
        if number is not None:
            block = Block(line, number)
            for rule in NUMBER_RULES:
                self._add(rule(block, self.track), line, number)
        self.track.see_plain(number, line, is_cut=found[2] is not None)
        return True

    def _block(self, body: bytes, number: int) -> None:
        text = body.decode("latin-1")
        try:
            block = read_block(text, number)
        except SyntaxProblem:
            self._add(iso_comment(text, number), number, None)
            return  # otherwise the interpreter tells it, as an alarm
        for rule in BLOCK_RULES:
            self._add(rule(block, self.track), number, block.number)
        self.track.see_block(block)

    def _idle(self, body: bytes, number: int) -> None:
        """A block that gave no command: perhaps coordinates of where the tool stands."""
        try:
            block = read_block(body.decode("latin-1"), number)
        except SyntaxProblem:
            return
        self._add(idle_words(block, self.track), number, block.number)

    def _commands(self, commands: list[canon.Command]) -> None:
        for command in commands:
            is_told = isinstance(command, canon.Alarm) and self._errors_here
            for rule in () if is_told else COMMAND_RULES.get(type(command), ()):
                for finding in rule(command, self.track):
                    self.found.keep(finding, command.line, command.block)
            self.track.see_command(command)
            self._time(command)
            if self._watch is not None:
                self._watch(command)
            if isinstance(command, canon.Alarm) and self._interpreter is not None:
                self._carry_on(command)

    def _carry_on(self, alarm: canon.Alarm) -> None:
        assert self._interpreter is not None
        self._alarms += 1
        if self._alarms == _MOST_ALARMS:
            self._interpreter = None
        else:
            self._interpreter = resumed_interpreter(self._interpreter.state, self._settings)
        if self._interpreter is None:
            self.found.add(not_checked(alarm.line))

    def _time(self, command: canon.Command) -> None:
        time_s = move_time_s(command, self.limits)
        size = 0
        while self._sizes and self._sizes[0][0] <= command.line:
            size += self._sizes.popleft()[1]
        for window in self._windows:
            window.add(time_s, size, command.line)


def lines_of(path: Path) -> Iterator[bytes]:
    """The lines of a program, ends attached, none longer than 64 KiB in memory; raises InputRejected."""
    if not path.is_file():
        what = "is a directory" if path.is_dir() else "is not a regular file" if path.exists() else "does not exist"
        raise InputRejected(what, path=path, remedy="name a program file")
    try:
        with path.open("rb") as file:
            while raw := file.readline(_LINE_LIMIT_BYTES):
                yield raw
                while not raw.endswith(b"\n") and (raw := file.readline(_LINE_LIMIT_BYTES)):
                    pass
    except OSError as problem:
        raise InputRejected(f"cannot be read: {problem.strerror}", path=path, remedy="check the rights") from None


def check_program(path: Path, limits: Limits, progress: Progress | None = None, watch: Watch | None = None) -> Check:
    """The finished check of a program file; `progress` hears the bytes done, `watch` every canonical command.

    Subprograms are looked for beside the program. Raises InputRejected for what cannot be read as a program.
    """
    dialect = limits.profile.control.dialect
    if dialect != "sinumerik":
        raise InputRejected(
            f"checking programs for {dialect} is not built yet", path=path, remedy="name a SINUMERIK machine"
        )
    check = Check(limits, Settings(is_drip_fed=True, subprogram_folder=path.parent), watch)
    done = 0
    for number, raw in enumerate(lines_of(path), 1):
        if number == 1 and raw.startswith(UTF16_MARKS):
            check.found.add(encoding_mark(raw, number, limits))
            return check
        check.line(raw, number)
        done += len(raw)
        if progress is not None and number % 4096 == 0:
            progress(done)
    if check.track.lines == 0:
        raise InputRejected("is empty", path=path, remedy="name a program file")
    check.finish()
    return check
