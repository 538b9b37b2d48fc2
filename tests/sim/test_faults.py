"""The switchboard: how it is written and what it refuses."""

import pytest

from planner.errors import SettingsRejected
from sim.faults import Faults, Moment, Ordinals, ReplyParity, StartRule, parse_faults


def test_every_switch_can_be_set() -> None:
    """(5.8)"""
    words = [
        "fifo=4096", "reaction=0.002", "start=repeat-xon", "cycle-start=2", "xon-delay=0.5", "xoff-delay=0.1",
        "lose-xon=2", "lose-xoff=1,3", "double-xon=all", "double-xoff=1", "noise=4", "drop=0.001", "flip=0.5",
        "parity=even", "silence=12.5", "unplug=400b", "slow-drain=3", "end-stops-reading=yes", "stop-answer=0",
        "optional-stop=no", "single-block=1+2", "override=50", "feed-hold=4000b+2", "reset=3", "alarm=4",
        "power-cycle=5+1",
    ]  # fmt: skip
    faults = parse_faults(words)
    assert len(words) == len(Faults.__dataclass_fields__)
    assert faults.start is StartRule.REPEATED_XON
    assert faults.parity is ReplyParity.EVEN
    assert faults.lose_xoff == Ordinals(frozenset({1, 3}))
    assert faults.double_xon.names(77)
    assert faults.feed_hold == Moment(at_s=None, at_bytes=4000, for_s=2.0)
    assert faults.end_stops_reading is True
    assert faults.optional_stop is False


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("nois=3", "did you mean noise?"),
        ("teapot=1", "known: fifo"),
        ("fifo", "write fifo=a count from 1"),
        ("fifo=0", "write fifo=a count from 1"),
        ("noise=-1", "a number from 0"),
        ("noise=nan", "a number from 0"),
        ("reset=later", "12.5 (seconds) or 4000b (bytes)"),
        ("start=maybe", "immediate, xon or repeat-xon"),
        ("end-stops-reading=perhaps", "yes or no"),
        ("lose-xon=0", "2, or 1,3, or all"),
    ],
)
def test_a_wrong_word_is_one_sentence_with_the_form_wanted(word: str, sentence: str) -> None:
    """(2.7, 5.8)"""
    with pytest.raises(SettingsRejected, match="--fault") as refused:
        parse_faults([word])
    assert sentence in str(refused.value)
