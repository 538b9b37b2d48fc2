r"""What surrounds a program on the tape and which bytes may be on it: leader, trailer, block ends, characters.

A control byte inside a program acts on the wire (DC3 in a comment stops the control's own reader), so everything but
tab, CR and LF is refused with line and column, before the first byte leaves.
"""

from __future__ import annotations

import re
from pathlib import Path

from dnc.errors import InputRejected, SettingsRejected

_NAMED = {"NUL": 0x00, "STX": 0x02, "ETX": 0x03, "EOT": 0x04, "DC2": 0x12, "DC4": 0x14, "ESC": 0x1B}
_NAMED |= {"LF": 0x0A, "CR": 0x0D, "TAB": 0x09, "SOH": 0x01, "ETB": 0x17, "SYN": 0x16}
_TOKEN = re.compile(r"\\(\\|x[0-9A-Fa-f]{2}|[A-Z]{2,3}\d?)(?:\*(\d{1,5}))?")
_CONTROL_BYTES = {0: "NUL", 4: "EOT", 0x11: "DC1 (XON)", 0x12: "DC2", 0x13: "DC3 (XOFF)", 0x14: "DC4", 0x1B: "ESC"}
_LAYOUT = b"\t\r\n"
_ASCII = _LAYOUT + bytes(range(0x20, 0x7F))
_ISO = _LAYOUT + b" %()*+-./:=#[]ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
_ANY = _LAYOUT + bytes(range(0x20, 0x7F)) + bytes(range(0xA0, 0x100))
CHARACTER_SETS = {"ascii": _ASCII, "iso": _ISO, "any": _ANY}
BLOCK_ENDS = {"lf": b"\n", "cr": b"\r", "crlf": b"\r\n", "lfcr": b"\n\r", "lfcrcr": b"\n\r\r"}
_BOMS = {b"\xef\xbb\xbf": "a UTF-8 byte order mark", b"\xff\xfe": "UTF-16 text", b"\xfe\xff": "UTF-16 text"}


def escaped_bytes(text: str) -> bytes:
    r"""The bytes of a leader, trailer or block end: \NUL*50, \CR, \LF, \DC2, \x1B and plain text.

    >>> escaped_bytes(r"\NUL*3%\CR\LF")
    b'\x00\x00\x00%\r\n'
    """
    out = bytearray()
    at = 0
    while at < len(text):
        if text[at] != "\\":
            out += text[at].encode("latin-1", "replace")
            at += 1
            continue
        found = _TOKEN.match(text, at)
        code = found and _code(found[1])
        if found is None or code is None:
            known = ", ".join(sorted(_NAMED))
            raise SettingsRejected(f"{text[at : at + 5]!r} is no known escape", remedy=f"known: \\x1B and {known}")
        out += bytes([code]) * int(found[2] or 1)
        at = found.end()
    return bytes(out)


def _code(name: str) -> int | None:
    if name == "\\":
        return 0x5C
    return int(name[1:], 16) if name.startswith("x") else _NAMED.get(name)


def block_end_bytes(name: str) -> bytes | None:
    """The bytes that end a block: lf, cr, crlf, lfcr, lfcrcr or escapes of one's own; None for as-is."""
    if name == "as-is":
        return None
    return BLOCK_ENDS.get(name.lower()) or escaped_bytes(name)


class CharacterCheck:
    """Refuses what must not be on the tape, chunk by chunk at constant memory; knows the line for the complaint."""

    def __init__(self, path: Path, character_set: str, line_max_bytes: int, data_bits: int) -> None:
        self._path, self._name, self._data_bits = path, character_set, data_bits
        self._allowed = bytes(byte for byte in CHARACTER_SETS[character_set] if byte >> data_bits == 0)
        self._line_max_bytes = line_max_bytes
        self._line, self._column = 1, 0
        self._is_first = True

    def feed(self, chunk: bytes) -> None:
        """Check the next bytes of the file; raises InputRejected with line and column."""
        if self._is_first:
            self._is_first = False
            self._refuse_marks(chunk)
        bad = chunk.translate(None, self._allowed)
        if bad:
            self._refuse(chunk, chunk.index(bad[:1]))
        self._count(chunk)

    def _refuse_marks(self, chunk: bytes) -> None:
        for mark, what in _BOMS.items():
            if chunk.startswith(mark):
                raise InputRejected(
                    f"starts with {what}", path=self._path, line=1, column=1, remedy="save it as plain ASCII"
                )

    def _refuse(self, chunk: bytes, at: int) -> None:
        self._count(chunk[:at])
        byte = chunk[at]
        if byte < 0x20 or byte == 0x7F:
            name = _CONTROL_BYTES.get(byte, "control byte")
            what, remedy = f"{name} 0x{byte:02X} would act on the line", "remove it"
        elif byte >> self._data_bits and byte in CHARACTER_SETS[self._name]:
            what = f"character {chr(byte)!r} (0x{byte:02X}) does not fit into {self._data_bits} data bits"
            remedy = "use a format with more data bits"
        elif byte < 0x7F:
            what, remedy = f"character {chr(byte)!r} is not in the control's set {self._name}", "write it otherwise"
        else:
            what, remedy = f"byte 0x{byte:02X} is not ASCII", "write the comment without accents"
        raise InputRejected(what, path=self._path, line=self._line, column=self._column + 1, remedy=remedy)

    def _count(self, chunk: bytes) -> None:
        """Follow line and column; refuse a line longer than any control reads."""
        limit = self._line_max_bytes
        if b"\n" not in chunk:
            chunk = chunk.replace(b"\r", b"\n")
        lines = chunk.split(b"\n")
        lengths = [self._column + len(lines[0]), *map(len, lines[1:])]
        if max(lengths) > limit:
            line = self._line + next(index for index, length in enumerate(lengths) if length > limit)
            raise InputRejected(
                f"a line of more than {limit} bytes", path=self._path, line=line, remedy="break the block up"
            )
        self._line += len(lines) - 1
        self._column = lengths[-1]
