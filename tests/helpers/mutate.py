"""Mutations of a text file that a tired person or a bad disk could make."""

from __future__ import annotations

import re

from hypothesis import strategies as st

_VALUES = [
    "nan",
    "inf",
    "-1",
    "0",
    "1e400",
    '"x"',
    "[]",
    "{}",
    "true",
    "",
    "1e-300",
    "-0.0",
    "99999999999999999999",
    "1_0",
]


@st.composite
def mutated(draw: st.DrawFn, original: bytes) -> bytes:
    """The file with one to three mutations: lines lost, doubled, swapped, cut; values replaced; bytes inserted."""
    data = original
    for _ in range(draw(st.integers(1, 3))):
        data = draw(st.sampled_from([_lines, _value, _bytes, _cut]))(draw, data)
    return data


def _lines(draw: st.DrawFn, data: bytes) -> bytes:
    lines = data.split(b"\n")
    first = draw(st.integers(0, len(lines) - 1))
    second = draw(st.integers(0, len(lines) - 1))
    what = draw(st.sampled_from(["drop", "double", "swap"]))
    if what == "drop":
        del lines[first]
    elif what == "double":
        lines.insert(second, lines[first])
    else:
        lines[first], lines[second] = lines[second], lines[first]
    return b"\n".join(lines)


def _value(draw: st.DrawFn, data: bytes) -> bytes:
    numbers = list(re.finditer(rb"-?\d+\.?\d*", data))
    if not numbers:
        return data
    found = draw(st.sampled_from(numbers))
    return data[: found.start()] + draw(st.sampled_from(_VALUES)).encode() + data[found.end() :]


def _bytes(draw: st.DrawFn, data: bytes) -> bytes:
    at = draw(st.integers(0, len(data)))
    return data[:at] + draw(st.binary(min_size=1, max_size=4)) + data[at:]


def _cut(draw: st.DrawFn, data: bytes) -> bytes:
    return data[: draw(st.integers(0, len(data)))]
