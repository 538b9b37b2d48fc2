"""What ends the blocks of a file, found and replaced chunk by chunk at constant memory."""

from __future__ import annotations

import re
from collections.abc import Iterator

_ANY = re.compile(rb"\r\n|\n\r\r|\n\r|\n|\r")
_LONGEST_BYTES = 3


class Ends:
    """Which block end all blocks on the tape share: the one that was put, else CR LF, LF CR CR, LF CR, LF or CR."""

    def __init__(self, wanted: bytes | None) -> None:
        self._wanted = wanted
        self._counts = dict.fromkeys((b"\n", b"\r", b"\r\n", b"\n\r", b"\n\r\r"), 0)
        self._kept_bytes = max(_LONGEST_BYTES, len(wanted or b"")) - 1
        self._last = b""

    def feed(self, chunk: bytes) -> None:
        """Count the ends of the next bytes."""
        before = self._last[1 - _LONGEST_BYTES :]
        seen = before + chunk
        if self._wanted is None:
            for end in self._counts:
                self._counts[end] += seen.count(end) - before.count(end)
        self._last = (self._last + chunk)[-1 - self._kept_bytes :]

    @property
    def common(self) -> bytes:
        """A pause falls behind it, so it must end every block: CR LF only if no LF stands alone."""
        if self._wanted is not None:
            return self._wanted
        ends = self._counts[b"\n"]
        if not ends:
            return b"\r" if self._counts[b"\r"] else b"\n"
        if self._counts[b"\r\n"] == ends:
            return b"\r\n"
        cut_off = self._last.endswith(b"\n")
        return next((end for end in (b"\n\r\r", b"\n\r") if self._counts[end] + cut_off == ends), b"\n")

    @property
    def is_closed(self) -> bool:
        """The last block has its end."""
        return self._last.endswith(self._wanted or (b"\r", b"\n"))


def normalised(chunks: Iterator[bytes], wanted: bytes) -> Iterator[bytes]:
    """The same blocks with the wanted block end; none of the file's ends is torn by a chunk's border."""
    kept = b""
    for chunk in chunks:
        data = kept + chunk
        whole = _whole_bytes(data)
        kept = data[whole:]
        yield _ANY.sub(lambda _found: wanted, data[:whole])
    yield _ANY.sub(lambda _found: wanted, kept)


def _whole_bytes(data: bytes) -> int:
    """How far these bytes can be read whatever follows: all but an end that the next chunk may make longer."""
    at = len(data.rstrip(b"\r\n"))
    while at + _LONGEST_BYTES <= len(data) and (found := _ANY.match(data, at)):
        at = found.end()
    return at
