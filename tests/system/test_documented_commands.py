"""The commands and links that README and docs name: each of them exists and loads."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    page for folder in ("", "docs", "dnc", "planner", "sim", "sim/motion") for page in (ROOT / folder).glob("*.md")
)
BENCHMARKS = sorted(path.stem for path in (ROOT / "benchmarks").glob("[!_]*.py"))


def test_every_benchmark_loads() -> None:
    """`python -m benchmarks.closed_forms` of sim/MODEL.md ended with an ImportError: no test runs any of these."""
    script = "; ".join(f"import benchmarks.{name}" for name in BENCHMARKS)
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_benchmark_that_a_page_names_is_there() -> None:
    named = {name for page in PAGES for name in re.findall(r"python -m benchmarks\.(\w+)", page.read_text())}
    assert named
    assert named <= set(BENCHMARKS)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)", page.read_text())
    assert not [link for link in links if not link.startswith("http") and not (page.parent / link).exists()]


def test_every_page_is_linked() -> None:
    """The planner's second page of equations and the model of motion were found by nobody."""
    linked = {
        (page.parent / link).resolve() for page in PAGES for link in re.findall(r"\]\(([^)#]+)", page.read_text())
    }
    assert not [page for page in PAGES if page.resolve() not in linked and page.name != "README.md"]
