"""A run of two parts, what goes wrong in the middle of one, and a program that is rewritten before its start."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pytest import MonkeyPatch

from console.session.cut import recording
from console.session.cut import run as run_module
from console.session.cut.engine import CutContext, PartStep, cut, load
from console.session.cut.in_process import simulated_context
from console.session.cut.recording import part_record
from console.session.cut.run import CutOutcome, cut_part, plan_run, roundness_of
from console.session.data.records import RunRecord
from console.session.errors import SessionError
from console.session.stages import Stage
from console.session.station.commands import Start
from console.session.station.progress import CutPhase, CutPhaseClock, planned_phases
from console.text.catalogue import load as load_text
from drivers.cutting.planning import CutPlan, plan_cut
from drivers.cutting.strategy import Strategy
from drivers.errors import RefusedError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath, StoppedError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import ideal
from profiles.job import Job
from profiles.problem import Problem
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.compact import compact_machine
from tests.console.commands import Console, JobFile
from tests.console.floor import experiment_1, set_up_once

MACHINE, COMPACT = load_machine("lee-2001-lathe").machine, compact_machine().machine
JOB = load_job("lee-2001-experiment-1").job
SHORT = replace(JOB, cut_length_mm=1.0)


@cache
def reference_plan() -> CutPlan:
    return plan_cut(JOB, MACHINE, Strategy.NONE)


def unheard(step: PartStep, detail: str) -> None:
    """Tell nobody."""


def planned_on(context: CutContext, strategy: Strategy = Strategy.NONE) -> CutPlan:
    return plan_cut(SHORT, COMPACT, strategy, watchdog=context.lathe.program.watchdog)


@pytest.mark.parametrize("stopped", [True, False])
def test_a_stop_after_the_reference_part_begins_no_second_one(monkeypatch: MonkeyPatch, stopped: bool) -> None:
    """A stop that comes while the first part is measured: nothing of the first cut refuses it."""
    stop = StopPath(cast(Any, SimpleNamespace(send_urgent=lambda _: None)))
    opened: list[None] = []
    cut: list[str] = []

    def open_machine() -> Any:
        opened.append(None)
        return SimpleNamespace(lathe=SimpleNamespace(stop=stop), simulated=True)

    def cut_part(*_: Any, name: Any, **__: Any) -> Any:
        cut.append(name)
        if stopped:
            stop.stop("ctrl-c")
        return CutOutcome(trace=None, figures=cast(Any, None), collisions=())

    monkeypatch.setattr(run_module, "cut_part", cut_part)
    plan: Any = SimpleNamespace(job=None, reference=object(), cut=object(), stage=Stage.FULL)
    if not stopped:
        run_module.run(plan, open_machine, lambda *_: None)
        assert (cut, len(opened)) == (["before", "after"], 2)
        return
    with pytest.raises(StoppedError):
        run_module.run(plan, open_machine, lambda *_: None)
    assert (cut, len(opened)) == (["before"], 1)


def test_the_retract_has_the_time_that_the_program_gives_it() -> None:
    """160 turns at 1000 rpm are 9.6 s; then 0.32 s of retract, within a segment of 8 ms; in all, the program."""
    left_s = {each.phase: each.left_s for each in planned_phases(reference_plan(), MACHINE)}
    assert left_s[CutPhase.CUT] == pytest.approx(9.6)
    assert left_s[CutPhase.RETRACT] == pytest.approx(0.32, abs=0.0085)
    assert sum(left_s.values()) == pytest.approx(reference_plan().duration_s)


@pytest.mark.parametrize("pace", [1.0, 0.5])
def test_what_is_left_of_the_retract_falls_and_its_delay_comes_off_the_next_phase(pace: float) -> None:
    clock = CutPhaseClock(reference_plan(), MACHINE)
    planned_s = {each.phase: each.left_s / pace for each in planned_phases(reference_plan(), MACHINE)}

    def left(at_s: float) -> list[tuple[CutPhase, float]]:
        snapshot: Any = SimpleNamespace(at_s=at_s)
        return [
            (each.phase, each.left_s) for each in clock.remaining_phases(CutPhase.RETRACT, snapshot, 0.0, pace)
        ]

    retract_s, home_s = planned_s[CutPhase.RETRACT], planned_s[CutPhase.HOME]
    for gone_s, expected in (
        (0.0, (retract_s, home_s)),
        (0.1, (retract_s - 0.1, home_s)),
        (retract_s + 0.2, (0.0, home_s - 0.2)),
    ):
        found = left(50.0 + gone_s)
        assert [phase for phase, _ in found] == [CutPhase.RETRACT, CutPhase.HOME]
        assert [seconds for _, seconds in found] == pytest.approx(expected, abs=1e-9)


def test_a_cut_that_is_ended_before_the_feed_ends_held_and_without_figures() -> None:
    """F7 while the spindle runs up: the tool is out again before a turn was polled, and nothing has gone wrong."""
    context, sim = simulated_context(COMPACT)
    lathe = context.lathe
    lathe.connect()
    sim.mount(SHORT)
    lathe.enable()
    lathe.home()
    plan = planned_on(context, Strategy.PVT)
    load(context, plan, unheard, aligned=True)
    asked: list[bool] = []

    def see(_: Snapshot) -> None:
        if not asked:
            asked.append(True)
            lathe.program.end_after_turn()

    ended = cut(context, SHORT, plan, unheard, see)
    assert (ended.held, ended.figures) == (True, None)


@pytest.mark.parametrize("clamped", [False, True])
def test_a_clamped_part_is_not_clamped_anew(monkeypatch: MonkeyPatch, clamped: bool) -> None:
    """Its fingerprint is that of this clamping."""
    mounted, mark = list[str](), cast(Any, "the jaws")
    context, sim = simulated_context(COMPACT)
    mount, look = sim.mount, sim.look

    def noting(job: Job) -> None:
        mounted.append(job.name)
        mount(job)

    sim.mount(SHORT)
    monkeypatch.setattr(sim, "mount", noting)
    monkeypatch.setattr(sim, "look", lambda: replace(look(), collisions=(mark,)))
    outcome = run_module.cut_part(context, SHORT, planned_on(context), unheard, clamped=clamped)
    assert mounted == ([] if clamped else [JOB.name])
    assert outcome.collisions == (mark,)
    assert outcome.trace is not None


def test_a_machine_that_does_not_admit_a_cut_is_left_as_it_was() -> None:
    """Another console controls it, say: no program is loaded, and no drive enabled."""
    context, sim = simulated_context(COMPACT)

    def admit() -> None:
        raise RefusedError(Problem(code="owner.held"))

    with pytest.raises(RefusedError):
        cut_part(replace(context, admit=admit), SHORT, planned_on(context), unheard)
    assert context.lathe.program.reports() is None and not context.lathe.has_moved
    assert context.lathe.stop.reason is None
    assert not any(motor.amplifier_enabled for motor in sim.controller.motors.values())


def test_an_error_of_the_console_in_mid_cut_stops_the_machine() -> None:
    """Nothing else had stopped it: the program would go on without being watched."""
    context, _ = simulated_context(COMPACT)
    lathe = context.lathe

    def see(snapshot: Snapshot) -> None:
        if snapshot.program_running:
            raise SessionError(Problem(code="session.nothing_seen"))

    beside: Any = SimpleNamespace(begin=lambda _: None, see=see)
    with pytest.raises(SessionError) as caught:
        cut_part(context, SHORT, planned_on(context), unheard, beside)
    assert caught.value.problems[0].code == lathe.stop.reason == "session.nothing_seen"
    assert lathe.stop.proven and lathe.snapshot().at_rest


@pytest.mark.parametrize(
    ("off_um", "ront_um", "passed"),
    [(59.0, 4.9, True), (-59.0, 4.9, True), (61.0, 4.9, False), (-61.0, 4.9, False), (0.0, 5.1, False)],
)
def test_a_part_passes_both_tolerances(
    monkeypatch: MonkeyPatch, off_um: float, ront_um: float, passed: bool
) -> None:
    """The bundled job allows 5 um of roundness, and 60 um of diameter either way."""
    job = JOB
    assert (job.roundness_tolerance_um, job.diameter_tolerance_um) == (5.0, 60.0)
    angle_deg = np.arange(0.0, 360.0, 0.5)
    trace = Trace(
        angle_deg=angle_deg, deviation_um=0.5 * ront_um * np.cos(np.radians(3 * angle_deg)), meta={"state": "free"}
    )
    diameter_mm = job.finished_diameter_mm + off_um / 1000.0
    monkeypatch.setattr(recording, "mean_diameter_of", lambda *_: diameter_mm)
    assert part_record(job, roundness_of(trace), trace, Stage.FULL).passed is passed


CUT_MM = 0.5
REWRITES = [
    pytest.param("OPEN PROG 2 CLEAR X0 Z0 CLOSE", "controller.program_differs", id="another program"),
    pytest.param("OPEN PROG 2 X0 CLOSE", "controller.program_differs", id="a line more"),
    pytest.param("P11=P11+500", "controller.constant_differs", id="a deeper cut"),
]


def rewrite(sim: SimulatedLathe, line: str) -> None:
    port = sim.connect()
    port.receive(f"{line}\r".encode("ascii"))
    sim.attend(port)


def started(sim: SimulatedLathe) -> bool:
    return any(system.running for system in sim.controller.systems.values())


@pytest.mark.parametrize(("line", "code"), REWRITES)
@pytest.mark.first(1)
def test_screens_refuse_it_before_anything_moves(tmp_path: Path, in_copies: None, line: str, code: str) -> None:
    floor, job = set_up_once(tmp_path), experiment_1(CUT_MM)
    assert floor.arm(job).armed is not None
    before = floor.lathe.snapshot()
    rewrite(floor.sim, line)
    state = floor.do(Start())
    assert [problem.code for problem in state.refusals] == [code] and not started(floor.sim)
    assert [axis.commanded_position for axis in floor.lathe.snapshot().axes] == [
        axis.commanded_position for axis in before.axes
    ]


@pytest.mark.first(3)
@pytest.mark.parametrize("step", [PartStep.ALIGN, PartStep.ARM])
@pytest.mark.parametrize(("line", "code"), REWRITES)
def test_console_run_refuses_it_and_leaves_the_machine_at_rest(line: str, code: str, step: PartStep) -> None:
    job = experiment_1(CUT_MM)
    context, sim = simulated_context(COMPACT)
    ran: list[bool] = []

    def tell(now: PartStep, _: str) -> None:
        ran.append(started(sim))
        if now is step:
            rewrite(sim, line)

    plan = plan_cut(job, COMPACT, Strategy.PVT, watchdog=context.lathe.program.watchdog)
    assert codes(failed(context, job, plan, tell)) == [code]
    assert not any(ran) and not started(sim) and context.lathe.snapshot().at_rest


RUN = {
    **dict.fromkeys(("software", "job", "job_sha256", "machine", "machine_sha256", "strategy", "program"), ""),
    "simulated": 1,
}


@pytest.fixture
def plan() -> CutPlan:
    return plan_run(JOB, COMPACT, Strategy.NONE).cut


def shop_of(friction_n: float = 0.0) -> tuple[CutContext, SimulatedLathe]:
    simulated = SimulatedLathe(COMPACT, replace(ideal(COMPACT), coulomb_friction_n=friction_n))
    link = MemoryLink(simulated.connect(), simulated)
    lathe = Lathe(PmacClient(link, simulated), COMPACT, simulated, StopPath(link))
    return CutContext(lathe=lathe, workshop=simulated), simulated


@pytest.fixture
def shop() -> tuple[CutContext, SimulatedLathe]:
    return shop_of()


def codes(error: SessionError) -> list[str]:
    return [problem.code for problem in error.problems]


def failed(
    opened: CutContext, job: Job, plan: CutPlan, tell: Callable[[PartStep, str], None] = unheard
) -> SessionError:
    with pytest.raises(SessionError) as caught:
        cut_part(opened, job, plan, tell)
    return caught.value


def once(simulated: SimulatedLathe, due: Callable[[], bool], act: Callable[[], Any]) -> None:
    """Let something happen between two waits, as soon as it is due."""
    original = simulated.wait

    def wait(seconds: float) -> None:
        if due():
            simulated.wait = original  # type: ignore[method-assign]
            act()
        original(seconds)

    simulated.wait = wait  # type: ignore[method-assign]


def at(step: PartStep, act: Callable[[], Any]) -> Callable[[PartStep, str], None]:
    """Return what is told the steps and does something at one of them."""
    return lambda told, detail: act() if told is step else None


def moving(simulated: SimulatedLathe) -> bool:
    before = [motor.actual for motor in simulated.controller.motors.values()]
    simulated.wait(0.5)
    after = [motor.actual for motor in simulated.controller.motors.values()]
    return any(abs(a - b) > 5 for a, b in zip(before, after, strict=True))


def test_a_fault_of_the_console_stops_and_is_told(shop: tuple[CutContext, SimulatedLathe], plan: CutPlan) -> None:
    opened, simulated = shop
    fault = failed(opened, JOB, plan, at(PartStep.RETRACT, lambda: [][1]))
    assert codes(fault) == ["session.fault"]
    assert "IndexError" in fault.problems[0].value
    assert not moving(simulated)


def test_a_stop_with_the_tool_in_the_part_says_so(shop: tuple[CutContext, SimulatedLathe], plan: CutPlan) -> None:
    opened, simulated = shop
    motors = simulated.controller.motors
    once(
        simulated,
        lambda: motors[3].actual > plan.carriage_start + 3000,
        lambda: opened.lathe.stop.stop("operator"),
    )
    assert codes(failed(opened, JOB, plan)) == ["machine.stopped", "machine.tool_in_part"]
    assert not moving(simulated)
    assert all(motor.enabled for motor in motors.values() if motor.activated), "ramped down under control"


def test_a_stop_before_the_zeros_names_no_place(shop: tuple[CutContext, SimulatedLathe], plan: CutPlan) -> None:
    opened, simulated = shop
    motors = simulated.controller.motors.values()
    once(
        simulated,
        lambda: any(motor.enabled for motor in motors),
        lambda: opened.lathe.stop.stop("operator"),
    )
    assert codes(failed(opened, JOB, plan)) == ["machine.stopped", "machine.tool_unknown"]


def test_a_trip_in_the_part_cannot_be_retracted(shop: tuple[CutContext, SimulatedLathe], plan: CutPlan) -> None:
    opened, simulated = shop
    motors = simulated.controller.motors
    once(
        simulated,
        lambda: motors[3].actual > plan.carriage_start + 3000,
        lambda: simulated.controller.variables.replace_i({**_settings(simulated), 111: 1.0}),
    )
    tripped = failed(opened, JOB, plan)
    told = codes(tripped)
    assert told[:2] == ["machine.fault", "machine.behind_after_change"]
    assert told[-1] == "machine.retract_not_possible"
    assert [each.key for each in tripped.problems if each.code.startswith("controller.")] == ["I111"]
    assert "fatal_following_error" in tripped.problems[0].value
    assert not any(motor.enabled for motor in motors.values())


@pytest.mark.parametrize("identified", [None, "8.2 ± 0.9 N"])
def test_a_tool_that_sticks_says_by_what_friction(identified: str | None) -> None:
    """Eight newtons of dry friction trip 150 um where the tool turns round, six do not; what is told is between.

    The loop gives way by 10.86 um/N and is pushed by twice the friction there: 150 / 2 / 10.86 = 6.9 N.
    """
    job = replace(JOB, cut_length_mm=1.5)
    planned = plan_run(job, COMPACT, Strategy.NONE).cut
    sticky, _ = shop_of(8.0)
    if identified is None:
        assert cut_part(shop_of(6.0)[0], job, planned, unheard).trace is not None
    else:
        sticky.lathe.friction = lambda: identified
    code = "machine.tool_left_behind" + ("_identified" if identified else "")
    told = next(each for each in failed(sticky, job, planned).problems if each.code == code)
    assert (told.where, told.key, told.limit) == ("6.9 N", identified or "5 N", "150 um (I111)")
    assert 20.0 < float(told.value.removesuffix(" um")) <= 150.0
    for language in ("en", "ko"):
        said = load_text(language).problem(told)
        assert all(fact in said for fact in (told.where, told.key, told.limit.split(" (")[0], told.value))


def _settings(simulated: SimulatedLathe) -> dict[int, float]:
    return {index: simulated.controller.variables.i(index) for index in range(1024)}


def test_other_settings_refuse_the_cut(shop: tuple[CutContext, SimulatedLathe], plan: CutPlan) -> None:
    opened, simulated = shop
    simulated.controller.variables.replace_i({**_settings(simulated), 115: 0.25, 500: 1.0})
    refused = failed(opened, JOB, plan)
    assert codes(refused) == ["controller.setting", "controller.unexpected_motor"]
    assert [problem.key for problem in refused.problems] == ["I115", "I500"]
    assert opened.lathe.stop.reason is None


def test_a_locked_record_stops_it(shop: tuple[CutContext, SimulatedLathe], plan: CutPlan, tmp_path: Path) -> None:
    opened, simulated = shop
    record = RunRecord(tmp_path, RUN, timeout_s=0.3)
    other = sqlite3.connect(tmp_path / "records.sqlite3", isolation_level=None)

    def lock() -> None:
        other.execute("BEGIN EXCLUSIVE")
        record.add("step", {})

    assert codes(failed(opened, JOB, plan, at(PartStep.ARM, lock))) == ["record.lost"]
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
def test_what_would_go_wrong_is_refused_before_it(changes: dict[str, Any], code: str, strategy: Strategy) -> None:
    rpm = changes.get("spindle_speed_rpm", JOB.spindle_speed_rpm)
    job: Job = replace(JOB, chucking_force_n=3100.0, lobe_force_n=3100.0, lobe_spindle_speed_rpm=rpm, **changes)
    with pytest.raises(SessionError) as refused:
        plan_run(job, COMPACT, strategy)
    assert code in codes(refused.value)


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
