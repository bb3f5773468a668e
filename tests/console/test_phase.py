"""By how much tool and lobe may be out of phase; figures, progress and evenness of a cut."""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from console.session.cut.telemetry import (
    ORDERS,
    WITHIN_LIMIT_PERCENT,
    PhaseLag,
    expected_lag,
    is_in_phase,
    lag_left_um_pp,
    phase_limit_deg,
    phase_of,
    spindle_ripple,
)
from console.session.learning.part_learning import accept
from console.session.station.commands import Acknowledge, DisableDrives, Recover, Retract, Start
from console.session.station.progress import CutPhase, CutProgress, CutStage
from drivers.cutting.planning import Strategy
from drivers.lathe.polling import Poller
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.simulator.plant.spindle import SimulatedSpindle
from profiles.compensations.learned_compensation import PartReading
from profiles.compensations.path import LobedPath, PathHarmonic, target_path
from profiles.store import load_job, load_machine
from tests.console.commands import JobFile
from tests.console.floor import Floor, codes, experiment_1, known, open_floor, order, set_up_once
from tests.console.test_learning_on_the_screen import Shop, lesson
from tests.drivers.conftest import Recorder
from tests.system.lathe_sites import compact_text


def path(lobe_um_pp: float, lobes: int = 3) -> LobedPath:
    return LobedPath(mean_um=100.0, amplitude_um=lobe_um_pp / 2.0, lobes=lobes, phase_deg=40.0)


def left_um(lobe_um_pp: float, lobes: int, late_deg: float) -> float:
    """What is left of a lobe that is cut so late, um peak to peak, by subtracting one sine from the other."""
    angle = np.radians(np.arange(0.0, 360.0, 0.05))
    lobe, cut = (np.cos(lobes * (angle - late)) for late in (0.0, math.radians(late_deg)))
    return float(np.ptp(0.5 * lobe_um_pp * (lobe - cut)))


@given(st.floats(2.0, 200.0), st.integers(2, 6), st.floats(0.5, 50.0))
def test_the_limit_leaves_four_fifths_of_it(lobe_um_pp: float, lobes: int, tolerance_um: float) -> None:
    """Never tighter than the 2 um that can be measured, and never looser than the tolerance."""
    allowed_um = min(max(0.8 * tolerance_um, 2.0), tolerance_um)
    limit_deg = phase_limit_deg(path(lobe_um_pp, lobes), tolerance_um)
    if limit_deg is None:
        assert left_um(lobe_um_pp, lobes, 180.0 / lobes) <= allowed_um * 1.0001
    else:
        assert left_um(lobe_um_pp, lobes, limit_deg) == pytest.approx(allowed_um, rel=1e-3)


def test_the_limits_of_the_jobs_of_the_paper() -> None:
    """55 and 33 um with three lobes, to 5 um: 4 um are left at 2/3 asin(4/110) and 2/3 asin(4/66) of a radian."""
    for lobe_um_pp, limit_deg in ((55.0, 1.389), (33.0, 2.316)):
        assert phase_limit_deg(path(lobe_um_pp), 5.0) == pytest.approx(limit_deg, abs=5e-4)
    assert phase_limit_deg(path(0.02, 6), 5.0) is None
    assert phase_limit_deg(path(0.0), 5.0) is None


@pytest.mark.parametrize(
    ("error_deg", "within_deg", "limit_deg", "in_phase"),
    [
        (1.3, 0.1, 1.4, True),
        (1.6, 0.1, 1.4, False),
        (1.6, 0.3, 1.4, True),  # it may be within
        (12.0, 13.0, 1.4, False),  # a tool that is jammed is known to nothing
        (-1.6, 0.1, 1.4, False),
        (40.0, 0.1, None, True),
        (0.0, 0.0, 0.4, True),  # on its path, however narrow the limit
    ],
)
def test_out_of_phase_is_surely_beyond_the_limit(
    error_deg: float, within_deg: float, limit_deg: float | None, in_phase: bool
) -> None:
    assert is_in_phase(PhaseLag(error_deg=error_deg, within_deg=within_deg), limit_deg) is in_phase
    assert is_in_phase(None, limit_deg) is None


def learned_from(version_target: LobedPath, tool: PathHarmonic | None) -> PartReading:
    """A part that taught something, cut with the path of a job."""
    lobe = PathHarmonic.from_coefficient(3, 3.0 + 0j)
    return PartReading(
        version=0,
        fraction=1.0,
        target=version_target.harmonics[0],
        lobe=lobe,
        lobe_sd_um=0.1,
        ront_um=9.0,
        tool=tool,
    )


def test_where_it_is_not_recorded_a_tool_between_a_learned_path_and_that_of_the_job_is_in_phase() -> None:
    # The part was 6 degrees late. Either the tool was, and is so again behind a path that is earlier by as much,
    # or the lobe is elsewhere, and the tool follows the learned path. Both make a round part.
    job = load_job("lee-2001-experiment-1").job
    of_job = target_path(job)

    def allowed(turned_deg: float, *late_deg: float) -> list[bool | None]:
        expected = expected_lag(of_job.turn_by(turned_deg), job, learned_from(of_job, None))
        return [is_in_phase(PhaseLag(error_deg=late, within_deg=0.0), 1.4, expected) for late in late_deg]

    assert expected_lag(of_job, job, None) == (0.0, 0.0)
    assert allowed(-6.0, -2.0, 0.0, 6.0, 8.0) == [False, True, True, False]
    assert allowed(6.0, -8.0, -6.0, 0.0, 2.0) == [False, True, True, False]


def test_a_learned_path_counts_on_the_lag_of_the_part_that_taught_it() -> None:
    # The tool led 27.5 um of lobe by 6 um across it: atan(6/27.5) = 12.31 deg of lobe, 4.10 of the spindle. Ahead
    # of a path of 34 um, turned by 7 deg, the same 6 um are atan(6/34) = 10.01 deg of lobe, 3.34 of the spindle.
    job = load_job("lee-2001-experiment-1").job
    before = target_path(job)
    across = PathHarmonic.from_coefficient(3, 6j * cmath.exp(-3j * math.radians(before.phase_deg)))
    part, path_ = learned_from(before, across), replace(before.turn_by(7.0), amplitude_um=34.0)
    expected = expected_lag(path_, job, part)
    assert expected == pytest.approx((-3.34, -3.34), abs=0.005)
    assert [
        is_in_phase(PhaseLag(error_deg=late, within_deg=0.0), 1.1, expected) for late in (-4.4, -2.3, 0.0)
    ] == [*(True, True, False)]
    half = replace(path_, amplitude_um=17.0)
    assert expected_lag(half, job, part, 0.5) == pytest.approx(expected), "half of the path, half of the error"


@given(st.floats(2.0, 200.0), st.integers(2, 6), st.floats(-10.0, 10.0))
def test_what_a_lag_leaves_is_told_in_um(lobe_um_pp: float, lobes: int, late_deg: float) -> None:
    assert lag_left_um_pp(path(lobe_um_pp, lobes), late_deg) == pytest.approx(
        left_um(lobe_um_pp, lobes, late_deg), rel=1e-3, abs=1e-3
    )


def cut(floor: Floor, strategy: Strategy = Strategy.PVT) -> list[float]:
    """Cut experiment 1 to its end, and return the phase errors that were seen, deg."""
    seen: list[float] = []

    def look(_: object) -> None:
        now = floor.state.cut
        if now is not None and now.stage is CutStage.CUT and now.phase is not None:
            seen.append(now.phase.error_deg)

    floor.looks.append(look)
    floor.arm(experiment_1(2.0), strategy)
    assert floor.do(Start()).cut_done, floor.state.refusals
    floor.looks.remove(look)
    return seen


@pytest.mark.parametrize(
    ("seed", "strategy"), [(1, Strategy.PVT), pytest.param(3, Strategy.CAM, marks=pytest.mark.long)]
)
@pytest.mark.long
def test_realistic_cuts_by_the_model_do_not_cry_wolf(tmp_path: Path, seed: int, strategy: Strategy) -> None:
    """Such a servo gives way to the cut, and is 0.9 deg late: 2.6 um of 55, of the 5 um that the part may have."""
    floor = open_floor(tmp_path, seed=seed, plant="steady")
    floor.set_up(experiment_1(2.0))
    seen = cut(floor, strategy)
    assert len(seen) > 40 and 0.6 < abs(float(np.mean(seen))) < 1.2
    assert floor.state.alarms == ()


@pytest.mark.long
def test_out_of_phase_is_over_with_its_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_copies: None
) -> None:
    """Half the gain of the tool is a lag. After the cut the operator acknowledges, and cuts a good part.

    Nobody reads the settings beside the polls here: that would stop the cut.
    """
    monkeypatch.setattr(Poller, "read_beside", lambda _: None)
    floor, job = set_up_once(tmp_path), experiment_1(2.0)
    motor = floor.context.machine.tool.motor
    gain = floor.context.machine.controller.variables[f"I{motor}30"]

    def set_gain(share: float) -> None:
        floor.sim.controller.variables.replace_i({**_settings(floor), motor * 100 + 30: share * gain})

    def in_the_part(_: Snapshot) -> bool:
        return floor.state.cut is not None and floor.state.cut.stage is CutStage.CUT

    floor.when(in_the_part, lambda: set_gain(0.5))
    floor.when(lambda _: bool(floor.state.alarms), lambda: set_gain(1.0))
    floor.arm(job)
    floor.do(Start())
    told = {alarm.problem.code: alarm.active for alarm in floor.idle().alarms}
    assert told["cut.out_of_phase"] is False, "it was of that cut, which is over"
    while floor.state.alarms and not all(alarm.acknowledged for alarm in floor.state.alarms):
        assert floor.station.post(Acknowledge())
    assert "cut.out_of_phase" not in [alarm.problem.code for alarm in floor.state.alarms]
    if floor.state.stop is not None:  # a cut that was not as planned is ended
        floor.do(Recover())
    floor.do(Retract(), DisableDrives())
    floor.set_up(job)
    cut(floor)
    assert floor.idle().alarms == ()


def _settings(floor: Floor) -> dict[int, float]:
    return {index: floor.sim.controller.variables.i(index) for index in range(1024)}


@pytest.mark.long
def test_a_learned_part_is_judged_by_its_lag(tmp_path: Path, job_file: JobFile, data_folder: Path) -> None:
    """This tool gives way to the cut by 4 um across the lobe. Beyond that, 2.5 deg are told: 9 um of 70."""
    lathe = tmp_path / "lathe.toml"
    lathe.write_text(compact_text("pmac"), encoding="utf-8")
    job, machine = load_job(str(job_file(cut_length_mm="1.5"))), load_machine(str(lathe))
    floor = open_floor(data_folder / "trilobe", 4, "realistic", machine)
    floor.set_up(job.job)
    shop = Shop(floor=floor, job=job, machine=machine, data=data_folder / "trilobe")
    version = accept(lesson(shop.part()), shop.data)
    assert "cut.tool_leads" in codes(floor.state), "nothing was learned yet"
    order(floor, Acknowledge())
    part = shop.part(compensation=version)
    assert 2.0 * part.result.amplitude_um(3) < 4.0
    assert not [code for code in codes(floor.idle()) if code in ("cut.tool_leads", "cut.out_of_phase")]
    shop.clamp()
    armed = shop.armed(compensation=version)
    target = armed.plan.target
    late = replace(armed.plan, target=replace(target, phase_deg=target.phase_deg - 2.5))
    floor.context.tell(armed=replace(armed, plan=late))
    floor.do(Start())
    assert "cut.out_of_phase" in codes(floor.state)


WANTED = LobedPath(mean_um=100.0, amplitude_um=27.5, lobes=3, phase_deg=40.0)


@given(st.floats(-20.0, 20.0), st.floats(0.5, 1.5), st.integers(0, 1000))
def test_the_phase_error_is_how_far_the_tool_is_behind(lag_deg: float, gain: float, seed: int) -> None:
    """A tool that makes the wanted sine `lag_deg` of the spindle later, looked at at any angles."""
    angle = np.random.default_rng(seed).uniform(0.0, 3600.0, 60)
    infeed = 100.0 + gain * 27.5 * np.cos(3.0 * np.radians(angle - lag_deg - 40.0))
    found = known(phase_of(np.stack([angle, infeed], axis=1), WANTED))
    assert found.error_deg == pytest.approx(lag_deg, abs=1e-6)
    assert found.within_deg < 1e-6


def test_a_phase_is_known_to_what_is_told_of_it() -> None:
    """Noise of 1 um on the 60 looks at 27.5 um of amplitude: the 19 of 20 that two standard deviations make up."""
    random = np.random.default_rng(5)
    within = 0
    for _ in range(400):
        angle = random.uniform(0.0, 3600.0, 60)
        infeed = 100.0 + 27.5 * np.cos(3.0 * np.radians(angle - 0.7 - 40.0)) + random.normal(0.0, 1.0, 60)
        found = known(phase_of(np.stack([angle, infeed], axis=1), WANTED))
        within += abs(found.error_deg - 0.7) <= found.within_deg
    assert 0.92 * 400 < within < 0.98 * 400


@pytest.mark.parametrize("seed", range(10))
def test_a_part_that_pushes_the_tool_off_where_it_begins_shifts_no_phase(seed: int) -> None:
    """25 um within some turns, halfway through the 60 looks at what is cut 0.9 degrees late."""
    angle = np.sort(np.random.default_rng(seed).uniform(0.0, 30_000.0, 60))
    infeed = 100.0 + 27.5 * np.cos(3.0 * np.radians(angle - 0.9 - 40.0))
    pushed = infeed - 25.0 * (1.0 - np.exp(-np.maximum(angle - 15_000.0, 0.0) / 2000.0))
    found = known(phase_of(np.stack([angle, pushed], axis=1), WANTED))
    assert found.error_deg == pytest.approx(0.9, abs=0.5)


def test_an_eccentric_and_oval_blank_is_not_called_a_lag_while_its_samples_are_few() -> None:
    """Tools on their path, seen 20 to 45 times, pushed 6 um once and 4 um twice a turn by the blank."""
    random, out = np.random.default_rng(7), 0
    for number in range(400):
        angle = np.sort(random.uniform(0.0, 7200.0, 20 + number % 25))
        once, twice = random.uniform(0.0, 360.0, 2)
        pushed = 6.0 * np.cos(np.radians(angle - once)) + 4.0 * np.cos(np.radians(2.0 * (angle - twice)))
        infeed = 100.0 + 27.5 * np.cos(3.0 * np.radians(angle - 40.0)) + pushed
        out += is_in_phase(phase_of(np.stack([angle, infeed], axis=1), WANTED), 1.0) is False
    assert out == 0


def test_of_enough_samples_what_the_blank_adds_once_twice_and_six_times_a_turn_is_no_part_of_the_phase() -> None:
    """60 of them, of a tool 0.7 degrees late: the phase is known as without the blank."""
    angle = np.sort(np.random.default_rng(3).uniform(0.0, 7200.0, 60))
    waves = ((6.0, 1, 10.0), (4.0, 2, 50.0), (2.0, 6, 20.0))
    pushed = sum(um * np.cos(order * np.radians(angle - crest_deg)) for um, order, crest_deg in waves)
    infeed = 100.0 + 27.5 * np.cos(3.0 * np.radians(angle - 0.7 - 40.0)) + pushed
    found = known(phase_of(np.stack([angle, infeed], axis=1), WANTED))
    assert found.error_deg == pytest.approx(0.7, abs=1e-6)
    assert found.within_deg < 1e-6


def test_without_a_lobe_there_is_no_phase() -> None:
    looks = np.stack([np.linspace(0.0, 360.0, 60), np.full(60, 100.0)], axis=1)
    assert phase_of(looks, WANTED) is None
    flat = LobedPath(mean_um=100.0, amplitude_um=0.0, lobes=3, phase_deg=0.0)
    assert phase_of(looks, flat) is None


@pytest.mark.long
def test_a_cut_is_followed_from_its_start_to_its_end(tmp_path: Path, in_copies: None) -> None:
    floor = set_up_once(tmp_path)
    floor.arm(experiment_1(3.0))
    seen: list[CutProgress] = []
    times_s: dict[CutStage, float] = {}

    def look(snapshot: Snapshot) -> None:
        if floor.state.cut is not None:
            seen.append(floor.state.cut)
            times_s.setdefault(floor.state.cut.stage, snapshot.at_s)

    floor.looks.append(look)
    floor.do(Start())
    stages = list(dict.fromkeys(moment.stage for moment in seen))
    assert stages == [CutStage.POSITION, CutStage.RUN_UP, CutStage.CUT, CutStage.RETRACT]
    assert all(a.fraction <= b.fraction for a, b in itertools.pairwise(seen))
    cutting = [moment for moment in seen if moment.stage is CutStage.CUT]
    steady = cutting[len(cutting) // 2 :]
    assert all(moment.speed_rpm == pytest.approx(1000.0, abs=2.0) for moment in steady)
    assert all(moment.phase is None or abs(moment.phase.error_deg) < 0.1 for moment in steady)
    assert max(abs(moment.tool_error_um) for moment in steady) < 2.0
    last = known(floor.state.cut)
    assert (last.turn, last.fraction) == (60.0, 1.0)
    # 60 turns of 60 ms in the part: what is left goes down to nothing, and so does the way of the carriage.
    left_s = [moment.phases[0].left_s for moment in cutting]
    assert {moment.phases[0].phase for moment in cutting} == {CutPhase.CUT}
    assert left_s == sorted(left_s, reverse=True) and left_s[0] == pytest.approx(3.6, abs=0.1)
    assert [each.phase for each in cutting[0].phases] == [CutPhase.CUT, CutPhase.RETRACT, CutPhase.HOME]
    (last_to_go,) = cutting[-1].to_go
    assert last_to_go.axis is AxisName.CARRIAGE and last_to_go.left < 0.1
    run_up = [moment for moment in seen if moment.stage is CutStage.RUN_UP]
    took_s = times_s[CutStage.CUT] - times_s[CutStage.RUN_UP]
    assert run_up[0].phases[0].left_s == pytest.approx(took_s, abs=0.2)
    # The line that the controller plays, by its own listing: the longest one, in the loop of the turns.
    places = {moment.place.text: moment.place.line for moment in steady if moment.place is not None}
    assert len(places) == 1
    ((text, line),) = places.items()
    assert floor.context.plan is not None and line is not None
    assert text.startswith("X(P11+P12*P55*COS(P27))")
    assert floor.context.plan.program.lines[-1 - len(floor.context.plan.program.program) + line - 1] == text


TURN = 10_000
Floats = NDArray[np.float64]


def swinging(mean: Floats, share: float, per_turn: int, turn: float = TURN) -> Floats:
    """What is read of a spindle whose speed swings by a share, where an even one would be at `mean` counts."""
    wave = 2.0 * np.pi * per_turn / turn
    position = np.round(mean + share / wave * np.sin(wave * mean))
    return np.column_stack([position, mean - position])


@pytest.mark.parametrize("per_turn", range(1, 7))
def test_a_swing_of_one_percent_is_told_from_once_to_six_times_a_turn(per_turn: int) -> None:
    """Belts, jaws, gears and poles, of 240 looks."""
    mean = np.sort(np.random.default_rng(per_turn).uniform(0.0, 100.0 * TURN, 240))
    told = known(spindle_ripple(swinging(mean, 0.01, per_turn), TURN))
    assert told.percent == pytest.approx(2.0, abs=0.2)


@given(
    st.floats(0.0, 0.05),
    st.sampled_from(ORDERS),
    st.integers(40, 240),
    st.integers(0, 1000),
)
def test_a_swing_is_told_within_its_bound(share: float, per_turn: int, looks: int, seed: int) -> None:
    """A speed of v (1 + share cos) goes from 1 - share to 1 + share of its mean."""
    mean = np.sort(np.random.default_rng(seed).uniform(0.0, 100.0 * TURN, looks))
    told = spindle_ripple(swinging(mean, share, per_turn), TURN)
    if told is not None:
        assert told.percent == pytest.approx(200.0 * share, abs=told.within_percent + 0.02 * 200.0 * share)
        assert told.within_percent <= WITHIN_LIMIT_PERCENT
    assert told is not None or looks < 120


def test_a_lag_that_grows_is_no_swing() -> None:
    mean = np.random.default_rng(1).uniform(0.0, 100.0 * TURN, 240)
    looks = swinging(mean, 0.01, 2)
    looks[:, 1] += 30.0 + 1e-4 * mean
    told = known(spindle_ripple(looks, TURN))
    assert told.percent == pytest.approx(2.0, abs=told.within_percent)


def test_too_few_places_too_coarse_an_encoder_or_a_spindle_at_rest_tell_no_ripple() -> None:
    """240 looks at 3, 5, 2, 1 or 8 places: a swing of a higher order looks like one of a lower.

    Half a count of 1000 in a turn is 0.18 deg: a swing of 1 % twice a turn moves the angle by 0.29 deg.
    """
    for stride in (1 / 3, 0.4, 0.5, 1.0, 2.125):
        assert spindle_ripple(swinging(stride * TURN * np.arange(240.0), 0.03, 2), TURN) is None
    places = np.random.default_rng(2).uniform(0.0, 100.0, 240)
    assert spindle_ripple(swinging(1000.0 * places, 0.01, 2, turn=1000.0), 1000.0) is None
    assert spindle_ripple(swinging(TURN * places, 0.01, 2), TURN) is not None
    for count in (0, 1, 39):
        assert spindle_ripple(swinging(TURN * places[:count], 0.01, 2), TURN) is None
    assert spindle_ripple(np.tile([1234.0, 0.0], (240, 1)), TURN) is None


# On the simulated lathe -----------------------------------------------------------------------------------------


def swing_of_the_iron(positions: Floats) -> float:
    """Peak to peak of the speed over its mean, percent: mean steps of a servo cycle in 60 sectors of a turn."""
    steps = np.diff(positions)
    sectors = np.floor((positions[:-1] % TURN) * 60 / TURN).astype(int)
    means = np.array([steps[sectors == sector].mean() for sector in range(60)])
    return 100.0 * float(np.ptp(means)) / float(steps.mean())


@pytest.mark.parametrize(
    ("strategy", "share", "per_turn"),
    [
        (Strategy.PVT, 0.0, 2),
        pytest.param(Strategy.TIMEBASE, 0.02, 3, marks=pytest.mark.long),
        (Strategy.CAM, 0.05, 1),
    ],
)
@pytest.mark.long
def test_a_cut_tells_the_swing_of_its_spindle(
    tmp_path: Path, in_copies: None, strategy: Strategy, share: float, per_turn: int
) -> None:
    """By every servo cycle of the iron in the part, on a lathe that is not what its profile says."""
    floor, job = set_up_once(tmp_path, "steady"), experiment_1(2.0)
    motor = floor.sim.controller.motors[2]
    spindle = cast("SimulatedSpindle", motor.axis)
    spindle.speed_ripple, spindle.ripple_per_turn = share, per_turn
    floor.arm(job, strategy)
    recorder = motor.axis = Recorder(spindle)
    in_part: list[int] = []

    def look(_: Snapshot) -> None:
        if floor.state.cut is not None and floor.state.cut.stage == "cut":
            in_part.append(len(recorder.positions))

    floor.looks.append(look)
    floor.do(Start())
    cut = known(floor.state.cut)
    assert cut.ripple is not None
    true_position = swing_of_the_iron(np.array(recorder.positions[in_part[0] : in_part[-1]]))
    assert cut.ripple.percent == pytest.approx(true_position, abs=cut.ripple.within_percent)
    assert true_position == pytest.approx(200.0 * share, abs=0.1)
