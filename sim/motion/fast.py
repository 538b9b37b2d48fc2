"""The time law, compiled where numba is installed; the same text interpreted where it is not."""

from __future__ import annotations

import functools
import importlib.util
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

from sim.motion import law, standing

_INNER_FIRST = {
    "sim.motion.braking": ("ramp_time_s", "brake_mm", "ease_mm", "jerk_to_speed"),
    "sim.motion.rows": ("piece_at", "step_to"),
    "sim.motion.landing": ("landing", "landing_jerk", "next_landing_jerk", "lands", "plan_landing"),
    "sim.motion.standing": ("stop_jerk", "can_stop", "way_jerk", "keep_way", "leave_landing"),
    "sim.motion.law": (
        "is_safe",
        "foreseen_jerk",
        "choose_jerk",
        "coasting_steps",
        "coast",
        "settle",
        "make_step",
        "next_jerk",
        "run",
    ),
}


def can_compile() -> bool:
    """Whether numba is installed."""
    return importlib.util.find_spec("numba") is not None


class TimeLaw(NamedTuple):
    """`sim.motion.law.run` and `sim.motion.standing.keep_way`, compiled or as they stand."""

    run: Callable[..., int]
    keep_way: Callable[..., float]


@functools.cache
def time_law(is_compiled: bool) -> TimeLaw:
    """The law; compiling takes seconds once and is kept on disk."""
    return _compiled_law() if is_compiled else TimeLaw(law.run, standing.keep_way)


def _compiled_law() -> TimeLaw:
    """Second copies of the law's modules, in which each function is compiled and calls compiled fellows."""
    import numba

    compiled: dict[str, Callable[..., Any]] = {}
    for room, names in _INNER_FIRST.items():
        twin = _copy_of(room)
        for name in compiled.keys() & vars(twin).keys():
            setattr(twin, name, compiled[name])
        for name in names:
            compiled[name] = numba.njit(cache=True, error_model="numpy")(getattr(twin, name))
            setattr(twin, name, compiled[name])
    return TimeLaw(compiled["run"], compiled["keep_way"])


def _copy_of(room: str) -> ModuleType:
    spec = importlib.util.find_spec(room)
    assert spec is not None
    assert spec.loader is not None
    twin = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(twin)
    return twin
