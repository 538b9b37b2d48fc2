"""Files that commands read and leave: refused before the work where they cannot be, written whole or not at all."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Literal

from planner.errors import InputRejected

_LINE_LIMIT_BYTES = 65536
_CHUNK_BYTES = 1 << 18


def made_folder(path: Path) -> Path:
    """The folder to write into, made if only its last part is missing; raises InputRejected where that fails."""
    try:
        path.mkdir(exist_ok=True)
    except OSError as problem:
        what = "is no folder" if kind_of(path) != "nothing" else f"cannot be made: {problem.strerror}"
        raise InputRejected(what, path=path, remedy="name a folder, or make it first") from None
    return path


def read_program(path: Path) -> bytes:
    """The bytes of a program, every one of them; raises InputRejected where there is none."""
    _require_program(path)
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise _unreadable(path, problem) from None
    if not data.strip():
        raise InputRejected("is empty", path=path, remedy="name a program file")
    return data


def program_chunks(path: Path) -> Iterator[bytes]:
    """A program in chunks of whole lines, of a line beyond 64 KiB no more than its head; raises InputRejected."""
    _require_program(path)
    rest = b""
    try:
        with path.open("rb") as file:
            while data := file.read(_CHUNK_BYTES):
                rest += data
                stop = rest.rfind(b"\n") + 1
                if stop:
                    yield rest[:stop]
                rest = rest[stop:][:_LINE_LIMIT_BYTES]
    except OSError as problem:
        raise _unreadable(path, problem) from None
    if rest:
        yield rest


def check_outputs(outputs: Sequence[Path | None], inputs: Sequence[Path | None] = ()) -> None:
    """Raises InputRejected where a file to be written is read too, is written twice, or cannot come to be.

    None stands for a file that was not asked for.
    """
    read, written = {os.path.realpath(path) for path in inputs if path is not None}, set[str]()
    for path in (each for each in outputs if each is not None):
        place = os.path.realpath(path)
        if place in read:
            raise InputRejected("is read by this command and would be lost", path=path, remedy="name another file")
        if kind_of(path.absolute().parent) != "folder":
            raise InputRejected(
                "its folder does not exist", path=path, remedy="create the folder, or name another file"
            )
        _refuse_what_is_no_file(path)
        if place in written:
            raise InputRejected("would be written twice", path=path, remedy="give every output a name of its own")
        written.add(place)


def write_file(path: Path, data: bytes) -> None:
    """Write a whole file or nothing; raises InputRejected, and never takes the place of a device."""
    write_with(path, lambda part: part.write_bytes(data))


def write_with(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a file of a temporary name beside this one, then give it this name."""
    _refuse_what_is_no_file(path)
    part = part_of(path)
    try:
        write(part)
        part.replace(path)
    except OSError as problem:
        raise unwritable(path, problem) from None
    finally:
        part.unlink(missing_ok=True)


def part_of(path: Path) -> Path:
    """The hidden name under which a file grows."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")


def unwritable(path: Path, problem: OSError) -> InputRejected:
    """The sentence for a file that the system does not let us write."""
    return InputRejected(f"cannot be written: {problem.strerror}", path=path, remedy="check folder, rights and space")


def _require_program(path: Path) -> None:
    kind = kind_of(path)
    if kind != "file":
        what = {"folder": "is a directory", "other": "is not a regular file", "nothing": "is not there"}[kind]
        raise InputRejected(what, path=path, remedy="name a program file")


def kind_of(path: Path) -> Literal["file", "folder", "other", "nothing"]:
    """What this name stands for; raises InputRejected where the system lets nobody look."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return "nothing"
    except OSError as problem:
        raise _unreadable(path, problem) from None
    return "file" if stat.S_ISREG(mode) else "folder" if stat.S_ISDIR(mode) else "other"


def _unreadable(path: Path, problem: OSError) -> InputRejected:
    return InputRejected(f"cannot be read: {problem.strerror}", path=path, remedy="check the name and the rights")


def _refuse_what_is_no_file(path: Path) -> None:
    if not os.access(path.absolute().parent, os.W_OK | os.X_OK):
        raise InputRejected("its folder may not be written to", path=path, remedy="check the rights of the folder")
    kind = kind_of(path)
    if kind == "folder":
        raise InputRejected("is a directory", path=path, remedy="name a file to write")
    if kind == "other":
        raise InputRejected("is not a regular file", path=path, remedy="name a file to write")
