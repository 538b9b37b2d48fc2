"""The settings that a shop writes down once: the user's file, then the system's, each key by itself.

The keys are the options that a `DNC_...` variable can give too; option and variable go before both files.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from dnc.errors import SettingsRejected
from dnc.numbers import LONGEST_S
from dnc.places import config_folder, system_config_folder
from planner import tomlfile


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One file; what it does not say is None."""

    machine: str | None = None
    baud: Annotated[int, Meta(ge=50, le=4_000_000)] | None = None
    format: Annotated[str, Meta(pattern=r"^[5-8][NEOMS](1|1\.5|2)$")] | None = None
    modbus: str | None = None
    port: str | None = None
    handshake: Literal["xonxoff", "driver", "rtscts", "dtrdsr", "none"] | None = None
    start: Literal["immediate", "wait-xon"] | None = None
    start_timeout: Annotated[float, Meta(ge=0, le=LONGEST_S)] | None = None
    hold_timeout: Annotated[float, Meta(ge=0, le=LONGEST_S)] | None = None


def load_settings() -> dict[str, Any]:
    """What the two files say together; raises SettingsRejected with file and line."""
    said: dict[str, Any] = {}
    for folder in (system_config_folder(), config_folder()):
        path = folder / "settings.toml"
        if path.exists() and path.stat().st_size > 0:
            found, _ = tomlfile.load(path, Settings, error=SettingsRejected)
            said |= {key: value for key, value in msgspec.structs.asdict(found).items() if value is not None}
    return said
