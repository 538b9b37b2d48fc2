"""Reading blocks: lexis and block rules (6.1)."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner.gcode import (
    FANUC,
    SINUMERIK,
    Binary,
    Block,
    Call,
    Name,
    Number,
    SyntaxProblem,
    Text,
    Word,
    directory_of,
    header_name,
    read_block,
    read_blocks,
    read_program,
    write_block,
    write_words,
)
from planner.gcode.reader import _full_block, _plain_block
from planner.gcode.statement import Case, Define, For, If, Jump, Mark, Procedure, RepeatSection, Until, While

GOLDEN = Path(__file__).parents[2] / "golden"


def bare(block: Block) -> list[tuple[str, object]]:
    return [(word.address, word.value) for word in block.words]


def test_words_may_stand_without_blanks_in_any_case() -> None:
    """(6.1)"""
    assert bare(read_block("n10g01x-.5Y+2.z3EX2f250")) == [
        ("G", 1.0), ("X", -0.5), ("Y", 2.0), ("Z", 300.0), ("F", 250.0),
    ]  # fmt: skip
    assert read_block("n10g01x1").number == 10


def test_column_and_text_are_kept() -> None:
    """(6.1)"""
    word = read_block("N10 G1  X-01.50").words[1]
    assert (word.address, word.text, word.column) == ("X", "-01.50", 9)


def test_tab_ampersand_and_control_characters_separate() -> None:
    """(6.1)"""
    assert bare(read_block("G1&X1\tY2\x07Z3\r\n")) == [("G", 1.0), ("X", 1.0), ("Y", 2.0), ("Z", 3.0)]


@pytest.mark.parametrize(
    ("text", "level", "number", "is_main"),
    [
        ("/N10 G1", 0, 10, False),
        ("/3 N10 G1", 3, 10, False),
        ("N10 / G1", 0, 10, False),
        (":20 G1", None, 20, True),
        ("G1", None, None, False),
    ],
)
def test_skip_levels_and_block_numbers(text: str, level: int | None, number: int | None, is_main: bool) -> None:
    """(6.1)"""
    block = read_block(text)
    assert (block.skip_level, block.number, block.is_main) == (level, number, is_main)


def test_address_with_extension_needs_equals() -> None:
    """(6.1)"""
    words = read_block("CIP I1=5 S1=1000 CR=-3.5 X1=R2*2").words
    assert [word.address for word in words] == ["CIP", "I1", "S1", "CR", "X1"]
    assert words[3].number == -3.5
    assert words[4].value == Binary("*", Name("R2"), Number(2.0, "2"))


def test_lists_calls_and_strings() -> None:
    """(6.1)"""
    po, den, msg, fgroup, x = read_block('PO[X]=(1,-2,,3) PO[]=(2) MSG("a;b") FGROUP (X,Y) X=AC(5)').words
    assert po.index == (Name("X"),)
    assert po.arguments is not None
    assert po.arguments[2] is None
    assert den.index == ()
    assert msg.arguments == (Text("a;b"),)
    assert fgroup.arguments == (Name("X"), Name("Y"))
    assert x.value == Call("AC", (Number(5.0, "5"),))


def test_literals_in_quotes() -> None:
    """(6.1)"""
    assert read_block("R1='HfF' R2='B101'").words[0].number == 255.0
    assert read_block("R1='HfF' R2='B101'").words[1].number == 5.0


def test_comment_and_headers() -> None:
    """(6.1)"""
    assert read_block("G1 X1 ; to the wall").comment == " to the wall"
    assert header_name(read_block("%_N_SHAFT123_MPF")) == "_N_SHAFT123_MPF"
    assert header_name(read_block(";%_N_SHAFT123_MPF")) == "_N_SHAFT123_MPF"
    assert directory_of(read_block(";$PATH=/_N_WKS_DIR/_N_SPIGOT_WPD")) == "/_N_WKS_DIR/_N_SPIGOT_WPD"
    assert read_block("%").header == ""


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("IF R1>5 GOTOF NAME", Jump),
        ("GOTOB N100", Jump),
        ("IF (R1>5) AND (R2<>3)", If),
        ("WHILE R1<5", While),
        ("FOR R1=1 TO 10", For),
        ("REPEAT", Mark),
        ("REPEAT L_A L_B P=3", RepeatSection),
        ("UNTIL R1==3", Until),
        ("CASE (R1+1) OF 1 GOTOF AA 2 GOTOB BB DEFAULT GOTO CC", Case),
        ("DEF REAL AA=5, BB[3]=SET(1,2,3)", Define),
        ("PROC POCKET(REAL DEPTH, VAR INT COUNT) SAVE", Procedure),
    ],
)
def test_statements(text: str, kind: type) -> None:
    """(6.4)"""
    assert isinstance(read_block(f"N10 {text} ; note").statement, kind)


def test_label_before_words() -> None:
    """(6.4)"""
    block = read_block("N10 START: G1 X1")
    assert (block.number, block.label, len(block.words)) == (10, "START", 2)


@pytest.mark.parametrize(
    ("text", "column", "expected"),
    [
        ("G1 X", 5, "a number or ="),
        ("G1 X1 {", 7, "an address, a name or ;"),
        ('MSG("open', 5, 'a second "'),
        ("X=(1+2", 7, ")"),
        ("X=", 3, "a value"),
        ("G=R1", 3, "a number right after G"),
        ("N1.5 G1", 2, "a whole number without sign"),
        ("GOTOF", 6, "a value"),
        ("FOR R1=1 10", 10, "TO"),
        ("X" + "(" * 60, 3, "at most 40 levels"),
        ("DEF FLOAT A1", 5, "REAL, INT, BOOL, CHAR, STRING, AXIS"),
        ("G1 X1 5", 7, "an address, a name or ;"),
    ],
)
def test_problem_names_column_and_what_was_expected(text: str, column: int, expected: str) -> None:
    """(6.5)"""
    with pytest.raises(SyntaxProblem) as caught:
        read_block(text, 7)
    assert caught.value.line == 7
    assert caught.value.expected == expected
    if column != 3 or "((" not in text:
        assert caught.value.column == column


def test_long_block_is_refused() -> None:
    """(6.1)"""
    assert read_block("; " + "x" * 509).comment
    with pytest.raises(SyntaxProblem, match="513 characters"):
        read_block("; " + "x" * 510)


def test_iso_dialects_read_letters_and_bracket_comments() -> None:
    """(6.1)"""
    block = read_block("/N20 G01 X1. (WALL) Y-2.5", dialect=FANUC)
    assert (block.number, block.comment, block.skip_level) == (20, "WALL", 0)
    assert bare(block) == [("G", 1.0), ("X", 1.0), ("Y", -2.5)]
    with pytest.raises(SyntaxProblem):
        read_block("X=R1", dialect=FANUC)


def test_every_block_of_the_thesis_program_is_read() -> None:
    """(2.4)"""
    program = read_program((GOLDEN / "thesis-5000.mpf").read_bytes())
    assert len(program.blocks) == 398
    assert program.name == "_N_HSM_LIN_TARGET_PIT"
    assert directory_of(program.blocks[1]) == "/_N_PIT_DIR"
    assert program.blocks[-1].header == ""


_NUMBERS = st.from_regex(r"[+-]?([0-9]{1,5}\.?[0-9]{0,4}|\.[0-9]{1,4})", fullmatch=True)
_PLAIN = st.lists(st.tuples(st.sampled_from("XYZGFMSTDIJKxyz"), _NUMBERS), min_size=1, max_size=7)


@given(_PLAIN, st.sampled_from(["", " ", "\t", "  "]), st.sampled_from(["", "; c", " ;"]))
def test_short_route_and_full_parser_agree(words: list[tuple[str, str]], blank: str, comment: str) -> None:
    """(6.7)"""
    text = "N5" + blank + blank.join(letter + number for letter, number in words) + comment
    assert read_block(text) == _full_block(text, 1)


_CURVE_PIECES = """
    POLY BSPLINE poly PO[X]=( PO[Y]=( PO[]=( po[z]=( PL= PW= pl= X Y Z F N5 G1
    1.5 -.25 +3 2. 0 , ) * - DIV E EX2 : = [ ;
"""
_PIECES = st.sampled_from(_CURVE_PIECES.split())


@given(st.lists(_PIECES, min_size=1, max_size=14), st.sampled_from(["", " "]))
def test_short_route_agrees_where_words_of_curves_stand(pieces: list[str], blank: str) -> None:
    """(6.7) Whatever the pieces make, the short route gives what the full parser gives, or leaves it to that."""
    text = blank.join(pieces)
    short = _plain_block(text, 1)
    if short is not None:
        assert short == _full_block(text, 1)


def test_words_of_curves_go_the_short_route() -> None:
    """(6.7)"""
    for text in ("N7POLY PO[X]=(49.87,12.1,-.7)PO[]=(2,1)PL=3 F250", "BSPLINE X10Z-.5PL=0", "X1PW=.5 PL=2 ; c"):
        assert _plain_block(text, 1) == _full_block(text, 1)


@given(st.text(alphabet=st.characters(min_codepoint=0, max_codepoint=255), max_size=80))
def test_any_text_is_read_or_refused_with_a_place(text: str) -> None:
    """(6.6)"""
    found = next(read_blocks(text.replace("\n", " ").encode("latin-1")), Block())
    if isinstance(found, SyntaxProblem):
        assert 1 <= found.column <= len(text) + 1
        assert found.expected


@given(_PLAIN)
def test_written_words_read_back(words: list[tuple[str, str]]) -> None:
    """(6.1)"""
    made = [Word(letter.upper(), float(number), number) for letter, number in words]
    for separator in ("", " "):
        again = read_block(write_words(made, separator=separator)).words
        assert [(word.address, word.value, word.text) for word in again] == [
            (word.address, word.value, word.text) for word in made
        ]


@pytest.mark.parametrize(
    "text",
    ["N10 G1 X1 ; wall", "/2 N5 POLY PO[X]=(1,2) PL=.5", "%_N_A_MPF", ":7 G0", 'MSG("hello")', "BSPLINE SD=3 X1 PL=0"],
)
def test_block_is_written_as_it_was_read(text: str) -> None:
    """(6.1)"""
    assert write_block(read_block(text)) == text


def test_reading_goes_on_after_a_problem() -> None:
    """(6.5)"""
    found = list(read_blocks(b"G1 X1\nG1 X{\r\nG1 X2"))
    assert isinstance(found[1], SyntaxProblem)
    assert (found[1].line, found[1].column) == (2, 5)
    assert isinstance(found[2], Block)
    assert SINUMERIK.max_block_characters == 512
