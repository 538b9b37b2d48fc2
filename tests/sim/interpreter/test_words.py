"""Words with meaning that the goldens do not show from both sides (6.2)."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings
from sim.interpreter.tangents import bounds, end_tangent, extent, point_on_arc, start_tangent

ORIGIN = (0.0, 0.0, 0.0)


def run(text: str, **keys: object) -> list[canon.Command]:
    return list(interpret(text.encode("latin-1"), Settings(start_mm=ORIGIN, **keys)))  # type: ignore[arg-type]


def motions(text: str, **keys: object) -> list[canon.Motion]:
    found = run(text, **keys)
    assert not any(isinstance(one, canon.Alarm) for one in found), found[-1]
    return [one for one in found if isinstance(one, canon.Motion)]


def test_reference_and_fixed_points() -> None:
    """(6.2) G74, G75 and G28 go where the machine knows, as rapids, in machine coordinates."""
    keys = {
        "work_offsets_mm": {"G54": (10.0, 20.0, 30.0)},
        "reference_point_mm": (1.0, 2.0, 3.0),
        "fixed_points_mm": {1: (5.0, 6.0, 7.0), 2: (8.0, 9.0, 10.0)},
    }
    text = "G54 G0 X1 Y1 Z1\nG74 X1=0 Y1=0\nG75 FP=2 Z1=0\nG75 X1=0\nG28 Y5 Z6"
    assert [move.end for move in motions(text, **keys)] == [
        (1, 1, 1), (-9, -18, 1), (-9, -18, -20), (-5, -18, -20), (-5, 5, 6), (-5, -18, -27),
    ]  # fmt: skip


def test_ac_and_ic_say_it_for_one_word() -> None:
    """(6.2)"""
    assert [move.end for move in motions("G0 X5\nX=IC(2) Y3\nG91\nX=AC(1) Y1\nX1")] == [
        (5, 0, 0), (7, 3, 0), (1, 4, 0), (2, 4, 0)
    ]  # fmt: skip


def test_t_changes_the_tool_where_there_is_no_changer() -> None:
    """(6.2)"""
    assert run("T3", has_tool_changer=False) == [canon.SelectTool(1, None, 3), canon.ChangeTool(1, None, 3)]
    assert run("T3\nM6") == [canon.SelectTool(1, None, 3), canon.ChangeTool(2, None, 3)]


def test_an_inch_machine_reads_inches_until_it_is_told_otherwise() -> None:
    """(6.2) G70 and G71 leave the feed to the machine's basic system, G700 and G710 do not."""
    text = "G1 F1 X1\nG71 X2\nG710 F100 X3\nG700 F2 X4\nG70 X5"
    assert [(move.end[0], move.feed_mm_min) for move in motions(text, is_inch=True)] == [
        (25.4, 25.4), (2, 25.4), (3, 100), (pytest.approx(101.6), pytest.approx(50.8)), (pytest.approx(127), 50.8)
    ]  # fmt: skip


def test_units_scale_everything_that_is_a_length() -> None:
    """(6.2)"""
    metric = run(
        "F100\nTRANS X25.4\nG2 X50.8 Y0 I38.1 J0\nG641 ADIS=2.54\nPOLY PO[X]=(0,25.4)\nCIP X50.8 I1=25.4 J1=12.7"
    )
    inch = run("F100\nG70\nTRANS X1\nG2 X2 Y0 I1.5 J0\nG641 ADIS=.1\nPOLY PO[X]=(0,1)\nCIP X2 I1=1 J1=.5")
    for a, b in zip(metric, inch, strict=True):
        assert type(a) is type(b)
    arcs = [next(one for one in found if isinstance(one, canon.Arc)) for found in (metric, inch)]
    assert arcs[0].centre == pytest.approx(arcs[1].centre)
    polys = [next(one for one in found if isinstance(one, canon.Polynomial)) for found in (metric, inch)]
    assert polys[0].coefficients[1] == pytest.approx(polys[1].coefficients[1])
    assert polys[0].coefficients[2] == pytest.approx(polys[1].coefficients[2])


def test_feed_of_an_arc_in_inverse_time() -> None:
    """(6.2) A half circle of radius 10 in a quarter minute."""
    (arc,) = motions("G93 G2 X20 Y0 I10 J0 F4")
    assert isinstance(arc, canon.Arc)
    assert arc.feed_mm_min == pytest.approx(40 * math.pi)
    assert run("G93 G1 X1 F2\nX2")[-1].number == 10860  # type: ignore[attr-defined]


def test_a_change_of_feed_type_forgets_the_feed() -> None:
    """(6.2)"""
    assert run("G1 X1 F100\nS100 M3\nG95 X2")[-1].number == 10860  # type: ignore[attr-defined]


def test_spindle_limits() -> None:
    """(6.2)"""
    speeds = [
        one.speed_rpm for one in run("G26 S800\nG25 S100\nS2000 M3\nS10\nS500 M4\nM5") if isinstance(one, canon.Spindle)
    ]
    assert speeds == [800, 100, -500, 0]


def test_working_area_counts_what_bulges_out() -> None:
    """(6.2) An arc or a polynomial may leave the area though its ends are inside."""
    assert run("G26 Y4\nG2 X10 Y0 I5 J0 F100")[-1].number == 10730  # type: ignore[attr-defined]
    assert run("G26 Y4\nPOLY PO[X]=(10) PO[Y]=(0,-20) F100")[-1].number == 10730  # type: ignore[attr-defined]
    assert run("G26 Y4\nBSPLINE X2 Y9 F9\nX4 Y9\nX6 Y9\nX8 Y0")[-1].number == 10730  # type: ignore[attr-defined]
    assert run("G26 Y4\nCSPLINE X2 Y3.9 F9\nX4 Y3.9\nX6 Y0")[-1].number == 10730  # type: ignore[attr-defined]
    assert len(motions("G26 Y5.1\nG2 X10 Y0 I5 J0 F100\nPOLY PO[X]=(0) PO[Y]=(0,-20)")) == 2


def test_a_helix_of_many_turns_bulges_out_like_one_of_few() -> None:
    """(6.2) The extremes of the first axis alone filled what was looked at: beyond 32 turns Y and Z had none."""
    for turns in (1, 31, 40, 999):
        assert run(f"G26 Y5\nG1 X10 F100\nG3 X10 Y0 Z-5 I-10 J0 TURN={turns}")[-1].number == 10730  # type: ignore[attr-defined]
        (_, helix) = motions(f"G26 Y11\nG1 X10 F100\nG3 X10 Y0 Z-5 I-10 J0 TURN={turns}")
        low, high = extent(helix)
        assert (*low, *high) == pytest.approx((-10, -10, -5, 10, 10, 0), abs=1e-9)


@pytest.mark.parametrize(
    "refused",
    ["G1 X10 I5", "G0 X10 CR=5", "X10 TURN=2", "S500 M3 X10 I5", "T2 M6 PL=3 X9", "G2 X10 I5 SD=3 J0", "POLY X10 J3"],
)
def test_a_refused_block_does_nothing(refused: str) -> None:
    """(6.2) A word without meaning was found after the move that it stood beside, and the mill made that move."""
    first, *rest = run(f"G1 X5 F100\n{refused}\nX20")
    assert isinstance(first, canon.Line)
    assert [type(one) for one in rest] == [canon.Alarm]


def test_what_waits_before_a_refused_block_is_given() -> None:
    """(6.2) The spline up to it, and the compensated contour."""
    spline = "G1 X0 F100\nBSPLINE X1 Y1\nX2\nX3\nX4\n"
    assert len(run(spline + "G1 X5 I5")) == len(motions(spline + "M30")) + 1
    contour = "T1 M6\nG41 G1 X10 Y5 F100\nX20\n"
    found = run(contour + "Y30 I5", unknown_radius_mm=2.0)
    assert [type(one) for one in found[-3:]] == [canon.Line, canon.Line, canon.Alarm]


def test_nothing_leaves_after_the_end() -> None:
    """(6.2)"""
    for end in ("M2", "M30", "M17"):
        assert run(f"G0 X1 {end}\nG0 X2")[-1] == canon.End(1, None)


@pytest.mark.parametrize(
    ("frames", "place"),
    [
        ("ROT RPL=90\nATRANS X5", (-2, 6, 3)),
        ("TRANS X5\nAROT RPL=90", (3, 1, 3)),
        ("ROT RPL=90\nASCALE X2", (-2, 2, 3)),
        ("SCALE X2\nAROT RPL=90", (-4, 1, 3)),
        ("ROT Z90 X90", (3, 1, 2)),
        ("MIRROR X0\nATRANS X5", (-6, 2, 3)),
        ("G18 ROT RPL=90", (3, 2, -1)),
        ("TRANS X5\nROT RPL=90", (-2, 1, 3)),
        ("TRANS X5\nG59 X1\nATRANS X1", (8, 2, 3)),
        ("TRANS X5\nG58 X7", (8, 2, 3)),
    ],
)
def test_additive_frames_act_in_the_frame_that_stands(frames: str, place: tuple[float, ...]) -> None:
    """(6.2) Each place of (1, 2, 3) worked out by head."""
    lines = frames.replace("G18 ROT", "G18\nROT")
    assert motions(f"{lines}\nG0 X1 Y2 Z3")[-1].end == pytest.approx(place)


def test_unprogrammed_axes_stay_to_the_last_bit() -> None:
    """(6.2)"""
    found = motions("TRANS X0.1 Y0.2 Z0.3\nG1 X1.1 Y2.2 Z3.3 F100\nX5\nX6\nG0 SUPA X7\nX8")
    assert {move.end[1:] for move in found} == {found[0].end[1:]}


ANGLE, SIZE = st.floats(-7, 7), st.floats(-50, 50)


@settings(max_examples=80, deadline=None)
@given(
    SIZE,
    SIZE,
    st.floats(0.1, 6.2),
    st.floats(0.5, 30),
    st.sampled_from(["G2", "G3"]),
    st.sampled_from(["G17", "G18", "G19"]),
)
def test_every_spelling_gives_the_same_arc(
    x: float, y: float, sweep: float, radius: float, code: str, plane: str
) -> None:
    """(6.2) I J K, absolute centre, CR= and AR= agree, and the arc ends where it should."""
    turn = -sweep if code == "G2" else sweep
    axes, centres = {"G17": ("XY", "IJ"), "G18": ("ZX", "KI"), "G19": ("YZ", "JK")}[plane]
    start = (x + radius, y)
    end = (x + radius * math.cos(turn), y + radius * math.sin(turn))
    first, second = axes
    head = f"{plane} G1 {first}{start[0]:.9f} {second}{start[1]:.9f} F100\n"
    head += f"{code} {first}{end[0]:.9f} {second}{end[1]:.9f} "
    spellings = [
        f"{centres[0]}{x - start[0]:.9f} {centres[1]}{y - start[1]:.9f}",
        f"{centres[0]}=AC({x:.9f}) {centres[1]}=AC({y:.9f})",
        f"CR={radius if sweep <= math.pi else -radius:.9f}",
        f"AR={math.degrees(sweep):.9f}",
    ]
    found = [motions(head + spelling)[-1] for spelling in spellings]
    for arc in found:
        assert isinstance(arc, canon.Arc)
        assert arc.sweep_rad == pytest.approx(sweep, abs=2e-3 if abs(sweep - math.pi) < 1e-2 else 1e-5)
        assert point_on_arc(arc, arc.sweep_rad) == pytest.approx(arc.end, abs=1e-9 + radius * 1e-9)
        low, high = extent(arc)
        assert bounds(arc) == (low, high)
        for share in range(11):
            point = point_on_arc(arc, arc.sweep_rad * share / 10)
            assert all(low[i] - 1e-7 <= point[i] <= high[i] + 1e-7 for i in range(3))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(SIZE, SIZE, SIZE), min_size=1, max_size=4), st.floats(0.1, 9))
def test_the_quick_box_holds_the_curve(terms: list[tuple[float, float, float]], length: float) -> None:
    """(6.2)"""
    values = [f"PO[{axis}]=({','.join(f'{term[index]:.6f}' for term in terms)})" for index, axis in enumerate("XYZ")]
    for curve in motions(f"POLY {' '.join(values)} PL={length:.6f} F100"):
        (low, high), (least, most) = bounds(curve), extent(curve)
        assert all(low[i] <= least[i] + 1e-9 and most[i] <= high[i] + 1e-9 for i in range(3))


@settings(max_examples=60, deadline=None)
@given(ANGLE, SIZE, SIZE)
def test_a_tangent_arc_leaves_along_what_was_before(heading: float, x: float, y: float) -> None:
    """(6.2)"""
    if math.hypot(x, y) < 1 or abs(math.remainder(math.atan2(y, x) - heading, math.tau)) > 3:
        return
    found = motions(f"G1 X{-math.cos(heading):.9f} Y{-math.sin(heading):.9f} F100\nX0 Y0\nCT X{x:.9f} Y{y:.9f}")
    line, arc = found[-2:]
    tangent, wanted = start_tangent(arc), end_tangent(line)
    assert tangent == pytest.approx(wanted, abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(st.tuples(SIZE, SIZE, SIZE), st.tuples(SIZE, SIZE, SIZE))
def test_cip_passes_through_its_middle(middle: tuple[float, ...], end: tuple[float, ...]) -> None:
    """(6.2) In space, too."""
    a, b = math.dist(middle, ORIGIN), math.dist(middle, end)
    text = "G1 X0 F100\nCIP X{:.6f} Y{:.6f} Z{:.6f} I1={:.6f} J1={:.6f} K1={:.6f}".format(*end, *middle)
    found = run(text)
    if not found or not isinstance(found[-1], canon.Arc) or a < 1 or b < 1 or math.dist(end, ORIGIN) < 1:
        return
    arc = found[-1]
    radius = math.dist(arc.centre, ORIGIN)
    if radius > 1e4:
        return
    assert math.dist(arc.centre, middle) == pytest.approx(radius, rel=1e-4)
    assert point_on_arc(arc, arc.sweep_rad) == pytest.approx(arc.end, abs=1e-5 * radius)
    nearest = min(math.dist(point_on_arc(arc, arc.sweep_rad * k / 2000), middle) for k in range(2001))
    assert nearest < radius * arc.sweep_rad / 2000


_FRAMES = (
    "TRANS X5 Y-3;ATRANS Z2;ROT RPL=30;AROT Z45;AROT X20 Y10;MIRROR X0;AMIRROR Y0 Z0;SCALE X2 Y2 Z2;"
    "ASCALE X.5 Y.5 Z.5;G18;G17;TRANS;G59 X1"
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from(_FRAMES.split(";")), max_size=6))
def test_frames_carry_arcs_as_they_carry_points(frames: list[str]) -> None:
    """(6.2) Under every frame of equal scale an arc's points are the images of its plain points."""
    text = "\n".join([*frames, "G17", "G0 X10 Y0 Z0", "G3 X-10 Y0 Z4 I-10 J0 F100"])
    arc = motions(text)[-1]
    assert isinstance(arc, canon.Arc)
    for share in (0.25, 0.5, 0.8):
        angle = math.pi * share
        x, y, z = 10 * math.cos(angle), 10 * math.sin(angle), 4 * share
        image = motions("\n".join([*frames, "G17", "G0 X77 Y77 Z77", f"G0 X{x:.12f} Y{y:.12f} Z{z:.12f}"]))[-1].end
        assert point_on_arc(arc, arc.sweep_rad * share) == pytest.approx(image, abs=1e-9)
