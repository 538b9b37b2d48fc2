"""What is wrong with a value of a TOML file, in words of the file: where it stands, what it is, what to write."""

from __future__ import annotations

import datetime as dt
import difflib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

import msgspec

from planner.errors import InputRejected

_KeyPath = tuple[str | int, ...]
_IN_WORDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "text in quotes",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
    "date": "a date",
    "time": "a time",
    "datetime": "a date",
}


def conversion_error(
    path: Path, problem: str, kind: type[Any], lines: dict[_KeyPath, int], error: type[InputRejected]
) -> InputRejected:
    """The complaint about a file whose values are not of `kind`, made of msgspec's own words in `problem`."""
    what, _, where = problem.partition(" - at `$")
    steps = re.findall(r"([A-Za-z_][A-Za-z0-9_-]*)|\[(\d+)\]", where.rstrip("`"))
    at: _KeyPath = tuple(int(index) if index else name for name, index in steps)
    unknown = re.search(r"unknown field `([^`]*)`", what)
    if unknown:
        name = unknown[1]
        said = name if name.isprintable() else repr(name)[1:-1]
        near = difflib.get_close_matches(name, sorted(_field_names(kind)), n=1)
        remedy = f"did you mean {near[0]}?" if near else "remove it, or see the list of keys in docs/interface.md"
        if near and near[0] == name:
            remedy = "it belongs in another table; see the list of keys in docs/interface.md"
        return error(f"unknown key {said}", path=path, line=_line(lines, (*at, name)), remedy=remedy)
    missing = re.search(r"missing required field `([^`]*)`", what)
    if missing:
        place = ".".join(str(part) for part in at) or "the file"
        return error(f"{missing[1]} is missing in {place}", path=path, line=_line(lines, at), remedy="add it")
    name = ".".join(str(part) for part in at)
    said, remedy = _wanted(what, kind, at)
    return error(f"{name}: {said}", path=path, line=_line(lines, at), remedy=remedy)


def _wanted(what: str, kind: type[Any], at: _KeyPath) -> tuple[str, str]:
    """What is wrong with a value and what to write, in words of the file instead of the reader's types."""
    choice = re.search(r"[Ii]nvalid enum value '?([^']*)'?", what)
    if choice and at:
        said = choice[1].lower() if choice[1] in ("True", "False") else repr(choice[1])
        return f"{said} is no choice", f"write one of {', '.join(_choices(kind, str(at[-1])))}"
    if "RFC3339" in what:
        return "is no date", "write one such as 2026-11-26, without quotes"
    types = re.fullmatch(r"Expected `([^`]*)`, got `([^`]*)`", what)
    if types:
        wanted, found = (_in_words(part) for part in types.groups())
        return f"is {found}", f"write {wanted}"
    lengths = re.fullmatch(r"Expected `array` of (?:at least )?length ([^,]*), got (.*)", what)
    if lengths:
        return f"is a list of {lengths[2]}", f"write a list of {lengths[1]}"
    limit = re.fullmatch(r"Expected `([^`]*)` ([<>]=?) (.*)", what)
    if limit:
        return "is out of range", f"write {_IN_WORDS.get(limit[1], limit[1])} {limit[2]} {limit[3]}"
    if "matching regex" in what:
        return "has another form", "write it as in the shipped profiles"
    return f"{what[:1].lower()}{what[1:]}", "mend the value"


def _in_words(types: str) -> str:
    """The types of `int | null` in a user's words; null cannot be written in TOML, it means: leave the key out."""
    return " or ".join(_IN_WORDS.get(one, one) for one in types.split(" | ") if one != "null")


def _line(lines: dict[_KeyPath, int], at: _KeyPath) -> int | None:
    while at and at not in lines:
        at = at[:-1]
    return lines.get(at)


def _field_names(kind: Any) -> set[str]:
    """Every key name that a Struct type and the Structs inside it know."""
    return {field.encode_name for field in _fields(kind)}


def _choices(kind: Any, name: str) -> list[str]:
    """The words that the key of this name may have."""
    literals = [part for field in _fields(kind) if field.encode_name == name for part in _parts(field.type)]
    words = [word for literal in literals if get_origin(literal) is Literal for word in get_args(literal)]
    said = [str(word).lower() if isinstance(word, bool) else str(word) for word in words]
    others = {float: "a number", dt.date: "a date such as 2026-11-26"}
    return said + [name for kind, name in others.items() if kind in literals]


def _parts(kind: Any) -> list[Any]:
    """The type, the members of a union, and what stands behind their bounds."""
    members = [kind, *get_args(kind)]
    return members + [get_args(one)[0] for one in members if get_origin(one) is Annotated]


def _fields(kind: Any) -> Iterator[msgspec.structs.FieldInfo]:
    """The fields of a Struct type and of the Structs inside it."""
    waiting, seen = [kind], set()
    while waiting:
        current = waiting.pop()
        if id(current) in seen:
            continue
        seen.add(id(current))
        if isinstance(current, type) and issubclass(current, msgspec.Struct):
            for field in msgspec.structs.fields(current):
                yield field
                waiting.append(field.type)
        else:
            waiting.extend(getattr(current, "__args__", ()))
