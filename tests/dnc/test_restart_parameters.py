"""Restarts of programs that read and set R parameters: what is the control's own, what only counts."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnc.errors import InputRejected
from dnc.restart import restart_at_line
from sim.interpreter.settings import Settings
from tests.dnc.restarts import HEAD, HEIGHTS


def test_a_parameter_that_the_first_run_has_changed_is_no_place_to_restart() -> None:
    """(6.8) R1 was the control's own at the place; the stopped run has counted it up since."""
    data = (HEAD + "G1 Z1 F100\nX10\nX=R1\nR1=R1+1\nG0 Z50\nM30\n").encode()
    line = HEAD.count("\n") + 2
    with pytest.raises(InputRejected, match="R1 is read behind it before the program sets it"):
        restart_at_line(data, line, HEIGHTS)
    assert restart_at_line(data.replace(b"R1=R1+1\n", b""), line, HEIGHTS)
    assert restart_at_line(b"R1=3\n" + data, line + 1, HEIGHTS)


@pytest.mark.parametrize(
    "counting",
    [
        *("N95 R99=R99+1 ; parts\r\n", "r099 = R99 - 1\n", "N10 R99=R99+1 M5\n", "N10R99=R99+1.M9M5 ;R99 counts\n"),
        *("G0 Z60 R99=R99-2\n", 'R99=R99+1 MSG("R99 OF 5")\n'),
    ],
)
def test_a_parameter_that_only_counts_parts_hinders_no_restart(counting: str) -> None:
    """(6.8) Nothing depends on it, and the preamble leaves it as the control has it; used elsewhere it is an input."""
    cuts = "G1 Z1 F100\nX10\n"
    line = HEAD.count("\n") + 2
    assert restart_at_line(f"{HEAD}{cuts}{counting}M30\n".encode(), line, HEIGHTS)
    behind = restart_at_line(f"{counting}{HEAD}{cuts}M30\n".encode(), line + 1, HEIGHTS)
    assert not [block for block in behind.preamble if "R99" in block]
    for used in ("X=R99", "X=R[99]", "R1=R99", "R99=R99+1*2", "R99=R99+1 DIV 2", "R99=R99+1+R4"):
        with pytest.raises(InputRejected, match="R99 is read"):
            restart_at_line(f"{HEAD}{cuts}{used}\n{counting}M30\n".encode(), line, HEIGHTS)


def test_a_counter_that_a_subprogram_reads_is_an_input(tmp_path: Path) -> None:
    """(6.8) R99 was left to the control, where the program itself does nothing but count it."""
    data = f"{HEAD}G1 Z1 F100\nX10\nL10P2\nR99=R99+1 M5\nM30\n".encode()
    settings = Settings(subprogram_folder=tmp_path, is_drip_fed=True)
    (tmp_path / "OTHER.SPF").write_bytes(b"X=R99\nM17\n")
    (tmp_path / "L10.SPF").write_bytes(b"L20\nM17\n")
    (tmp_path / "L20.SPF").write_bytes(b"G91 X3\nG90\nM17\n")
    line = HEAD.count("\n") + 2
    assert restart_at_line(data, line, HEIGHTS, settings)
    (tmp_path / "L20.SPF").write_bytes(b"X=R99\nM17\n")
    with pytest.raises(InputRejected, match="R99 is read"):
        restart_at_line(data, line, HEIGHTS, settings)


@pytest.mark.parametrize(
    ("behind", "is_safe"),
    [
        ("X=R2\nIF R1>3\nR2=R2+9\nENDIF\n", False),
        ("X=R2\nIF R1<3 GOTOF ON\nN7 R2=9\nON: Y3\n", False),
        ("IF R1>3\nR2=9\nENDIF\nX=R2\n", False),
        ("X=R2\nIF R1>3\nR[R1]=9\nENDIF\n", False),
        ("R2=5\nX=R2\nIF R1>3\nR2=R2+9\nENDIF\n", True),
        ("X=R2\nIF R1>3\nR3=9\nENDIF\n", True),
        ("R2=5\nX=R2\n", True),
    ],
)
def test_what_a_branch_behind_may_have_changed_is_no_input(behind: str, *, is_safe: bool) -> None:
    """(6.8) The control's own R1 chose a branch that set R2; the restart read R2 as that had left it."""
    data = f"{HEAD}G1 Z1 F100\nX10\n{behind}G0 Z50\nM30\n".encode()
    line = HEAD.count("\n") + 2
    if is_safe:
        assert restart_at_line(data, line, HEIGHTS)
        return
    with pytest.raises(InputRejected, match=r"R[12] is read"):
        restart_at_line(data, line, HEIGHTS)
    assert restart_at_line(b"R1=4 R2=3\n" + data, line + 1, HEIGHTS)


@pytest.mark.parametrize(
    ("head", "named"),
    [("", None), ("R1=3\n", HEAD.count("\n") + 4), ("IF R2\nENDIF\n", None)],
)
def test_the_line_that_a_refusal_names_is_not_refused_for_a_parameter(head: str, named: int | None) -> None:
    """(6.8) "restart at line 12" was refused itself, for R1 was read behind it and changed."""
    text = f"{head}{HEAD}G1 Z1 F100\nX10\nROT RPL=30\nX=R1\nR1=R1+1\nROT\nG0 Z50\nM30\n"
    line = text[: text.index("X=R1")].count("\n") + 1
    with pytest.raises(InputRejected, match="turns, scales") as caught:
        restart_at_line(text.encode(), line, HEIGHTS)
    assert str(caught.value).endswith(
        "; set R1 by hand to what it was, and run the program from its start" if named is None else f"at line {named}"
    )
    if named is not None:
        assert restart_at_line(text.encode(), named, HEIGHTS).line == named
