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
_NAME = "|".join(_NAMED)
_TOKEN = re.compile(rf"\\(\\|x[0-9A-Fa-f]{{2}}|{_NAME})(?:\*(\d{{1,5}}))?(?P<glued>{_NAME})?")
_CONTROL_BYTES = {0: "NUL", 4: "EOT", 0x11: "DC1 (XON)", 0x12: "DC2", 0x13: "DC3 (XOFF)", 0x14: "DC4", 0x1B: "ESC"}
_LAYOUT = b"\t\r\n"
_LONGEST_END_BYTES = 8
_ASCII = _LAYOUT + bytes(range(0x20, 0x7F))
_ISO = _LAYOUT + b" %()*+-./:=#[]ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
_ANY = _LAYOUT + bytes(range(0x20, 0x7F)) + bytes(range(0xA0, 0x100))
CHARACTER_SETS = {"ascii": _ASCII, "iso": _ISO, "any": _ANY}
BLOCK_ENDS = {"lf": b"\n", "cr": b"\r", "crlf": b"\r\n", "lfcr": b"\n\r", "lfcrcr": b"\n\r\r"}
_BOMS = {b"\xef\xbb\xbf": "a UTF-8 byte order mark", b"\xff\xfe": "UTF-16 text", b"\xfe\xff": "UTF-16 text"}


def framing_bytes(key: str, text: str, data_bits: int) -> bytes:
    """The bytes of `tape.leader` or `tape.trailer`; raises SettingsRejected for what the line cannot carry."""
    found = escaped_bytes(key, text)
    for byte in found:
        if byte >> data_bits:
            what = f"tape.{key} '{text}': 0x{byte:02X} does not fit into {data_bits} data bits"
            raise SettingsRejected(what, remedy="leave it out or use a format with more data bits")
    return found


def escaped_bytes(key: str, text: str) -> bytes:
    r"""The bytes of a leader, trailer or block end: \NUL*50, \CR, \LF, \DC2, \x1B and plain text.

    >>> escaped_bytes("leader", r"\NUL*3%\CR\LFO1234")
    b'\x00\x00\x00%\r\nO1234'
    """
    out = bytearray()
    at = 0
    while at < len(text):
        if text[at] != "\\":
            if ord(text[at]) > 0xFF:
                what = f"tape.{key} '{text}': no line carries {text[at]!r}"
                raise SettingsRejected(what, remedy="leave it out")
            out += text[at].encode("latin-1")
            at += 1
            continue
        found = _TOKEN.match(text, at)
        if found is None:
            known = ", ".join(sorted(_NAMED))
            what = f"tape.{key} '{text}': '{text[at : at + 5]}' is no known escape"
            raise SettingsRejected(what, remedy=f"known: \\x1B and {known}")
        if found["glued"]:
            what = f"tape.{key} '{text}': {found[0]!r} would send the text {found['glued']!r}"
            raise SettingsRejected(what, remedy=f"write \\{found['glued']}")
        out += bytes([_code(found[1])]) * int(found[2] or 1)
        at = found.end()
    return bytes(out)


def _code(name: str) -> int:
    if name == "\\":
        return 0x5C
    return int(name[1:], 16) if name.startswith("x") else _NAMED[name]


def block_end_bytes(name: str) -> bytes | None:
    """The bytes that end a block: lf, cr, crlf, lfcr, lfcrcr or escapes of one's own; None for as-is.

    Raises SettingsRejected for what has neither CR nor LF: its letters would reach the control as words.
    """
    if name == "as-is":
        return None
    found = BLOCK_ENDS.get(name.lower()) or escaped_bytes("end_of_block", name)
    is_harmless = not {0x11, 0x13} & set(found) and len(found) <= _LONGEST_END_BYTES
    if not is_harmless or not {0x0A, 0x0D} & set(found):
        what = f"tape.end_of_block '{name}' ends no block"
        raise SettingsRejected(what, remedy="write as-is, lf, cr, crlf, lfcr, lfcrcr, or escapes such as \\CR\\LF")
    return found


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
