"""What on this computer could spoil a job, each finding with the command that mends it.

Reads /sys, /proc and /dev below a root that tests can exchange; changes nothing.
"""

from __future__ import annotations

import contextlib
import grp
import os
import select
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

from dnc.device_names import real_path
from dnc.errors import PortLost
from dnc.port import Port
from dnc.priority import LATENCY_WISH, WAKES_WITHIN_US, may_go_first

_DISK_FREE_BYTES = 200_000_000
_FTDI_LATENCY_MS = 1
_TRIGGER_BYTES = 1
_SLOW_WAKING_US = 100
_FIRST_SANE_TIME_S = 1_700_000_000


@dataclass(frozen=True, slots=True)
class Finding:
    """One check: `is_good`, what was found, and the command or deed that mends it."""

    id: str
    is_good: bool
    text: str
    remedy: str = ""


def examine(state: Path, root: Path = Path("/")) -> list[Finding]:
    """All findings that need no port to be opened."""
    devices = _adapters(root)
    findings = [_rights(root, devices), _modem_manager(root), *_autosuspend(root, devices)]
    findings += [*_latency_timers(root, devices), *_trigger_levels(root), _clock(root), _disk(state)]
    findings += [_realtime(), _idle_states(root)]
    return findings


def _adapters(root: Path) -> list[str]:
    return sorted(entry.name for entry in (root / "sys/class/tty").glob("tty[UA][SC][BM]*"))


def _rights(root: Path, devices: list[str]) -> Finding:
    for name in devices:
        device = root / "dev" / name
        if device.exists() and not os.access(device, os.R_OK | os.W_OK):
            return Finding(
                "rights", False, f"/dev/{name} may not be opened", "sudo usermod -aG dialout $USER, then log in again"
            )
    if os.getuid() == 0:
        return Finding("rights", True, "runs as root: works, but no lock keeps root out; better a user in dialout")
    with contextlib.suppress(KeyError):
        if grp.getgrnam("dialout").gr_gid in os.getgroups():
            return Finding("rights", True, "this user is in dialout")
    return Finding("rights", False, "this user is not in dialout", "sudo usermod -aG dialout $USER, then log in again")


def _said_in(file: Path) -> str:
    """What such a file says, whatever its bytes; nothing where it cannot be read, as when its device has just gone."""
    try:
        return file.read_text(encoding="latin-1").strip()
    except OSError:
        return ""


def _modem_manager(root: Path) -> Finding:
    text = "ModemManager runs and may write to a port that has just been plugged in"
    for comm in (root / "proc").glob("[0-9]*/comm"):
        if _said_in(comm) == "ModemManager":
            return Finding("modem-manager", False, text, "sudo systemctl disable --now ModemManager")
    return Finding("modem-manager", True, "no ModemManager")


def _autosuspend(root: Path, devices: list[str]) -> list[Finding]:
    findings = []
    for name in devices:
        for folder in real_path(root / "sys/class/tty" / name / "device").parents:
            control = folder / "power/control"
            if (says := _said_in(control)) and (folder / "idVendor").is_file():
                is_good = says == "on"
                remedy = "" if is_good else f"echo on | sudo tee {control}"
                words = "stays awake" if is_good else "may be put to sleep by USB power saving"
                findings.append(Finding("autosuspend", is_good, f"{name} {words}", remedy))
                break
    return findings


def _latency_timers(root: Path, devices: list[str]) -> list[Finding]:
    findings = []
    for name in devices:
        timer = root / "sys/class/tty" / name / "device/latency_timer"
        with contextlib.suppress(ValueError):
            latency_ms = int(_said_in(timer))
            is_good = latency_ms <= _FTDI_LATENCY_MS
            remedy = "" if is_good else f"echo {_FTDI_LATENCY_MS} | sudo tee {timer}"
            findings.append(
                Finding("latency-timer", is_good, f"{name} hands XOFF over after up to {latency_ms} ms", remedy)
            )
    return findings


def _trigger_levels(root: Path) -> list[Finding]:
    findings = []
    for trigger in sorted((root / "sys/class/tty").glob("ttyS*/rx_trig_bytes")):
        with contextlib.suppress(ValueError):
            level = int(_said_in(trigger))
            is_good = level <= _TRIGGER_BYTES
            remedy = "" if is_good else f"echo {_TRIGGER_BYTES} | sudo tee {trigger}"
            name = trigger.parent.name
            findings.append(Finding("uart-trigger", is_good, f"{name} reports after {level} bytes", remedy))
    return findings


def _clock(root: Path) -> Finding:
    source = _said_in(root / "sys/devices/system/clocksource/clocksource0/current_clocksource")
    if source in ("jiffies", "refined-jiffies"):
        return Finding("clock", False, f"the clock source {source} is too coarse to pace bytes", "use another kernel")
    resolution_s = time.clock_getres(time.CLOCK_MONOTONIC)
    if resolution_s > 1e-5:
        return Finding(
            "clock", False, f"the monotonic clock ticks every {resolution_s * 1e6:.0f} us only", "use another kernel"
        )
    if time.time() < _FIRST_SANE_TIME_S:
        return Finding("clock", False, "the date is wrong: records will carry it", "sudo timedatectl set-ntp true")
    return Finding("clock", True, "the monotonic clock is fine enough, the date is plausible")


def _disk(state: Path) -> Finding:
    folder = state
    while not folder.is_dir() and folder != folder.parent:
        if folder.exists():
            text = f"{folder} is a file where a folder is needed: no journal"
            return Finding("disk", False, text, f"mv {folder} {folder}.old")
        folder = folder.parent
    free = shutil.disk_usage(folder).free
    if not os.access(folder, os.W_OK):
        return Finding("disk", False, f"{folder} cannot be written: no journal", f"sudo chown -R $USER {folder}")
    if free < _DISK_FREE_BYTES:
        return Finding("disk", False, f"{free // 1_000_000} MB left for journal and spool", f"free space on {folder}")
    return Finding("disk", True, f"{free // 1_000_000} MB free for journal and spool")


def _realtime() -> Finding:
    if may_go_first():
        return Finding("realtime", True, "real-time priority is allowed")
    line = "echo '@dialout - rtprio 20' | sudo tee /etc/security/limits.d/dnc.conf, then log in again"
    return Finding("realtime", False, "real-time priority is not allowed: a busy computer may starve the line", line)


def _idle_states(root: Path) -> Finding:
    """A processor in a deep idle state hears a stop late; `dnc send` keeps it out of them where it may."""
    slowest_us = 0
    for latency in (root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpuidle/state[0-9]*/latency"):
        with contextlib.suppress(ValueError):
            slowest_us = max(slowest_us, int(_said_in(latency)))
    text = f"an idle processor wakes within {slowest_us} us" if slowest_us else "no slow idle states are known"
    if slowest_us <= _SLOW_WAKING_US:
        return Finding("idle-states", True, text)
    if os.access(root / "dev" / LATENCY_WISH.name, os.W_OK):
        return Finding("idle-states", True, f"{text}; dnc send makes that {WAKES_WITHIN_US} us while it runs")
    rule = '\'KERNEL=="cpu_dma_latency", GROUP="dialout", MODE="0660"\''
    file = "/etc/udev/rules.d/60-dnc.rules"
    reload = "sudo udevadm control --reload && sudo udevadm trigger --name-match=cpu_dma_latency"
    remedy = f"echo {rule} | sudo tee {file} && {reload}"
    return Finding("idle-states", False, f"{text}, and dnc send may not forbid that: a stop is answered late", remedy)


def probe_loopback(port: Port, timeout_s: float = 2.0) -> Finding:
    """With a plug that joins TX and RX: what is written must come back, whole and unchanged, DC1 and DC3 included."""
    pattern = bytes(range(0x10, 0x7F)) + b"\x11\x13\x11"
    heard, end_s = b"", time.monotonic() + timeout_s
    try:
        port.write(pattern)
        while len(heard) < len(pattern) and (left_s := end_s - time.monotonic()) > 0:
            if select.select([port.fileno()], [], [], left_s)[0]:
                heard += port.read()
    except PortLost as problem:
        return Finding("loopback", False, str(problem), "plug the adapter in again; if it goes on, another cable")
    if heard == pattern:
        return Finding("loopback", True, f"{len(pattern)} bytes came back unchanged")
    if not heard:
        return Finding("loopback", False, "nothing came back", "join pins 2 and 3 of the 9-pin plug; check the adapter")
    if bytes(code & 0x7F for code in heard) == bytes(code & 0x7F for code in pattern):
        return Finding("loopback", False, "bit 7 differs: parity is at work", "set the format as at the control")
    if heard == bytes(code for code in pattern if code not in b"\x11\x13"):
        return Finding("loopback", False, "DC1 and DC3 were swallowed", "switch off the adapter's own XON/XOFF")
    return Finding("loopback", False, f"{len(heard)} of {len(pattern)} bytes came back, changed", "replace the adapter")
