"""By how much tool and lobe may be out of phase, and that realistic cuts by the model do not cry wolf."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.cut.telemetry import Phase, expected_lag, is_in_phase, lag_left_um_pp, phase_limit_deg
from console.session.learning.part_learning import accept
from console.session.station.commands import Acknowledge, DisableDrives, Recover, Retract, Start
from console.session.station.progress import CutStage
from drivers.cutting.planning import Strategy
from drivers.lathe.polling import Poller
from drivers.lathe.snapshot import Snapshot
from profiles.compensations.learned import PartRead
from profiles.compensations.path import LobedPath, PathHarmonic, target_path
from profiles.store import load_job, load_machine
from tests.console.commands import JobFile
from tests.console.floor import Floor, codes, experiment_1, open_floor, order, set_up_once
from tests.console.test_learning_on_the_screen import Shop, lesson
from tests.system.lathe_sites import compact_text


def path(lobe_um_pp: float, lobes: int = 3) -> LobedPath:
    return LobedPath(mean_um=100.0, amplitude_um=lobe_um_pp / 2.0, lobes=lobes, phase_deg=40.0)


def left_um(lobe_um_pp: float, lobes: int, late_deg: float) -> float:
    """What is left of a lobe that is cut so late, um peak to peak, by subtracting one sine from the other."""
    angle = np.radians(np.arange(0.0, 360.0, 0.05))
    lobe, cut = (np.cos(lobes * (angle - late)) for late in (0.0, math.radians(late_deg)))
    return float(np.ptp(0.5 * lobe_um_pp * (lobe - cut)))


@given(st.floats(2.0, 200.0), st.integers(2, 6), st.floats(0.5, 50.0))
def test_at_the_limit_the_phase_leaves_four_fifths_of_the_tolerance(
    lobe_um_pp: float, lobes: int, tolerance_um: float
) -> None:
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
    assert is_in_phase(Phase(error_deg=error_deg, within_deg=within_deg), limit_deg) is in_phase
    assert is_in_phase(None, limit_deg) is None


def learned_from(version_target: LobedPath, tool: PathHarmonic | None) -> PartRead:
    """A part that taught something, cut with the path of a job."""
    lobe = PathHarmonic.of(3, 3.0 + 0j)
    return PartRead(
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
        expected = expected_lag(of_job.turned(turned_deg), job, learned_from(of_job, None))
        return [is_in_phase(Phase(error_deg=late, within_deg=0.0), 1.4, expected) for late in late_deg]

    assert expected_lag(of_job, job, None) == (0.0, 0.0)
    assert allowed(-6.0, -2.0, 0.0, 6.0, 8.0) == [False, True, True, False]
    assert allowed(6.0, -8.0, -6.0, 0.0, 2.0) == [False, True, True, False]


def test_a_learned_path_counts_on_the_lag_of_the_part_that_taught_it() -> None:
    # The tool led 27.5 um of lobe by 6 um across it: atan(6/27.5) = 12.31 deg of lobe, 4.10 of the spindle. Ahead
    # of a path of 34 um, turned by 7 deg, the same 6 um are atan(6/34) = 10.01 deg of lobe, 3.34 of the spindle.
    job = load_job("lee-2001-experiment-1").job
    before = target_path(job)
    across = PathHarmonic.of(3, 6j * cmath.exp(-3j * math.radians(before.phase_deg)))
    part, path_ = learned_from(before, across), replace(before.turned(7.0), amplitude_um=34.0)
    expected = expected_lag(path_, job, part)
    assert expected == pytest.approx((-3.34, -3.34), abs=0.005)
    assert [is_in_phase(Phase(error_deg=late, within_deg=0.0), 1.1, expected) for late in (-4.4, -2.3, 0.0)] == [
        *(True, True, False)
    ]
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
def test_out_of_phase_is_over_with_its_cut_and_leaves_when_it_was_seen(
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
    floor.do(Retract())
    floor.do(DisableDrives())
    floor.set_up(job)
    cut(floor)
    assert floor.idle().alarms == ()


def _settings(floor: Floor) -> dict[int, float]:
    return {index: floor.sim.controller.variables.i(index) for index in range(1024)}


@pytest.mark.long
def test_a_learned_part_is_judged_about_the_lag_that_taught_it(
    tmp_path: Path, job_file: JobFile, data_folder: Path
) -> None:
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
