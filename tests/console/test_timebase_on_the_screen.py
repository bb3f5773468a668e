"""A cut on the spindle's time from the screen: what it changes on the card is put back, however it ends."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.station.commands import Disarm, Recover, Retract, Start
from console.session.station.progress import CutStage
from drivers.cutting.planning import Strategy
from tests.console.floor import Floor, experiment_1, set_up_once

JOB = experiment_1()


@pytest.fixture
def floor(tmp_path: Path, in_copies: None) -> Floor:
    return set_up_once(tmp_path)


def as_its_profile_says(floor: Floor) -> bool:
    return floor.lathe.verify() == ()


def test_arming_and_taking_it_back_leaves_the_card_as_it_was(floor: Floor) -> None:
    assert floor.arm(JOB, Strategy.TIMEBASE).armed is not None
    floor.do(Disarm())
    assert as_its_profile_says(floor)
    assert floor.arm(JOB, Strategy.PVT).armed is not None, floor.state.refusals


def test_it_is_armed_twice_in_a_row(floor: Floor) -> None:
    for _ in range(2):
        assert floor.arm(JOB, Strategy.TIMEBASE).armed is not None, floor.state.refusals


def test_after_a_stop_in_the_cut_f8_puts_it_back(floor: Floor) -> None:
    assert floor.arm(JOB, Strategy.TIMEBASE).armed is not None
    floor.when(
        lambda _: floor.state.cut is not None and floor.state.cut.stage is CutStage.CUT,
        lambda: floor.stop.stop("space"),
    )
    floor.do(Start())
    floor.idle()
    floor.do(Recover())
    state = floor.do(Retract())
    assert state.stop is None and state.refusals == (), state.alarms
    assert as_its_profile_says(floor)
    assert floor.arm(JOB, Strategy.PVT).armed is not None, floor.state.refusals
