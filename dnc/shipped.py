"""The one look-up of files that ship with the product: machine profiles, jobs, surfaces."""

from __future__ import annotations

import importlib.resources
from pathlib import Path

from dnc.errors import SettingsRejected


def shipped_path(folder: str, name: str) -> Path:
    """The shipped file `configs/<folder>/<name>.toml`; raises SettingsRejected and lists what there is."""
    root = Path(str(importlib.resources.files("configs")))
    path = root / folder / f"{name}.toml"
    if path.is_file():
        return path
    known = ", ".join(sorted(found.stem for found in (root / folder).glob("*.toml")))
    raise SettingsRejected(f"there is no {folder[:-1]} named {name!r}", remedy=f"known: {known}")


def shipped_names(folder: str) -> list[str]:
    """The names of all shipped files of one folder, sorted."""
    root = Path(str(importlib.resources.files("configs")))
    return sorted(found.stem for found in (root / folder).glob("*.toml"))
