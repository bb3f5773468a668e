"""Some servo cycles at once, although motors are coupled by tables or data are gathered in each of them.

Coupled motors are run one servo cycle after another, because anything may happen in a cycle. In most stretches of
some cycles nothing can: no piece of motion ends, no trigger is searched, no time base changes. There each motor is
run through the whole stretch, those first whose positions a table adds to another, and every one gets in each
cycle exactly the numbers that it would get one cycle after another:

- instants are added up cycle by cycle (`Player.sample_singly`);
- a table sees a source of a lower number than its target in the same cycle, one of a higher number a cycle late;
- for a sample of the gathering buffer every motor is shown as it was at the end of that cycle (`MotorLoop.show`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Protocol

from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.gather_buffer import GatherBuffer
from drivers.simulator.card.jog_motion import TriggerStage
from drivers.simulator.card.leads import Leads
from drivers.simulator.card.motor import Motor

_SEARCHING: Final = TriggerStage.SEARCHING  # a look-up less in every block
LEAST: Final = 2  # cycles; a single one is cheaper by itself


class Load(Protocol):
    """What a machine itself puts on an axis, by where two others were in the servo cycle before."""

    def watches(self) -> bool:
        """Whether there may be any."""

    def lead(self, first: Sequence[tuple[float, float]], second: Sequence[tuple[float, float]]) -> None:
        """Take where the others are in each cycle of a stretch, by their last cycle, and their step in that."""


@dataclass(frozen=True, slots=True)
class LoadedAxis:
    """The axis with a load, which is run after the others; in each cycle it is the first."""

    load: Load
    motor: Motor
    others: tuple[Motor, Motor]

    @property
    def in_order(self) -> bool:
        """Whether it can be run after the others, in closed loop and moving freely."""
        motor = self.motor
        first = all(motor.number < other.number for other in self.others)
        return first and motor.enabled and not motor.axis.jammed


class Stretch:
    """The stretches of one controller. `loaded` is the axis under a load of the machine itself, if any is."""

    def __init__(self, leads: Leads, systems: Iterable[CoordinateSystem], gather: GatherBuffer) -> None:
        self.loaded: LoadedAxis | None = None
        self._leads = leads
        self._systems = tuple(systems)
        self._gather = gather

    def length(self, motors: Sequence[Motor], most: int, cycle_ms: float) -> int:
        """Return for how many servo cycles, up to `most`, nothing can happen; 1 where that is not known."""
        leads = self._leads
        if most < LEAST or (leads.active and not leads.in_order):
            return 1
        loaded = self._loaded_now()
        if loaded is not None and (not loaded.in_order or loaded.motor.number in leads.sources()):
            return 1
        for system in self._systems:
            if system.busy:
                most = min(most, system.motion.uneventful(cycle_ms))
        for motor in motors:
            jog = motor.jog
            if jog.stage is _SEARCHING or not motor.undisturbed:
                return 1
            if jog.player is not None:
                most = min(most, jog.player.whole_cycles(cycle_ms))
        if self._gather.running:
            most = 1 if self._gather.by_cycle else min(most, self._gather.cycles_left)
        return max(1, most)

    def run(
        self, motors: Sequence[Motor], cycles: int, cycle_ms: float, count: Callable[[int], None]
    ) -> dict[int, list[float]]:
        """Run so many cycles; `count` counts cycles of the controller. Return the machine positions by motor."""
        commands: dict[int, list[float]] = {}
        for system in self._systems:
            if system.busy:
                commands.update(system.motion.sample_singly(cycles, cycle_ms))
        leads, gathered = self._leads, self._gather.motors
        seen = leads.sources()
        leads.let_stand(seen, cycles)
        tracks: dict[int, list[float]] = {}
        loaded = self._loaded_now()
        starts = [(other.true_position, other.pace) for other in loaded.others] if loaded is not None else []
        for motor in self._in_order(motors, loaded):
            number = motor.number
            if loaded is not None and motor is loaded.motor:
                first, second = (
                    _extrapolate_track(*start, tracks[each.number])
                    for start, each in zip(starts, loaded.others, strict=True)
                )
                loaded.load.lead(first, second)
            told = commands.get(number)
            if told is None and motor.jog.player is not None:
                told = motor.jog.player.sample_singly(cycles, cycle_ms)[0]
            corrections = leads.corrections(motor, cycles, seen)
            motor.begin_stretch()
            tracks[number] = motor.run(cycles, cycle_ms, told, corrections)
            if number in seen or (self._gather.running and (gathered is None or number in gathered)):
                motor.keep_stretch(cycle_ms, told, corrections)
        self._pass_time(motors, cycles, count)
        return {motor.number: tracks[motor.number] for motor in motors}

    def _loaded_now(self) -> LoadedAxis | None:
        return self.loaded if self.loaded is not None and self.loaded.load.watches() else None

    def _in_order(self, motors: Sequence[Motor], loaded: LoadedAxis | None) -> Sequence[Motor]:
        """Return motors in the order in which they can be run."""
        ordered = self._leads.order_motors(motors)
        if loaded is None:
            return ordered
        return [*(motor for motor in ordered if motor is not loaded.motor), loaded.motor]

    def _pass_time(self, motors: Sequence[Motor], cycles: int, count: Callable[[int], None]) -> None:
        """Count the cycles, and take the samples that are due."""
        if self._gather.running and self._gather.motors is None:
            self._sample(motors, cycles, count)
            return
        count(cycles)
        if self._gather.running:
            self._gather.sample_stretch(cycles)

    def _sample(self, motors: Sequence[Motor], cycles: int, count: Callable[[int], None]) -> None:
        """Take the samples one after the other, each with the motors as they were then."""
        for at in range(cycles):
            count(1)
            if self._gather.running:
                if self._gather.is_due:
                    for motor in motors:
                        motor.show(at)
                self._gather.sample()
        for motor in motors:
            motor.show(cycles - 1)


def _extrapolate_track(start: float, pace: float, track: Sequence[float]) -> list[tuple[float, float]]:
    """Return the place of an axis in each cycle of a stretch, extrapolated from the one before, and its step.

    `start` and `pace` are place and step in the cycle before the stretch.
    """
    places = [start, *track[:-1]]
    steps = [pace, *(after - before for before, after in pairwise(places))]
    return [(place + step, step) for place, step in zip(places, steps, strict=True)]
