"""The stamp in a program's head: which control and which point of the tool it was written for."""

from __future__ import annotations

import re
from pathlib import Path

from dnc.errors import InputRejected
from dnc.profile import MachineProfile
from dnc.tape import Tape

_HEAD_BYTES = 4096
_STAMP = re.compile(r"\b(CONTROL|REFERENCE)=([A-Za-z0-9_.-]+)")
_COMMENT = re.compile(r"^[^;(]*[;(](.*)$", re.MULTILINE)


def stamp_of(head: bytes) -> dict[str, str]:
    r"""The stamped values of a program's head, comments only.

    >>> stamp_of(b";CONTROL=sinumerik-840d REFERENCE=tip R=4\nG0 X0")
    {'CONTROL': 'sinumerik-840d', 'REFERENCE': 'tip'}
    """
    comments = "\n".join(_COMMENT.findall(head.decode("latin-1").replace("\r", "\n")))
    return dict(_STAMP.findall(comments))


def refuse_contradiction(tape: Tape, profile: MachineProfile, path: Path) -> None:
    """Raise InputRejected if the program says that it is for another control or another programmed point."""
    stamp = stamp_of(tape.peek(tape.leader_bytes, _HEAD_BYTES))
    dialect, reference = profile.control.dialect, profile.control.tool_length_reference
    control = stamp.get("CONTROL", dialect).lower()
    if control.split("-")[0] != dialect:
        raise InputRejected(
            f"the program was written for {control}, the machine profile is {dialect}",
            path=path,
            remedy="name the right --machine, or plan it again with --post",
        )
    stamped = stamp.get("REFERENCE", reference).lower()
    if stamped != reference:
        raise InputRejected(
            f"the program drives the tool's {stamped}, the machine profile measures tools to the {reference}",
            path=path,
            remedy="plan it again with the right reference, or mend tool_length_reference in the profile",
        )
