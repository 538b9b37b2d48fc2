"""Where the state of the sending side lives: journal, records, spool, sockets; and how a file gets there whole."""

from __future__ import annotations

import os
from pathlib import Path

from planner.errors import SettingsRejected


def _folder(variable: str, below_home: str) -> Path:
    """What the variable names, else a folder of the user's; raises SettingsRejected where neither is known."""
    named = os.environ.get(variable)
    if named:
        return Path(named) / "dnc"
    try:
        return Path.home() / below_home / "dnc"
    except RuntimeError:
        raise SettingsRejected("this user has no home folder", remedy=f"set HOME, or {variable}") from None


def state_folder() -> Path:
    """`$XDG_STATE_HOME/dnc`, by default ~/.local/state/dnc."""
    return _folder("XDG_STATE_HOME", ".local/state")


def made_state_folder() -> Path:
    """The same, made where it is missing; raises SettingsRejected where it cannot be made."""
    folder = state_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        what = f"{folder}: the folder for journal and records cannot be made: {problem.strerror}"
        raise SettingsRejected(what, remedy="set XDG_STATE_HOME to a folder of yours") from None
    return folder


def runtime_folder() -> Path:
    """`$XDG_RUNTIME_DIR/dnc` where there is one, else the state folder's `run`."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    return Path(runtime) / "dnc" if runtime else state_folder() / "run"


def config_folder() -> Path:
    """`$XDG_CONFIG_HOME/dnc`, by default ~/.config/dnc."""
    return _folder("XDG_CONFIG_HOME", ".config")


def system_config_folder() -> Path:
    """The first of `$XDG_CONFIG_DIRS` with `dnc` in it, by default /etc/xdg/dnc: settings for all users."""
    return Path((os.environ.get("XDG_CONFIG_DIRS") or "/etc/xdg").split(":")[0]) / "dnc"


def user_machines() -> Path:
    """Where the user's own machine profiles lie; a shipped one of the same name goes before them."""
    return config_folder() / "machines"


def write_whole(path: Path, text: str, *, to_disk: bool = False) -> None:
    """A file that is there whole or not at all; with `to_disk` it outlives a power cut from here on."""
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with unfinished.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            if to_disk:
                os.fsync(file.fileno())
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
