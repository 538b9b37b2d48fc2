"""What single blocks are to the flow: targets of jumps, openings and ends of structures."""

from __future__ import annotations

from planner.gcode import Block, SyntaxProblem, read_block
from planner.gcode.statement import For, If, Mark, Marker, Statement, Until, While
from sim.interpreter.alarms import AlarmNumber, ControlAlarm

CLOSES = {Marker.ENDIF: "IF", Marker.ENDWHILE: "WHILE", Marker.ENDFOR: "FOR", Marker.ENDLOOP: "LOOP"}
ENDS = {"IF": "ENDIF", "WHILE": "ENDWHILE", "FOR": "ENDFOR", "LOOP": "ENDLOOP", "REPEAT": "UNTIL"}


def second_else() -> ControlAlarm:
    """What a second ELSE in one IF raises."""
    return ControlAlarm(AlarmNumber.NESTING, "a second ELSE stands in one IF; ENDIF is expected")


def is_target(block: Block, target: str) -> bool:
    """Whether the block has this label or, for N100 or :100, this number."""
    if block.label == target:
        return True
    number = target[1:]
    return (
        number.isdigit() and block.number == int(number) and (target[0] == ":") == block.is_main and target[0] in "N:"
    )


def glance(raw: bytes) -> Block:
    """The block for a search; one that cannot be read is no target."""
    try:
        return read_block(raw.decode("latin-1"))
    except SyntaxProblem:
        return Block()


def opens(statement: Statement | None) -> str | None:
    """The structure a statement opens, or None."""
    match statement:
        case If():
            return "IF"
        case While():
            return "WHILE"
        case For():
            return "FOR"
        case Mark(Marker.LOOP):
            return "LOOP"
        case Mark(Marker.REPEAT):
            return "REPEAT"
    return None


def closes(statement: Statement | None) -> str | None:
    """The structure a statement closes, or None."""
    match statement:
        case Mark(marker) if marker in CLOSES:
            return CLOSES[marker]
        case Until():
            return "REPEAT"
    return None
