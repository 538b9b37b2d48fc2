"""Plain blocks by the thousand: which lines of a chunk hold nothing but N, G1, X, Y, Z and F, and what they say.

A byte-wise triage decides; whatever it does not recognise beyond doubt goes to the full parser. Numbers come from the
same conversion as the parser's, so both routes give the same floats.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.request import LARGEST

_OTHER, _BLANK, _END, _LETTER, _DIGIT, _SIGN, _POINT = range(7)
_LETTERS = b"NGXYZF"
_LONGEST = 500
_LARGEST_NUMBER = 999_999_999


def _class_table() -> bytes:
    table = bytearray([_OTHER] * 256)
    letters = _LETTERS + _LETTERS.lower()
    for characters, kind in (
        (b" \t\r", _BLANK), (b"\n", _END), (b"0123456789", _DIGIT), (b"+-", _SIGN), (b".", _POINT), (letters, _LETTER)
    ):  # fmt: skip
        for character in characters:
            table[character] = kind
    return bytes(table)


def _wrong_pairs() -> bytes:
    """1 where a class may not follow another, by 8 times the first plus the second."""
    after = {
        _BLANK: (_BLANK, _END, _LETTER),
        _END: (_BLANK, _END, _LETTER),
        _LETTER: (_DIGIT, _SIGN, _POINT),
        _DIGIT: (_DIGIT, _POINT, _BLANK, _END, _LETTER),
        _SIGN: (_DIGIT, _POINT),
        _POINT: (_DIGIT, _BLANK, _END, _LETTER),
    }
    table = bytearray([1] * 256)
    for first, seconds in after.items():
        for second in seconds:
            table[8 * first + second] = 0
    return bytes(table)


def _column_table() -> NDArray[np.int8]:
    table = np.full(256, -1, dtype=np.int8)
    for column, letter in enumerate(_LETTERS):
        table[[letter, letter | 0x20]] = column
    return table


_CLASS, _WRONG_PAIR, _COLUMN = _class_table(), _wrong_pairs(), _column_table()
_BLANKED = bytes(0x20 if byte in _LETTERS + _LETTERS.lower() else byte for byte in range(256))


@dataclass(frozen=True, slots=True)
class PlainLines:
    """What the lines of a chunk hold: `values` (lines, 6) in the order N G X Y Z F, NaN where a word is missing.

    `is_plain` (lines,); rows of lines that are not plain mean nothing. `starts` (lines + 1,) are byte offsets in the
    chunk, the last one its length.
    """

    is_plain: NDArray[np.bool_]
    values: NDArray[np.float64]
    starts: NDArray[np.int64]


def plain_lines(chunk: bytes) -> PlainLines:
    """Triage and values of a chunk of whole lines; the last one may lack its LF."""
    if not chunk.endswith(b"\n"):
        chunk += b"\n"
    raw = np.frombuffer(chunk, dtype=np.uint8)
    kinds = np.frombuffer(chunk.translate(_CLASS), dtype=np.uint8)
    ends = np.flatnonzero(kinds == _END)
    starts = np.concatenate([[0], ends + 1])
    count = len(ends)
    is_plain = np.ones(count, dtype=np.bool_)
    is_plain[np.diff(starts) > _LONGEST] = False
    pairs = kinds.copy()
    pairs[0] |= _END << 3
    pairs[1:] |= kinds[:-1] << 3
    _mark(is_plain, np.flatnonzero(np.frombuffer(pairs.tobytes().translate(_WRONG_PAIR), dtype=np.uint8)), ends)
    words = np.flatnonzero(kinds == _LETTER)
    values = np.full((count, len(_LETTERS)), np.nan)
    if len(words) == 0:
        return PlainLines(is_plain, values, starts)
    word_lines = np.searchsorted(ends, words)
    points = np.searchsorted(words, np.flatnonzero(kinds == _POINT)) - 1
    _check_words(is_plain, kinds, words, word_lines, points)
    has_point = np.zeros(len(words), dtype=np.bool_)
    has_point[points] = True
    keep = is_plain[word_lines]
    numbers = _numbers(chunk, is_plain, starts)
    if not keep.all():
        words, word_lines, has_point = words[keep], word_lines[keep], has_point[keep]
    columns = _COLUMN[raw[words]]
    values[word_lines, columns] = numbers
    is_number = columns == 0
    is_plain[word_lines[is_number & ((kinds[words + 1] != _DIGIT) | has_point)]] = False
    _check_values(is_plain, word_lines, is_number, values)
    return PlainLines(is_plain, values, starts)


def _mark(is_plain: NDArray[np.bool_], places: NDArray[np.int64], ends: NDArray[np.int64]) -> None:
    if len(places):
        is_plain[np.searchsorted(ends, places)] = False


def _check_words(
    is_plain: NDArray[np.bool_],
    kinds: NDArray[np.uint8],
    words: NDArray[np.int64],
    word_lines: NDArray[np.int64],
    points: NDArray[np.int64],
) -> None:
    """Every word has at least one digit and at most one point; `points` gives the word of each point."""
    twice = points[1:][points[1:] == points[:-1]]
    is_plain[word_lines[twice]] = False
    odd = np.flatnonzero(kinds[words + 1] != _DIGIT)
    # after a sign or a point at the latest the third character is a digit, or the word has none
    places = np.minimum(words[odd, None] + np.arange(1, 4), len(kinds) - 1)
    following = kinds[places]
    is_sign, is_point = following[:, 0] == _SIGN, following[:, 0] == _POINT
    has_digit = (following[:, 1] == _DIGIT) & (is_sign | is_point)
    has_digit |= is_sign & (following[:, 1] == _POINT) & (following[:, 2] == _DIGIT)
    is_plain[word_lines[odd[~has_digit]]] = False


def _numbers(chunk: bytes, is_plain: NDArray[np.bool_], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """The numbers of the plain lines in order."""
    if not is_plain.all():
        runs = np.flatnonzero(np.diff(np.concatenate([[False], is_plain, [False]]).astype(np.int8)))
        pieces = [chunk[starts[a] : starts[b]] for a, b in zip(runs[::2].tolist(), runs[1::2].tolist(), strict=True)]
        chunk = b"".join(pieces)
    return np.fromstring(chunk.translate(_BLANKED), dtype=np.float64, sep=" ")


def _check_values(
    is_plain: NDArray[np.bool_],
    word_lines: NDArray[np.int64],
    is_number: NDArray[np.bool_],
    values: NDArray[np.float64],
) -> None:
    """No word twice, N first and not too long, G1 only, feeds above 0, nothing too large."""
    missing = np.isnan(values)
    per_line = np.bincount(word_lines, minlength=len(is_plain))
    is_plain &= per_line == len(_LETTERS) - missing.sum(axis=1)
    is_first = np.concatenate([[True], word_lines[1:] != word_lines[:-1]])
    is_plain[word_lines[is_number & ~is_first]] = False
    is_plain &= missing[:, 0] | (values[:, 0] <= _LARGEST_NUMBER)
    is_plain &= missing[:, 1] | (values[:, 1] == 1.0)
    is_plain &= missing[:, 5] | (values[:, 5] > 0.0)
    is_plain &= (missing[:, 2:] | (np.abs(values[:, 2:]) <= LARGEST)).all(axis=1)
