"""Programs by hand against their canonical lists, and programs the control must refuse with the message of line 1.

`make golden` writes the lists anew; the difference is reviewed like code.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from sim.interpreter import canon
from sim.interpreter.listing import listed
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import Settings, Tool

HERE = Path(__file__).parent
CONTROL = Settings(start_mm=(0.0, 0.0, 0.0), tools={1: Tool(2.0)}, max_repeats=1000)
PROGRAMS = [*sorted((HERE / "canon").glob("*.mpf")), HERE / "thesis-5000.mpf"]
BAD = sorted((HERE / "bad").glob("*.mpf"))


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_canonical_list(path: Path) -> None:
    """(6.6)"""
    found = "".join(listed(command) + "\n" for command in interpret(path.read_bytes(), CONTROL))
    expected = HERE / "canon" / f"{path.stem}.canon"
    if os.environ.get("DRIPMILL_GOLDEN") == "write":
        expected.write_text(found)
    assert found == expected.read_text()
    assert " Alarm " not in found


@pytest.mark.parametrize("path", BAD, ids=lambda path: path.stem)
def test_refused_with_the_message_of_line_1(path: Path) -> None:
    """(6.6) The first line is `; line:column number text`."""
    data = path.read_bytes()
    wanted = data.split(b"\n")[0].decode("latin-1").removeprefix("; ")
    for found in (list(interpret(data, CONTROL)), _by_blocks(data)):
        last = found[-1]
        assert isinstance(last, canon.Alarm)
        assert f"{last.line}:{last.column or '-'} {last.number} {last.text}" == wanted


def test_there_are_enough_of_them() -> None:
    """(6.6)"""
    assert len(PROGRAMS) >= 8
    assert len(BAD) >= 30
    texts = {re.sub(r"^\S+ ", "", path.read_text("latin-1").split("\n")[0]) for path in BAD}
    assert len(texts) >= 30


def _by_blocks(data: bytes) -> list[canon.Command]:
    interpreter = Interpreter(CONTROL)
    found: list[canon.Command] = []
    for line, raw in enumerate(data.removesuffix(b"\n").split(b"\n"), start=1):
        found += interpreter.block(raw, line)
    return found + interpreter.finish()
