"""The way the probes' functions become machine code where numba is installed, and what may be kept of it on disk."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

SOURCES = ("blunt.py", "piece_fast.py", "probe_fast.py")

F = TypeVar("F", bound=Callable[..., Any])


def source_stamp(folder: Path) -> bytes:
    """A digest of the files that hold compiled functions: what was kept of others is made anew."""
    return hashlib.sha256(b"".join((folder / name).read_bytes() for name in SOURCES)).digest()


_STAMP = source_stamp(Path(__file__).parent)


def compiled(function: F) -> F:
    """The function through numba, kept on disk between runs, free of the interpreter's lock; itself without numba."""
    try:
        from numba import njit
    except ImportError:
        return function
    made: Any = njit(cache=True, nogil=True, error_model="numpy")(function)
    # numba compares the file of the function alone, but the code it keeps holds all that the function calls
    made._cache._cache_file._source_stamp = _STAMP
    return cast("F", made)
