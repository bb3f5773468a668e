"""What programs wait for, what breaks their blending, and the time base that they run by."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.requests import DefaultAddress
from drivers.pmac.trajectory.pieces import Piece, position_at
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.player import Player
from tests.drivers.wire_card import BLOCK, CYCLE_MS, IdealCard, moving_time_ms, refused, rests, stops


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(request: pytest.FixtureRequest) -> IdealCard:
    dialect: Dialect = request.param
    return IdealCard(dialect)


def test_home_waits_until_every_motor_is_home_and_the_program_goes_on_from_there(card: IdealCard) -> None:
    """The triggers are 500 counts behind the motors; at 5 counts/ms that takes 100 ms."""
    card.program("ABS", "TA20 TS0 TM100", "X300", "HOME1..2", "P1=1", "X200 Y0")
    card.set(I123=-5, I223=-5)
    card.system.run()
    card.wait(200)
    assert card.motor(1).jog.homes and card.motor(1).jog.stage
    assert card.get("P1") == 0
    assert card.system.running
    card.settle()
    assert card.motor(1).home_complete and card.motor(2).home_complete
    assert card.get("P1") == 1
    assert card.x == 200, "from the new zero"
    assert card.motor(1).axis.origin == pytest.approx(0), "which is where the trigger is"


def test_homez_declares_home_without_a_move(card: IdealCard) -> None:
    card.run("ABS", "TA20 TS0 TM100", "X300", "HOMEZ1", "X0", "P1=1")
    assert card.motor().home_complete
    assert card.x == 0
    assert card.motor().axis.origin == 500 + 300, "where the motor stood at power-up, and how far it went"
    assert card.get("P1") == 1


@pytest.mark.parametrize("motor", [7, 32])
def test_a_home_that_cannot_be_is_a_run_time_error(card: IdealCard, motor: int) -> None:
    card.program(f"HOME{motor}", "X1000")
    card.system.run()
    card.settle()
    assert card.system.motion.runtime_error
    assert card.x == 0


def test_a_home_of_a_motor_that_another_program_moves_is_a_run_time_error(card: IdealCard) -> None:
    card.controller.define_axis(1, 2, None)
    card.controller.define_axis(2, 2, read_definitions(["#2->X"])[0])
    card.store("INC", "TA20 TS0 TM1000", "X5000", number=2)
    card.controller.systems[2].point(2)
    card.program("HOME2")
    card.controller.each_system(CoordinateSystem.run)
    card.wait(100)
    assert card.system.motion.runtime_error
    card.settle()
    assert card.motor(2).desired == pytest.approx(5000), "the other program goes on"


def test_a_home_search_that_is_killed_ends_the_program(card: IdealCard) -> None:
    card.program("HOME1", "X1000")
    card.system.run()
    card.wait(20)
    assert card.motor().jog.homes and card.motor().jog.stage
    card.motor().kill()
    card.wait(20)
    assert card.system.motion.runtime_error
    assert not card.system.running


def test_pset_changes_where_the_axes_are_and_moves_nothing(card: IdealCard) -> None:
    track = card.run("ABS", "TA20 TS0 TM100", "X1000", "PSET X50 Y7", "X80", "INC", "X5")
    assert track[-1] == pytest.approx(1035)
    assert card.motor().position == 85, "what is reported is counted from the new zero"
    assert card.motor(2).position == 7
    assert card.motor(2).desired == 0


def test_an_axis_may_be_redefined_from_outside(card: IdealCard) -> None:
    card.run("ABS", "TA20 TS0 TM100", "X1000 Y500")
    card.system.set_axis("X", 5)
    card.run("X6")
    assert card.x == pytest.approx(1001)
    card.system.zero_axes()
    assert card.system.frame.positions() == {"X": 0, "Y": 0}
    assert card.motor(2).position == 0
    card.system.set_axis("X", 0.0)
    assert refused(lambda: card.system.set_axis("Z", 1)) == 3


def test_a_jog_goes_to_what_is_reported(card: IdealCard) -> None:
    card.run("ABS", "TA20 TS0 TM100", "X1000", "PSET X0")
    card.motor().jog_to(30)
    card.settle()
    assert (card.motor().position, card.x) == (30, 1030)


def test_the_axes_are_not_redefined_while_a_program_runs(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM1000", "X1000")
    card.system.run()
    card.wait(50)
    for act in (lambda: card.system.set_axis("X", 1), card.system.zero_axes, card.system.match_positions):
        assert refused(act) == 1


def test_a_definition_begins_to_count_anew(card: IdealCard) -> None:
    card.run("ABS", "TA20 TS0 TM100", "X1000", "PSET X0")
    definition = card.system.frame.definitions[1]
    card.controller.define_axis(1, 1, definition)
    assert card.motor().position == 1000
    assert card.system.frame.positions()["X"] == 1000


def test_a_synchronous_assignment_waits_for_the_start_of_its_move(card: IdealCard) -> None:
    """M1=1 is done when its line is calculated, when the move before it begins; M2==1 when its own move begins."""
    card.program("INC", "TA20 TS0 TM300", "X3000", "M1=1 M2==1", "X3000", "DWELL0")
    card.system.run()
    seen: dict[str, float] = {}
    while card.system.moving:
        card.block()
        for name in ("M1", "M2"):
            if card.get(name) and name not in seen:
                seen[name] = card.x
    one_block = 11 * CYCLE_MS * 10
    assert seen["M1"] < 2 * one_block
    # The ramp into the second move begins half of TA before the boundary; it is a ramp between equal speeds.
    assert seen["M2"] == pytest.approx(3000 - 10 * 10, abs=one_block)


def test_calls_reach_the_other_programs_of_the_card(card: IdealCard) -> None:
    card.store("INC", "X1000", "RETURN", number=500)
    card.store("N1000", "X(Q101)", "RETURN", number=1000)
    card.program("INC TA20 TS0 TM100", "CALL 500", "X1")
    card.system.run()
    card.settle()
    assert card.x == pytest.approx(1001)


def test_what_a_program_says_waits_for_the_ports(card: IdealCard) -> None:
    card.run('SEND"READY"', 'CMD"#2J+"', "ENABLE PLC 1,3", "DISABLE PLC 1")
    assert [text for text, _ in card.controller.host.host_messages] == ["READY"]
    assert list(card.controller.host.pending_commands) == [("#2J+", "", DefaultAddress(motor=1, system=1))]
    assert card.controller.plcs.switches.enabled == {3}
    card.controller.reset()
    assert not card.controller.host.host_messages
    assert not card.controller.host.pending_commands


# What brings the axes to their programmed point between two moves, and what does not.

BREAKS = {
    "a DWELL": ("DWELL50",),
    "a DWELL of nothing": ("DWELL0",),
    "PSET": ("PSET Y0",),
    "HOME": ("HOMEZ2",),
    "a RAPID move": ("RAPID Y10 LINEAR",),
    "WAIT": ("WHILE(P1=0)WAIT",),
    "two jumps back": ("WHILE(P2<3)", "P2=P2+1", "ENDWHILE"),
    "two jumps back with GOTO": ("N1 P2=P2+1", "IF(P2<3)", "GOTO1", "ENDIF"),
}
GOES_ON = {
    "nothing": (),
    "calculation": ("P1=1 P2=2",),
    "one jump back": ("WHILE(P2<1)", "P2=P2+1", "ENDWHILE"),
    "GOSUB": ("GOSUB7",),
    "CALL": ("CALL500",),
    "another mode word": ("ABS INC LINEAR",),
}


AT_THE_POINT = [pytest.approx(1000, abs=0.05)]
"""Between two servo cycles a motion at half a count/ms2 may be that far from where it stood for an instant."""


def run(lines: tuple[str, ...], **settings: float) -> np.ndarray:
    """Two moves of 1000 counts with something between them."""
    card = IdealCard(**settings)
    card.store("P3=1", "RETURN", number=500)
    card.program("INC TA20 TS0 TM100", "X1000", *lines, "X1000", "DWELL0", "RETURN", "N7 P3=1", "RETURN")

    def go() -> None:
        card.system.run()
        card.wait(400)
        card.set(P1=1)
        card.settle()

    track = card.record(go)
    assert track[-1] == pytest.approx(2000)
    return track


@pytest.mark.parametrize("name", BREAKS)
def test_it_comes_to_rest_at_its_point(name: str) -> None:
    assert stops(run(BREAKS[name])) == AT_THE_POINT


@pytest.mark.parametrize("name", GOES_ON)
def test_it_goes_on_without_a_rest(name: str) -> None:
    assert stops(run(GOES_ON[name])) == []


def test_what_rests_inside_after_or_between_moves() -> None:
    """The motion rests inside it, from half of TA after its nominal start to half of TA before its end."""
    ((position, ms),) = rests(run(("DELAY50",)))
    assert position == pytest.approx(1000)
    assert ms == pytest.approx(30, abs=2 * CYCLE_MS)
    assert stops(run((), I192=1)) == AT_THE_POINT
    card = IdealCard()
    track = card.run("INC TA20 TS0 TM100", "X1000")
    assert track[-1] == 1000
    assert (len(track) - 1) * CYCLE_MS < 200
    ((_, ms),) = rests(run(("DWELL50",)))
    assert ms == pytest.approx(50, abs=2 * CYCLE_MS)


def test_single_step_stops_after_each_move() -> None:
    card = IdealCard()
    card.program("INC TA20 TS0 TM100", "X1000", "X1000")

    def go() -> None:
        card.system.step()
        card.settle()
        card.system.step()
        card.settle()

    assert stops(card.record(go)) == AT_THE_POINT


# The time base: what `%` stretches and what it does not, and how fast it gets there.

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


def test_delay_and_i11_are_stretched_and_dwell_and_jogs_are_not() -> None:
    """A DELAY of 400 ms at 50 % takes 800 ms, a DWELL of 400 ms takes 400 ms."""
    lines = ("INC", "TA20 TS0 TM100", "X1000", "{wait}400", "X1000")
    dwell = at_percent(50, *(line.format(wait="DWELL") for line in lines))
    delay = at_percent(50, *(line.format(wait="DELAY") for line in lines))
    # The DELAY begins half a ramp before the motion rests and ends half a ramp after it goes on: 2 x 10 ms.
    assert [rest for _, rest in rests(dwell)] == pytest.approx([400], abs=2 * CYCLE_MS)
    assert [rest for _, rest in rests(delay)] == pytest.approx([2 * (400 - 20)], abs=2 * CYCLE_MS)
    card = IdealCard(I11=100)
    card.system.set_override(50)
    card.wait(20)
    track = card.run("INC", "TA20 TS0 TM100", "X1000")
    assert float(np.flatnonzero(np.diff(track))[0]) * CYCLE_MS == pytest.approx(200, abs=2 * CYCLE_MS)
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
