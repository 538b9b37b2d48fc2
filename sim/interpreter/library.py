"""Subprograms in a folder, by the names a control knows them under."""

from __future__ import annotations

from pathlib import Path

_ENDINGS = ("_SPF", "_MPF")


def plain_name(name: str) -> str:
    """A program's name without folder, `_N_`, extension or type.

    >>> plain_name("/_N_SPF_DIR/_N_POCKET_SPF"), plain_name("pocket.spf"), plain_name("L100")
    ('POCKET', 'POCKET', 'L100')
    """
    last = name.replace("\\", "/").rsplit("/", 1)[-1].upper().removeprefix("_N_")
    last = last.rsplit(".", 1)[0] if last.endswith((".SPF", ".MPF")) else last
    for ending in _ENDINGS:
        last = last.removesuffix(ending)
    return last


class Library:
    """The programs of one folder; the folder is read when the first one is wanted."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._paths: dict[str, Path] | None = None

    @property
    def names(self) -> list[str]:
        """The names that can be called."""
        return sorted(self._found())

    def program(self, name: str) -> bytes | None:
        """The text of the program of this name, or None."""
        path = self._found().get(plain_name(name))
        return None if path is None else path.read_bytes()

    def _found(self) -> dict[str, Path]:
        if self._paths is None:
            files = [] if self._folder is None else sorted(path for path in self._folder.iterdir() if path.is_file())
            self._paths = {plain_name(path.name): path for path in files}
        return self._paths
