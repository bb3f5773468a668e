"""A half stage on lathes whose lobe is elsewhere: the force says so. What the push of a cut leaves."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pytest import MonkeyPatch

from benchmarks.feed_hold import ABOUT_HOLD_MM, Cutting, figures, row_fall_um
from console.session.cut.engine import CutContext
from console.session.cut.force_watch import MOST_SAMPLES, ForceWatch
from console.session.cut.in_process import simulated_context
from console.session.cut.run import RunResult, plan_run, run_once
from console.session.force_record import ForceCheck, against_full, force_event, force_of
from console.session.guide.start_checks import checks
from console.session.stages import Stage
from console.session.station.commands import Arm, Start
from console.session.station.state import StationState
from console.session.work import Work, open_work
from drivers.controller import Controller
from drivers.cutting.planning import CutPlan
from drivers.cutting.sampling import BatchGather
from drivers.cutting.strategy import Strategy
from drivers.errors import LinkTimeoutError
from drivers.pmac.gathering.gather import GatherError
from drivers.pmac.gathering.gather_client import DataGathering
from drivers.simulator.plant.presets import plant_named
from profiles.compensations.force_null import ForceNull, ForceNullReason, Sign, unknown
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.store import LoadedMachine, load_job, load_machine
from tests.compact import close_together, compact_machine
from tests.console.commands import Console, JobFile
from tests.console.floor import Floor, experiment_1, known, open_floor
from tests.system.lathe_sites import compact_text


def cut(
    plant: str = "steady",
    turned_deg: float = 0.0,
    *,
    seed: int = 1,
    machine: MachineProfile | None = None,
    strategy: Strategy = Strategy.PVT,
    stage: Stage = Stage.PARTIAL,
    pressed: float = 1.0,
) -> RunResult:
    """Experiment 1 on a plant whose lobe is so much further on; a blank that was round before it was clamped."""
    machine = machine or compact_machine().machine
    true = plant_named(plant, machine, seed)
    true = replace(true, lobe_turned_deg=true.lobe_turned_deg + turned_deg, blank_pressed=pressed)
    plan = plan_run(experiment_1(), machine, strategy, stage=stage, simulated=True)
    context: CutContext = simulated_context(machine, true)[0]
    return run_once(plan, context, lambda *_: None)


def said(*args: Any, **more: Any) -> ForceNull:
    found = known(cut(*args, **more).force)
    return found


@pytest.mark.parametrize(
    ("turned_deg", "sign"), [(0.0, Sign.AGREES), (60.0, Sign.WRONG_SIGN), (30.0, Sign.TURNED)]
)
def test_the_force_says_whether_sign_and_angle_are_right(turned_deg: float, sign: Sign) -> None:
    found = said(turned_deg=turned_deg)
    assert found.sign is sign
    assert abs((found.turned_deg - turned_deg + 60.0) % 120.0 - 60.0) < found.turned_sd_deg < 6.0
    # 2.96 N at 0.1 mm; the tool is pushed off by some hundredths.
    assert 2.0 < found.mean_n < 3.0


def test_a_turbo_gathers_the_same() -> None:
    turbo = close_together(load_machine("turbo-ethernet-lathe").machine)
    assert said(turned_deg=60.0, machine=turbo).sign is Sign.WRONG_SIGN


@pytest.mark.first(1)
@pytest.mark.parametrize("strategy", [Strategy.CAM, Strategy.TIMEBASE])
def test_every_strategy_with_a_path_is_checked(strategy: Strategy) -> None:
    assert said(turned_deg=60.0, strategy=strategy).sign is Sign.WRONG_SIGN


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("plant", "pressed", "why"), [("ideal", 1.0, ForceNullReason.NO_FORCE), ("steady", 0.0, ForceNullReason.ROUND)]
)
def test_where_the_force_shows_nothing_it_says_why(plant: str, pressed: float, why: ForceNullReason) -> None:
    found = said(plant, 60.0, pressed=pressed)
    assert (found.sign, found.why, found.alarms) == (Sign.UNKNOWN, why, False)


@pytest.mark.parametrize("stage", [Stage.AIR, Stage.FULL])
def test_only_the_half_stage_is_checked(stage: Stage) -> None:
    assert cut(stage=stage).force is None


@pytest.mark.parametrize("lost", [False, True])
def test_a_controller_that_does_not_gather_or_a_lost_line_costs_the_check_alone(
    monkeypatch: MonkeyPatch, lost: bool
) -> None:
    request = DataGathering.start

    def refuse(*_: Any) -> None:
        raise GatherError("no room")

    def lose(self: DataGathering, plan: Any) -> None:
        client: Controller = self.client
        request(self, plan)
        raise LinkTimeoutError(Problem(code="link.no_answer", where=client.link.address))

    if lost:
        monkeypatch.setattr(DataGathering, "start", lose)
    else:
        monkeypatch.setattr(DataGathering, "prepare", refuse)
    result = cut()
    assert result.force is not None and result.force.why is ForceNullReason.NOT_GATHERED
    assert result.after is not None


@pytest.mark.long
@pytest.mark.parametrize("seed", range(1, 11))
def test_no_realistic_lathe_is_accused_and_each_wrong_sign_is_told(seed: int) -> None:
    right, wrong = (said("realistic", by_deg, seed=seed, strategy=Strategy.CAM) for by_deg in (0.0, 60.0))
    assert not right.alarms and wrong.sign is Sign.WRONG_SIGN


WRONG = """\
schema = 1
like = "steady"
[blank]
pressed_fraction = 1.0
[chuck]
lobe_turned_deg = {turned}
"""


def plant_file(folder: Path, turned_deg: float) -> str:
    path = folder / f"turned-{turned_deg:g}.toml"
    path.write_text(WRONG.format(turned=turned_deg), encoding="utf-8")
    return str(path)


def half(floor: Floor, **more: Any) -> StationState:
    floor.arm(experiment_1(), stage=Stage.PARTIAL, **more)
    return floor.do(Start())


def warned(state: StationState, work: Work, machine: LoadedMachine) -> list[str]:
    found = checks(state, work, machine.machine)
    return [problem.code for check in found if check.name == "force" for problem in check.warnings]


def test_on_the_screen_a_wrong_sign_is_warned_of_before_the_whole(tmp_path: Path) -> None:
    floor = open_floor(tmp_path, plant=plant_file(tmp_path, 60.0))
    floor.set_up(experiment_1())
    state = half(floor)
    assert state.cut is not None and state.cut.force is not None
    assert state.cut.force.sign is Sign.WRONG_SIGN and state.cut_done and state.stop is None
    machine = compact_machine()
    whole = replace(opened_work(machine), stage=Stage.FULL)
    assert warned(state, whole, machine) == ["force.wrong_sign"]
    assert warned(state, replace(whole, stage=Stage.PARTIAL), machine) == []
    other = replace(whole, job=replace(whole.job, depth_of_cut_mm=0.09))
    assert warned(state, other, machine) == []
    # Found again half a lobe further on, jaw 1 is where the force has it.
    alignment = state.alignment
    assert alignment.jaw is not None
    jaw = replace(alignment.jaw, angle_deg=(alignment.jaw.angle_deg + 60.0) % 360.0)
    assert warned(replace(state, alignment=replace(alignment, jaw=jaw)), whole, machine) == []


def opened_work(machine: LoadedMachine) -> Work:
    work = open_work(load_job("lee-2001-experiment-1"), machine)
    return replace(work, job=experiment_1())


@pytest.mark.long
def test_a_right_sign_warns_of_nothing(tmp_path: Path) -> None:
    floor = open_floor(tmp_path, plant=plant_file(tmp_path, 0.0))
    floor.set_up(experiment_1())
    state = half(floor)
    assert state.force is not None and state.force.found.sign is Sign.AGREES
    machine = compact_machine()
    assert warned(state, replace(opened_work(machine), stage=Stage.FULL), machine) == []


@pytest.mark.long
def test_the_command_says_it_and_warns_the_whole_run(console: Console, tmp_path: Path, job_file: JobFile) -> None:
    lathe = tmp_path / "lathe.toml"
    lathe.write_text(compact_text("pmac"), encoding="utf-8")
    job, wrong = str(job_file(cut_length_mm="1.5")), plant_file(tmp_path, 60.0)
    words = ("run", job, "--machine", str(lathe), "--sim", "--plant", wrong, "--seed", "2")
    found = console(*words, "--stage", "partial", "--json").json["force_null"]
    assert (found["sign"], found["why"], found["lobes"]) == ("wrong_sign", "", 3)
    assert abs(complex(*found["force_n"])) > 1.5 * abs(complex(*found["right_n"]))
    whole = console(*words, "--json")
    assert "the sign is wrong" in whole.err and "force_null" not in whole.json
    assert any("the sign is wrong" in each for each in whole.json["warnings"])
    # The whole part was the last one: it is not said twice.
    assert "sign of the compensation" not in console(*words, "--json").err
    spoken = console("--lang", "ko", *words, "--stage", "partial")
    assert "절삭력: 부호가 틀렸습니다" in spoken.out


@pytest.mark.long
def test_after_a_restart_arming_the_whole_says_it_from_the_record(tmp_path: Path, job_file: JobFile) -> None:
    job = load_job(str(job_file(cut_length_mm="1.5")))
    floor = open_floor(tmp_path / "data", plant=plant_file(tmp_path, 60.0))
    floor.set_up(job.job)
    order: dict[str, Any] = {"job": job.job, "job_sha256": job.sha256, "strategy": Strategy.PVT, "loaded": job}
    floor.do(Arm(**order, stage=Stage.PARTIAL), Start())
    floor.station.close("restart")
    again = open_floor(tmp_path / "data", plant=plant_file(tmp_path, 60.0))
    assert again.state.force is None
    again.set_up(job.job)
    state = again.do(Arm(**order, stage=Stage.FULL))
    machine = compact_machine()
    assert state.armed is not None
    assert warned(state, open_work(job, machine), machine) == ["force.wrong_sign"]


def test_five_turns_of_air_and_six_of_a_full_chip_are_gathered(monkeypatch: MonkeyPatch) -> None:
    """At 1000 rpm a turn is 60 ms: 135 servo cycles of 0.4427 ms. The chip is full after two turns."""
    prepared: dict[str, Any] = {}

    def prepare(_: BatchGather, plan: CutPlan, samples: int, seconds: float, take: object, **more: Any) -> None:
        prepared.update(more, samples=samples, seconds=seconds, plan=plan)

    monkeypatch.setattr(BatchGather, "prepare", prepare)
    machine = compact_machine().machine
    plan = plan_run(experiment_1(), machine, Strategy.PVT, stage=Stage.PARTIAL, simulated=True)
    context: CutContext = simulated_context(machine, plant_named("steady", machine, 1))[0]
    ForceWatch(context.lathe, plan.job).begin(plan.cut)
    assert plan.cut.spindle_speed_rpm == pytest.approx(1000.0, rel=0.001)
    setup, land_mm = plan.cut.setup, machine.tool.wiper_land_mm
    touches = setup.carriage_face - 0.5 * land_mm * machine.carriage.counts_per_mm
    air_turns = (touches - prepared["from_counts"]) / setup.carriage_per_turn
    assert 1.0 < air_turns <= 5.0 + 0.15 / 0.060 + 1e-9
    assert prepared["seconds"] == pytest.approx((air_turns + 2.0 + 6.0) * 0.060, rel=0.002)
    assert (prepared["samples"], prepared["thrust"]) == (135, True)
    ForceWatch(context.lathe, plan.job).begin(replace(plan.cut, spindle_speed_rpm=100.0))
    turns = prepared["seconds"] / 0.6
    assert 0.5 * MOST_SAMPLES < prepared["samples"] * turns <= MOST_SAMPLES, "a slow cut gathers less often"


TURNED = ForceNull(
    sign=Sign.TURNED,
    lobes=3,
    force_n=-0.7 + 0.2j,
    force_sd_n=0.03,
    right_n=-0.6j,
    wrong_n=1.0j,
    mean_n=2.6,
    ratio=0.1 - 0.9j,
    turned_deg=28.0,
    turned_sd_deg=2.5,
    air_turns=6,
    cut_turns=6,
)


def test_what_is_written_is_read_again_and_what_another_version_wrote_is_nothing() -> None:
    for found in (TURNED, replace(TURNED, sign=Sign.AGREES), unknown(3, ForceNullReason.ROUND)):
        assert force_of(json.dumps({"strategy": "cam", **force_event(found)})) == found
    nothing = ('{"force_null": 1}', '{"force_null": {"sign": "agrees"}}', '{"force_null": null}')
    assert [force_of(data) for data in ("{}", "[]", "{", *nothing)] == [None] * 6
    assert force_event(None) == {}


@pytest.mark.parametrize(
    ("moved_deg", "code"),
    [
        (0.0, "force.turned"),
        (28.0, None),
        (20.0, None),
        (-28.0, "force.wrong_sign"),  # 56 degrees of spindle are 168 of the lobe
        (148.0, None),
        (15.0, "force.turned"),
    ],
)
def test_it_stands_until_jaw_1_is_where_the_force_has_it(moved_deg: float, code: str | None) -> None:
    """Ten degrees of spindle are 30 of a lobe of three; 120 degrees further on is the same lobe."""
    said = against_full(TURNED, moved_deg)
    assert (None if said is None else said.code) == code


def test_it_is_said_of_its_job_alone() -> None:
    job = experiment_1()
    check = ForceCheck(job=job, found=TURNED)
    assert check.contradicts(job) is not None
    assert check.contradicts(replace(job, assumed=())) is not None
    assert check.contradicts(replace(job, lobe_phase_deg=job.lobe_phase_deg + 28.0)) is None
    assert check.contradicts(replace(job, depth_of_cut_mm=0.2)) is None
    assert ForceCheck(job=job, found=replace(TURNED, sign=Sign.AGREES)).contradicts(job) is None


DESIGNED = (766.0, 15326.0, 4.39)  # docs/tuning.md: V/m, V/(m s), V s/m


def cutting(
    strategy: Strategy, gains: tuple[float, ...] | None = DESIGNED, parts: int = 0, passive: float = 0.0
) -> Cutting:
    return Cutting(
        job_name="lee-2001-experiment-1",
        machine_name="lee-2001-lathe",
        strategy=strategy,
        plant="steady",
        parts=parts,
        gains=gains,
        passive_fraction=passive,
    )


@pytest.mark.long
@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE])
def test_with_a_stiff_loop_neither_entry_nor_hold_leaves_a_step(strategy: Strategy) -> None:
    """With one amplitude along Z: what is seen is of entry and hold alone."""
    found = figures(replace(cutting(strategy), one_lobe=True), 7)
    assert not found.refused
    assert found.fall_um is not None and abs(found.fall_um) < 1.0
    # Both of these parts scatter by some tenths of a um: friction and noise differ after the hold.
    assert found.step_um is not None and found.step_um < 1.0
    assert min(ABOUT_HOLD_MM) < -0.4 and max(ABOUT_HOLD_MM) > 0.4  # as long as the land reaches


@pytest.mark.long
@pytest.mark.parametrize("strategy", [Strategy.CAM, Strategy.PVT, Strategy.TIMEBASE])
def test_a_stated_force_takes_the_push_of_a_soft_loop_out(strategy: Strategy) -> None:
    found = figures(cutting(strategy, gains=None, passive=0.4), 7)
    assert not found.refused
    # Without it both are 17 to 19 um; what is left of the fall is dry friction.
    assert found.fall_um is not None and abs(found.fall_um) < 4.0
    assert found.step_um is not None and found.step_um < 1.5


@pytest.mark.long
def test_a_row_of_parts_learns_the_push_of_a_soft_loop() -> None:
    soft = cutting(Strategy.CAM, gains=None, parts=2)
    # With nothing learned the second part falls by 12 um, as the first does; the third falls by 0.1 um.
    assert abs(row_fall_um(soft, 7)) < 8.0
