"""From the program's file to the tape: one pass that copies, checks, normalises block ends, frames and hashes."""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from dnc import profile
from dnc.block_ends import Ends, normalised
from dnc.branches import Branches, Codes
from dnc.errors import InputRejected, SettingsRejected
from dnc.framing import CharacterCheck, block_end_bytes, framing_bytes
from dnc.tape import Frame, LineIndex, Tape, Traits

_CHUNK_BYTES = 1 << 16
_MEMORY_BYTES = 8 << 20


def load_tape(path: Path, rules: profile.Tape, spool_folder: Path, data_bits: int = 8) -> Tape:
    """Spool, check, frame and hash a program; raises InputRejected (bad program) or SettingsRejected (no space).

    Up to 8 MB stay in memory; more goes to an unnamed file in `spool_folder`. A character that the line's `data_bits`
    cannot carry is refused like one that the control cannot read.
    """
    source = _open_program(path)
    try:
        spool = _spool(os.fstat(source).st_size, spool_folder)
        try:
            return _spooled(source, spool, path, rules, data_bits)
        except BaseException:
            os.close(spool)
            raise
    except OSError as problem:
        raise SettingsRejected(
            f"the program cannot be copied to {spool_folder}: {problem.strerror}",
            remedy="free space there, or set XDG_STATE_HOME",
        ) from None
    finally:
        os.close(source)


def _open_program(path: Path) -> int:
    try:
        found = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as problem:
        raise InputRejected(
            f"cannot be read: {problem.strerror}", path=path, remedy="check the name and the rights"
        ) from None
    about = os.fstat(found)
    if stat.S_ISREG(about.st_mode) and about.st_size > 0:
        return found
    os.close(found)
    kinds = {stat.S_IFDIR: "a directory", stat.S_IFREG: "empty", stat.S_IFIFO: "a FIFO"}
    kind = kinds.get(stat.S_IFMT(about.st_mode), "not a regular file")
    raise InputRejected(f"is {kind}", path=path, remedy="name a program")


def _spool(size_bytes: int, folder: Path) -> int:
    """A descriptor of anonymous storage: gone when closed, whatever happens to the process."""
    if size_bytes <= _MEMORY_BYTES:
        return os.memfd_create("dnc-tape", os.MFD_CLOEXEC)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder) as file:
        return os.dup(file.fileno())


def _spooled(source: int, spool: int, path: Path, rules: profile.Tape, data_bits: int) -> Tape:
    head = os.pread(source, _CHUNK_BYTES, 0)
    wanted = block_end_bytes(rules.end_of_block)
    ends = Ends(wanted)
    leader, trailer = (framing_bytes(key, getattr(rules, key), data_bits) for key in ("leader", "trailer"))
    lines = LineIndex(wanted or (b"\n" if b"\n" in head or b"\r" not in head else b"\r"), len(leader))
    of_tape, of_program = hashlib.sha256(), hashlib.sha256()
    check = CharacterCheck(path, rules.character_set, rules.line_max_bytes, data_bits)

    def put(chunk: bytes) -> None:
        of_tape.update(chunk)
        _write_all(spool, chunk)

    def checked() -> Iterator[bytes]:
        while chunk := os.read(source, _CHUNK_BYTES):
            check.feed(chunk)
            of_program.update(chunk)
            yield chunk

    branches, codes = Branches(lines.mark, len(leader)), Codes()
    put(leader)
    for chunk in checked() if wanted is None else normalised(checked(), wanted):
        lines.feed(chunk)
        branches.feed(chunk)
        codes.feed(chunk)
        ends.feed(chunk)
        put(chunk)
    branches.close()
    if trailer and not ends.is_closed and not trailer.startswith(ends.common):
        put(ends.common)  # the trailer is no part of the last block
    put(trailer)
    traits = Traits(branches.first_at, codes.is_compensated, codes.is_incremental, codes.has_other_plane)
    frame = Frame(len(leader), len(trailer), ends.common)
    return Tape(spool, of_tape.hexdigest(), of_program.hexdigest(), lines, frame, traits)


def _write_all(target: int, data: bytes) -> None:
    while data:
        data = data[os.write(target, data) :]
