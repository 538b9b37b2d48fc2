"""The axes in time: interpreted commands in, a motion log out.

The machine knows nothing of bytes. Its horizon is the look-ahead or the blocks offered so far, whichever ends first;
where its knowledge ends it must be able to stand, so a slow line shows as slowing and standing. Time is the
machine's own: `advance(until_s)` moves it; the caller maps wall time to it. The same offers at the same machine times
give the same motion, live or not.
"""

from __future__ import annotations

import math

import numpy as np

from sim.interpreter.canon import Command, LineRun, Motion, Vector
from sim.motion.auxiliary import Auxiliary
from sim.motion.interpolator import Interpolator
from sim.motion.limits import axis_limits
from sim.motion.prepare import Preparation
from sim.motion.record import Recorder
from sim.motion.values import (
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
        axes, self._times = axis_limits(profile, profile.block_cycle_s), times or MachineTimes()
        self._lookahead_blocks = profile.lookahead_blocks
        self._step_s = step_s
        self._settle_s = self._times.settle_s(float(np.max(axes.jerk)))
        self._stops_at_optional = stops_at_optional
        self._interpolator = Interpolator(
            axes, self._times, self._lookahead_blocks, step_s, speed_error=speed_error, is_compiled=is_compiled
        )
        self._auxiliary = Auxiliary(self._times, stops_at_optional=stops_at_optional)
        self._record = Recorder(step_s)
        self._position: Vector = (0.0, 0.0, 0.0)
        self._begin()

    def _begin(self) -> None:
        """Nothing queued and nothing asked: the state after power-on and after a reset."""
        self._preparation = Preparation(self._times, stops_at_optional=self._stops_at_optional)
        self._record.owe_rest(0)
        self._is_closed = self._is_holding = self._is_resetting = False
        self._state = MachineState.READY

    # --- what is asked of it

    def offer(self, command: Command | LineRun) -> None:
        """Queue an interpreted command, or a run of straight cuts."""
        self._preparation.offer(command)

    def close(self) -> None:
        """No more blocks will come: standing at the end of what is known is the end, not starvation."""
        self._is_closed = True

    def set_override(self, percent: float) -> None:
        """Feed override, 0 to 120 %; rapids follow it up to 100 %."""
        self._interpolator.set_override(min(max(percent, 0.0), 120.0) / 100.0)

    def set_single_block(self, is_on: bool) -> None:
        """Stand after every motion block until cycle start."""
        self._interpolator.set_single_block(is_on)

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
        self._preparation.forget_offers()
        if self._interpolator.is_settled:
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
        return max(0, self._lookahead_blocks - self._queued())

    @property
    def time_s(self) -> float:
        """The machine's clock."""
        return self._record.step * self._step_s

    @property
    def starved(self) -> list[StarvedInterval]:
        """Every time the machine stood in cycle for want of blocks, the present one included."""
        return self._record.starved()

    @property
    def stands(self) -> list[StandStill]:
        """Every standstill with its reason, the present one included."""
        return self._record.stands()

    @property
    def stands_for(self) -> StopReason | None:
        """Why the machine stands now, or None."""
        return self._record.reason

    @property
    def roundings(self) -> list[Rounding]:
        """Every rounded corner with the deviation it made, planned ones included."""
        return self._interpolator.roundings

    @property
    def start_mm(self) -> Vector | None:
        """Where the first motion known begins."""
        return self._interpolator.start_mm

    @property
    def travelled(self) -> list[Motion]:
        """The motions as really made so far, roundings included."""
        return self._interpolator.travelled

    def snapshot(self) -> MachineSnapshot:
        """The machine at this moment."""
        interpolator, auxiliary, record = self._interpolator, self._auxiliary, self._record
        motion = interpolator.motion
        to_go = np.zeros(3) if motion is None else np.subtract(motion.end, self._position)
        return MachineSnapshot(
            time_s=self.time_s,
            position_mm=self._position,
            distance_to_go_mm=(float(to_go[0]), float(to_go[1]), float(to_go[2])),
            feed_mm_min=interpolator.speed_mm_s * 60.0,
            line=record.line,
            block=record.block,
            state=self._state,
            tool=auxiliary.tool,
            spindle_rpm=auxiliary.spindle_rpm,
            is_flood=auxiliary.is_flood,
            is_mist=auxiliary.is_mist,
            override_percent=interpolator.override * 100.0,
            is_single_block=interpolator.is_single_block,
            blocks_done=interpolator.blocks_done,
            blocks_queued=self._queued(),
            message=auxiliary.message,
            alarm=auxiliary.alarm,
        )

    def _queued(self) -> int:
        return self._preparation.offered + self._interpolator.motion_count - self._interpolator.ordinal

    # --- what it does

    def _prepare(self) -> None:
        """Take what was offered into the path and the queue of events."""
        if not self._preparation.has_offers or self._is_resetting:
            return
        if self._state is MachineState.READY:
            self._state = MachineState.ACTIVE
        interpolator = self._interpolator
        runs = self._preparation.take(interpolator.motion_count, is_single_block=interpolator.is_single_block)
        if runs:
            self._interpolator.add(runs)

    def _do_something(self, limit: float) -> bool:
        """One stretch of standing, one event or one run of the law; False when only others can make it go on."""
        left = limit - self._record.step
        if self._record.rest(left, self._position):
            return True
        if self._state not in (MachineState.ACTIVE, MachineState.FEED_HOLD):
            return False
        if self._interpolator.is_at_stop:
            return self._leave_stop()
        if self._interpolator.is_at_rest and self._is_holding:
            return self._hold()
        if self._interpolator.is_at_rest and self._interpolator.override == 0.0:
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
        self._interpolator.reset()
        self._auxiliary.reset()
        self._begin()
        self._record.begin_stand(StopReason.RESET, self._position)

    def _leave_stop(self) -> bool:
        """Standing at a stop: the next event, the next motion, or waiting."""
        if self._is_resetting:
            self._finish_reset()
            return False
        events = self._preparation.events
        if events and events[0].after <= self._interpolator.ordinal:
            self._do_event(events.popleft().command)
            return True
        if self._is_holding:
            return self._hold()
        motion = self._interpolator.set_off()
        if motion is not None:
            if self._record.is_new:
                self._position = motion.start
            return True
        if self._is_closed:
            self._state = MachineState.COMPLETED
            self._record.begin_stand(StopReason.END, self._position)
        elif self._interpolator.has_path:
            self._record.begin_stand(StopReason.STARVED, self._position)
        return False

    def _move(self, steps: int) -> None:
        """Move for at most this many steps and log them."""
        self._record.end_stand()
        stretch = self._interpolator.run(steps, self._is_holding)
        self._record.move(stretch.points_mm, stretch.feeds_mm_min, stretch.lines, stretch.blocks)
        x, y, z = stretch.points_mm[-1].tolist()
        self._position = (x, y, z)
        events = self._preparation.events
        while events and events[0].after <= self._interpolator.ordinal and not events[0].is_synchronous:
            self._do_event(events.popleft().command)
        if stretch.landed is not None:
            self._arrive(stretch.landed)
        elif stretch.has_halted:
            self._halt()

    def _halt(self) -> None:
        """The axes have come to rest between two ends: by order, or because blocks came too late to go on."""
        if self._is_holding:
            self._hold()
        else:
            is_by_override = self._interpolator.override == 0.0
            self._record.begin_stand(StopReason.OVERRIDE if is_by_override else StopReason.LATE, self._position)

    def _arrive(self, ordinal: int) -> None:
        """The axes stand at the end of a motion."""
        reason, is_single = self._interpolator.arrive(ordinal)
        if is_single:
            self._state = MachineState.SINGLE_BLOCK
            reason = reason or StopReason.SINGLE_BLOCK
        is_end_known = self._is_closed or self._preparation.events or ordinal + 1 < self._interpolator.motion_count
        if reason is None and not is_end_known:
            reason = StopReason.STARVED
        if reason is not None:
            self._record.begin_stand(reason, self._position)
        if reason is StopReason.EXACT_STOP:
            self._record.owe_rest(math.ceil(self._settle_s / self._step_s))

    def _do_event(self, command: Command) -> None:
        """Carry out what is no motion."""
        halt = self._auxiliary.carry_out(command)
        if halt is not None:
            self._record.begin_stand(halt.reason, self._position)
            self._record.owe_rest(math.ceil(halt.time_s / self._step_s - 1e-9))
            self._state = halt.state or self._state
        self._record.at(command.line, command.block)
