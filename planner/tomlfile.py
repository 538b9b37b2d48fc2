"""TOML files into typed values, with the line of every key in every complaint.

One door for jobs, surfaces and machine profiles: `load(path, Type)` reads, converts and rejects with one sentence.
The standard parser gives no line numbers, so `key_lines` walks the (already accepted) text once more.
"""

from __future__ import annotations

import math
import re
import stat
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from planner.errors import InputRejected
from planner.toml_complaints import conversion_error

T = TypeVar("T")
KeyPath = tuple[str | int, ...]
_KEY = re.compile(r"""[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*'""")
_BOMS = {b"\xef\xbb\xbf": "UTF-8 byte order mark", b"\xff\xfe": "UTF-16 text", b"\xfe\xff": "UTF-16 text"}


def load(
    path: Path, kind: type[T], *, error: type[InputRejected] = InputRejected, limit_bytes: int = 200_000_000
) -> tuple[T, dict[KeyPath, int]]:
    """The file as a value of this type, and the line of every key.

    `kind` is a msgspec.Struct with `forbid_unknown_fields`. Raises `error` with file, line and remedy: file absent,
    not a regular file, empty, not UTF-8 text, not TOML, unknown key (with the nearest known one), wrong type, NaN.
    """
    text = read_text(path, error=error, limit_bytes=limit_bytes)
    try:
        return _converted(text, path, kind, error)
    except RecursionError:
        raise error("is nested too deep", path=path, remedy="begin from a file of those shipped in configs/") from None


def _converted(text: str, path: Path, kind: type[T], error: type[InputRejected]) -> tuple[T, dict[KeyPath, int]]:
    """The text of the file as `load` gives it."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise _syntax_error(path, str(problem), error) from None
    except ValueError:  # Python reads no whole number beyond 4300 digits
        raise error("holds a whole number of thousands of digits", path=path, remedy="write it shorter") from None
    lines = key_lines(text)
    _reject_not_finite(data, (), path, lines, error)
    try:
        return msgspec.convert(data, kind, strict=True), lines
    except msgspec.ValidationError as problem:
        raise conversion_error(path, _with_name(str(problem), data, kind), kind, lines, error) from None


def _with_name(problem: str, data: dict[str, Any], kind: type[Any]) -> str:
    """The complaint with the name of the table it is about, where msgspec writes `[...]` for a name that is free.

    Tables of free names are converted one at a time, until one of them brings the same complaint.
    """
    above, mark, _ = problem.partition("[...]")
    _, here, names = above.partition("`$.")
    if not mark or not here:
        return problem
    steps = names.split(".")
    tables: Any = data
    for step in steps:
        tables = tables[step]
    for name in tables:
        try:
            msgspec.convert(_with_one(data, steps, name), kind, strict=True)
        except msgspec.ValidationError as again:
            if str(again) == problem:
                return problem.replace(mark, f".{name}", 1)
    return problem


def _with_one(data: dict[str, Any], steps: list[str], name: str) -> dict[str, Any]:
    """The data with nothing but `name` in the table that `steps` lead to."""
    if not steps:
        return {name: data[name]}
    return {**data, steps[0]: _with_one(data[steps[0]], steps[1:], name)}


def read_text(
    path: Path,
    *,
    error: type[InputRejected] = InputRejected,
    limit_bytes: int = 200_000_000,
    remedy: str = "begin from a TOML file of those shipped in configs/",
) -> str:
    """The text of a regular UTF-8 file; raises `error` with one sentence for anything else."""
    try:
        mode = path.stat().st_mode
    except OSError as problem:
        raise error(f"cannot be read: {problem.strerror}", path=path, remedy="check the name and the rights") from None
    except ValueError:  # it holds a NUL
        raise error(f"{str(path)!r} is no name of a file", remedy="check the name") from None
    if stat.S_ISDIR(mode):
        raise error("is a directory", path=path, remedy="name the file in it")
    if not stat.S_ISREG(mode):
        raise error("is not a regular file", path=path, remedy=remedy)
    if path.stat().st_size > limit_bytes:
        raise error(f"is larger than {limit_bytes} bytes", path=path, remedy="split it")
    try:
        raw = path.read_bytes()
    except OSError as problem:
        raise error(f"cannot be read: {problem.strerror}", path=path, remedy="check the name and the rights") from None
    for mark, name in _BOMS.items():
        if raw.startswith(mark):
            raise error(f"begins with {name}", path=path, line=1, remedy="save it as UTF-8 without a mark")
    if not raw.strip():
        raise error("is empty", path=path, remedy=remedy)
    try:
        return re.sub("\r+\n", "\n", raw.decode("utf-8"))  # a text converted twice has CR CR LF
    except UnicodeDecodeError as problem:
        line = raw.count(b"\n", 0, problem.start) + 1
        raise error("is not UTF-8 text", path=path, line=line, remedy="save it as UTF-8") from None


def key_lines(text: str) -> dict[KeyPath, int]:
    r"""The physical line (from 1) of every key and array element of a valid TOML text.

    >>> key_lines("a = 1\n[t]\nb = [1,\n 2]\n")[("t", "b", 1)]
    4
    """
    return dict(_Walker(text).walk())


class _Walker:
    """Walks valid TOML and yields (key path, line); it understands brackets and quotes, not values."""

    def __init__(self, text: str) -> None:
        self.text, self.at, self.line = text, 0, 1
        self.table: KeyPath = ()
        self.counts: dict[KeyPath, int] = {}

    def walk(self) -> Iterator[tuple[KeyPath, int]]:
        while self._skip_blank():
            if self.text[self.at] == "[":
                yield self._header()
            else:
                yield from self._pair(self.table)

    def _header(self) -> tuple[KeyPath, int]:
        line, many = self.line, self.text.startswith("[[", self.at)
        self._move(2 if many else 1)
        path = self._resolve(self._key("]"), many=many)
        self._move(2 if many else 1)
        self.table = path
        return path, line

    def _resolve(self, names: tuple[str, ...], *, many: bool) -> KeyPath:
        path: KeyPath = ()
        for depth, name in enumerate(names):
            path = (*path, name)
            if many and depth == len(names) - 1:
                self.counts[path] = self.counts.get(path, -1) + 1
            if path in self.counts:
                path = (*path, self.counts[path])
        return path

    def _pair(self, table: KeyPath) -> Iterator[tuple[KeyPath, int]]:
        line = self.line
        path = (*table, *self._key("="))
        self._move(1)
        yield path, line
        yield from self._value(path)

    def _key(self, stop: str) -> tuple[str, ...]:
        names: list[str] = []
        while True:
            self._skip_blank()
            found = _KEY.match(self.text, self.at)
            assert found is not None
            name = found.group()
            names.append(next(iter(tomllib.loads(f"{name} = 0"))))
            self._move(len(name))
            self._skip_blank()
            if self.text[self.at] == stop:
                return tuple(names)
            self._move(1)  # the dot

    def _value(self, path: KeyPath) -> Iterator[tuple[KeyPath, int]]:
        self._skip_blank()
        first = self.text[self.at]
        if first == "[":
            yield from self._array(path)
        elif first == "{":
            self._move(1)
            while self._skip_blank() and self.text[self.at] != "}":
                yield from self._pair(path)
                self._skip_separator()
            self._move(1)
        elif first in "\"'":
            self._string(first)
        else:
            found = re.compile(r"[^,\]}#\n]*").match(self.text, self.at)
            assert found is not None
            self._move(len(found.group()))

    def _array(self, path: KeyPath) -> Iterator[tuple[KeyPath, int]]:
        self._move(1)
        index = 0
        while self._skip_blank() and self.text[self.at] != "]":
            yield (*path, index), self.line
            yield from self._value((*path, index))
            self._skip_separator()
            index += 1
        self._move(1)

    def _string(self, quote: str) -> None:
        mark = quote * 3 if self.text.startswith(quote * 3, self.at) else quote
        end = self.at + len(mark)
        while not self.text.startswith(mark, end):
            end += 2 if quote == '"' and self.text[end] == "\\" else 1
        end += len(mark)
        while len(mark) == 3 and self.text.startswith(quote, end):
            end += 1
        self._move(end - self.at)

    def _skip_separator(self) -> None:
        self._skip_blank()
        if self.text[self.at] == ",":
            self._move(1)

    def _skip_blank(self) -> bool:
        """Past blanks, line ends and comments; False at the end of the text."""
        while self.at < len(self.text):
            if self.text[self.at] == "#":
                end = self.text.find("\n", self.at)
                self._move((len(self.text) if end < 0 else end) - self.at)
            elif self.text[self.at] in " \t\n":
                self._move(1)
            else:
                return True
        return False

    def _move(self, count: int) -> None:
        self.line += self.text.count("\n", self.at, self.at + count)
        self.at += count


def _syntax_error(path: Path, problem: str, error: type[InputRejected]) -> InputRejected:
    place = re.search(r" \(at line (\d+), column (\d+)\)$", problem)
    if place is None:
        return error(f"not valid TOML: {problem}", path=path, remedy="mend the last line")
    what = problem[: place.start()]
    return error(
        f"not valid TOML: {what}", path=path, line=int(place[1]), column=int(place[2]), remedy="mend this line"
    )


def _reject_not_finite(
    data: object, at: KeyPath, path: Path, lines: dict[KeyPath, int], error: type[InputRejected]
) -> None:
    if isinstance(data, float) and not math.isfinite(data):
        name = ".".join(str(part) for part in at)
        raise error(f"{name} is {data}", path=path, line=lines.get(at), remedy="give a finite number")
    if isinstance(data, dict):
        for key, value in data.items():
            _reject_not_finite(value, (*at, key), path, lines, error)
    elif isinstance(data, list):
        for index, value in enumerate(data):
            _reject_not_finite(value, (*at, index), path, lines, error)
