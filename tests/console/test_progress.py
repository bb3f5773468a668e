"""The figures of a cut as it goes: phase against a sine of known lag, progress that ends at its end."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.cut.telemetry import is_in_phase, phase_of
from console.session.station.commands import Start
from console.session.station.progress import CutPhase, CutProgress, CutStage
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.compensations.path import LobedPath
from tests.console.floor import experiment_1, set_up_once

WANTED = LobedPath(mean_um=100.0, amplitude_um=27.5, lobes=3, phase_deg=40.0)


@given(st.floats(-20.0, 20.0), st.floats(0.5, 1.5), st.integers(0, 1000))
def test_the_phase_error_is_how_far_the_tool_is_behind(lag_deg: float, gain: float, seed: int) -> None:
    """A tool that makes the wanted sine `lag_deg` of the spindle later, looked at at any angles."""
    angle = np.random.default_rng(seed).uniform(0.0, 3600.0, 60)
    infeed = 100.0 + gain * 27.5 * np.cos(3.0 * np.radians(angle - lag_deg - 40.0))
    found = phase_of(np.stack([angle, infeed], axis=1), WANTED)
    assert found is not None and found.error_deg == pytest.approx(lag_deg, abs=1e-6)
    assert found.within_deg < 1e-6


def test_a_phase_is_known_to_what_is_told_of_it() -> None:
    """Noise of 1 um on the 60 looks at 27.5 um of amplitude: the 19 of 20 that two standard deviations make up."""
    random = np.random.default_rng(5)
    within = 0
    for _ in range(400):
        angle = random.uniform(0.0, 3600.0, 60)
        infeed = 100.0 + 27.5 * np.cos(3.0 * np.radians(angle - 0.7 - 40.0)) + random.normal(0.0, 1.0, 60)
        found = phase_of(np.stack([angle, infeed], axis=1), WANTED)
        assert found is not None
        within += abs(found.error_deg - 0.7) <= found.within_deg
    assert 0.92 * 400 < within < 0.98 * 400


@pytest.mark.parametrize("seed", range(10))
def test_a_part_that_pushes_the_tool_off_where_it_begins_shifts_no_phase(seed: int) -> None:
    """25 um within some turns, halfway through the 60 looks at what is cut 0.9 degrees late."""
    angle = np.sort(np.random.default_rng(seed).uniform(0.0, 30_000.0, 60))
    infeed = 100.0 + 27.5 * np.cos(3.0 * np.radians(angle - 0.9 - 40.0))
    pushed = infeed - 25.0 * (1.0 - np.exp(-np.maximum(angle - 15_000.0, 0.0) / 2000.0))
    found = phase_of(np.stack([angle, pushed], axis=1), WANTED)
    assert found is not None and found.error_deg == pytest.approx(0.9, abs=0.5)


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
    found = phase_of(np.stack([angle, infeed], axis=1), WANTED)
    assert found is not None and found.error_deg == pytest.approx(0.7, abs=1e-6)
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
    last = floor.state.cut
    assert last is not None and (last.turn, last.fraction) == (60.0, 1.0)
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
