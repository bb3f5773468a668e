"""The time base: what `%` stretches and what it does not, and how fast it gets there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.axes import read_definitions
from drivers.pmac.trajectory.pieces import Piece, position_at
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.player import Player
from tests.drivers.ideal_card import BLOCK, CYCLE_MS, IdealCard, moving_time_ms, refused, rests

MOVES = ("INC", "TA40 TS10 TM200", "X3000 Y-1000", "X-500", "DELAY70", "X800 Y20")


def at_percent(percent: float, *lines: str) -> np.ndarray:
    card = IdealCard()
    card.system.set_override(percent)
    card.wait(20)
    return card.run(*lines)


def test_at_half_the_rate_every_position_comes_at_twice_the_time() -> None:
    full, half = at_percent(100, *MOVES), at_percent(50, *MOVES)
    count = min(len(full), len(half) // 2)
    assert half[: 2 * count : 2] == pytest.approx(full[:count], abs=1e-8)


def test_delay_is_stretched_and_dwell_is_not() -> None:
    """A DELAY of 400 ms at 50 % takes 800 ms, a DWELL of 400 ms takes 400 ms."""
    lines = ("INC", "TA20 TS0 TM100", "X1000", "{wait}400", "X1000")
    dwell = at_percent(50, *(line.format(wait="DWELL") for line in lines))
    delay = at_percent(50, *(line.format(wait="DELAY") for line in lines))
    # The DELAY begins half a ramp before the motion rests and ends half a ramp after it goes on: 2 x 10 ms.
    assert [rest for _, rest in rests(dwell)] == pytest.approx([400], abs=2 * CYCLE_MS)
    assert [rest for _, rest in rests(delay)] == pytest.approx([2 * (400 - 20)], abs=2 * CYCLE_MS)


def test_i11_is_stretched_too() -> None:
    card = IdealCard(I11=100)
    card.system.set_override(50)
    card.wait(20)
    track = card.run("INC", "TA20 TS0 TM100", "X1000")
    assert float(np.flatnonzero(np.diff(track))[0]) * CYCLE_MS == pytest.approx(200, abs=2 * CYCLE_MS)


def test_a_jog_knows_no_time_base() -> None:
    card = IdealCard()
    card.system.set_override(10)
    card.wait(50)
    track = card.record(lambda: card.motor().jog_to(5000), card.settle)
    assert moving_time_ms(track) == pytest.approx(5000 / 50 + 10, abs=2 * CYCLE_MS)


def test_each_coordinate_system_has_its_own() -> None:
    card = IdealCard(I300=1, I316=0, I317=0, I320=1)
    third = card.motor(3)
    third.jog_speed(0)
    card.controller.define_axis(2, 3, read_definitions(["#3->X"])[0])
    card.system.set_override(50)
    card.program("INC", "TA20 TS0 TM200", "X1000")
    card.controller.systems[2].point(1)
    card.wait(20)
    card.controller.each_system(CoordinateSystem.run)
    card.wait(230)
    assert third.desired == 1000
    assert card.x < 600
    card.settle()
    assert card.x == 1000


@pytest.mark.parametrize("number", ["I194", "I195"])
def test_from_full_rate_to_nothing_takes_the_factorys_second(number: str) -> None:
    """1644 x 2^-23 ms a servo cycle and cycle (Software Reference, Ix94 and Ix95)."""
    card = IdealCard(**{number: 1644})
    card.program("INC", "TA20 TS0 TM60000", "X600000")
    card.system.run()
    card.wait(200)
    act = card.system.hold if number == "I195" else lambda: card.system.set_override(0)
    track = card.record(act, lambda: card.wait(1200))
    assert moving_time_ms(track) == pytest.approx(1000, abs=1)
    # A steady decline: half of what would have been covered in that time.
    assert track[-1] - track[0] == pytest.approx(10 * 1000 / 2, abs=10)
    assert np.ptp(np.diff(track, 2)[: int(900 / CYCLE_MS)]) == pytest.approx(0, abs=1e-9)


def test_the_card_takes_the_most_that_it_can() -> None:
    """`%500`, then `%`: 225.88230574 (Software Reference, %{constant})."""
    card = IdealCard()
    card.system.set_override(500)
    card.wait(20)
    assert round(card.system.time_base.percent, 8) == 225.88230574
    track = card.run("INC", "TA20 TS0 TM500", "X10000")
    assert moving_time_ms(track) == pytest.approx(520 / 2.2588230574, abs=2 * CYCLE_MS)


@pytest.mark.parametrize("percent", [-1.0, float("nan"), float("inf")])
def test_what_is_no_rate_is_refused(percent: float) -> None:
    card = IdealCard()
    assert refused(lambda: card.system.set_override(percent)) == 3
    assert card.system.time_base.percent == 100


def test_nothing_passes_at_zero_and_the_program_goes_on_from_there() -> None:
    card = IdealCard()
    card.program("INC", "TA20 TS0 TM500", "X10000", "X5000")
    card.system.run()
    card.wait(100)
    card.system.set_override(0)
    card.wait(20)
    here = card.x
    card.wait(3000)
    assert card.x == here
    assert card.system.running
    assert refused(lambda: card.controller.refuse_in_control(1)) == 1, "%0 is no hold: nobody else may move it"
    card.system.set_override(100)
    card.settle()
    assert card.x == pytest.approx(15_000)


def test_back_at_full_rate_the_instants_are_those_of_the_servo_clock() -> None:
    disturbed = IdealCard()
    disturbed.system.set_override(30)
    disturbed.wait(50)
    disturbed.system.set_override(100)
    disturbed.wait(50)
    assert disturbed.run(*MOVES).tolist() == IdealCard().run(*MOVES).tolist()


PIECES = st.lists(st.tuples(st.floats(0.05, 9.0), st.floats(-3.0, 3.0), st.booleans()), min_size=1, max_size=6)


@given(PIECES, st.lists(st.floats(0.0, 2.2), min_size=3, max_size=40))
def test_time_passes_at_the_rate_of_each_cycle_and_in_a_dwell_at_that_of_the_clock(
    shapes: list[tuple[float, float, bool]], rates: list[float]
) -> None:
    """The second method walks through each cycle in fractions of it, from one piece to the next."""
    pieces, start = [], 0.0
    for duration, slope, real_time in shapes:
        pieces.append(Piece(duration, ((start, slope, 0.0, 0.0),), real_time=real_time))
        start = position_at(pieces[-1].cubics[0], duration)
    player = Player((0.0,))
    player.append(pieces)
    played = [player.sample(1, 1.0, rate)[0][0] for rate in rates]
    place, elapsed, expected = 0, 0.0, []
    for rate in rates:
        left = 1.0
        while left > 0.0 and place < len(pieces):
            piece = pieces[place]
            speed = 1.0 if piece.real_time else rate
            needed = (piece.duration_ms - elapsed) / speed if speed else float("inf")
            if needed >= left:
                elapsed, left = elapsed + speed * left, 0.0
            else:
                place, elapsed, left = place + 1, 0.0, left - needed
        at = pieces[min(place, len(pieces) - 1)]
        expected.append(position_at(at.cubics[0], elapsed if place < len(pieces) else at.duration_ms))
    assert played == pytest.approx(expected, abs=1e-9)


def test_a_block_of_cycles_is_the_same_as_its_cycles_one_by_one() -> None:
    def player() -> Player:
        made = Player((0.0,))
        made.append([Piece(7.3, ((0.0, 1.0, 0.1, 0.0),)), Piece(40.0, ((12.6, 2.0, 0.0, 0.0),))])
        return made

    whole, single = player(), player()
    rate = 0.37 * CYCLE_MS
    together = whole.sample(5 * BLOCK, CYCLE_MS, rate)[0]
    assert [single.sample(1, CYCLE_MS, rate)[0][0] for _ in together] == pytest.approx(together, abs=1e-12)
