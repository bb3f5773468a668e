"""A planned cut on a simulated card, from homing to the measured part, with every servo cycle of it kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import TrueParameters, as_simulated
from profiles.compensations.path import CutPath
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.roundness import RoundnessResult, evaluate
from tests.drivers.conftest import JobMaker, Recorder, beside_home
from tests.drivers.families import of_family as of_family
from tests.drivers.wire_card import Wire

Floats = NDArray[np.float64]

TOOL, SPINDLE, CARRIAGE = 1, 2, 3
SHORT_MM = 1.0
FAMILIES = pytest.mark.parametrize("family", ["pmac", "turbo"])


def short(experiment: JobMaker, number: int = 1) -> Job:
    """A cut of 34 turns: what counts is in each of them."""
    return replace(experiment(number), cut_length_mm=SHORT_MM)


def with_inverter(machine: MachineProfile) -> MachineProfile:
    """The same lathe with a conventional spindle, which the card only reads."""
    spindle = replace(machine.spindle, drive="inverter", ramp_rpm_per_s=500.0, slip_rpm=60.0)
    controller = replace(machine.controller, axis_definitions=("#1->X", "#3->Z"))
    return replace(machine, spindle=spindle, controller=controller)


@dataclass(frozen=True, kw_only=True)
class Track:
    """A cut: what the axes were told and where they were, counts, one value for each servo cycle."""

    tool_told: Floats
    tool: Floats
    spindle: Floats
    carriage: Floats


class CutFloor:
    """One lathe, homed, with a blank in its chuck and the program of a cut in its card."""

    def __init__(
        self,
        job: Job,
        machine: MachineProfile,
        strategy: Strategy,
        true: TrueParameters | None = None,
        watchdog: str = "",
        *,
        trimmed: bool = False,
        path: CutPath | None = None,
    ) -> None:
        machine = as_simulated(machine, true)
        self.job, self.machine = job, machine
        self.plan: CutPlan = plan_cut(job, machine, strategy, watchdog=watchdog, trimmed=trimmed, path=path)
        sim = SimulatedLathe(machine, beside_home(machine, true), DIALECTS[machine.controller.family])
        self.card = Wire(sim=sim, port=sim.connect())
        self.card.raw("I3=2 I6=1\r")
        self._home()
        sim.mount(job)
        self.card.tell(*self.plan.program.lines)
        self._recorders = {motor: self._record(motor) for motor in (TOOL, SPINDLE, CARRIAGE)}

    @property
    def turned_apart(self) -> bool:
        """Whether somebody at the lathe turns the spindle."""
        return self.machine.spindle.drive != "servo"

    def ripple(self, share: float) -> None:
        """Let the speed of the spindle swing by a share, twice a turn."""
        axis: Any = self.card.card.motors[SPINDLE].axis
        axis._axis.speed_ripple = share

    def start(self, before_run: str = "") -> None:
        """Go to the start of the plan and begin, with `before_run` on the same line."""
        plan, card = self.plan, self.card
        # Ten times as fast as an operator would: nothing is told of the way.
        jog = self.machine.controller.variables[f"I{CARRIAGE}22"]
        card.tell(f"I{CARRIAGE}22={10 * jog}", f"#{CARRIAGE}J={plan.carriage_start}")
        card.settle()
        card.tell(f"I{CARRIAGE}22={jog}")
        card.tell(*([] if self.turned_apart else [f"#{SPINDLE}J={plan.spindle_start}"]), f"#1J={plan.tool_start}")
        card.settle()
        card.sim.wait(0.5)
        if self.turned_apart:
            card.sim.set_spindle(self.job.spindle_speed_rpm)
            card.sim.wait(3.0)
        for recorder in self._recorders.values():
            recorder.commands.clear()
            recorder.positions.clear()
        card.tell(f"&1 {before_run} B{plan.program.number}R")

    def finish(self, timeout_s: float = 60.0) -> Track:
        """Let time pass until the program has ended and nothing moves, and return what was done."""
        card, system = self.card, self.card.card.systems[1]
        end = card.sim.now_s() + timeout_s
        while system.running or system.moving:
            assert card.sim.now_s() < end, "the program does not end"
            card.sim.wait(0.05)
        if not self.turned_apart:
            card.settle()
        tool, spindle, carriage = (self._recorders[motor] for motor in (TOOL, SPINDLE, CARRIAGE))
        return Track(
            tool_told=np.array(tool.commands),
            tool=np.array(tool.positions),
            spindle=np.array(spindle.positions),
            carriage=np.array(carriage.positions),
        )

    def cut(self) -> Track:
        """Make the whole cut."""
        self.start()
        return self.finish()

    def measured(self) -> RoundnessResult:
        """Release the part and measure it, without a filter."""
        trace = self.card.sim.measure()
        return evaluate(trace.angle_deg, trace.deviation_um, None)

    def number(self, item: str) -> float:
        """Return what the card says, addresses too, which it writes in hexadecimal."""
        (said,) = self.card.ask(item)
        return float(int(said[1:], 16)) if said.startswith("$") else float(said)

    @property
    def tool_told(self) -> float:
        """Where the tool was told to be in the last servo cycle, counts."""
        return self._recorders[TOOL].commands[-1]

    def _home(self) -> None:
        card = self.card
        motors = (TOOL, CARRIAGE) if self.turned_apart else (TOOL, CARRIAGE, SPINDLE)
        card.tell(*(f"#{motor}J/" for motor in motors))
        for motor in motors:
            card.tell(f"#{motor}HM")
            card.settle()

    def _record(self, motor: int) -> Recorder:
        target = self.card.card.motors[motor]
        recorder = Recorder(target.axis)
        target.axis = recorder
        return recorder


def until(floor: CutFloor, condition: Callable[[], bool]) -> None:
    """Let time pass in steps of 2 ms."""
    end_s = floor.card.sim.now_s() + 20.0
    while not condition():
        assert floor.card.sim.now_s() < end_s
        floor.card.sim.wait(0.002)
