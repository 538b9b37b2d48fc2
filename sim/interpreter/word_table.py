"""The table of docs/dialects.md: every word, whether it is acted on, accepted or refused, and how; and that of
sim/MODEL.md: the words without effect.

`python -m sim.interpreter.word_table` prints both; a test holds the pages to them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

from planner.gcode import GROUP_OF, ModalGroup
from sim.interpreter.system_variables import SYSTEM_VARIABLES
from sim.interpreter.values import FUNCTIONS
from sim.interpreter.vocabulary import (
    ACTED_ADDRESSES,
    ACTED_CODES,
    ACTED_M,
    IGNORED_ADDRESSES,
    IGNORED_CODES,
    IGNORED_M,
    REFUSED_CODES,
    REFUSED_WORDS,
)

STATEMENTS = (
    "IF ELSE ENDIF GOTOF GOTOB GOTO GOTOC CASE OF DEFAULT FOR TO ENDFOR WHILE ENDWHILE LOOP ENDLOOP REPEAT REPEATB "
    "UNTIL DEF PROC EXTERN RET"
)
_NO_EFFECT = "accepted without effect"
_CHECKED = {"acted on": "interpreted", _NO_EFFECT: "no finding", "alarm": "unknown-word"}
"""What `dnc check` makes of a word, by what becomes of it."""

_TESTS: dict[ModalGroup, str] = {
    ModalGroup.MOTION: "canon/arcs, canon/splines, test_splines",
    ModalGroup.ONE_SHOT: "canon/feeds, test_words",
    ModalGroup.FRAME: "canon/frames, canon/feeds",
    ModalGroup.PLANE: "canon/arcs",
    ModalGroup.COMPENSATION: "canon/compensation, test_compensation",
    ModalGroup.WORK_OFFSET: "test_run, test_words",
    ModalGroup.SUPPRESSION: "canon/frames, test_run",
    ModalGroup.PATH_MODE: "canon/modes",
    ModalGroup.EXACT_STOP_ONCE: "canon/modes",
    ModalGroup.UNITS: "canon/feeds",
    ModalGroup.DIMENSION: "canon/arcs, test_words",
    ModalGroup.FEED_TYPE: "canon/feeds",
    ModalGroup.FEED_CORRECTION: "test_compensation",
    ModalGroup.CORNER: "test_compensation",
    ModalGroup.SPLINE_START: "test_splines",
    ModalGroup.SPLINE_END: "test_splines",
    ModalGroup.ACCELERATION: "canon/modes",
    ModalGroup.WORKING_AREA: "canon/feeds",
}


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Word, what becomes of it, remark, and where that is tested beside the test of the three lists."""
    for group in ModalGroup:
        members = [code for code, its_group in GROUP_OF.items() if its_group is group]
        acted = [code for code in members if code in ACTED_CODES]
        name = group.name.lower().replace("_", " ")
        if acted:
            yield _together(acted), "acted on", f"group {group.value}, {name}", _TESTS.get(group, "test_vocabulary")
        for listed, fate in ((IGNORED_CODES, _NO_EFFECT), (REFUSED_CODES, "alarm")):
            for reason in dict.fromkeys(listed[code] for code in members if code in listed):
                words = [code for code in members if listed.get(code) == reason]
                yield _together(words), fate, reason, "test_vocabulary"
    yield _together([f"M{number}" for number in sorted(ACTED_M)]), "acted on", "", "canon/modes, test_run"
    for reason in dict.fromkeys(IGNORED_M.values()):
        words = [f"M{number}" for number, its in IGNORED_M.items() if its == reason]
        yield _together(words), _NO_EFFECT, reason, "test_vocabulary"
    yield "other M", "alarm", "unless the settings accept it", "test_vocabulary"
    yield _together(sorted(ACTED_ADDRESSES, key=lambda one: (len(one), one))), "acted on", "addresses, calls", "canon/*"
    for word, reason in IGNORED_ADDRESSES.items():
        yield word, _NO_EFFECT, reason, "test_vocabulary"
    yield _together(STATEMENTS.split()), "acted on", "every loop bounded; drip-fed, going back is an alarm", "test_flow"
    yield _together(sorted(FUNCTIONS)), "acted on", "functions, angles in degrees", "test_flow"
    yield _together(list(SYSTEM_VARIABLES)), "acted on", "system variables, read only", "test_flow"
    for reason in dict.fromkeys(REFUSED_WORDS.values()):
        words = [word for word, its in REFUSED_WORDS.items() if its == reason]
        yield _together(words), "alarm", reason, "test_vocabulary"
    yield "any other word", "alarm", "line, column, and what may be meant", "bad/*"


def table() -> str:
    """The table as Markdown."""
    head = "| word | what becomes of it | checked | remark | tested in |\n|---|---|---|---|---|\n"
    return head + "".join(
        f"| {words} | {fate} | {_CHECKED[fate]} | {remark} | {tests} |\n" for words, fate, remark, tests in rows()
    )


def table_without_effect() -> str:
    """The words that are accepted without effect, and why they have none here, as Markdown."""
    found = dict.fromkeys((words, why) for words, fate, why, _ in rows() if fate == _NO_EFFECT)
    return "| word | why it has no effect |\n|---|---|\n" + "".join(f"| {words} | {why} |\n" for words, why in found)


def _together(words: list[str]) -> str:
    """Words with blanks; a long run of numbered ones by its ends."""
    if len(words) > 40:
        return " ".join([*words[:5], f"{words[5]}-{words[-1]}"])
    return " ".join(words)


if __name__ == "__main__":
    sys.stdout.write(f"{table()}\n{table_without_effect()}")
