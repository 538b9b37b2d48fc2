"""One pass over a program: every line past the text rules, every block past the word rules, every command past the
motion rules, at constant memory. After an alarm the refused block is left out and the rest is checked as well.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from dnc.check.finding import Collection, Finding, Severity
from dnc.check.limits import Limits
from dnc.check.motion_rules import COMMAND_RULES
from dnc.check.number_rules import NUMBER_RULES
from dnc.check.plain_runs import (
    SHORTEST_RUN,
    cut_sizes_bytes,
    cut_times_ns,
    doubtful,
    see_numbers,
    see_run,
    steady_lines,
    stretches,
    takes_runs,
)
from dnc.check.program_rules import END_RULES, last_block_end, not_checked, wrong_stamp
from dnc.check.rate import LineSizes, RateWindow, move_time_s, rate_findings, whole_ns
from dnc.check.text_rules import LINE_RULES, UTF8_MARK, UTF16_MARKS, allowed_lines, encoding_mark, is_clean
from dnc.check.track import Track
from dnc.check.word_rules import BLOCK_RULES, IDLE_CODES, idle_words, iso_comment
from dnc.control_side import settings_of
from dnc.errors import InputRejected
from planner.files import program_chunks
from planner.gcode import Block, SyntaxProblem, read_block
from planner.post.stamp import read_stamp
from sim.interpreter import canon
from sim.interpreter.bulk import straight_run
from sim.interpreter.plain import PlainLines, plain_lines
from sim.interpreter.run import Interpreter
from sim.interpreter.settings import Settings

_STAMP_LINES = 10
_NUMBER = rb"-?(?:\d+\.?\d*|\.\d+)"
_WORDS = rb"(?:[XYZF]%b|PO\[[XYZ]\]=\((?:%b,)*%b\)) ?" % (_NUMBER, _NUMBER, _NUMBER)
_PLAIN = re.compile(rb"(?:N(\d{1,8}) ?)?(?:G0?([01]) ?(?:G9 ?)?|(POLY) )?(?:%b)+(PL=%b ?)?" % (_WORDS, _NUMBER))
_POINT = re.compile(rb"[XYZ][-.\d]")
_READYING = frozenset({"M", "M1", "S", "S1", "T"})
_MOST_ALARMS = 100
Progress = Callable[[int], None]
Watch = Callable[[canon.Command], None]


class Check:
    """The running check of one program; give it the lines in order, then finish."""

    def __init__(self, limits: Limits, settings: Settings | None = None, watch: Watch | None = None) -> None:
        self.limits = limits
        self._watch = watch
        self.found = Collection()
        self._last_byte = b""
        self.track = Track(limits, is_inch=limits.profile.control.units == "inch")
        self._settings = settings or _settings(limits, None)
        self._interpreter: Interpreter | None = Interpreter(self._settings)
        self._windows = (RateWindow(1.0), RateWindow(1.2))
        self._errors_here = False
        self._readies_here = False
        self._alarms = 0
        self._sizes = LineSizes()

    def line(self, raw: bytes, number: int) -> None:
        """Check one line, its end attached."""
        self._last_byte = raw[-1:]
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
        motion_code = self.track.motion_code
        self.track.is_passed_over = self._interpreter is not None and self._interpreter.is_passing_over
        is_plain = self._plain(body, number)
        block = None if is_plain else self._block(body, number)
        self._readies_here = not is_plain and (block is None or any(word.address in _READYING for word in block.words))
        if self._interpreter is None:
            return
        self._sizes.note(number, len(raw))
        commands = self._interpreter.block(body, number, block)
        is_left_out = self.track.is_passed_over and self._interpreter.is_passing_over
        if is_left_out:
            self.track.motion_code = motion_code
        if commands:
            self._commands(commands)
        elif is_left_out:
            return
        elif self._interpreter.modal.compensation == "G40" and self.track.motion_code in IDLE_CODES:
            self._idle(block or _read(body, number))  # otherwise the move waits for the next

    def chunk(self, data: bytes, first_line: int) -> int:
        """Check whole lines, those with plain blocks in bulk where that gives the same; the number of the next line."""
        self._last_byte = data[-1:]
        lines = plain_lines(data)
        starts, is_steady = lines.starts.tolist(), steady_lines(lines) & allowed_lines(data, lines.starts, self.limits)
        count = len(is_steady)
        breaks = np.append(np.flatnonzero(~is_steady), count)
        index = 0
        while index < count:
            stop = int(breaks[np.searchsorted(breaks, index)])
            if stop - index >= SHORTEST_RUN and self._takes_runs(first_line + index):
                index = self._steady(data, lines, index, stop, first_line)
            else:
                self.line(data[starts[index] : starts[index + 1]], first_line + index)
                index += 1
        return first_line + count

    def finish(self) -> Collection:
        """The findings, those of the whole program included."""
        if self._interpreter is not None:
            self._commands(self._interpreter.finish())
        for end_rule in END_RULES:
            self.found.add(end_rule(self.track))
        if not self.limits.profile.tape.trailer:
            self.found.add(last_block_end(self.track, self._last_byte))
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

    def _takes_runs(self, line: int) -> bool:
        interpreter = self._interpreter
        return line > _STAMP_LINES and interpreter is not None and takes_runs(interpreter, self.track)

    def _steady(self, data: bytes, lines: PlainLines, index: int, stop: int, first_line: int) -> int:
        """Check plain lines `index` to `stop`; the index of the first that is not done."""
        interpreter = self._interpreter
        assert interpreter is not None
        starts = lines.starts
        for low, high in stretches(doubtful(lines.values[index:stop], interpreter, self.track)):
            rows = slice(index + low, index + high)
            if high - low >= SHORTEST_RUN and self._takes_runs(first_line + rows.start):
                self._run(interpreter, lines, rows, first_line + rows.start)
                continue
            for row in range(rows.start, rows.stop):
                self.line(data[starts[row] : starts[row + 1]], first_line + row)
                if self._interpreter is not interpreter:
                    return row + 1
        return stop

    def _run(self, interpreter: Interpreter, lines: PlainLines, rows: slice, first_line: int) -> None:
        """Plain lines in which no rule finds anything."""
        values, sizes_bytes = lines.values[rows], np.diff(lines.starts[rows.start : rows.stop + 1])
        run = straight_run(interpreter, values, first_line)
        see_numbers(values, self.track)
        self.track.lines = first_line + len(values) - 1
        done = first_line
        if run is not None:
            see_run(run, self.track)
            done = int(run.lines[-1]) + 1
            sizes = cut_sizes_bytes(run, sizes_bytes, first_line)
            sizes[0] += self._sizes.up_to(first_line)
            for window in self._windows:
                window.add_many(cut_times_ns(run), sizes, run.lines)
            if self._watch is not None:
                for command in run.expand():
                    self._watch(command)
        for line in range(done, first_line + len(values)):
            self._sizes.note(line, int(sizes_bytes[line - first_line]))

    def _plain(self, body: bytes, line: int) -> bool:
        """A block of plain coordinates, which only its number can make wrong; False for any other."""
        found = _PLAIN.fullmatch(body)
        if found is None:
            return False
        code = f"G{found[2].decode()}" if found[2] else "POLY" if found[3] else None
        if self.track.motion_code == "BSPLINE" and (code is not None or _POINT.search(body) is None):
            return False  # a code ends the spline, and a feed alone is no point of it
        if self.track.motion_code == "G0" and code is None and b"F" in body:
            return False  # a G1 may have been lost
        number = int(found[1]) if found[1] else None
        if number is not None:
            block = Block(line, number)
            for rule in NUMBER_RULES:
                self._add(rule(block, self.track), line, number)
        self.track.see_plain(number, line, code, has_length=found[4] is not None)
        return True

    def _block(self, body: bytes, number: int) -> Block | None:
        """The block, past the rules for blocks; None where it cannot be read."""
        block = _read(body, number)
        if block is None:
            self._add(iso_comment(body.decode("latin-1"), number), number, None)
            return None  # otherwise the interpreter tells it, as an alarm
        for rule in BLOCK_RULES:
            self._add(rule(block, self.track), number, block.number)
        self.track.see_block(block)
        return block

    def _idle(self, block: Block | None) -> None:
        """A block that gave no command: perhaps coordinates of where the tool stands."""
        if block is not None:
            self._add(idle_words(block, self.track), block.line, block.number)

    def _commands(self, commands: list[canon.Command]) -> None:
        if self._interpreter is not None:
            self.track.is_incremental = self._interpreter.modal.dimension == "G91"
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
        self.track.forget(is_readiness_lost=self._readies_here)
        if self._alarms == _MOST_ALARMS:
            self._interpreter = None
            self.found.add(not_checked(alarm.line))
        else:
            fresh = Interpreter(self._settings)
            fresh.go_on_from(self._interpreter)
            self._interpreter = fresh

    def _time(self, command: canon.Command) -> None:
        time_ns = whole_ns(move_time_s(command, self.limits, self.track.length_mm))
        size = self._sizes.up_to(command.line)
        for window in self._windows:
            window.add(time_ns, size, command.line)


def _settings(limits: Limits, folder: Path | None) -> Settings:
    """Tools whose radius is not known run on the programmed contour, which is told."""
    return settings_of(
        limits.profile, tool_radii_mm=limits.tool_radii_mm, subprogram_folder=folder, unknown_radius_mm=0.0
    )


def _read(body: bytes, line: int) -> Block | None:
    """The block, or None where it cannot be read."""
    try:
        return read_block(body.decode("latin-1"), line)
    except SyntaxProblem:
        return None


def check_program(path: Path, limits: Limits, progress: Progress | None = None, watch: Watch | None = None) -> Check:
    """The finished check of a program file; `progress` hears the bytes done, `watch` every canonical command.

    Subprograms are looked for beside the program. Raises InputRejected for what cannot be read as a program.
    """
    dialect = limits.profile.control.dialect
    if dialect != "sinumerik":
        raise InputRejected(
            f"checking programs for {dialect} is not built yet", path=path, remedy="name a SINUMERIK machine"
        )
    settings = _settings(limits, path.parent)
    check = Check(limits, settings, watch)
    check.track.is_subprogram = path.suffix.lower() == ".spf"
    line, done_bytes = 1, 0
    for chunk in program_chunks(path):
        if line == 1 and chunk.startswith(UTF16_MARKS):
            check.found.add(encoding_mark(chunk, line, limits))
            return check
        line = check.chunk(chunk, line)
        done_bytes += len(chunk)
        if progress is not None:
            progress(done_bytes)
    if check.track.lines == 0:
        raise InputRejected("is empty", path=path, remedy="name a program file")
    check.finish()
    return check
