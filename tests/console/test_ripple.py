"""How evenly the spindle turns: arithmetic on a swing that is known, and the iron of the simulated lathe."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from console.session.cut.telemetry import ORDERS, WITHIN_LIMIT_PERCENT, spindle_ripple
from console.session.station.commands import Start
from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.plant.spindle import Spindle
from tests.console.floor import experiment_1, set_up_once
from tests.drivers.conftest import Recorder

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
    told = spindle_ripple(swinging(mean, 0.01, per_turn), TURN)
    assert told is not None and told.percent == pytest.approx(2.0, abs=0.2)


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
    told = spindle_ripple(looks, TURN)
    assert told is not None
    assert told.percent == pytest.approx(2.0, abs=told.within_percent)


@pytest.mark.parametrize("stride", [1 / 3, 0.4, 0.5, 1.0, 2.125])
def test_looks_that_meet_few_places_of_a_turn_tell_nothing(stride: float) -> None:
    """240 looks at 3, 5, 2, 1 or 8 places: a swing of a higher order looks like one of a lower."""
    assert spindle_ripple(swinging(stride * TURN * np.arange(240.0), 0.03, 2), TURN) is None


def test_what_the_encoder_cannot_resolve_is_not_told() -> None:
    """Half a count of 1000 in a turn is 0.18 deg: a swing of 1 % twice a turn moves the angle by 0.29 deg."""
    places = np.random.default_rng(2).uniform(0.0, 100.0, 240)
    assert spindle_ripple(swinging(1000.0 * places, 0.01, 2, turn=1000.0), 1000.0) is None
    assert spindle_ripple(swinging(TURN * places, 0.01, 2), TURN) is not None


@pytest.mark.parametrize("count", [0, 1, 39])
def test_few_looks_tell_nothing(count: int) -> None:
    mean = np.random.default_rng(3).uniform(0.0, 100.0 * TURN, count)
    assert spindle_ripple(swinging(mean, 0.01, 2), TURN) is None


def test_a_spindle_that_stands_has_no_ripple() -> None:
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
    spindle = cast("Spindle", motor.axis)
    spindle.speed_ripple, spindle.ripple_per_turn = share, per_turn
    floor.arm(job, strategy)
    recorder = motor.axis = Recorder(spindle)
    in_part: list[int] = []

    def look(_: Snapshot) -> None:
        if floor.state.cut is not None and floor.state.cut.stage == "cut":
            in_part.append(len(recorder.positions))

    floor.looks.append(look)
    floor.do(Start())
    cut = floor.state.cut
    assert cut is not None and cut.ripple is not None
    true_position = swing_of_the_iron(np.array(recorder.positions[in_part[0] : in_part[-1]]))
    assert cut.ripple.percent == pytest.approx(true_position, abs=cut.ripple.within_percent)
    assert true_position == pytest.approx(200.0 * share, abs=0.1)
