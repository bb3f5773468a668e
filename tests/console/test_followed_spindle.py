"""A spindle on an inverter: the controller follows it, the operator sets it, and the stop leaves it alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.cut.engine import CutContext
from console.session.cut.interlocks import of_zero
from console.session.cut.run import cut_part, plan_run
from console.session.errors import SessionError
from drivers.cutting.planning import Strategy
from drivers.lathe.heartbeat import Heartbeat, cut_condition
from drivers.lathe.lathe import Lathe
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.roundness import evaluate
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.compact import CLOSE_TOGETHER, close_together
from tests.console.commands import Console, JobFile
from tests.drivers.cut_floor import with_inverter

JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.6)


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return close_together(with_inverter(load_machine("lee-2001-lathe").machine))


class Floor:
    """The machine, with somebody at the lathe who sets the spindle to `set_rpm` when a speed is asked for."""

    def __init__(self, machine: MachineProfile, set_rpm: float) -> None:
        self.sim = SimulatedLathe(machine)
        link = MemoryLink(self.sim.connect(), self.sim)
        client = PmacClient(link, self.sim)
        self.stop = StopPath(link)
        heartbeat = Heartbeat(client, self.sim, machine)
        self.lathe = Lathe(client, machine, self.sim, self.stop, heartbeat=heartbeat)
        self._set_rpm = set_rpm
        self.context = CutContext(lathe=self.lathe, workshop=self, sets_spindle=True)

    def mount(self, job: Job) -> None:
        self.sim.mount(job)

    def measure(self) -> Trace:
        return self.sim.measure()

    def indicate(self, places: int | None = None) -> ClampReadings:
        return self.sim.indicate(places)

    def look(self) -> WorkshopView:
        return self.sim.look()

    def set_spindle(self, rpm: float | None) -> None:
        self.sim.set_spindle(None if rpm is None else self._set_rpm)


def cut(machine: MachineProfile, set_rpm: float) -> tuple[Floor, float]:
    floor = Floor(machine, set_rpm)
    plan = plan_run(JOB, machine, Strategy.TIMEBASE, watchdog=cut_condition(machine))
    trace = cut_part(floor.context, JOB, plan.cut, lambda step, detail: None).trace
    assert trace is not None
    return floor, evaluate(trace.angle_deg, trace.deviation_um, 50.0).ront_um


def test_a_part_is_round_on_a_spindle_that_somebody_else_turns(machine: MachineProfile) -> None:
    floor, ront_um = cut(machine, JOB.spindle_speed_rpm)
    assert ront_um < 1.0
    assert not floor.sim.controller.motors[machine.spindle.motor].enabled, "the card never drove it"


def test_a_spindle_at_another_speed_is_not_cut_on(machine: MachineProfile) -> None:
    with pytest.raises(SessionError) as refused:
        cut(machine, 0.9 * JOB.spindle_speed_rpm)
    assert "machine.not_at_speed" in [problem.code for problem in refused.value.problems]


def test_every_stop_is_a_control_k_because_control_a_would_close_the_spindle(machine: MachineProfile) -> None:
    floor = Floor(machine, 1000.0)
    floor.lathe.connect()
    assert floor.lathe.verify() == ()
    floor.lathe.enable()
    assert floor.lathe.snapshot().loops_closed
    floor.stop.stop("operator")
    assert floor.stop.killed
    floor.lathe.wait_for_rest()
    assert not any(motor.enabled for motor in floor.sim.controller.motors.values())


@pytest.mark.parametrize(
    ("strategy", "jaw_found", "code"),
    [
        (Strategy.CAM, True, []),
        (Strategy.CAM, False, ["cut.zero_unknown"]),
        (Strategy.TIMEBASE, True, ["cut.index_unknown"]),
        (Strategy.TIMEBASE, False, []),
    ],
)
def test_jaw_1_is_known_from_the_zero_of_the_strategy(
    machine: MachineProfile, strategy: Strategy, jaw_found: bool, code: list[str]
) -> None:
    assert [problem.code for problem in of_zero(machine, strategy, jaw_found=jaw_found)] == code


@pytest.mark.long
def test_the_command_cuts_without_a_part_to_compare_with(
    console: Console, tmp_path: Path, job_file: JobFile
) -> None:
    text = load_machine("lee-2001-lathe").path.read_text(encoding="utf-8")
    drive = 'drive = "inverter"\nramp_rpm_per_s = 500.0\nslip_rpm = 60.0\npeak_torque_n_m = 50.0'
    text = text.replace('["#1->X", "#2->Y", "#3->Z"]', '["#1->X", "#3->Z"]').replace(
        "peak_torque_n_m = 50.0", drive
    )
    for usual, near in CLOSE_TOGETHER.items():
        text = text.replace(usual, near)
    file = tmp_path / "inverter.toml"
    file.write_text(text, encoding="utf-8")
    words = ("--sim", "--machine", str(file), "--strategy", "timebase", "--json")
    result = console("run", str(job_file(cut_length_mm="0.6")), *words).json
    assert result["before"] is None and result["improvement_percent"] is None
    assert result["after"]["RONt_um"] < 1.0
