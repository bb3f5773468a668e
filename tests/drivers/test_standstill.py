"""A healthy tool at a turning point is no tool that does not respond, however coarse the controller answers."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import DriverError
from drivers.identification.standstill import (
    CONFIRMING_PERIODS,
    LONGEST_WAIT_S,
    Standstill,
    confirming_wait_s,
    detected_within_s,
)
from drivers.lathe.motion import CUT_POLL_S
from drivers.pmac.dialect import DIALECTS
from profiles.store import load_machine

MACHINE = load_machine("lee-2001-lathe").machine

MOVING = ((50.0, -40.0, 0.0), (-60.0, 40.0, 0.0))
"""What confirms the first poll: the tool moves."""


class Card:
    """Answers the confirming polls: position, following error and velocity word, one after the other."""

    def __init__(self, *answers: tuple[float, float, float]) -> None:
        self.killed: list[str] = []
        given_answers = iter(answers)
        self.rig = cast(
            Any,
            SimpleNamespace(
                machine=MACHINE,
                dialect=DIALECTS["pmac"],
                where="",
                clock=SimpleNamespace(wait=lambda seconds: None),
                client=SimpleNamespace(numbers=lambda *items, again: next(given_answers)),
                lathe=SimpleNamespace(stop=SimpleNamespace(kill=self.killed.append)),
            ),
        )


def poll(position: float, command: float) -> Any:
    return SimpleNamespace(tool=SimpleNamespace(position=position, following_error=command - position))


def seen(card: Card, *polls: tuple[float, float]) -> None:
    watch = Standstill(card.rig, 210.0, 35.0)
    for position, command in polls:
        watch.see(poll(position, command))


def test_confirming_polls_of_the_same_servo_cycle_prove_nothing() -> None:
    """As seen at 210 Hz: two polls near a turning point, and twice the second of them again."""
    card = Card(*MOVING, (29.0, -229.405, 0.0), (29.0, -229.405, 0.0))
    seen(card, (90.0, 20.0), (28.0, -135.967), (29.0, -200.405))
    assert card.killed == []


def test_a_reading_that_stays_while_new_answers_show_another_command_is_told() -> None:
    card = Card(*MOVING, (29.0, 90.0, 0.0), (29.0, -120.0, 0.0))
    with pytest.raises(DriverError) as told:
        seen(card, (90.0, 20.0), (28.0, -135.967), (29.0, -200.405))
    assert (told.value.problems[0].code, card.killed) == ("identify.no_motion", ["identify.no_motion"])


@given(st.floats(0.5, 400.0), st.sampled_from(CONFIRMING_PERIODS), st.floats(0.001, 0.01))
def test_it_waits_a_background_cycle_and_keeps_the_phase(hz: float, periods: float, background_s: float) -> None:
    """Or, where that takes too long, it waits no whole period: a wait that is cut short has lost its phase."""
    wait_s = confirming_wait_s(periods, hz, background_s)
    assert wait_s <= LONGEST_WAIT_S
    whole = wait_s * hz - periods
    if whole >= 0.5:
        assert wait_s >= background_s * (1.0 - 1e-9)
    if wait_s < LONGEST_WAIT_S:
        assert whole == pytest.approx(round(whole), abs=1e-9)


class FrozenCard(Card):
    """Answers once per background cycle; its command swings on, and its reading stands."""

    def __init__(self, hz: float, began_s: float, round_trip_s: float) -> None:
        super().__init__()
        self._hz, self._round_trip_s = hz, round_trip_s
        self._cycle_s, self._counts = 11e-3 * MACHINE.controller.servo_period_ms, 35.0 / MACHINE.tool.count_um
        self.now_s = began_s
        self.rig.clock.wait, self.rig.client.numbers = self.wait, self.answer

    def wait(self, seconds: float) -> None:
        self.now_s += seconds

    def answer(self, *items: str, again: bool = True) -> tuple[float, float, float]:
        self.wait(self._round_trip_s)
        latched_s = math.floor(self.now_s / self._cycle_s + 1e-9) * self._cycle_s
        return 7.0, self._counts * math.sin(2.0 * math.pi * self._hz * latched_s) - 7.0, 0.0


@pytest.mark.parametrize("round_trip_s", [0.0005, 0.003])
@pytest.mark.parametrize("hz", [10.0, 37.0, 46.5, 50.0, 50.2, 51.3, 62.5, 81.0, 120.0, 187.5, 225.0])
def test_a_frozen_reading_is_detected_in_time_whatever_the_phase(hz: float, round_trip_s: float) -> None:
    for eighth in range(8):
        began_s = eighth / 8 / hz
        card = FrozenCard(hz, began_s, round_trip_s)
        watch = Standstill(card.rig, hz, 35.0)
        with pytest.raises(DriverError):
            while card.now_s < began_s + 3.0:
                position, error, _ = card.answer()
                watch.see(poll(position, position + error))
                card.wait(CUT_POLL_S)
        assert card.now_s - began_s <= detected_within_s(round_trip_s)
