"""Variables, expressions, jumps, loops and subprograms (6.4)."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim.interpreter import canon
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import Settings

ORIGIN = (0.0, 0.0, 0.0)


def run(text: str, **settings: object) -> list[canon.Command]:
    whole = list(interpret(text.encode("latin-1"), Settings(start_mm=ORIGIN, **settings)))  # type: ignore[arg-type]
    interpreter = Interpreter(Settings(start_mm=ORIGIN, **settings))  # type: ignore[arg-type]
    received: list[canon.Command] = []
    for line, raw in enumerate(text.encode("latin-1").split(b"\n"), 1):
        received += interpreter.block(raw, line)
    received += interpreter.finish()
    assert received == whole
    return whole


def ends(text: str, **settings: object) -> list[float]:
    """X of every move."""
    found = run(text, **settings)
    assert not [command for command in found if isinstance(command, canon.Alarm)], found[-1]
    return [command.end[0] for command in found if isinstance(command, canon.Motion)]


def alarm(text: str, **settings: object) -> canon.Alarm:
    found = run(text, **settings)[-1]
    assert isinstance(found, canon.Alarm), found
    return found


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("2+3*4", 14), ("(2+3)*4", 20), ("-2*3", -6), ("7/2", 3.5), ("7 DIV 2", 3), ("7 MOD 4", 3), ("2--3", 5),
        ("SIN(30)", 0.5), ("COS(60)", 0.5), ("TAN(45)", 1), ("ASIN(1)", 90), ("ACOS(0)", 90), ("ATAN2(1,1)", 45),
        ("SQRT(16)", 4), ("POT(3)", 9), ("ABS(-4)", 4), ("TRUNC(-2.7)", -2), ("ROUND(2.5)", 3), ("LN(EXP(2))", 2),
        ("'HF'+'B11'", 18), ("1.5EX2", 150), ("(3>2)+(2>=2)+(1<>1)", 2), ("NOT 0", 1), ("(1==1) AND (2==3)", 0),
        ("(1==1) XOR (2==3)", 1), ("6 B_AND 3", 2), ("6 B_OR 3", 7), ("6 B_XOR 3", 5), ("MINVAL(3,2)+MAXVAL(3,2)", 5),
        ("BOUND(1,5,9)", 5), ("R[1+1]+R2", 14), ("5>3+1", 1), ("3>2 AND 0", 1),
    ],
)  # fmt: skip
def test_expressions(expression: str, value: float) -> None:
    """(6.4)"""
    assert ends(f"R2=7\nG0 X=1000+({expression})") == [pytest.approx(1000 + value)]


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("R1=1/0", 14051), ("R1=5 MOD 0", 14051), ("R1=SQRT(-1)", 14051), ("R1=EXP(1000)", 14051), ("R1=LN(0)", 14051),
        ("R5000=1", 17020), ("R1=UNKNOWN", 12550), ("R1=NOFUNC(1)", 12550), ("R1=SIN(1,2)", 14020),
        ("DEF INT AA[3]\nAA[3]=1", 17020), ("DEF INT AA[3]\nAA=1", 17020), ("DEF STRING[9] TT\nTT=5", 12150),
        ('R1="text"', 12150), ("DEF INT AA[0]", 17020), ("DEF REAL X=1", 12170), ("DEF INT AA[999999]", 17020),
        ("GOTOF NOWHERE", 14080), ("GOTOB NOWHERE", 14080), ("IF 1==1\nG0 X1", 12640), ("ENDIF", 12640),
        ("WHILE 0\nG0 X1", 12640), ("ENDFOR", 12640), ("NOTHING", 12550), ("L99", 14011), ('EXTCALL("NOTHING")', 14011),
    ],
)  # fmt: skip
def test_what_is_not_defined_is_an_alarm(text: str, number: int) -> None:
    """(6.4)"""
    assert alarm(text).number == number


def test_did_you_mean() -> None:
    """(6.5)"""
    assert "BSPLINE may be meant" in alarm("BSPLIN X1").text
    assert alarm("N10 G1 BSPLIN X1").column == 8


def test_variables_have_types_and_arrays() -> None:
    """(6.4)"""
    text = """DEF REAL LENGTH=1.5, STEPS[2,3]=SET(1,2,3,4,5,6)
    DEF INT COUNT=2.5
    DEF BOOL FLAG=7
    DEF STRING[20] NAME="HERE"
    G0 X=STEPS[1,0]+LENGTH+COUNT*100+FLAG*1000
    GOTOF NAME
    G0 X1
    HERE: STEPS[0,0]=9
    G0 X=STEPS[0,0]"""
    assert ends(text) == [4 + 1.5 + 300 + 1000, 9]


def test_if_else_endif_nested() -> None:
    """(6.4)"""
    text = """R1={0} R2={1}
    IF R1==1
      IF R2==1
        G0 X11
      ELSE
        G0 X10
      ENDIF
    ELSE
      IF R2==1
        G0 X1
      ENDIF
    ENDIF
    G0 X100"""
    assert ends(text.format(1, 1)) == [11, 100]
    assert ends(text.format(1, 0)) == [10, 100]
    assert ends(text.format(0, 1)) == [1, 100]
    assert ends(text.format(0, 0)) == [100]


def test_loops() -> None:
    """(6.4)"""
    assert ends("FOR R1=1 TO 3\nG0 X=R1\nENDFOR\nG0 X=R1") == [1, 2, 3, 4]
    assert ends("FOR R1=5 TO 3\nG0 X=R1\nENDFOR\nG0 X9") == [9]
    assert ends("R1=3\nWHILE R1>0\nG0 X=R1\nR1=R1-1\nENDWHILE\nG0 X9") == [3, 2, 1, 9]
    assert ends("R1=0\nREPEAT\nR1=R1+1\nG0 X=R1\nUNTIL R1>=2\nG0 X9") == [1, 2, 9]
    assert ends("R1=0\nLOOP\nR1=R1+1\nIF R1>3 GOTOF OUT\nG0 X=R1\nENDLOOP\nOUT: G0 X9") == [1, 2, 3, 9]


def test_nested_loops_of_one_kind_left_by_a_jump() -> None:
    """(6.4) The inner loop left by a jump must not catch the outer one's end."""
    text = """FOR R1=1 TO 2
    FOR R2=1 TO 9
    IF R2==2 GOTOF NEXT
    G0 X=R1*10+R2
    ENDFOR
    NEXT: G0 X=R1*10+9
    ENDFOR
    G0 X100"""
    assert ends(text) == [11, 19, 21, 29, 100]


def test_jumps() -> None:
    """(6.4)"""
    assert ends("GOTOF AA\nG0 X1\nAA: G0 X2") == [2]
    assert ends("N10 GOTOF N30\nN20 G0 X1\nN30 G0 X2") == [2]
    assert ends("R1=0\nN20 R1=R1+1\nG0 X=R1\nIF R1<3 GOTOB N20\nG0 X9") == [1, 2, 3, 9]
    assert ends("R1=0\nAA: R1=R1+1\nG0 X=R1\nIF R1<2 GOTO AA\nG0 X9") == [1, 2, 9]
    assert ends("GOTOC NOWHERE\nG0 X1") == [1]
    assert ends("R1=2\nCASE R1 OF 1 GOTOF AA 2 GOTOF BB DEFAULT GOTOF CC\nAA: G0 X1\nBB: G0 X2\nCC: G0 X3") == [2, 3]
    assert ends("R1=7\nCASE R1 OF 1 GOTOF AA DEFAULT GOTOF CC\nAA: G0 X1\nCC: G0 X3") == [3]


def test_a_jump_back_out_of_open_structures_leaves_them() -> None:
    """(6.4) Else they would count as never closed at the end of the program."""
    out = "AA: R1=R1+1\nG0 X=R1\nIF R1<3\nLOOP\nGOTOB AA\nENDLOOP\nENDIF\nG0 X9"
    assert ends(f"R1=0\n{out}") == [1, 2, 3, 9]
    inside = "R1=0\nIF 1==1\nAA: R1=R1+1\nG0 X=R1\nIF R1<3\nGOTOB AA\nENDIF\nENDIF\nG0 X9"
    assert ends(inside) == [1, 2, 3, 9]


def test_a_label_may_be_a_letter_with_digits() -> None:
    """(6.4)"""
    assert ends("G0 X1\nGOTOF C13\nX2\nN40 C13: X3") == [1, 3]


def test_repeated_sections() -> None:
    """(6.4)"""
    assert ends("R1=0\nAA: R1=R1+1\nG0 X=R1\nREPEAT AA P=2\nG0 X9") == [1, 2, 3, 9]
    assert ends("R1=0\nAA: R1=R1+1\nBB: G0 X=R1\nG0 X50\nREPEAT AA BB P=2\nG0 X9") == [1, 50, 2, 3, 9]
    assert ends("R1=0\nAA: R1=R1+1\nG0 X=R1\nREPEATB AA P=3\nG0 X=R1") == [1, 4]


def test_skipped_blocks_are_passed_over() -> None:
    """(6.1)"""
    text = "/N10 G0 X1\n/2 N20 G0 X2\nG0 X3"
    assert ends(text) == [1, 2, 3]
    assert ends(text, skip_levels=frozenset({0})) == [2, 3]
    assert ends(text, skip_levels=frozenset({0, 2})) == [3]


@pytest.mark.parametrize(
    "text",
    [
        "AA: G0 X1\nGOTOB AA",
        "AA: G0 X1\nGOTO AA",
        "R1=0\nWHILE R1<3\nR1=R1+1\nENDWHILE",
        "FOR R1=1 TO 2\nG0 X=R1\nENDFOR",
        "AA: G0 X1\nREPEAT AA",
    ],
)
def test_a_drip_fed_program_cannot_go_back(text: str) -> None:
    """(6.4)"""
    assert alarm(text, is_drip_fed=True, backward_jump_alarm=14001).number == 14001


def test_a_drip_fed_program_may_go_forward() -> None:
    """(6.4)"""
    text = "GOTOF AA\nG0 X1\nAA: IF 1==2\nG0 X2\nELSE\nG0 X3\nENDIF\nWHILE 1==2\nENDWHILE"
    assert ends(text, is_drip_fed=True) == [3]


def test_every_loop_is_bounded() -> None:
    """(6.4)"""
    found = alarm("LOOP\nENDLOOP", max_repeats=1000)
    assert (found.number, "1000 jumps" in found.text) == (14092, True)
    assert alarm("AA: GOTOB AA", max_repeats=50).number == 14092
    body = "R1=1\n" * 30
    found = run(f"AA: G0 X1\n{body}GOTOB AA", max_repeats=100)[-1]
    assert isinstance(found, canon.Alarm)
    assert found.number == 14092


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "POCKET.SPF").write_text(
        "PROC POCKET(REAL DEPTH, INT COUNT=2, VAR REAL BACK)\nG0 X=DEPTH*COUNT\nBACK=DEPTH+1\nRET\n"
    )
    (tmp_path / "_N_L100_SPF").write_text("N5 G0 X77\nG91\nM17\n")
    (tmp_path / "keep.spf").write_text("PROC KEEP SAVE\nG91 G0 X5\n")
    (tmp_path / "DEEP.SPF").write_text("DEEP\nM17\n")
    (tmp_path / "LOCAL.SPF").write_text("DEF REAL INNER=3\nG0 X=INNER\nM30\n")
    (tmp_path / "BAD.SPF").write_text("G1 X{\n")
    return tmp_path


def test_subprograms(folder: Path) -> None:
    """(6.4)"""
    assert ends("DEF REAL GOT\nPOCKET(10,3,GOT)\nG0 X=GOT\nPOCKET(4)", subprogram_folder=folder) == [30, 11, 8]
    assert ends("G90 L100 P2\nX1", subprogram_folder=folder) == [77, 154, 155]
    assert ends("KEEP\nG0 X1", subprogram_folder=folder) == [5, 1]
    assert ends('EXTCALL("/_N_SPF_DIR/_N_LOCAL_SPF")\nCALL "LOCAL"\nG0 X1', subprogram_folder=folder) == [3, 1]
    assert alarm("LOCAL\nG0 X=INNER", subprogram_folder=folder).number == 12550


def test_subprogram_commands_carry_the_block_that_called(folder: Path) -> None:
    """(6.4)"""
    found = run("N10 G0 X1\nN20 L100\nN30 M30", subprogram_folder=folder)
    assert [(command.line, command.block) for command in found] == [(1, 10), (2, 20), (3, 30)]
    bad = alarm("N10 G0 X1\nN20 BAD", subprogram_folder=folder)
    assert (bad.line, bad.block, "in subprogram BAD" in bad.text) == (2, 20, True)


def test_calls_are_bounded(folder: Path) -> None:
    """(6.4)"""
    assert alarm("DEEP", subprogram_folder=folder).number == 14010


def test_system_variables(folder: Path) -> None:
    """(6.4)"""
    assert ends("TRANS X10\nG0 X5\nG0 X=$P_EP[X]+1\nG0 X=$AA_IM[X1]-9", subprogram_folder=folder) == [15, 16, 17]
    assert alarm("R1=$A_DBB[0]").number == 12550
    assert math.isclose(ends("F200 S500 T3\nM6\nG0 X=$P_F+$P_S+$P_TOOLNO")[0], 703)
