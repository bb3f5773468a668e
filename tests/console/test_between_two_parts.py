"""Between the reference part and the compensated one of a run, and what is left of a cut's phases."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from console.session.cut import recording
from console.session.cut import run as run_module
from console.session.cut.engine import cut, load
from console.session.cut.in_process import simulated_context
from console.session.cut.recording import part_record
from console.session.cut.run import CutOutcome, roundness_of
from console.session.errors import SessionError
from console.session.stages import Stage
from console.session.station.progress import CutPhase, PhaseClock, planned_phases
from drivers.cutting.planning import Strategy, plan_cut
from drivers.errors import RefusedError
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath, StoppedError
from profiles.job import Job
from profiles.problem import Problem
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.compact import compact_machine

MACHINE = load_machine("lee-2001-lathe").machine
PLAN = plan_cut(load_job("lee-2001-experiment-1").job, MACHINE, Strategy.NONE)


@pytest.mark.parametrize("stopped", [True, False])
def test_a_stop_after_the_reference_part_begins_no_second_one(
    monkeypatch: pytest.MonkeyPatch, stopped: bool
) -> None:
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
    left_s = {each.phase: each.left_s for each in planned_phases(PLAN, MACHINE)}
    assert left_s[CutPhase.CUT] == pytest.approx(9.6)
    assert left_s[CutPhase.RETRACT] == pytest.approx(0.32, abs=0.0085)
    assert sum(left_s.values()) == pytest.approx(PLAN.duration_s)


@pytest.mark.parametrize("pace", [1.0, 0.5])
def test_what_is_left_of_the_retract_falls_and_its_delay_comes_off_the_next_phase(pace: float) -> None:
    clock = PhaseClock(PLAN, MACHINE)
    planned_s = {each.phase: each.left_s / pace for each in planned_phases(PLAN, MACHINE)}

    def left(at_s: float) -> list[tuple[CutPhase, float]]:
        snapshot: Any = SimpleNamespace(at_s=at_s)
        return [(each.phase, each.left_s) for each in clock.left(CutPhase.RETRACT, snapshot, 0.0, pace)]

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
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=1.0)
    machine = compact_machine().machine
    context, _ = simulated_context(machine)
    lathe, workshop = context.lathe, context.workshop
    lathe.connect()
    assert workshop is not None
    workshop.mount(job)
    lathe.enable()
    lathe.home()
    plan = plan_cut(job, machine, Strategy.PVT, watchdog=lathe.program.watchdog)
    load(context, plan, lambda *_: None, aligned=True)
    asked: list[bool] = []

    def see(_: Snapshot) -> None:
        if not asked:
            asked.append(True)
            lathe.program.end_after_turn()

    ended = cut(context, job, plan, lambda *_: None, see)
    assert (ended.held, ended.figures) == (True, None)


@pytest.mark.parametrize("clamped", [False, True])
def test_a_part_that_is_clamped_is_not_clamped_anew_and_what_it_ran_into_is_told(
    monkeypatch: pytest.MonkeyPatch, clamped: bool
) -> None:
    """Its fingerprint is that of this clamping."""
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=1.0)
    machine, mounted, mark = compact_machine().machine, list[str](), cast(Any, "the jaws")
    context, sim = simulated_context(machine)
    mount, look = sim.mount, sim.look

    def noting(job: Job) -> None:
        mounted.append(job.name)
        mount(job)

    sim.mount(job)
    monkeypatch.setattr(sim, "mount", noting)
    monkeypatch.setattr(sim, "look", lambda: replace(look(), collisions=(mark,)))
    watchdog = context.lathe.program.watchdog
    plan = plan_cut(job, machine, Strategy.NONE, watchdog=watchdog)
    outcome = run_module.cut_part(context, job, plan, lambda *_: None, clamped=clamped)
    assert mounted == ([] if clamped else [job.name])
    assert outcome.collisions == (mark,)
    assert outcome.trace is not None


def test_a_machine_that_does_not_admit_a_cut_is_left_as_it_was() -> None:
    """Another console controls it, say: no program is loaded, and no drive enabled."""
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=1.0)
    context, sim = simulated_context(compact_machine().machine)

    def admit() -> None:
        raise RefusedError(Problem(code="owner.held"))

    plan = plan_cut(job, compact_machine().machine, Strategy.NONE, watchdog=context.lathe.program.watchdog)
    with pytest.raises(RefusedError):
        run_module.cut_part(replace(context, admit=admit), job, plan, lambda *_: None)
    assert context.lathe.program.reports() is None and not context.lathe.has_moved
    assert context.lathe.stop.reason is None
    assert not any(motor.amplifier_enabled for motor in sim.controller.motors.values())


def test_an_error_of_the_console_in_mid_cut_stops_the_machine() -> None:
    """Nothing else had stopped it: the program would go on without being watched."""
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=1.0)
    context, _ = simulated_context(compact_machine().machine)
    lathe = context.lathe

    def see(snapshot: Snapshot) -> None:
        if snapshot.program_running:
            raise SessionError(Problem(code="session.nothing_seen"))

    beside: Any = SimpleNamespace(begin=lambda _: None, see=see)
    plan = plan_cut(job, compact_machine().machine, Strategy.NONE, watchdog=lathe.program.watchdog)
    with pytest.raises(SessionError) as failed:
        run_module.cut_part(context, job, plan, lambda *_: None, beside)
    assert failed.value.problems[0].code == lathe.stop.reason == "session.nothing_seen"
    assert lathe.stop.proven and lathe.snapshot().at_rest


@pytest.mark.parametrize(
    ("off_um", "ront_um", "passed"),
    [(59.0, 4.9, True), (-59.0, 4.9, True), (61.0, 4.9, False), (-61.0, 4.9, False), (0.0, 5.1, False)],
)
def test_a_part_passes_within_both_of_its_tolerances(
    monkeypatch: pytest.MonkeyPatch, off_um: float, ront_um: float, passed: bool
) -> None:
    """The bundled job allows 5 um of roundness, and 60 um of diameter either way."""
    job = load_job("lee-2001-experiment-1").job
    assert (job.roundness_tolerance_um, job.diameter_tolerance_um) == (5.0, 60.0)
    angle_deg = np.arange(0.0, 360.0, 0.5)
    trace = Trace(
        angle_deg=angle_deg, deviation_um=0.5 * ront_um * np.cos(np.radians(3 * angle_deg)), meta={"state": "free"}
    )
    diameter_mm = job.finished_diameter_mm + off_um / 1000.0
    monkeypatch.setattr(recording, "mean_diameter_of", lambda *_: diameter_mm)
    assert part_record(job, roundness_of(trace), trace, Stage.FULL).passed is passed
