"""The control as a process of its own, so that its thinking cannot hold up the line: `LiveMill` on a clock, and Modbus.

It obeys its parent over a socket pair, ends when that closes, and hands over its part of the report at the end.
"""

from __future__ import annotations

import dataclasses
import gc
import json
import multiprocessing
import select
import signal
import socket
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.errors import SettingsRejected, UserError
from sim.clock import MachineClock
from sim.endpoint_modbus import ModbusEnd
from sim.interpreter.canon import Motion, Vector
from sim.lifeline import end_with_parent
from sim.live import LiveMill
from sim.messages import Failed, Finish, Heard, Ready, Result, Start, Wire
from sim.mill import rehearse
from sim.motion.values import Samples
from sim.motion_log import MotionLog, Peaks
from sim.setup import Setup

TICK_WALL_S = 0.002
PANEL_WALL_S = 0.1


def run_control(end: socket.socket, setup: Setup) -> None:
    """The whole life of the process; signals are the parent's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None and parent.pid is not None:
        end_with_parent(parent.pid)
    wire = Wire(end)
    try:
        _work(wire, setup)
    except UserError as problem:
        wire.send(Failed(str(problem), int(problem.exit_code)))
    except Exception as problem:  # noqa: BLE001 (the rim of a process: a fault of ours becomes one sentence)
        wire.send(Failed(f"internal fault in the mill's control: {type(problem).__name__}: {problem}", 1))
    while wire.has_unsent and not wire.is_closed:
        select.select([], [wire], [], 5.0)
        wire.flush()


def _work(wire: Wire, setup: Setup) -> None:
    measuring = _measuring(setup)
    rehearse(b"G1 X1 F100\nX2\nM30\n", setup.profile)
    log = None if setup.motion is None else MotionLog(setup.motion, measuring.tip_below_mm)
    peaks = Peaks()

    def keep(samples: Samples) -> None:
        peaks.add(samples)
        if log is not None:
            log.add(samples)

    mill = LiveMill(setup.profile, setup.faults, keep, setup.tool_radii_mm, setup.subprogram_folder)
    modbus = _serve_modbus(setup)
    modbus.show(mill.panel())
    try:
        wire.send(Ready(f"{modbus.host}:{modbus.port}"))
        gc.collect()
        gc.freeze()
        _live(wire, mill, modbus, setup.speed)
    finally:
        modbus.stop()
        if log is not None:
            log.close()
    if not wire.is_closed:
        dwells_mm = [one.position_mm for one in mill.machine.starved]
        report = _report(mill, peaks) | measuring.measure(mill.machine.travelled, dwells_mm)
        wire.send(Result(json.dumps(report, default=float)))


def _serve_modbus(setup: Setup) -> ModbusEnd:
    """Serve status where it is wanted; the profile's own address gives way where it is taken, or the real machine's."""
    modbus = ModbusEnd(setup.modbus_host, setup.modbus_port)
    try:
        modbus.start()
    except SettingsRejected:
        if setup.is_port_fixed:
            raise
        modbus = ModbusEnd("127.0.0.1", 0)
        modbus.start()
    return modbus


def _live(wire: Wire, mill: LiveMill, modbus: ModbusEnd, speed: float) -> None:
    """Until the parent says that it is over; the panel is shown every 100 ms."""
    clock: MachineClock | None = None
    show_s, is_over = 0.0, False
    while not is_over:
        select.select([wire], [wire] if wire.has_unsent else [], [], TICK_WALL_S)
        for message in wire.receive():
            match message:
                case Start(begun_wall_s):
                    clock = MachineClock(speed, begun_wall_s)
                case Heard():
                    mill.hear(message)
                case Finish():
                    is_over = True
                case _:
                    pass
        wire.flush()
        for order in mill.advance(clock.now_s()) if clock is not None else ():
            wire.send(order)
        if time.monotonic() >= show_s:
            modbus.show(mill.panel())
            show_s = max(show_s + PANEL_WALL_S, time.monotonic())
        is_over |= wire.is_closed


def _report(mill: LiveMill, peaks: Peaks) -> dict[str, Any]:
    """The control's half of the report."""
    starved = mill.machine.starved
    ended_s = mill.machine.time_s if mill.completed_s is None else mill.completed_s
    return {
        "is_completed": mill.completed_s is not None,
        "execution": mill.control.execution.name,
        "blocks": mill.blocks,
        "alarms": [
            {"number": alarm.number, "text": alarm.text, "line": alarm.line, "block": alarm.block, "time_s": at_s}
            for at_s, alarm in mill.alarms
        ],
        "machining_time_s": 0.0 if mill.begun_s is None else ended_s - mill.begun_s,
        "peak_acceleration_mm_s2": peaks.acceleration_mm_s2,
        "peak_jerk_mm_s3": peaks.jerk_mm_s3,
        "starved_s": sum(one.duration_s for one in starved),
        "starved": [dataclasses.asdict(one) for one in starved],
        "happenings": [
            {"time_s": at_s, "happening": happening.value, "execution": execution.name}
            for at_s, happening, execution in mill.control.history
        ],
    }


@dataclass(frozen=True, slots=True)
class _Measuring:
    """What the design is good for: how far the tip lies below the programmed point, and the keys of the verdict."""

    tip_below_mm: float
    measure: Callable[[Sequence[Motion], Sequence[Vector]], dict[str, Any]]


def _measuring(setup: Setup) -> _Measuring:
    """Reads the design now and measures the cut part at the end; draws the deviation map where one is wanted.

    The probes are loaded only where a design is named: a mill that measures nothing is ready sooner. What draws is
    loaded before the run, so that a missing library is known before an hour of cutting and not after it.
    """
    if setup.nominal is None:
        return _Measuring(0.0, lambda _travelled, _dwells_mm: {})
    if setup.plot is not None:
        from sim.plot import require_drawing

        require_drawing()
    from sim.deviation import judge
    from sim.nominal import load_nominal
    from sim.tool import tool_of

    nominal = load_nominal(setup.nominal)
    tip_below_mm = nominal.cutter.corner_mm if nominal.reference == "centre" else 0.0

    def measured(travelled: Sequence[Motion], dwells_mm: Sequence[Vector]) -> dict[str, Any]:
        tool, pitch_mm = tool_of(nominal.cutter), setup.probe_pitch_mm
        verdict = judge(nominal, tool, travelled, reference=nominal.reference, probe_pitch_mm=pitch_mm)
        if setup.plot is not None:
            from sim.plot import plot_deviation

            # Above the highest point of the part the tool stands in air and marks nothing.
            top_mm = tip_below_mm + max(float(np.nanmax(mapped.net.points[..., 2])) for mapped in verdict.maps)
            plot_deviation(verdict, setup.plot, [dwell for dwell in dwells_mm if dwell[2] <= top_mm])
        return verdict.report()

    return _Measuring(tip_below_mm, measured)
