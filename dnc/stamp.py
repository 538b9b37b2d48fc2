"""Refuses a program whose stamp says that it is for another control, or drives another point of the tool."""

from __future__ import annotations

from pathlib import Path

from dnc.errors import InputRejected
from dnc.profile import MachineProfile
from dnc.tape import Tape
from planner.post.stamp import read_stamp

_HEAD_BYTES = 4096


def refuse_contradiction(tape: Tape, profile: MachineProfile, path: Path) -> None:
    """Raise InputRejected if the program says that it is for another control or another programmed point."""
    stamp = read_stamp(tape.peek(tape.leader_bytes, _HEAD_BYTES))
    if stamp is None:
        return
    dialect, reference = profile.control.dialect, profile.control.tool_length_reference
    if stamp.control.split("-")[0] != dialect:
        raise InputRejected(
            f"the program was written for {stamp.control}, the machine profile is {dialect}",
            path=path,
            remedy="name the right --machine, or plan it again with --post",
        )
    if stamp.reference != reference:
        raise InputRejected(
            f"the program drives the tool's {stamp.reference}, the machine profile measures tools to the {reference}",
            path=path,
            remedy="plan it again with the right reference, or mend tool_length_reference in the profile",
        )
