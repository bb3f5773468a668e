"""Bring the axes to the start of a test, under the watchdog: home, tool first, and return to the start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.commissioning.judged import JudgedAxis
from drivers.commissioning.proofs.air_cut import Begin
from drivers.commissioning.proofs.bench import REASON, ProofRig
from drivers.errors import DriverError
from drivers.pmac.heartbeat.keeper import LOSS_SEEN, NOTHING_GUARDED, Keeper
from drivers.pmac.heartbeat.watch import Look, Watch, rests
from drivers.pmac.heartbeat.watchdog import PERIOD_MS
from drivers.pmac.language.text import format_number
from profiles.problem import Problem

TIMEOUT_S = 60.0
TRIES = 3  # a delayed host finds its motion ended by the controller, and begins it anew this often at most
HOMING_ORDER = ("tool", "carriage", "spindle")


@dataclass(kw_only=True)
class Guarded:
    """The driven axes of a controller whose heartbeat is in order. `starts` is where they were homed, counts.

    Every method that moves raises `DriverError`: `machine.timeout`, somebody has stopped, or the link broke.
    """

    bench: ProofRig
    i10: float
    starts: dict[str, float] = field(default_factory=dict)

    @property
    def axes(self) -> tuple[JudgedAxis, ...]:
        """The axes that the controller moves."""
        return self.bench.judged.driven_axes

    @property
    def watch(self) -> Watch:
        """The monitor of all their motors."""
        bench = self.bench
        motors = tuple(axis.motor for axis in self.axes)
        return Watch(bench.client, bench.clock, bench.dialect, motors, bench.see_owner)

    @property
    def keeper(self) -> Keeper:
        """The watchdog lines."""
        return Keeper(dialect=self.bench.dialect, i10=self.i10)

    def inwards(self, axis: JudgedAxis) -> int:
        """Return the direction away from the home end, +1 or -1: the free travel."""
        return -1 if self.bench.judged.of_motor(axis, 23) > 0.0 and axis.name != "spindle" else 1

    def begin(self, name: str) -> Begin:
        """Return where an axis was homed, and the direction of free travel."""
        axis = next(each for each in self.axes if each.name == name)
        return Begin(self.starts[name], self.inwards(axis))

    def close(self) -> None:
        """Close every loop at its present position."""
        for axis in self.axes:
            self.bench.move(f"#{axis.motor}J/")
        self.bench.settle()
        self.bench.moving = False

    def home(self) -> None:
        """Home each axis, the tool first, so that it is retracted when another one moves."""
        for axis in sorted(self.axes, key=lambda axis: HOMING_ORDER.index(axis.name)):
            self.starts[axis.name] = self._homed(axis)

    def back(self) -> None:
        """Return tool and carriage to where they were homed, the tool first."""
        for axis in self.axes:
            if axis.name != "spindle":
                self._go(f"#{axis.motor}J={format_number(self.starts[axis.name])}", axis, lambda _: True)

    def _homed(self, axis: JudgedAxis) -> float:
        def done(look: Look) -> bool:
            flags = look.flags[axis.motor]
            return "home_complete" in flags and "home_search" not in flags

        look = self._go(f"#{axis.motor}HM", axis, done)
        return float(round(look.positions[axis.motor]))

    def _go(self, line: str, axis: JudgedAxis, done: Callable[[Look], bool]) -> Look:
        for _ in range(TRIES):
            look = self._once(line, axis, done)
            if look is not None:
                return look
        raise self._timeout(axis)

    def _once(self, line: str, axis: JudgedAxis, done: Callable[[Look], bool]) -> Look | None:
        """Move, and renew the watchdog until done; None when the controller has ended the motion."""
        bench, watch, keeper = self.bench, self.watch, self.keeper
        polls: list[Look] = []
        end_s = bench.clock.now_s() + TIMEOUT_S
        bench.move(f"{keeper.jog_line()} {line}")
        while not (polls and (polls[-1].lost or (rests(polls) and done(polls[-1])))):
            bench.clock.wait(PERIOD_MS / 1000.0)
            bench.stop.check()
            watch.renew(keeper)
            polls.append(watch.look())
            if bench.clock.now_s() > end_s:
                raise self._timeout(axis)
        watch.client.request(f"{NOTHING_GUARDED} {LOSS_SEEN}")
        bench.moving = polls[-1].lost  # ended by the controller, it may not rest yet
        return None if polls[-1].lost else polls[-1]

    def _timeout(self, axis: JudgedAxis) -> DriverError:
        self.bench.stop.stop(REASON)
        return DriverError(Problem(code="machine.timeout", key=axis.name, value=f"{TIMEOUT_S:g} s"))
