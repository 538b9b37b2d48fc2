"""What the doctor and the lists find, on made-up computers (5.5, 5.7, 5.9; faults A11, A12)."""

from __future__ import annotations

import fcntl
import json
import os
import pty
import select
import socket
import subprocess
import sys
import threading
import time
import tty
from pathlib import Path

import pytest
from click.testing import CliRunner

from dnc.cli.main import program
from dnc.doctor import Finding, examine, probe_loopback
from dnc.errors import PortLost
from dnc.events import JobState, LinkState
from dnc.joblist import first_broken_link, past_jobs
from dnc.journal import Journal, Record
from dnc.port import SerialPort
from dnc.portlist import find_ports
from dnc.profile import Link
from dnc.record import append_record
from dnc.shipped import shipped_path
from tests.helpers.line import read_until


def computer(root: Path, *, awake: str = "auto", latency_ms: int = 16, modem_manager: bool = True) -> Path:
    """A computer with one FTDI adapter as it looks below /sys, /dev and /proc."""
    usb = root / "sys/devices/usb1/1-2"
    tty_folder = usb / "1-2:1.0/ttyUSB0"
    (tty_folder / "tty").mkdir(parents=True)
    (usb / "power").mkdir()
    (usb / "power/control").write_text(awake + "\n")
    (usb / "idVendor").write_text("0403\n")
    (usb / "idProduct").write_text("6001\n")
    (tty_folder / "latency_timer").write_text(f"{latency_ms}\n")
    (root / "sys/bus/ftdi_sio").mkdir(parents=True)
    (tty_folder / "driver").symlink_to(root / "sys/bus/ftdi_sio")
    entry = root / "sys/class/tty/ttyUSB0"
    entry.mkdir(parents=True)
    (entry / "device").symlink_to(tty_folder)
    uart = root / "sys/class/tty/ttyS0"
    uart.mkdir()
    (uart / "rx_trig_bytes").write_text("8\n")
    (root / "dev/serial/by-id").mkdir(parents=True)
    (root / "dev/ttyUSB0").touch()
    (root / "dev/serial/by-id/usb-FTDI_A1B2-if00-port0").symlink_to(root / "dev/ttyUSB0")
    (root / "proc/77").mkdir(parents=True)
    (root / "proc/77/comm").write_text("ModemManager\n" if modem_manager else "bash\n")
    return root


def found(findings: list[Finding], name: str) -> Finding:
    return next(finding for finding in findings if finding.id == name)


def test_each_finding_has_its_remedy(tmp_path: Path) -> None:
    """(5.9; fault A12)"""
    findings = examine(tmp_path, computer(tmp_path / "root"))
    assert found(findings, "modem-manager").remedy.startswith("sudo systemctl disable")
    assert "power/control" in found(findings, "autosuspend").remedy
    assert "latency_timer" in found(findings, "latency-timer").remedy
    assert "rx_trig_bytes" in found(findings, "uart-trigger").remedy
    assert all(finding.remedy for finding in findings if not finding.is_good)


def test_odd_words_of_the_system_are_no_fault(tmp_path: Path) -> None:
    """(5.9) A process name is cut at 15 bytes, inside a letter of two; a device goes while it is looked at."""
    root = computer(tmp_path / "root", modem_manager=False)
    (root / "proc/78").mkdir()
    (root / "proc/78/comm").write_bytes("Maschinenfräse-Überwacher".encode()[:11] + b"\xff\n")
    (root / "proc/79/comm").mkdir(parents=True)
    (root / "sys/devices/usb1/1-2/power/control").unlink()
    (root / "sys/devices/usb1/1-2/power/control").mkdir()
    (root / "sys/devices/usb1/1-2/1-2:1.0/ttyUSB0/latency_timer").write_bytes(b"\xff\xfe")
    clock = root / "sys/devices/system/clocksource/clocksource0/current_clocksource"
    clock.parent.mkdir(parents=True)
    clock.write_bytes(b"\xe4\n")
    loop = root / "sys/class/tty/ttyACM0"
    loop.mkdir()
    (loop / "device").symlink_to(loop / "device")
    (root / "dev/ttyACM0").touch()
    (root / "dev/serial/by-id/a-circle").symlink_to(root / "dev/serial/by-id/a-circle")
    (root / "sys/class/tty/ttyUSB0/type").write_bytes(b"\xff")
    (root / "sys/devices/usb1/1-2/idVendor").write_bytes(b"\xe4\n")
    assert [(port.vendor_product, Path(str(port.by_id)).name) for port in find_ports(root)] == [
        ("\xe4:6001", "usb-FTDI_A1B2-if00-port0")
    ]
    findings = examine(tmp_path, root)
    assert found(findings, "modem-manager").is_good
    assert not [one for one in findings if one.id in ("autosuspend", "latency-timer")]


def test_a_file_in_place_of_the_state_folder_is_found(tmp_path: Path) -> None:
    """(5.9) The doctor was content, and `dnc send` ended with exit code 8."""
    (tmp_path / "dnc").write_text("")
    finding = found(examine(tmp_path / "dnc", computer(tmp_path / "root")), "disk")
    assert not finding.is_good
    assert finding.remedy == f"mv {tmp_path}/dnc {tmp_path}/dnc.old"


def test_a_plug_that_is_pulled_during_the_loopback_is_a_finding() -> None:
    """(5.9) The findings so far were lost with it."""

    class Gone(SerialPort):
        def __init__(self) -> None:
            pass

        def write(self, data: bytes) -> int:
            raise PortLost("/dev/ttyUSB0 was lost: Input/output error")

    finding = probe_loopback(Gone())
    assert (finding.is_good, finding.text) == (False, "/dev/ttyUSB0 was lost: Input/output error")
    assert finding.remedy


def test_a_mended_computer_is_well(tmp_path: Path) -> None:
    findings = examine(tmp_path, computer(tmp_path / "root", awake="on", latency_ms=1, modem_manager=False))
    for name in ("modem-manager", "autosuspend", "latency-timer", "clock", "disk"):
        assert found(findings, name).is_good


@pytest.mark.parametrize(
    ("slowest_us", "may_forbid", "good"), [(2, False, True), (890, True, True), (890, False, False)]
)
def test_idle_states_that_wake_slowly(tmp_path: Path, slowest_us: int, may_forbid: bool, good: bool) -> None:
    """(5.2, 5.9; fault H4) A stop that comes while the processor sleeps deeply is answered that much late."""
    root = computer(tmp_path / "root")
    for number, latency_us in enumerate((0, slowest_us)):
        state = root / f"sys/devices/system/cpu/cpu0/cpuidle/state{number}"
        state.mkdir(parents=True)
        (state / "latency").write_text(f"{latency_us}\n")
    if may_forbid:
        (root / "dev/cpu_dma_latency").touch()
    finding = found(examine(tmp_path, root), "idle-states")
    assert finding.is_good == good
    assert f"{slowest_us} us" in finding.text
    assert ("udev" in finding.remedy) == (not good)


def test_ports_with_their_lasting_names(tmp_path: Path) -> None:
    """(5.5)"""
    (port,) = find_ports(computer(tmp_path))
    assert port.driver == "ftdi_sio"
    assert port.vendor_product == "0403:6001"
    assert port.by_id is not None
    assert port.by_id.endswith("usb-FTDI_A1B2-if00-port0")
    assert port.link is LinkState.CLOSED


def test_ports_of_a_new_kernel_and_their_empty_slots(tmp_path: Path) -> None:
    """(5.5) Since Linux 6.5 a bus of ports stands between chip and port: 32 empty slots looked like ports."""
    root = computer(tmp_path)
    for number, kind in enumerate(("4", "0")):
        slot = root / f"sys/devices/pnp0/00:0{number}/00:0{number}:0/00:0{number}:0.0"
        slot.mkdir(parents=True)
        (slot / "driver").symlink_to("/sys/bus/serial-base/drivers/port")
        (slot.parent / "driver").symlink_to("/sys/bus/serial-base/drivers/ctrl")
        (slot.parents[1] / "driver").symlink_to("/sys/bus/pnp/drivers/serial")
        entry = root / f"sys/class/tty/ttyS{number}"
        entry.mkdir(exist_ok=True)
        (entry / "device").symlink_to(slot)
        (entry / "type").write_text(f"{kind}\n")
        (root / f"dev/ttyS{number}").touch()
    assert [(Path(port.device).name, port.driver) for port in find_ports(root)] == [
        ("ttyS0", "serial"),
        ("ttyUSB0", "ftdi_sio"),
    ]


def test_a_number_that_went_to_another_program_is_no_running_job(tmp_path: Path) -> None:
    """(5.7) After a power cut --resume was refused for ever: the job was said to be RUNNING."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, cwd="/") as other:
        folder = tmp_path / f"jobs/20260101T000000.000000-{other.pid}"
        folder.mkdir(parents=True)
        journal = Journal(folder / "journal", "ab" * 32, 100, lambda: None)
        journal.open()
        journal.note(42, JobState.SENDING)
        journal.close(42, JobState.SENDING)
        (past,) = past_jobs(tmp_path)
        other.kill()
    assert past.outcome == "INTERRUPTED"


@pytest.mark.parametrize(("age_s", "outcome"), [(0.0, "RUNNING"), (3600.0, "INTERRUPTED"), (-3600.0, "INTERRUPTED")])
def test_a_dnc_that_began_after_the_job_is_not_its_process(tmp_path: Path, age_s: float, outcome: str) -> None:
    """(5.7) In a container each dnc is process 1: a killed job was RUNNING for ever, and --resume refused it."""
    words = [sys.executable, "-c", "print(flush=True); input()", "dnc"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd="/") as process:
        assert process.stdout is not None
        process.stdout.readline()  # from here on it bears its own words
        folder = tmp_path / f"jobs/20260101T000000.000000-{process.pid}"
        folder.mkdir(parents=True)
        record = Record(0, JobState.SENDING, bytes(16), 42, 142, time.monotonic() - age_s, time.time())
        (folder / "journal").write_bytes(record.packed())
        (past,) = past_jobs(tmp_path)
        process.kill()
    assert past.outcome == outcome


def test_a_port_in_use_is_locked(tmp_path: Path) -> None:
    """(5.5)"""
    root = computer(tmp_path)
    with (root / "dev/ttyUSB0").open() as device:
        fcntl.flock(device, fcntl.LOCK_EX)
        (port,) = find_ports(root)
    assert port.link is LinkState.LOCKED
    assert port.in_use_by is not None
    assert str(os.getpid()) in port.in_use_by


@pytest.mark.parametrize(
    ("change", "good", "words"),
    [
        (lambda data: data, True, "unchanged"),
        (lambda data: b"", False, "nothing came back"),
        (lambda data: bytes(code for code in data if code not in b"\x11\x13"), False, "swallowed"),
        (lambda data: bytes(code | (code.bit_count() & 1) << 7 for code in data), False, "parity"),
        (lambda data: data[:-5], False, "changed"),
    ],
)
def test_loopback_plug(change: object, good: bool, words: str) -> None:
    """(5.9) Faults of plug, adapter and format are told apart."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    port = SerialPort(os.ttyname(slave), Link())

    def echo() -> None:
        data = read_until(master, b"\x11\x13\x11")
        os.write(master, change(data))  # type: ignore[operator]

    thread = threading.Thread(target=echo)
    thread.start()
    finding = probe_loopback(port, timeout_s=0.5)
    thread.join(5)
    assert (finding.is_good, words in finding.text) == (good, True), finding
    port.close()
    os.close(slave)
    os.close(master)


@pytest.mark.parametrize("handshake", ["driver", "dtrdsr"])
def test_the_plug_is_judged_without_the_profiles_handshake(tmp_path: Path, handshake: str) -> None:
    """(5.9) The driver obeyed the DC3 that came back: "3 of 114 bytes, changed; replace the adapter"."""
    machine = tmp_path / "m.toml"
    shipped = shipped_path("machines", "sinumerik-840d").read_text()
    machine.write_text(shipped.replace('handshake = "xonxoff"', f'handshake = "{handshake}"'))
    master, slave = pty.openpty()
    tty.setraw(slave)
    is_over = threading.Event()

    def echo() -> None:
        while not is_over.is_set():
            if select.select([master], [], [], 0.05)[0]:
                os.write(master, os.read(master, 1))

    thread = threading.Thread(target=echo)
    thread.start()
    words = ["doctor", "--port", os.ttyname(slave), "--loopback", "--machine", str(machine)]
    ran = CliRunner().invoke(program, words, standalone_mode=False)
    is_over.set()
    thread.join(5)
    os.close(slave)
    os.close(master)
    assert "114 bytes came back unchanged" in ran.output, ran.output


def examined(*words: str) -> dict[str, object]:
    """What the doctor says of a port."""
    ran = CliRunner().invoke(program, ["doctor", "--json", *words], standalone_mode=False)
    (finding,) = [one for one in json.loads(ran.stdout)["findings"] if one["id"] == "port"]
    assert (ran.return_value == 0) == finding["is_good"]
    return dict(finding)


@pytest.mark.parametrize(
    ("name", "what", "remedy"),
    [
        ("/dev/ttyUSB77", "No such file", "see dnc ports"),
        (__file__, "is not a serial port", "see dnc ports"),
        ("socket://127.0.0.1:1", "cannot be opened", "check address, port number and network"),
    ],
)
def test_a_port_that_cannot_be_had_is_told_once_with_its_own_remedy(name: str, what: str, remedy: str) -> None:
    """(5.9) "See dnc ports" stood twice, and behind what it is no help for; a device server was looked for in /dev."""
    finding = examined("--port", name)
    assert what in str(finding["text"])
    assert remedy not in str(finding["text"])
    assert finding["remedy"] == remedy


def test_a_device_server_can_be_examined() -> None:
    """(5.9)"""
    with socket.create_server(("127.0.0.1", 0)) as server:
        assert examined("--port", f"socket://127.0.0.1:{server.getsockname()[1]}")["is_good"]


def test_a_pseudo_terminal_is_labelled() -> None:
    """(Interface, section 1; O7) A port of the virtual mill looked like one that leads to a control."""
    master, slave = os.openpty()
    try:
        assert str(examined("--port", os.ttyname(slave))["text"]).startswith("SIMULATED: /dev/pts/")
    finally:
        os.close(slave)
        os.close(master)


def record(job: str, outcome: str = "SENT") -> dict[str, object]:
    return {"job": job, "outcome": outcome, "program": "a.mpf", "bytes_sent": 5, "bytes_total": 5}


def test_records_are_chained(tmp_path: Path) -> None:
    """(5.7) A changed or removed line shows."""
    for name in ("1", "2", "3"):
        append_record(tmp_path, record(name))
    assert first_broken_link(tmp_path) is None
    path = tmp_path / "records.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([lines[0], lines[1].replace("SENT", "DONE"), lines[2]]))
    assert first_broken_link(tmp_path) == 3
    path.write_text("".join([lines[0], lines[2]]))
    assert first_broken_link(tmp_path) == 2


def test_interrupted_jobs_are_listed(tmp_path: Path) -> None:
    """(5.7; fault H1) A journal without a record: interrupted, with what it knows; a torn one too."""
    append_record(tmp_path, record("20260101T000000-1"))
    cut = Journal(tmp_path / "jobs/20260102T000000-99999999/journal", "ab" * 32, 100, lambda: None)
    cut.open()
    cut.note(42, JobState.SENDING)
    cut.close(42, JobState.SENDING)
    (tmp_path / "jobs/20260102T000000-99999999/job.json").write_text(json.dumps({"program": "b.mpf"}))
    (tmp_path / "jobs/20260103T000000-99999999").mkdir()
    (tmp_path / "jobs/20260103T000000-99999999/journal").write_bytes(b"torn")
    jobs = past_jobs(tmp_path)
    assert [past.outcome for past in jobs] == ["SENT", "INTERRUPTED", "INTERRUPTED"]
    assert (jobs[1].values["bytes_sent"], jobs[1].values["program"]) == (42, "b.mpf")


@pytest.mark.parametrize("name", ["jobs", "ports", "machines", "doctor"])
def test_commands_report_json(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    result = CliRunner().invoke(program, [name, "--json"])
    assert result.exit_code == 0
    assert json.loads(result.stdout)["schema"] == f"dripmill.{name}"


def test_jobs_command_shows_and_verifies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    append_record(tmp_path / "dnc", record("20260101T000000-1"))
    append_record(tmp_path / "dnc", {**record("20270101T000000-1"), "port": "/dev/ttyUSB7"})
    listed = CliRunner().invoke(program, ["jobs", "--verify"]).stdout.splitlines()
    assert [line.split()[-2:] for line in listed] == [["?", "a.mpf"], ["/dev/ttyUSB7", "a.mpf"]]
    one = ["jobs", "20260101"]
    assert json.loads(CliRunner().invoke(program, [*one, "--json"]).stdout)["jobs"][0]["outcome"] == "SENT"
    page = dict(line.split(maxsplit=1) for line in CliRunner().invoke(program, one).stdout.splitlines())
    assert (page["outcome"], page["program"]) == ("SENT", "a.mpf")
