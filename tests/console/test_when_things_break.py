"""What goes wrong in the middle of a job: the machine is proven to rest, and the operator is told which."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.session.cut.engine import CutContext, Step
from console.session.cut.run import cut_part, plan_run
from console.session.data.records import RunRecord
from console.session.errors import SessionError
from console.text.catalogue import load
from drivers.cutting.planning import CutPlan, Strategy
from drivers.lathe.lathe import Lathe
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import ideal
from profiles.job import Job
from profiles.store import load_job
from tests.compact import compact_machine
from tests.console.commands import Console, JobFile

JOB = load_job("lee-2001-experiment-1").job
MACHINE = compact_machine().machine
RUN = {
    "software": "x",
    "job": "j",
    "job_sha256": "0",
    "machine": "m",
    "machine_sha256": "0",
    "simulated": 1,
    "strategy": "pvt",
    "program": "",
}


@pytest.fixture
def plan() -> CutPlan:
    return plan_run(JOB, MACHINE, Strategy.NONE).cut


@pytest.fixture
def shop() -> tuple[CutContext, SimulatedLathe]:
    simulated = SimulatedLathe(MACHINE)
    link = MemoryLink(simulated.connect(), simulated)
    stop = StopPath(link)
    lathe = Lathe(PmacClient(link, simulated), MACHINE, simulated, stop)
    opened = CutContext(lathe=lathe, workshop=simulated)
    return opened, simulated


def codes(error: pytest.ExceptionInfo[SessionError]) -> list[str]:
    return [problem.code for problem in error.value.problems]


def at(step: Step, act: Callable[[], Any]) -> Callable[[Step, str], None]:
    """Return what is told the steps and does something at one of them."""
    return lambda told, detail: act() if told is step else None


def moving(simulated: SimulatedLathe) -> bool:
    before = [motor.actual for motor in simulated.controller.motors.values()]
    simulated.wait(0.5)
    after = [motor.actual for motor in simulated.controller.motors.values()]
    return any(abs(a - b) > 5 for a, b in zip(before, after, strict=True))


def test_a_fault_of_the_console_stops_the_machine_and_is_told(
    shop: tuple[CutContext, SimulatedLathe], plan: CutPlan
) -> None:
    opened, simulated = shop
    with pytest.raises(SessionError) as fault:
        cut_part(opened, JOB, plan, at(Step.RETRACT, lambda: [][1]))
    assert codes(fault) == ["session.fault"]
    assert "IndexError" in fault.value.problems[0].value
    assert not moving(simulated)


def test_a_stop_with_the_tool_in_the_part_says_so(shop: tuple[CutContext, SimulatedLathe], plan: CutPlan) -> None:
    opened, simulated = shop
    original = simulated.wait

    def wait(seconds: float) -> None:
        if simulated.controller.motors[3].actual > plan.carriage_start + 3000:
            simulated.wait = original  # type: ignore[method-assign]
            opened.lathe.stop.stop("operator")
        original(seconds)

    simulated.wait = wait  # type: ignore[method-assign]
    with pytest.raises(SessionError) as stopped:
        cut_part(opened, JOB, plan, lambda step, detail: None)
    assert codes(stopped) == ["machine.stopped", "machine.tool_in_part"]
    assert not moving(simulated)
    activated = [motor for motor in simulated.controller.motors.values() if motor.activated]
    assert all(motor.enabled for motor in activated), "ramped down under control"


def test_a_trip_with_the_tool_in_the_part_says_that_it_cannot_be_retracted(
    shop: tuple[CutContext, SimulatedLathe], plan: CutPlan
) -> None:
    opened, simulated = shop
    original = simulated.wait

    def wait(seconds: float) -> None:
        if simulated.controller.motors[3].actual > plan.carriage_start + 3000:
            simulated.wait = original  # type: ignore[method-assign]
            simulated.controller.variables.replace_i({**_settings(simulated), 111: 1.0})
        original(seconds)

    simulated.wait = wait  # type: ignore[method-assign]
    with pytest.raises(SessionError) as tripped:
        cut_part(opened, JOB, plan, lambda step, detail: None)
    told = codes(tripped)
    assert (told[:2], told[-1]) == (
        ["machine.fault", "machine.behind_after_change"],
        "machine.retract_not_possible",
    )
    assert [problem.key for problem in tripped.value.problems if problem.code.startswith("controller.")] == [
        "I111"
    ]
    assert "fatal_following_error" in tripped.value.problems[0].value
    assert not any(motor.enabled for motor in simulated.controller.motors.values())


@pytest.mark.first(1)
@pytest.mark.parametrize(("friction_n", "trips"), [(6.0, False), (8.0, True)])
def test_a_tool_that_sticks_says_how_far_it_was_behind_and_what_friction_does_that(
    friction_n: float, trips: bool
) -> None:
    """Eight newtons of dry friction trip 150 um where the tool turns round, six do not; what is told is between.

    The loop gives way by 10.86 um/N and is pushed by twice the friction there: 150 / 2 / 10.86 = 6.9 N.
    """
    job = replace(JOB, cut_length_mm=1.5)
    simulated = SimulatedLathe(MACHINE, replace(ideal(MACHINE), coulomb_friction_n=friction_n))
    link = MemoryLink(simulated.connect(), simulated)
    lathe = Lathe(PmacClient(link, simulated), MACHINE, simulated, StopPath(link))
    sticky = CutContext(lathe=lathe, workshop=simulated)
    planned = plan_run(job, MACHINE, Strategy.NONE).cut
    if not trips:
        assert cut_part(sticky, job, planned, lambda step, detail: None).trace is not None
        return
    with pytest.raises(SessionError) as tripped:
        cut_part(sticky, job, planned, lambda step, detail: None)
    told = next(each for each in tripped.value.problems if each.code == "machine.tool_left_behind")
    assert (told.where, told.key, told.limit) == ("6.9 N", "5 N", "150 um (I111)")
    assert 20.0 < float(told.value.removesuffix(" um")) <= 150.0
    for language in ("en", "ko"):
        said = load(language).problem(told)
        assert all(fact in said for fact in ("6.9 N", "5 N", "150 um", told.value))


def test_friction_that_was_identified_stands_beside_the_friction_that_trips() -> None:
    simulated = SimulatedLathe(MACHINE, replace(ideal(MACHINE), coulomb_friction_n=8.0))
    link = MemoryLink(simulated.connect(), simulated)
    lathe = Lathe(PmacClient(link, simulated), MACHINE, simulated, StopPath(link))
    lathe.friction = lambda: "8.2 ± 0.9 N"
    planned = plan_run(replace(JOB, cut_length_mm=1.5), MACHINE, Strategy.NONE).cut
    with pytest.raises(SessionError) as tripped:
        cut_part(CutContext(lathe=lathe, workshop=simulated), JOB, planned, lambda step, detail: None)
    told = next(each for each in tripped.value.problems if each.code == "machine.tool_left_behind_identified")
    assert (told.where, told.key) == ("6.9 N", "8.2 ± 0.9 N")
    for language in ("en", "ko"):
        said = load(language).problem(told)
        assert "6.9 N" in said and "8.2 ± 0.9 N" in said


def test_a_stop_before_the_zeros_are_found_does_not_say_where_the_tool_stands(
    shop: tuple[CutContext, SimulatedLathe], plan: CutPlan
) -> None:
    opened, simulated = shop
    original = simulated.wait

    def wait(seconds: float) -> None:
        if any(motor.enabled for motor in simulated.controller.motors.values()):
            simulated.wait = original  # type: ignore[method-assign]
            opened.lathe.stop.stop("operator")
        original(seconds)

    simulated.wait = wait  # type: ignore[method-assign]
    with pytest.raises(SessionError) as stopped:
        cut_part(opened, JOB, plan, lambda step, detail: None)
    assert codes(stopped) == ["machine.stopped", "machine.tool_unknown"]


def _settings(simulated: SimulatedLathe) -> dict[int, float]:
    return {index: simulated.controller.variables.i(index) for index in range(1024)}


def test_settings_that_differ_refuse_the_cut_and_leave_the_machine_alone(
    shop: tuple[CutContext, SimulatedLathe], plan: CutPlan
) -> None:
    opened, simulated = shop
    simulated.controller.variables.replace_i({**_settings(simulated), 115: 0.25, 500: 1.0})
    with pytest.raises(SessionError) as refused:
        cut_part(opened, JOB, plan, lambda step, detail: None)
    assert codes(refused) == ["controller.setting", "controller.unexpected_motor"]
    assert [problem.key for problem in refused.value.problems] == ["I115", "I500"]
    assert opened.lathe.stop.reason is None


def test_a_record_that_is_locked_stops_the_machine_within_a_moment(
    shop: tuple[CutContext, SimulatedLathe], plan: CutPlan, tmp_path: Path
) -> None:
    opened, simulated = shop
    record = RunRecord(tmp_path, RUN, timeout_s=0.3)
    other = sqlite3.connect(tmp_path / "records.sqlite3", isolation_level=None)

    def lock() -> None:
        other.execute("BEGIN EXCLUSIVE")
        record.add("step", {})

    with pytest.raises(SessionError) as lost:
        cut_part(opened, JOB, plan, at(Step.ARM, lock))
    assert codes(lost) == ["record.lost"]
    assert not moving(simulated)
    other.execute("ROLLBACK")
    other.close()
    record.close()


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"cut_length_mm": 0.1}, "cut.too_short"),
        ({"cut_length_mm": 27.9, "feed_mm_per_rev": 0.4, "spindle_speed_rpm": 2400.0}, "cut.near_jaws"),
        ({"lobe_error_um_pp": 990.0, "spindle_speed_rpm": 800.0, "depth_of_cut_mm": 0.5}, "cut.following_error"),
    ],
)
@pytest.mark.parametrize("strategy", [Strategy.PAPER, Strategy.PVT])
@pytest.mark.first(3)
def test_what_would_go_wrong_in_the_cut_is_refused_before_it(
    changes: dict[str, Any], code: str, strategy: Strategy
) -> None:
    rpm = changes.get("spindle_speed_rpm", JOB.spindle_speed_rpm)
    job: Job = replace(JOB, chucking_force_n=3100.0, lobe_force_n=3100.0, lobe_spindle_speed_rpm=rpm, **changes)
    with pytest.raises(SessionError) as refused:
        plan_run(job, MACHINE, strategy)
    assert code in codes(refused)


def test_a_cut_of_endless_moves_is_refused_at_once(job_file: JobFile, console: Console) -> None:
    said = console("run", str(job_file(feed_mm_per_rev="0.0001")), "--sim")
    assert said.code == 1
    assert "the cut needs" in said.err
    assert "refuse" not in said.err


@pytest.mark.long
def test_too_fast_a_lobe_is_refused_with_the_speed_that_passes(job_file: JobFile, console: Console) -> None:
    changes = {"jaws": "12", "chucking_force_n": "6500.0", "lobe_force_n": "6500.0"}
    said = console("run", str(job_file(**changes)), "--sim")
    assert said.code == 1
    line = next(line for line in said.err.splitlines() if "1 ms" in line)
    allowed = int(line.rpartition("<= ")[2].partition(" rpm")[0])
    assert 100 < allowed < 1000
    words = ("program", str(job_file("slower", **changes, spindle_speed_rpm=f"{allowed}.0")), "--json")
    assert console(*words).code == 0
