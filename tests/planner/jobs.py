"""The thesis job as the tests of the planner change it."""

from __future__ import annotations

from pathlib import Path

from dnc.shipped import shipped_path
from planner.post.written import ControlLimits

JOB = shipped_path("jobs", "thesis").read_text()
SURFACE = shipped_path("surfaces", "thesis").read_text()
LIMITS = ControlLimits()


def job_in(folder: Path, *changes: tuple[str, str], surface: tuple[str, str] | None = None) -> Path:
    """The thesis job in a folder of its own, with replacements in job and surface."""
    text = JOB.replace("../surfaces/thesis.toml", "surface.toml")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    shape = SURFACE
    if surface:
        assert surface[0] in shape
        shape = shape.replace(*surface)
    (folder / "surface.toml").write_text(shape)
    (folder / "job.toml").write_text(text)
    return folder / "job.toml"
