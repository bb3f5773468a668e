"""Whether tool and spindle keep together, how fast it turns, and a spindle on an inverter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import groupby
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.cut.engine import CutContext, _find_earlier_cut
from console.session.cut.interlocks import of_zero
from console.session.cut.run import cut_part, plan_run
from console.session.cut.telemetry import CutFigures, Telemetry, is_leaving
from console.session.errors import SessionError
from console.session.stages import Stage
from console.session.station.commands import Start
from console.session.station.progress import (
    CutProgress,
    CutStage,
    CutTracker,
    SpindleWatch,
    Synchronisation,
    before_part,
    in_part,
)
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.lathe.heartbeat import Heartbeat, cut_condition
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisState, Snapshot, driven_axes
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.compensations.trial_band import BandReadings
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.metrology.cylindricity import PartSection
from profiles.roundness import evaluate
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.compact import CLOSE_TOGETHER, close_together
from tests.console.commands import Console, JobFile
from tests.console.floor import experiment_1, known, set_up_once
from tests.drivers.cut_floor import with_inverter
from tests.system.lathe_sites import compact
from tests.tui.stage import ON, look_at

QUEUED, WAITING, IN_SYNC, LOST = Synchronisation
FOLLOWING = [strategy for strategy in Strategy if strategy is not Strategy.NONE]


@pytest.mark.parametrize("strategy", FOLLOWING)
def test_a_spindle_is_waited_for_and_in_the_part_the_phase_decides(strategy: Strategy) -> None:
    """Only a program on the spindle's time waits for its index."""
    waits = WAITING if strategy is Strategy.TIMEBASE else QUEUED
    for begun, unbegun_at_speed in ((False, waits), (True, QUEUED)):
        for rpm in (None, 0.0, 970.0):
            assert before_part(strategy, spindle_rpm=rpm, target_rpm=1000.0, begun=begun) is QUEUED
        for rpm in (985.0, 1000.0, -1000.0, 1015.0):
            assert before_part(strategy, spindle_rpm=rpm, target_rpm=1000.0, begun=begun) is unbegun_at_speed
    for rpm in (None, 400.0, 1000.0):
        for in_phase, told in ((True, IN_SYNC), (False, LOST), (None, None)):
            assert in_part(strategy, spindle_rpm=rpm, target_rpm=1000.0, in_phase=in_phase) is told


def test_a_tool_that_follows_no_lobe_keeps_nothing() -> None:
    for rpm in (None, 0.0, 1000.0):
        assert before_part(Strategy.NONE, spindle_rpm=rpm, target_rpm=1000.0, begun=False) is None
        assert in_part(Strategy.NONE, spindle_rpm=rpm, target_rpm=1000.0, in_phase=None) is None


@given(st.floats(-49.0, 49.0), st.sampled_from([True, False, None]), st.sampled_from(FOLLOWING))
def test_a_spindle_that_stands_is_lost(rpm: float, in_phase: bool | None, strategy: Strategy) -> None:
    assert in_part(strategy, spindle_rpm=rpm, target_rpm=1000.0, in_phase=in_phase) is LOST


# In a cut -------------------------------------------------------------------------------------------------------


def test_a_followed_spindle_that_comes_to_stand_is_lost_and_has_no_ripple() -> None:
    """A program on its time stands with it: tool and carriage where they were, in phase."""
    job, machine = experiment_1(), with_inverter(load_machine("lee-2001-lathe").machine)
    plan = plan_cut(job, machine, Strategy.TIMEBASE)
    watch = CutTracker(plan, job, machine)
    turn, per_mm = machine.spindle.counts_per_rev, machine.carriage.counts_per_mm
    told = []
    for number in range(200):
        turns = 0.4056 * min(number, 150)
        infeed_um = plan.target.at_um(360.0 * turns)
        look = look_at(
            ON,
            tool=plan.setup.surface + float(infeed_um) / machine.tool.count_um,
            spindle=turns * turn,
            carriage=plan.carriage_start + 1.5 * per_mm,
            running=True,
        )
        rpm = 1000.0 if number < 150 else 0.0
        told.append(watch.see(replace(look, driven=driven_axes(machine)), CutStage.RUN_UP, False, rpm))
    assert [each.synchronisation for each in (told[149], told[150], told[199])] == [IN_SYNC, LOST, LOST]
    assert told[199].in_phase
    assert {each.ripple for each in told} == {None}


# On the simulated lathe -----------------------------------------------------------------------------------------


def told_in(seen: Sequence[CutProgress], *stages: CutStage) -> list[Synchronisation | None]:
    """What was told in these stages, each once in its order."""
    return [told for told, _ in groupby(each.synchronisation for each in seen if each.stage in stages)]


@pytest.mark.parametrize(
    ("strategy", "before", "inside"),
    [
        (Strategy.NONE, [None], [None]),
        (Strategy.PVT, [QUEUED], [None, IN_SYNC]),
        pytest.param(Strategy.CAM, [QUEUED], [None, IN_SYNC], marks=pytest.mark.long),
        (Strategy.TIMEBASE, [QUEUED, WAITING, QUEUED], [None, IN_SYNC]),
        # Printed times are not those of the lobe: 28 um of 55 are left.
        (Strategy.PAPER, [QUEUED], [None, LOST]),
    ],
)
@pytest.mark.first(1)
def test_an_undisturbed_cut_is_queued_then_in_sync_or_lost_and_done(
    tmp_path: Path,
    in_copies: None,
    strategy: Strategy,
    before: list[Synchronisation | None],
    inside: list[Synchronisation | None],
) -> None:
    floor, job = set_up_once(tmp_path), experiment_1()
    floor.arm(job, strategy)
    seen: list[CutProgress] = []
    floor.looks.append(lambda _: seen.append(floor.state.cut) if floor.state.cut else None)
    floor.do(Start())
    running = [each for each in told_in(seen, CutStage.RUN_UP) if each is not None or strategy is Strategy.NONE]
    assert running == before
    assert told_in(seen, CutStage.CUT) == inside
    assert told_in(seen, CutStage.POSITION, CutStage.RETRACT) == [None]
    assert floor.state.cut is not None and floor.state.cut.synchronisation is None
    alarms = [alarm.problem.code for alarm in floor.state.alarms]
    assert floor.state.cut_done and alarms == (["cut.out_of_phase"] if LOST in inside else [])


JOB, MACHINE = load_job("lee-2001-experiment-1").job, compact("pmac")
POLL_S, TURN_S, OFF_UM, LAG_UM = 0.023, 0.06, 0.4, 3.0


@cache
def plan() -> CutPlan:
    return plan_cut(JOB, MACHINE, Strategy.PVT)


def cut(
    *,
    last_um: float = 0.0,
    first_um: float = 0.0,
    leaves_at: int = 0,
    off_at: Callable[[float], float] = lambda _: 0.0,
) -> tuple[CutFigures, int]:
    """A tool `OFF_UM` too deep, and so many um in the turns before the part and in the last one.

    It is further off by `off_at` mm past the middle of the cut, um.
    From poll `leaves_at` on the program ends early: the tool retracts over the part. Returns the figures, and how
    many polls are of the part, but for its last turn.
    """
    setup, per_um, polls = plan().setup, 1.0 / MACHINE.tool.count_um, Telemetry(plan(), MACHINE, JOB)
    end = plan().carriage_start + setup.carriage_counts
    first, last = end - JOB.cut_length_mm * MACHINE.carriage.counts_per_mm, end - setup.carriage_per_turn
    counted = 0
    for number in range(int(setup.turns * TURN_S / POLL_S)):
        at_s = number * POLL_S
        turn = at_s / TURN_S
        carriage = plan().carriage_start + turn * setup.carriage_per_turn
        counted += first <= carriage <= last
        off_um = OFF_UM + (last_um if carriage > last else 0.0) + (first_um if carriage < first else 0.0)
        if leaves_at and number >= leaves_at:
            off_um = -5.0 * (number - leaves_at + 1)
        past_mm = (carriage - setup.carriage_middle) / MACHINE.carriage.counts_per_mm
        off_um += off_at(past_mm)
        tool = setup.surface + per_um * float(plan().target.at_um(360.0 * turn, past_mm) + off_um)
        places = ((tool, LAG_UM * per_um), (turn * setup.counts_per_turn, 0.0), (carriage, 0.0))
        axes = [AxisState(position=float(at), following_error=lag, flags=frozenset()) for at, lag in places]
        snapshot = Snapshot(
            asked_s=at_s,
            at_s=at_s,
            program_running=True,
            runtime_error=False,
            tool=axes[0],
            spindle=axes[1],
            carriage=axes[2],
        )
        polls.see(snapshot, holding=bool(leaves_at))
    found = known(polls.figures())
    return found, counted


def test_the_figures_are_those_of_the_part_without_its_last_turn() -> None:
    """A turn of 60 ms is 1000 rpm. Before the part the tool may be anywhere, and in its last turn it may leave."""
    found, counted = cut(first_um=40.0, last_um=50.0)
    assert found.samples == counted > 100
    assert found.spindle_speed_rpm == pytest.approx(1000.0, rel=1e-6)
    assert (found.tool_error_um, found.tool_error_rms_um) == pytest.approx((OFF_UM, OFF_UM), rel=1e-3)
    assert (found.following_error_um, found.following_error_rms_um) == pytest.approx((LAG_UM, LAG_UM))


def test_each_stretch_along_z_has_its_own_tool_error() -> None:
    """The cut of 8 mm ends 22 mm in front of the jaws; the tool is 2 um less deep past its middle."""
    found, _ = cut(off_at=lambda past_mm: -2.0 if 0.8 < past_mm < 2.4 else 0.0)
    ends = [(each.from_z_mm, each.to_z_mm) for each in found.stretches]
    assert ends == pytest.approx([(30.0, 28.4), (28.4, 26.8), (26.8, 25.2), (25.2, 23.6), (23.6, 22.0)])
    errors_um = [each.error_um for each in found.stretches]
    assert errors_um == pytest.approx([OFF_UM, OFF_UM, OFF_UM, 2.0 - OFF_UM, OFF_UM], rel=1e-3)


def test_a_stretch_that_was_not_cut_has_no_error() -> None:
    errors_um = [each.error_um for each in cut(leaves_at=200)[0].stretches]
    assert errors_um[0] == pytest.approx(OFF_UM, rel=1e-3)
    assert errors_um[-1] is None


def test_a_tool_that_leaves_the_part_early_ends_its_figures() -> None:
    assert cut(leaves_at=100)[0].tool_error_um == pytest.approx(OFF_UM, rel=1e-3)
    assert cut(leaves_at=100)[0].samples < cut()[0].samples


@pytest.mark.parametrize(
    ("error_um", "peak_um", "leaves"),
    [(1.9, 0.1, False), (-2.1, 0.1, True), (5.9, 3.0, False), (-6.1, 3.0, True)],
)
def test_a_tool_leaves_where_it_is_off_by_twice_and_2_um(error_um: float, peak_um: float, leaves: bool) -> None:
    assert bool(is_leaving(error_um, np.float64(peak_um))) is leaves


@pytest.mark.parametrize(
    ("stage", "left_um_pp"), [(Stage.AIR, None), (Stage.PARTIAL, (27.5, 82.5)), (Stage.FULL, None)]
)
def test_the_half_stage_alone_tells_what_it_leaves(stage: Stage, left_um_pp: tuple[float, float] | None) -> None:
    """Of 55 um the half, or as much more."""
    told = plan_run(JOB, MACHINE, Strategy.PVT, stage=stage, simulated=True).expected_residual
    assert (None if told is None else (told.right_um_pp, told.wrong_um_pp)) == left_um_pp


def test_a_lost_cut_may_have_gone_on_unseen_for_a_turn_and_as_long_as_the_controller_takes_to_end_it() -> None:
    """6.3 s at 1000 rpm are 105 turns."""
    lathe: Any = SimpleNamespace(ends_within_s=6.3, machine=MACHINE)
    before = known(_find_earlier_cut(lathe, plan(), touched_mm=2.5))
    assert before.to_mm == 2.5
    assert before.unseen_mm == pytest.approx(106.0 * JOB.feed_mm_per_rev)
    assert _find_earlier_cut(lathe, plan(), touched_mm=0.0) is None


HOMED = frozenset({"home_complete"})


def look(at_s: float, counts: float, flags: frozenset[str] = HOMED) -> Snapshot:
    rest = AxisState(position=0.0, following_error=0.0, flags=flags)
    spindle = AxisState(position=counts, following_error=0.0, flags=flags)
    return Snapshot(
        asked_s=at_s,
        at_s=at_s,
        tool=rest,
        spindle=spindle,
        carriage=rest,
        program_running=False,
        runtime_error=False,
    )


UNHOMED = frozenset[str]()
POLLED: dict[str, list[tuple[float, float, frozenset[str], float | None]]] = {
    "a tenth of a turn in a quarter of a second": [(100.0, 350.0, HOMED, None), (100.25, 1350.0, HOMED, 24.0)],
    "a second later all is forgotten": [
        *((0.0, 0.0, HOMED, None), (0.5, 80_000.0, HOMED, 960.0)),
        *((1.6, 80_000.0, HOMED, None), (1.7, 80_000.0, HOMED, 0.0)),
    ],
    "the same poll twice": [(0.0, 0.0, HOMED, None), (0.0, 0.0, HOMED, None)],
    "a new zero is no turn": [
        *((0.0, 7300.0, UNHOMED, None), (0.1, 7300.0, UNHOMED, 0.0)),
        *((0.2, 0.0, HOMED, None), (0.3, 0.0, HOMED, 0.0)),
    ],
}


@pytest.mark.parametrize("case", POLLED)
def test_the_speed_of_the_spindle_is_that_of_its_polls(case: str) -> None:
    watch = SpindleWatch(10_000)
    for at_s, counts, flags, rpm in POLLED[case]:
        found = watch.see(look(at_s, counts, flags))
        assert found == (None if rpm is None else pytest.approx(rpm))


def test_what_is_forgotten_is_not_told_of() -> None:
    watch = SpindleWatch(10_000)
    watch.see(look(0.0, 0.0))
    watch.see(look(0.5, 80_000.0))
    watch.forget()
    assert [watch.see(look(at_s, 80_000.0)) for at_s in (0.6, 0.7)] == [None, 0.0]


@given(st.floats(-3000.0, 3000.0), st.lists(st.floats(0.01, 0.3), min_size=2, max_size=60))
def test_a_steady_speed_is_told_whatever_the_looks(rpm: float, pauses_s: list[float]) -> None:
    watch, at_s, told = SpindleWatch(10_000), 0.0, None
    for pause_s in pauses_s:
        at_s += pause_s
        told = watch.see(look(at_s, rpm / 60.0 * 10_000.0 * at_s))
    assert told == pytest.approx(rpm, abs=1e-6)


SHORT = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.6)


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

    def measure(self, *, turned_deg: float = 0.0) -> Trace:
        return self.sim.measure(turned_deg=turned_deg)

    def sections(self) -> tuple[PartSection, ...]:
        return self.sim.sections()

    def indicate(self, places: int | None = None) -> ClampReadings:
        return self.sim.indicate(places)

    def indicate_band(self, behind_face_mm: float) -> BandReadings:
        return self.sim.indicate_band(behind_face_mm)

    def look(self) -> WorkshopView:
        return self.sim.look()

    def set_spindle(self, rpm: float | None) -> None:
        self.sim.set_spindle(None if rpm is None else self._set_rpm)


def cut_at(machine: MachineProfile, set_rpm: float) -> tuple[Floor, float]:
    floor = Floor(machine, set_rpm)
    plan = plan_run(SHORT, machine, Strategy.TIMEBASE, watchdog=cut_condition(machine))
    trace = known(cut_part(floor.context, SHORT, plan.cut, lambda step, detail: None).trace)
    return floor, evaluate(trace.angle_deg, trace.deviation_um, 50.0).ront_um


def test_a_part_is_round_on_a_spindle_that_somebody_else_turns(machine: MachineProfile) -> None:
    floor, ront_um = cut_at(machine, SHORT.spindle_speed_rpm)
    assert ront_um < 1.0
    assert not floor.sim.controller.motors[machine.spindle.motor].enabled, "the card never drove it"


def test_a_spindle_at_another_speed_is_not_cut_on(machine: MachineProfile) -> None:
    with pytest.raises(SessionError) as refused:
        cut_at(machine, 0.9 * SHORT.spindle_speed_rpm)
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
def test_the_command_has_no_part_to_compare(console: Console, tmp_path: Path, job_file: JobFile) -> None:
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
