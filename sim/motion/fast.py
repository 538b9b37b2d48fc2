"""The time law, compiled where numba is installed; the same text interpreted where it is not."""

from __future__ import annotations

import functools
import importlib.util
from collections.abc import Callable
from types import ModuleType

from sim.motion import law

_INNER_FIRST = (
    "ramp_time_s",
    "brake_mm",
    "ease_mm",
    "jerk_to_speed",
    "piece_at",
    "is_safe",
    "landing",
    "landing_jerk",
    "step_to",
    "lands",
    "plan_landing",
    "stop_jerk",
    "can_stop",
    "choose_jerk",
)


def can_compile() -> bool:
    """Whether numba is installed."""
    return importlib.util.find_spec("numba") is not None


@functools.cache
def time_law(is_compiled: bool) -> Callable[..., int]:
    """`sim.motion.law.run`, compiled or as it stands; compiling takes seconds once and is kept on disk."""
    if not is_compiled:
        return law.run
    compiled: Callable[..., int] = _compiled_twin().run
    return compiled


def _compiled_twin() -> ModuleType:
    """A second copy of the law's module in which each function is compiled and calls its compiled fellows."""
    import numba

    spec = importlib.util.find_spec("sim.motion.law")
    assert spec is not None
    assert spec.loader is not None
    twin = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(twin)
    for name in (*_INNER_FIRST, "run"):
        setattr(twin, name, numba.njit(cache=True, error_model="numpy")(getattr(twin, name)))
    return twin
