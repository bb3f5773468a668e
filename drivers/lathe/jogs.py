"""Jogs of one axis at a time: home, to a position, by an increment, retract. Each is monitored while it moves."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial

from drivers.errors import DriverError, RefusedError
from drivers.lathe.commands import Wiring
from drivers.lathe.guards import JogGuard, OthersStill
from drivers.lathe.lengths import Lengths, motor_of, settings_of
from drivers.lathe.motion import MotionWaits, refuse_beyond_travel
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot, driven_axes
from drivers.lathe.standstill import ARRIVED_COUNTS, HomeSearch, Settling, nearly_arrived
from drivers.pmac.language.text import format_number
from profiles.machine import MachineProfile
from profiles.problem import Problem

READ_S = 0.01  # time skew within one poll: position and following error are not sampled simultaneously


def band_counts(machine: MachineProfile, axis: AxisName) -> float:
    """Return the following-error warning limit of an axis."""
    return settings_of(machine, axis).warning_counts


class Jogs:
    """The jogs of one machine."""

    def __init__(self, wiring: Wiring, motion: MotionWaits) -> None:
        self._machine, self._poller, self._stop = wiring.machine, wiring.poller, wiring.stop
        self._motion, self._tables, self._send = motion, wiring.tables, wiring.sending.jog
        self._lengths = Lengths(wiring.machine)

    def home(self, timeout_s: float = 60.0) -> None:
        """Home each axis: tool first, then the carriage, then the spindle's index.

        Raises:
            DriverError: `machine.timeout`, `machine.fault`; `machine.home_ended`, before a zero was found;
                `controller.home_lost`, `controller.zero_shifted`, of an axis that was homed before.
        """
        driven, homed = driven_axes(self._machine), list[AxisName]()
        for axis in (AxisName.TOOL, AxisName.CARRIAGE, AxisName.SPINDLE):
            if axis not in driven:
                continue
            now = self._poller.look()
            self._refuse_shifted(now, homed)
            others = self._guard_others(axis, now)
            self._send(f"#{motor_of(self._machine, axis)}HM")
            self._poller.positions.trust(axis)  # its flag is down until the zero is found
            braking_s = settings_of(self._machine, axis).home_braking_s
            search = HomeSearch(axis, band_counts(self._machine, AxisName.TOOL), braking_s)
            last = self._motion.until(search.is_over, timeout_s, f"home {axis}", guard=others, homing=axis)
            if search.sudden or "home_complete" not in last.axis(axis).flags:
                self._stop.stop(f"home {axis}")
                raise DriverError(Problem(code="machine.home_ended", key=axis))
            self._poller.positions.hold(last)
            homed.append(axis)

    def to(
        self,
        axis: AxisName,
        counts: float,
        timeout_s: float = 120.0,
        *,
        settle: bool = True,
        held_counts: float = 0.0,
        outward: bool = False,
    ) -> None:
        """Jog one axis to a position in counts of its motor.

        With `settle` it gets time to come in position, see `Settling`; without, it suffices that it is
        commanded to rest there and lags by less than the warning limit: the integrator of a slow loop may need
        many seconds for the remainder. `held_counts` is what a compensation table adds to its reported position. A
        tool that goes `outward` goes wherever its zero is.

        Raises:
            DriverError: `controller.zero_shifted`, nothing was sent; `machine.timeout`,
                `machine.fault`, `machine.not_arrived`, or, while it moves, `machine.jog_astray`,
                `machine.unexpected_motion` and those of `MotionWaits.until`.
        """
        guard = self._jog_guard(axis, counts + held_counts, outward=outward)
        self._send(f"#{motor_of(self._machine, axis)}J={format_number(counts)}")
        done = Settling((axis,), band_counts(self._machine, AxisName.TOOL)).is_over
        if not settle:
            done = partial(nearly_arrived, axis=axis, band_counts=band_counts(self._machine, axis))
        last = self._motion.until(done, timeout_s, f"jog {axis}", guard=guard)
        self._poller.positions.hold(last)
        state = last.axis(axis)
        if abs(state.commanded_position - counts - held_counts) > ARRIVED_COUNTS:
            # It rests, but not at its target: somebody else, or the controller itself, has ended the jog.
            value, limit = (
                self._lengths.format_position(axis, state.commanded_position),
                self._lengths.format_position(axis, counts),
            )
            self._stop.stop(f"jog {axis}")
            raise DriverError(Problem(code="machine.not_arrived", key=axis, value=value, limit=limit))

    def _jog_guard(self, axis: AxisName, end: float, *, outward: bool) -> JogGuard:
        """Return the guard of a jog to `end`; the reported position leads by the travel during one poll."""
        now = self._poller.look()
        if not outward:
            self._refuse_shifted(now, now.driven)
        settings = settings_of(self._machine, axis)
        return JogGuard(
            axis=axis,
            begin=now.axis(axis).commanded_position,
            end=end,
            beyond_counts=settings.jog_speed * READ_S * settings.counts_per_unit + ARRIVED_COUNTS,
            others=self._guard_others(axis, now),
            lengths=self._lengths,
        )

    def _refuse_shifted(self, now: Snapshot, axes: Collection[AxisName]) -> None:
        """Refuse while one of these axes is not where it was left: another host moved it or changed its zero."""
        shifted = sorted(now.shifted.keys() & set(axes))
        if shifted:
            values = ", ".join(now.shifted[axis] for axis in shifted)
            raise RefusedError(Problem(code="controller.zero_shifted", key=", ".join(shifted), value=values))

    def _guard_others(self, axis: AxisName, begun: Snapshot) -> OthersStill:
        """Return the guard of the axes that do not jog; with a table on, the tool follows another axis."""
        follows = axis is not AxisName.TOOL and self._tables.are_on()
        return OthersStill({axis, AxisName.TOOL} if follows else {axis}, begun, self._lengths)

    def jog_by(self, axis: AxisName, counts: float, timeout_s: float = 120.0) -> None:
        """Jog one axis by an increment in counts from its commanded position.

        Raises DriverError: `machine.moving`, `machine.not_enabled`, `machine.beyond_travel`, and those of `to`.
        """
        state = self._ready_to_jog(axis)
        held = self._tables.correction_counts() if axis is AxisName.TOOL else 0.0
        end = state.commanded_position - held + counts
        refuse_beyond_travel(self._machine, axis, end)
        self.to(axis, end, timeout_s, settle=False, held_counts=held)

    def retract(self, to_counts: float, timeout_s: float = 60.0) -> None:
        """Retract the tool to a position in counts, after a stop or an early end; positive is towards the work.

        A tool that is already there, within the band of its in-position flag, is left alone.

        Raises:
            DriverError: `machine.retract_direction`, the position is further in than the tool;
                `machine.moving`, `machine.not_enabled`, and those of `to`.
        """
        here = self._ready_to_jog(AxisName.TOOL).position
        if abs(to_counts - here) <= settings_of(self._machine, AxisName.TOOL).in_position_counts:
            return
        if to_counts > here:
            value, limit = (self._lengths.format_position(AxisName.TOOL, each) for each in (to_counts, here))
            raise RefusedError(
                Problem(code="machine.retract_direction", key=AxisName.TOOL, value=value, limit=f"< {limit}")
            )
        held = self._tables.correction_counts()
        self.to(AxisName.TOOL, to_counts, timeout_s, held_counts=held, outward=True)

    def _ready_to_jog(self, axis: AxisName) -> AxisState:
        """Return the position of an axis; its loop must be closed, because a jog would close an open one."""
        self._stop.check()
        snapshot = self._poller.look()
        if snapshot.moving or not snapshot.axis(axis).closed:
            code = "machine.moving" if snapshot.moving else "machine.not_enabled"
            raise RefusedError(Problem(code=code, where=self._poller.address))
        return snapshot.axis(axis)
