"""The axes in time: interpreted commands in, a motion log out.

The machine knows nothing of bytes. Its horizon is the look-ahead or the blocks offered so far, whichever ends first;
where its knowledge ends it must be able to stand, so a slow line shows as slowing and standing. Time is the
machine's own: `advance(until_s)` moves it; the caller maps wall time to it. The same offers at the same machine times
give the same motion, live or not.
"""

from __future__ import annotations

import math

import numpy as np

from sim.interpreter import canon
from sim.interpreter.canon import Command, LineRun, Motion, Vector
from sim.motion.braking import PLANNED, brake_mm
from sim.motion.fast import can_compile, time_law
from sim.motion.limits import axis_limits
from sim.motion.path import Path
from sim.motion.prepare import Preparation
from sim.motion.record import Recorder
from sim.motion.rows import ACC, HORIZON, JERK, PIECE, STATE_SIZE, A, S, V
from sim.motion.travelled import travelled
from sim.motion.values import (
    Array,
    Indices,
    MachineSnapshot,
    MachineState,
    MachineTimes,
    Rounding,
    Samples,
    StandStill,
    StarvedInterval,
    StopReason,
)
from sim.profile import MillProfile

__all__ = [
    "Machine",
    "MachineSnapshot",
    "MachineState",
    "MachineTimes",
    "Rounding",
    "Samples",
    "StandStill",
    "StarvedInterval",
    "StopReason",
]


class Machine:
    """Three axes, a spindle and an interpolator with the limits of a profile.

    `step_s` is the step of the time law and of the log; the profile's `block_cycle_s` when in doubt. Begins in cycle:
    it moves as soon as it is offered a motion. `stops_at_optional`: M1 counts. `is_compiled` chooses the law's twin;
    None takes the compiled one if it can be had.
    """

    def __init__(
        self,
        profile: MillProfile,
        step_s: float,
        *,
        times: MachineTimes | None = None,
        stops_at_optional: bool = False,
        is_compiled: bool | None = None,
        speed_error: float = 1e-5,
    ) -> None:
        self._profile = profile
        self._step_s = step_s
        self._times = times or MachineTimes()
        self._stops_at_optional = stops_at_optional
        self._run = time_law(can_compile() if is_compiled is None else is_compiled)
        self._axes = axis_limits(profile, profile.block_cycle_s)
        self._speed_error = speed_error
        self._override = 1.0
        self._is_single_block = False
        self._tool = 0
        self._spindle_rpm = 0.0
        self._is_flood = self._is_mist = False
        self._message = self._alarm = ""
        self._record = Recorder(step_s)
        self._position: Vector = (0.0, 0.0, 0.0)
        self._travelled: list[Motion] = []
        self._roundings: list[Rounding] = []
        self._blocks_before = 0
        self._begin()

    def _begin(self) -> None:
        """An empty path and nothing queued: the state after power-on and after a reset."""
        self._path = Path(self._axes, self._speed_error, self._times.same_place_mm)
        self._pending: list[Command | LineRun] = []
        self._preparation = Preparation(self._times, stops_at_optional=self._stops_at_optional)
        self._law = np.zeros(STATE_SIZE)
        self._is_at_stop = True
        self._standing_steps = 0
        self._is_closed = self._is_holding = self._is_resetting = False
        self._single_ordinal = -1
        self._state = MachineState.READY

    # --- what is asked of it

    def offer(self, command: Command | LineRun) -> None:
        """Queue an interpreted command, or a run of straight cuts."""
        self._pending.append(command)

    def close(self) -> None:
        """No more blocks will come: standing at the end of what is known is the end, not starvation."""
        self._is_closed = True

    def set_override(self, percent: float) -> None:
        """Feed override, 0 to 120 %; rapids follow it up to 100 %."""
        self._override = min(max(percent, 0.0), 120.0) / 100.0
        self._path.pieces.limit(self._override, 0)

    def set_single_block(self, is_on: bool) -> None:
        """Stand after every motion block until cycle start."""
        self._is_single_block = is_on
        self._mark_single_block()

    def feed_hold(self) -> None:
        """Stop along the path as fast as jerk allows; cycle start goes on."""
        if self._state is MachineState.ACTIVE:
            self._is_holding = True
            self._state = MachineState.FEED_HOLD

    def cycle_start(self) -> None:
        """Go on after a hold, a programmed stop, a single block or the end of a program; not after an alarm."""
        if self._state in (MachineState.ALARM, MachineState.READY) or self._is_resetting:
            return
        self._is_holding = False
        self._state = MachineState.ACTIVE

    def reset(self) -> None:
        """Stop along the path, then forget everything that is queued."""
        self._is_holding = self._is_resetting = True
        self._pending.clear()
        if self._law[V] == 0.0 and self._law[A] == 0.0:
            self._finish_reset()

    def advance(self, until_s: float) -> Samples:
        """Let time go on to `until_s`; what was logged meanwhile.

        With infinity it runs until only somebody else can make it go on: blocks, cycle start, the end.
        """
        self._prepare()
        limit = math.inf if math.isinf(until_s) else math.floor(until_s / self._step_s + 1e-9)
        while self._record.step < limit and self._do_something(limit):
            pass
        if math.isfinite(limit):
            self._record.skip_to(int(limit))
        return self._record.take()

    # --- what it tells

    @property
    def free_blocks(self) -> int:
        """How many more blocks fit between interpreter and interpolator."""
        return max(0, self._profile.lookahead_blocks - self._queued())

    @property
    def time_s(self) -> float:
        """The machine's clock."""
        return self._record.step * self._step_s

    @property
    def starved(self) -> list[StarvedInterval]:
        """Every time the machine stood in cycle for want of blocks, the present one included."""
        return [
            StarvedInterval(stand.t_s, stand.duration_s, stand.position_mm, stand.line, stand.block)
            for stand in self._record.stands()
            if stand.reason is StopReason.STARVED
        ]

    @property
    def stands(self) -> list[StandStill]:
        """Every standstill with its reason, the present one included."""
        return self._record.stands()

    @property
    def roundings(self) -> list[Rounding]:
        """Every rounded corner with the deviation it made, planned ones included."""
        return self._roundings + self._path.track.roundings()

    @property
    def start_mm(self) -> Vector | None:
        """Where the first motion known begins."""
        return self._path.moves[0].start if len(self._path.moves) else None

    @property
    def travelled(self) -> list[Motion]:
        """The motions as really made so far, roundings included."""
        return self._travelled + self._path_so_far()

    def snapshot(self) -> MachineSnapshot:
        """The machine at this moment."""
        motion = self._motion()
        to_go = np.zeros(3) if motion is None else np.subtract(motion.end, self._position)
        line, block = self._record.line, self._record.block
        return MachineSnapshot(
            time_s=self.time_s,
            position_mm=self._position,
            distance_to_go_mm=(float(to_go[0]), float(to_go[1]), float(to_go[2])),
            feed_mm_min=float(self._law[V]) * 60.0,
            line=line,
            block=block,
            state=self._state,
            is_starved=self._record.reason is StopReason.STARVED,
            is_moving=bool(self._law[V] > 0.0),
            tool=self._tool,
            spindle_rpm=self._spindle_rpm,
            is_flood=self._is_flood,
            is_mist=self._is_mist,
            override_percent=self._override * 100.0,
            is_single_block=self._is_single_block,
            blocks_done=self._blocks_before + self._ordinal(),
            blocks_queued=self._queued(),
            message=self._message,
            alarm=self._alarm,
        )

    # --- preparation

    def _prepare(self) -> None:
        """Take what was offered into the path and the queue of events."""
        if not self._pending or self._is_resetting:
            return
        if self._state is MachineState.READY:
            self._state = MachineState.ACTIVE
        runs = self._preparation.take(self._pending, len(self._path.moves), is_single_block=self._is_single_block)
        self._pending.clear()
        if runs:
            first = self._path.add(runs, self._committed_mm())
            self._path.pieces.limit(self._override, max(first - 1, 0))
            self._find_piece()
            self._mark_single_block()

    def _committed_mm(self) -> float:
        """Path length where the machine can stand at the earliest."""
        rows, state = self._path.pieces, self._law
        if rows.count == 0:
            return 0.0
        piece = min(int(state[PIECE]), rows.count - 1)
        room = brake_mm(state[V], state[A], 0.0, PLANNED * rows.rows[piece, ACC], PLANNED * rows.rows[piece, JERK])
        return float(state[S] + room)

    def _find_piece(self) -> None:
        """The path has changed ahead: the same place may have another row now."""
        rows, state = self._path.pieces, self._law
        if not self._is_at_stop:
            found = int(np.searchsorted(rows.ends[: rows.count], state[S], side="right"))
            state[PIECE] = min(found, rows.count - 1)
        state[HORIZON] = state[PIECE]

    def _mark_single_block(self) -> None:
        """In single block the first block end at which the axes can stand is a stop."""
        rows, path = self._path.pieces, self._path
        if self._single_ordinal >= 0 and not self._is_single_block:
            path.unstop(self._single_ordinal)
            self._single_ordinal = -1
        elif self._is_single_block and not self._is_at_stop and rows.count:
            self._single_ordinal = path.first_end(int(self._law[PIECE]), self._committed_mm())
            path.stop_at(self._single_ordinal)
        else:
            return
        rows.limit(self._override, int(self._law[PIECE]))

    # --- motion

    def _do_something(self, limit: float) -> bool:
        """One stretch of standing, one event or one run of the law; False when only others can make it go on."""
        left = limit - self._record.step
        if self._standing_steps > 0:
            steps = int(min(self._standing_steps, left))
            self._record.stand(steps, self._position)
            self._standing_steps -= steps
            return True
        if self._state not in (MachineState.ACTIVE, MachineState.FEED_HOLD):
            return False
        if self._is_at_stop:
            return self._leave_stop()
        if self._law[V] == 0.0 and self._is_holding:
            return self._hold()
        if self._law[V] == 0.0 and self._override == 0.0:
            self._record.begin_stand(StopReason.OVERRIDE, self._position)
            return False
        self._move(int(min(left, 4096)))
        return True

    def _hold(self) -> bool:
        """The axes have come to rest by order."""
        if self._is_resetting:
            self._finish_reset()
        else:
            self._record.begin_stand(StopReason.FEED_HOLD, self._position)
        return False

    def _finish_reset(self) -> None:
        self._travelled += self._path_so_far()
        self._roundings += self._path.track.roundings()
        self._blocks_before += self._ordinal()
        self._begin()
        self._spindle_rpm = 0.0
        self._is_flood = self._is_mist = False
        self._alarm = ""
        self._record.begin_stand(StopReason.RESET, self._position)

    def _leave_stop(self) -> bool:
        """Standing at a stop: the next event, the next motion, or waiting."""
        if self._is_resetting:
            self._finish_reset()
            return False
        events = self._preparation.events
        if events and events[0].after <= self._ordinal():
            self._do_event(events.popleft().command)
            return True
        if self._is_holding:
            return self._hold()
        rows = self._path.pieces
        next_piece = int(np.searchsorted(rows.ends[: rows.count], self._law[S], side="right"))
        if next_piece < rows.count:
            self._law[PIECE] = self._law[HORIZON] = next_piece
            self._is_at_stop = False
            self._mark_single_block()
            motion = self._path.moves[int(rows.ordinals[next_piece])]
            if self._record.is_new:
                self._position = motion.start
            return True
        if self._is_closed:
            self._state = MachineState.COMPLETED
            self._record.begin_stand(StopReason.END, self._position)
        elif rows.count > 0:
            self._record.begin_stand(StopReason.STARVED, self._position)
        return False

    def _move(self, steps: int) -> None:
        """Run the law for at most this many steps and log them."""
        rows = self._path.pieces
        log_s, log_v, log_piece = np.empty(steps), np.empty(steps), np.empty(steps, dtype=np.int64)
        self._record.end_stand()
        done = self._run(
            self._law,
            rows.count,
            rows.rows,
            rows.ordinals,
            self._profile.lookahead_blocks,
            self._is_holding,
            self._step_s,
            log_s,
            log_v,
            log_piece,
        )
        points = self._path.track.positions(log_s[:done], log_piece[:done])
        piece = int(log_piece[done - 1])
        has_landed = self._law[V] == 0.0 and log_s[done - 1] == rows.ends[piece]
        if has_landed:
            end = self._path.moves[int(rows.ordinals[piece])].end
            if np.max(np.abs(points[-1] - end)) <= self._times.same_place_mm:
                points[-1] = end
        self._log(points, log_v[:done], rows.ordinals[log_piece[:done]])
        events = self._preparation.events
        while events and events[0].after <= self._ordinal() and not events[0].is_synchronous:
            self._do_event(events.popleft().command)
        if has_landed:
            self._arrive(int(rows.ordinals[piece]))

    def _log(self, points: Array, speeds: Array, ordinals: Indices) -> None:
        """Log steps on the motions of these numbers."""
        self._record.move(points, speeds * 60.0, *self._path.moves.sources(ordinals))
        self._position = (float(points[-1, 0]), float(points[-1, 1]), float(points[-1, 2]))

    def _arrive(self, ordinal: int) -> None:
        """The axes stand at the end of a motion."""
        self._is_at_stop = True
        reason = self._path.reasons.get(ordinal)
        if ordinal == self._single_ordinal:
            self._single_ordinal = -1
            self._state = MachineState.SINGLE_BLOCK
            reason = reason or StopReason.SINGLE_BLOCK
        if reason is not None:
            self._record.begin_stand(reason, self._position)
        if reason is StopReason.EXACT_STOP:
            self._standing_steps = math.ceil(self._times.settle_s(float(np.max(self._axes.jerk))) / self._step_s)

    def _do_event(self, command: Command) -> None:
        """Carry out what is no motion; the axes stand if it is one they stand for."""
        match command:
            case canon.Dwell(time_s=time_s):
                self._stand(StopReason.DWELL, time_s)
            case canon.ChangeTool(number=number):
                self._tool = number
                self._stand(StopReason.TOOL_CHANGE, self._times.tool_change_s)
            case canon.Spindle(speed_rpm=speed_rpm):
                if speed_rpm != self._spindle_rpm:
                    self._spindle_rpm = speed_rpm
                    self._stand(StopReason.SPINDLE, self._times.spindle_start_s)
            case canon.Coolant(is_flood=is_flood, is_mist=is_mist):
                self._is_flood, self._is_mist = is_flood, is_mist
            case canon.Message(text=text):
                self._message = text
            case canon.Stop(is_optional=is_optional):
                if not is_optional:
                    self._wait(MachineState.PROGRAM_STOPPED, StopReason.PROGRAM_STOP)
                elif self._stops_at_optional:
                    self._wait(MachineState.OPTIONAL_STOP, StopReason.OPTIONAL_STOP)
            case canon.End():
                self._spindle_rpm = 0.0
                self._is_flood = self._is_mist = False
                self._wait(MachineState.COMPLETED, StopReason.END)
            case canon.Alarm(number=number, text=text):
                self._alarm = f"{number} {text}"
                self._wait(MachineState.ALARM, StopReason.ALARM)
            case _:
                pass
        self._record.at(command.line, command.block)

    def _stand(self, reason: StopReason, time_s: float) -> None:
        self._record.begin_stand(reason, self._position)
        self._standing_steps = math.ceil(time_s / self._step_s - 1e-9)

    def _wait(self, state: MachineState, reason: StopReason) -> None:
        self._state = state
        self._record.begin_stand(reason, self._position)

    # --- bookkeeping

    def _ordinal(self) -> int:
        """Motions finished (standing), or the index of the one being made."""
        rows = self._path.pieces
        if not self._is_at_stop:
            return int(rows.ordinals[int(self._law[PIECE])])
        following = int(np.searchsorted(rows.ends[: rows.count], self._law[S], side="right"))
        return int(rows.ordinals[following]) if following < rows.count else len(self._path.moves)

    def _motion(self) -> Motion | None:
        ordinal = self._ordinal()
        if self._is_at_stop or ordinal >= len(self._path.moves):
            return None
        return self._path.moves[ordinal]

    def _queued(self) -> int:
        waiting = sum(len(each) if isinstance(each, LineRun) else 1 for each in self._pending)
        return waiting + len(self._path.moves) - self._ordinal()

    def _path_so_far(self) -> list[Motion]:
        return travelled(self._path.track, float(self._law[S]))
