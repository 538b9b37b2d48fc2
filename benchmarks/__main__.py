"""`make bench`: every benchmark of this folder, one after the other, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

_NOT_BENCHMARKS = {
    "__init__",
    "__main__",
    "dripping",
    "planner_accuracy",
    "thesis_figures",
    "wave_line",
    "wave_surface",
}


def main() -> int:
    """Run them all; the number of those that failed."""
    names = sorted(path.stem for path in Path(__file__).parent.glob("*.py"))
    failed = 0
    for name in names:
        if name in _NOT_BENCHMARKS or name.startswith("_"):
            continue
        print(f"== benchmarks.{name}", flush=True)
        failed += subprocess.run([sys.executable, "-m", f"benchmarks.{name}"], check=False).returncode != 0
    return failed


if __name__ == "__main__":
    sys.exit(main())
