"""When the test of a cable may say that the control never stopped us (5.9)."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Literal

import msgspec
import pytest

from dnc.errors import PortLost
from dnc.examiner import Examiner, Verdict, to_and_fro
from dnc.pacing import ByteClock, Pace
from dnc.profile import Control
from dnc.rules import Rules
from dnc.sender import Sender
from dnc.stream import Stream
from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings
from tests.helpers.broken_port import BrokenPort
from tests.helpers.line import NoJournal, tape_of

CONTROL = Control(receive_buffer_bytes=300, xoff_free_bytes=100, xon_fill_bytes=100, lookahead_blocks=5)


@pytest.mark.parametrize(
    ("unseen_bytes", "verdict"), [(4096, Verdict.BROKEN_OFF), (0, Verdict.NEVER_STOPPED)], ids=["adapter", "control"]
)
def test_what_an_adapter_takes_that_obeys_xoff_is_no_proof(tmp_path: Path, unseen_bytes: int, verdict: Verdict) -> None:
    """(5.9; fault A7) A sound cable failed: the adapter had stopped, and its FIFO took more than the control holds."""
    pace = Pace(1e-4, 2, 0.0, slack=0.0, unseen_bytes=unseen_bytes)
    with closing(tape_of(tmp_path, to_and_fro(CONTROL, unseen_bytes))) as tape:
        sender = Sender(tape, ByteClock(pace), Rules(hears_xoff=False, is_driver_asked=True))
        sender.start(0.0)
        now_s = 0.0
        while sender.offset_bytes < CONTROL.receive_buffer_bytes + 1200:
            now_s += 1.0
            sender.take(100, now_s)
        stream = Stream(sender, BrokenPort(PortLost("")), NoJournal(), lambda _: None)  # type: ignore[arg-type]
        examiner = Examiner(stream, CONTROL, 0.0, lambda _: None)
        examiner._end.set()
        assert examiner._examined(sender) is verdict
        stream.close()
        assert tape.size_bytes > CONTROL.receive_buffer_bytes + unseen_bytes


@pytest.mark.parametrize("units", ["mm", "inch"])
def test_the_moves_are_as_small_as_the_operator_was_told(units: Literal["mm", "inch"]) -> None:
    """(5.9) 0.01 of an inch is a quarter of a millimetre."""
    data = to_and_fro(msgspec.structs.replace(CONTROL, units=units))
    settings = Settings(is_inch=units == "inch", start_mm=(0.0, 0.0, 0.0))
    cuts = [one for one in interpret(data, settings) if isinstance(one, canon.Line)]
    assert max(abs(one.end[0]) for one in cuts) == pytest.approx(0.01, abs=0.0002)
    assert {round(one.feed_mm_min) for one in cuts} == {10}
