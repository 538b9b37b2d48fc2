import pytest

from sim.errors import InputRejected
from sim.nominal import CutterData
from sim.tool import BallTool, BluntTool, tool_of


@pytest.mark.parametrize("corner_mm", [0.0, 4.0, 5.0, -1.0])
def test_a_bull_nose_needs_a_corner_that_fits(corner_mm: float) -> None:
    """(2.7, 3.1) One sentence with both radii and what to do."""
    with pytest.raises(InputRejected, match=r"radius 4 mm with corner_radius_mm.*below half the diameter"):
        tool_of(CutterData("bull", 4.0, corner_mm))


def test_cutters_by_kind() -> None:
    """(3.1) Ball, bull-nose and flat through the same interface: edge radius and flat radius."""
    made = [tool_of(CutterData(kind, 4.0, corner)) for kind, corner in (("ball", 4.0), ("bull", 1.5), ("flat", 0.0))]
    assert made == [BallTool(4.0), BluntTool(1.5, 2.5), BluntTool(0.0, 4.0)]
    assert [(each.corner_mm, each.flat_mm) for each in made] == [(4.0, 0.0), (1.5, 2.5), (0.0, 4.0)]
