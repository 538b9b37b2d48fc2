"""The byte clock (5.2)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from dnc.forewarning import line_warnings
from dnc.line_pace import pace_of
from dnc.pacing import ByteClock, Pace
from dnc.profile import load_profile
from dnc.shipped import shipped_path


@given(
    steps=st.lists(st.tuples(st.floats(0, 0.02), st.integers(1, 9)), max_size=60),
    inflight=st.integers(1, 9),
    lag_s=st.floats(0, 0.001),
)
def test_never_more_in_flight_than_allowed(steps: list[tuple[float, int]], inflight: int, lag_s: float) -> None:
    """(5.2) Against a line that really starts `lag_s` late: what it has not finished never exceeds the bound."""
    byte_s = 0.001
    clock = ByteClock(Pace(byte_s, inflight, lag_s, slack=0.0))
    now_s, free_s = 0.0, 0.0
    for wait_s, wanted in steps:
        now_s += wait_s
        count = min(wanted, clock.room_bytes(now_s))
        if count:
            clock.note(count, now_s)
            free_s = max(free_s, now_s + lag_s) + count * byte_s
        assert (free_s - now_s - lag_s) / byte_s <= inflight + 1e-6
        assert clock.inflight_bytes(now_s) <= inflight + (lag_s > 0)


def test_the_line_is_kept_busy_by_refills_in_time() -> None:
    """(5.2) Refilled at the asked-for moments, the clock's line never falls silent."""
    clock = ByteClock(Pace(0.001, 3, 0.0, slack=0.0))
    now_s, sent = 0.0, 0
    while now_s < 1.0:
        room = clock.room_bytes(now_s)
        clock.note(room, now_s)
        sent += room
        now_s = clock.room_at_s(clock.refill_bytes) + 1e-9
    assert sent >= 1000


def test_refills_are_small_while_a_run_is_young() -> None:
    """(5.2) Few wake-ups in a long run, no gaps in a short one: at 115200 baud 2 bytes at first, 6 after 10 ms."""
    clock = ByteClock(Pace(10 / 115200, 7, 0.0002, slack=0.028))
    refills, now_s = [], 0.0
    for _ in range(100):
        clock.note(clock.refill_bytes if clock.inflight_bytes(now_s) else 7, now_s)
        refills.append(clock.refill_bytes)
        now_s = clock.room_at_s(clock.refill_bytes)
    assert (refills[0], refills[-1], sorted(refills) == refills) == (2, 6, True)
    clock.note(7, clock.idle_at_s + 0.001)
    assert clock.refill_bytes == 6, "a wake-up that came late is no stop"
    clock.note(7, clock.idle_at_s + 0.003)
    assert clock.refill_bytes == 2


def test_delays_and_given_back_bytes() -> None:
    """(5.3) Character and line delays stretch the clock; bytes that were not accepted free it again."""
    clock = ByteClock(Pace(0.001, 3, 0.0, slack=0.0, char_delay_s=0.009))
    clock.note(3, 0.0)
    assert clock.inflight_bytes(0.0) == 3
    assert abs(clock.idle_at_s - 0.03) < 1e-12
    clock.take_back(2)
    clock.delay(0.5)
    assert abs(clock.idle_at_s - 0.51) < 1e-12


def test_only_the_first_byte_after_a_silence_may_be_late() -> None:
    """(5.2) The lag is waited for once a burst: bytes that follow in time follow at the line's own rate."""
    clock = ByteClock(Pace(0.001, 3, 0.0005, slack=0.0))
    clock.note(3, 0.0)
    assert abs(clock.idle_at_s - 0.0035) < 1e-12
    clock.note(1, 0.003)
    assert abs(clock.idle_at_s - 0.0045) < 1e-12
    clock.note(1, 1.0)
    assert abs(clock.idle_at_s - 1.0015) < 1e-12


def test_a_line_too_fast_for_the_controls_reserve_is_not_used_up_and_that_is_said() -> None:
    """(5.2) 40 bytes free when XOFF comes are 0.35 ms at 1152000 baud: bytes leave so that they last 2 ms."""
    profile = load_profile(shipped_path("machines", "sinumerik-840d"))
    control, fast = replace(profile.control, xoff_free_bytes=40), replace(profile.link, baud=1152000)
    small = replace(profile, control=control, link=fast)

    class Local:
        is_bound_assured = True

    pace = pace_of(small)
    assert pace.byte_s + pace.char_delay_s == pytest.approx(0.002 / 40)
    assert pace_of(profile).char_delay_s == 0.0
    assert pace_of(replace(small, link=replace(fast, handshake="rtscts"))).char_delay_s == 0.0
    (warning,) = line_warnings(small, Local())  # type: ignore[arg-type]
    assert "40 bytes free, too few at 1152000 baud: sending 20000 bytes a second" in warning
