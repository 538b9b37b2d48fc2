"""Statements: flow, definitions and subprogram heads of the control's language, as values without meaning."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from planner.gcode.expression import Expression


class Marker(Enum):
    """Statements that are one keyword."""

    ELSE = "ELSE"
    ENDIF = "ENDIF"
    ENDWHILE = "ENDWHILE"
    ENDFOR = "ENDFOR"
    LOOP = "LOOP"
    ENDLOOP = "ENDLOOP"
    REPEAT = "REPEAT"


@dataclass(frozen=True, slots=True)
class Mark:
    """ELSE, ENDIF, ENDWHILE, ENDFOR, LOOP, ENDLOOP, or REPEAT that opens a loop."""

    marker: Marker


@dataclass(frozen=True, slots=True)
class Jump:
    """GOTOF, GOTOB, GOTO, GOTOC to a label or block number; `condition` of a preceding IF, or None."""

    keyword: str
    target: Expression
    condition: Expression | None = None


@dataclass(frozen=True, slots=True)
class If:
    """IF that opens IF/ELSE/ENDIF."""

    condition: Expression


@dataclass(frozen=True, slots=True)
class While:
    """WHILE condition."""

    condition: Expression


@dataclass(frozen=True, slots=True)
class Until:
    """UNTIL condition, which closes REPEAT."""

    condition: Expression


@dataclass(frozen=True, slots=True)
class For:
    """FOR variable = first TO last."""

    variable: str
    index: tuple[Expression, ...] | None
    first: Expression
    last: Expression


@dataclass(frozen=True, slots=True)
class RepeatSection:
    """REPEAT start end P=count, or REPEATB start P=count: run blocks between labels again."""

    start: str
    end: str | None
    count: Expression | None
    is_single_block: bool


@dataclass(frozen=True, slots=True)
class Case:
    """CASE selector OF value jump ... DEFAULT jump."""

    selector: Expression
    branches: tuple[tuple[Expression, Jump], ...]
    default: Jump | None


@dataclass(frozen=True, slots=True)
class Variable:
    """One name of a DEF or a parameter of a PROC; `dimensions` of an array; `is_reference` for VAR parameters."""

    name: str
    type_name: str
    dimensions: tuple[Expression, ...] = ()
    initial: Expression | None = None
    initial_list: tuple[Expression | None, ...] | None = None
    is_reference: bool = False


@dataclass(frozen=True, slots=True)
class Define:
    """DEF type names."""

    variables: tuple[Variable, ...]


@dataclass(frozen=True, slots=True)
class Procedure:
    """PROC name(parameters), the head of a subprogram; `attributes` such as SAVE, DISPLOF."""

    name: str
    parameters: tuple[Variable, ...]
    attributes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Extern:
    """EXTERN name(types): a subprogram with arguments is announced."""

    name: str


@dataclass(frozen=True, slots=True)
class Return:
    """RET; M17 is a word."""


Statement = Mark | Jump | If | While | Until | For | RepeatSection | Case | Define | Procedure | Extern | Return
