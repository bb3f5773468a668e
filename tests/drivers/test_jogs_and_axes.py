"""Jogs and home searches, and the definitions of axes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.axes import (
    AxisDefinition,
    axis_positions,
    preset_origins,
    read_definitions,
    refuse_singular,
    scan_definition,
)
from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.card.jog_motion import TriggerStage
from profiles.problem import ProfileError
from tests.drivers.conftest import Bench, Recorder
from tests.drivers.wire_card import BLOCK, CYCLE_MS, IdealCard, refused


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(request: pytest.FixtureRequest) -> IdealCard:
    return IdealCard(request.param)


def jogged(card: IdealCard) -> float:
    card.settle()
    return card.x


def test_j_colon_is_relative_to_the_commanded_and_j_caret_to_the_actual_position(card: IdealCard) -> None:
    motor = card.motor()
    motor.jog_to(0.4)
    card.settle()
    motor.jog_by(100.0)
    assert jogged(card) == pytest.approx(100.4)
    assert motor.encoder == 100
    motor.jog_by(100.0, from_actual=True)
    assert jogged(card) == 200, "from what the encoder says, not from 100.4"


def test_a_jog_by_nothing_closes_an_open_loop_and_moves_nothing(card: IdealCard) -> None:
    """`J:0`, as clients send it."""
    card.motor().jog_to(100)
    card.settle()
    card.motor().kill()
    card.motor().jog_by(0.0)
    assert card.motor().enabled
    assert jogged(card) == 100


def test_a_jog_until_a_trigger_ends_so_many_counts_past_it(card: IdealCard) -> None:
    """The next trigger is 1500 counts ahead; it moves no zero."""
    motor = card.motor()
    motor.jog_to(5000, past_trigger=-20.0)
    card.wait(10)
    assert (motor.jog.stage, motor.jog.homes, motor.home_complete) == (TriggerStage.SEARCHING, False, False)
    assert jogged(card) == pytest.approx(1500 - 20)
    assert (motor.jog.stage, motor.home_complete) == (None, False)


def test_without_a_trigger_it_ends_where_it_was_told_and_the_bit_stays(card: IdealCard) -> None:
    motor = card.motor()
    motor.jog_to(1000, past_trigger=0.0)
    assert jogged(card) == 1000
    assert motor.jog.stage not in (None, TriggerStage.SEARCHING)
    motor.jog_by(1.0)
    assert motor.jog.stage is None


def test_the_search_bit_ends_with_the_trigger_and_home_complete_comes_with_it(card: IdealCard) -> None:
    card.set(I123=-5)
    motor = card.motor()
    motor.home()
    while motor.jog.stage is TriggerStage.SEARCHING:
        assert not motor.home_complete
        card.block()
    assert motor.home_complete
    assert motor.jogging, "it still comes to rest"
    card.settle()
    assert card.x == 0


@pytest.mark.parametrize("offset", [0.0, 160.0, -160.0])
def test_a_home_search_ends_at_zero_which_is_ix26_from_the_trigger(card: IdealCard, offset: float) -> None:
    """In sixteenths of a count; the trigger is 500 counts behind the place of power-up."""
    card.set(I123=-5, I126=offset)
    card.motor().home()
    card.settle()
    motor = card.motor()
    assert (card.x, motor.position) == (0, 0)
    assert motor.axis.origin == pytest.approx(offset / 16)
    assert motor.home_capture == pytest.approx(-500), "counted from power-up"


def test_hmz_declares_the_place_home_without_a_move(card: IdealCard) -> None:
    motor = card.motor()
    motor.jog_to(321)
    card.settle()
    motor.home_zero()
    assert motor.home_complete
    assert motor.position == 0
    assert motor.home_capture == 321
    card.wait(50)
    assert card.x == 0
    assert motor.enabled
    assert motor.axis.origin == 500 + 321


def test_a_home_moves_the_place_that_j_equals_leads_back_to_with_the_zero(card: IdealCard) -> None:
    """J= alone goes back to a place of the iron, whatever it is called now."""
    motor = card.motor()
    motor.jog_to(5000)
    card.settle()
    motor.home_zero()
    motor.jog_back()
    card.settle()
    assert motor.axis.origin + card.x == 500, "where the motor stood before the jog"


def test_a_program_goes_on_from_where_the_motor_is_when_its_zero_has_moved(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM100", "X1000", "X1000", "X1000")
    card.system.run()
    card.wait(50)
    card.system.quit()
    card.settle()
    assert card.x == 2000
    card.motor().home_zero()
    seen = len(card.track[1])
    card.system.run()
    card.settle()
    assert card.x == 1000, "the last distance, from the new zero"
    assert all(0 <= place <= 1000 for place in card.track[1][seen:])


def test_hmz_leaves_a_killed_motor_killed(card: IdealCard) -> None:
    card.motor().kill()
    card.motor().home_zero()
    assert card.motor().home_complete
    assert not card.motor().enabled


@pytest.mark.parametrize(("percent", "effective"), [(50, 50), (-25, -25), (130, 100), (-999, -100)])
def test_an_output_is_a_share_of_ix69_and_saturates(card: IdealCard, percent: float, effective: float) -> None:
    """An ideal motor goes to 100 counts/ms at full output."""
    card.motor().open_loop(percent)
    card.wait(2000)
    assert card.motor().encoder_step == pytest.approx(effective * CYCLE_MS, abs=1)
    card.motor().open_loop(0)
    card.wait(3000)
    assert card.motor().encoder_step == 0


def test_001_an_absolute_position_is_not_read_while_a_program_is_held(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM500", "X1000", "X1000")
    card.system.run()
    card.wait(100)
    card.system.hold()
    card.wait(50)
    assert card.system.motion.held_at is not None
    assert refused(lambda: card.controller.read_absolute_position(1)) == 1
    card.system.run()
    card.settle()
    assert card.x == 2000
    assert not card.system.moving


def test_reading_an_absolute_position_kills_and_forgets_home(card: IdealCard) -> None:
    card.motor().jog_to(100)
    card.settle()
    card.motor().home_zero()
    card.system.set_axis("X", 50)
    card.controller.read_absolute_position(1)
    motor = card.motor()
    assert (motor.enabled, motor.home_complete, motor.position) == (False, False, 0)
    assert card.system.frame.positions()["X"] == 0


def test_a_pushed_slide_is_newtons_law(closed: Bench) -> None:
    """10 % of Ix69: 1053.1 bits of 10 V / 32768, 11.45 A/V, 54.5 N/A on 4.74 kg with 201.6 N s/m."""
    newton = 0.1 * 10_531 * 10 / 32_768 * 11.45 * 54.5
    closed.client.request("I113=0 #1O10")
    start = closed.sim.controller.now_ms
    closed.sim.wait(0.1)
    motor = closed.sim.controller.motors[1]
    for _ in range(3):
        seconds = (closed.sim.controller.now_ms - start) / 1000
        speed_um_s = newton / 201.6 * (1 - math.exp(-201.6 / 4.74 * seconds)) * 1e6
        # The output reaches the amplifier one cycle late, and the encoder counts 0.2 um.
        assert motor.encoder_step * 0.2 == pytest.approx(speed_um_s * CYCLE_MS / 1000, rel=0.01, abs=0.3)
        closed.sim.wait(BLOCK * CYCLE_MS / 1000)


# Jogs and home searches: how far, how fast and how long, against closed forms.

SLOW_CYCLES = 3
"""Servo cycles that starting and sampling may cost."""


def moving_ms(bench: Bench, recorder: Recorder) -> float:
    """Return the time between the first and the last command that differs from its neighbour."""
    changes = np.flatnonzero(np.diff(recorder.commands))
    return float(changes[-1] - changes[0] + 1) * bench.cycle_ms


def velocities(bench: Bench, recorder: Recorder) -> np.ndarray:
    """Commanded velocity in counts/ms."""
    return np.diff(recorder.commands) / bench.cycle_ms


def test_a_jog_to_a_position_takes_distance_over_speed_and_one_acceleration_time(closed: Bench) -> None:
    """Ix22 = 10, Ix20 = 100: 5000 counts take 500 + 100 ms."""
    recorder = closed.record(3)
    closed.client.request("#3J=5000")
    closed.settle()
    assert recorder.commands[-1] == 5000
    assert moving_ms(closed, recorder) == pytest.approx(600, abs=SLOW_CYCLES * closed.cycle_ms)
    assert velocities(closed, recorder).max() == pytest.approx(10, rel=1e-6)


def test_two_s_curves_longer_than_the_jog_acceleration_time_set_it(closed: Bench) -> None:
    closed.client.request("I320=40 I321=60 I319=0")
    recorder = closed.record(3)
    closed.client.request("#3J=-5000")
    closed.settle()
    assert moving_ms(closed, recorder) == pytest.approx(620, abs=SLOW_CYCLES * closed.cycle_ms)


def test_factory_rates_take_two_seconds_to_stop_a_jog(closed: Bench) -> None:
    """32 counts/ms at 0.015625 counts/ms2 is 2048 ms and, without S-curves, 32768 counts."""
    closed.client.request("I319=0.015625 I320=0 I321=0 I322=32")
    recorder = closed.record(3)
    closed.client.request("#3J+")
    closed.sim.wait(3.0)
    before = recorder.commands[-1]
    start = len(recorder.commands)
    closed.client.request("#3J/")
    closed.settle()
    recorder.commands = recorder.commands[start:]
    assert moving_ms(closed, recorder) == pytest.approx(2048, abs=12)
    assert recorder.commands[-1] - before == pytest.approx(0.5 * 32 * 2048, abs=32 * 12)


def test_a_speed_of_the_other_sign_is_still_a_speed(closed: Bench) -> None:
    closed.client.request("I322=-10 #3J=1000")
    closed.settle()
    assert closed.number("#3P") == 1000


def test_a_jog_to_where_the_motor_stands_is_done_at_once(closed: Bench) -> None:
    closed.client.request("#3J=0")
    closed.sim.wait(0.03)
    assert "in_position" in closed.lathe.snapshot().carriage.flags


def test_jog_times_of_nothing_stop_neither_the_card_nor_the_jog(closed: Bench) -> None:
    closed.client.request("I319=0 I320=0 I321=0 #3J=500")
    closed.settle()
    assert closed.number("#3P") == 500


def test_a_new_jog_in_mid_motion_stops_first_and_never_jumps(closed: Bench) -> None:
    recorder = closed.record(3)
    closed.client.request("#3J=20000")
    closed.sim.wait(0.7)
    closed.client.request("#3J=-1000")
    closed.settle()
    assert recorder.commands[-1] == -1000
    steps = np.diff(velocities(closed, recorder))
    assert np.abs(steps).max() <= 0.5 * closed.cycle_ms * 1.001  # Ix19 = 0.5 counts/ms2


@pytest.mark.parametrize(("motor", "seconds"), [(1, 5000 / 10 / 1000), (3, 2000 / 5 / 1000)])
def test_homing_finds_the_flag_at_the_end_of_travel(closed: Bench, motor: int, seconds: float) -> None:
    """The machine stands 1 mm (tool) and 2 mm (carriage) from its flag; Ix23 is 2 and 5 mm/s."""
    true_position = closed.sim.controller.motors[motor]
    start = true_position.actual + true_position.axis.origin
    began = closed.sim.now_s()
    closed.client.request(f"#{motor}HM")
    while not {"home_complete", "in_position"} <= closed.lathe.snapshot().axes[{1: 0, 3: 2}[motor]].flags:
        closed.sim.wait(0.005)
    assert start > 0
    assert closed.sim.now_s() - began == pytest.approx(seconds, abs=0.6)
    assert closed.number(f"#{motor}P") == pytest.approx(0, abs=10)
    assert true_position.axis.origin == pytest.approx(0, abs=1)
    assert "home_complete" in closed.lathe.snapshot().axes[{1: 0, 3: 2}[motor]].flags


@pytest.mark.parametrize("speed", [5, -5])
def test_homing_finds_the_index_of_the_spindle_from_either_side(closed: Bench, speed: int) -> None:
    closed.client.request(f"I223={speed} #2HM")
    closed.sim.wait(5.0)
    spindle = closed.sim.controller.motors[2]
    assert spindle.home_complete
    assert closed.number("#2P") == 0
    turns = (spindle.actual + spindle.axis.origin) / 10_000
    assert turns == pytest.approx(round(turns), abs=1e-6)


def test_homing_never_jumps(closed: Bench) -> None:
    recorder = closed.record(3)
    closed.client.request("#3HM")
    closed.sim.wait(3.0)
    machine_steps = np.diff(recorder.commands)
    jumps = np.flatnonzero(np.abs(np.diff(machine_steps)) > 0.6 * closed.cycle_ms)
    # The one jump is that of the zero itself, by the 2000 counts less the way to the flag and back.
    assert len(jumps) <= 2


# Axis definitions as the manual gives them, their spelling, and the way back from motors to axes.


def one(text: str) -> AxisDefinition:
    (definition,) = read_definitions([text])
    return definition


@pytest.mark.parametrize(
    ("text", "positions", "counts"),
    [
        ("#1->X", {"X": 12.0}, 12.0),
        ("#4->2000 A", {"A": 1.5}, 3000.0),
        ("#8->3333.333Z-666.667", {"Z": 3.0}, 9333.332),
        ("#1->8660X-5000Y", {"X": 1.0, "Y": 2.0}, -1340.0),
        ("#2->5000X+8660Y", {"X": 1.0, "Y": 2.0}, 22_320.0),
        ("#3->2000Z-6000", {"Z": 3.0}, 0.0),
        ("#6->-29.1X+100000Y", {"X": 10.0, "Y": 1.0}, 99_709.0),
        ("#1->U-V+W-10", {"U": 1.0, "V": 2.0, "W": 4.0}, -7.0),
        ("#1->-X", {"X": 3.0}, -3.0),
    ],
)
def test_the_manual_s_definitions_give_their_counts(text: str, positions: dict[str, float], counts: float) -> None:
    assert one(text).counts(positions) == pytest.approx(counts)


@pytest.mark.parametrize(
    ("typed", "reported"),
    [
        ("#1->8660 x - 5000 y + 10", "8660X-5000Y+10"),
        ("#1->X", "X"),
        ("#1->1X", "X"),
        ("#1->-X", "-1X"),
        ("#1->u-v", "U-1V"),
        ("#1->3333.333Z-666.667", "3333.333Z-666.667"),
        ("#1->X+0", "X"),
    ],
)
def test_a_definition_is_reported_in_one_spelling(typed: str, reported: str) -> None:
    assert str(one(typed)) == reported


@pytest.mark.parametrize(
    "text",
    ["0X", "X+0Y", "5", "X+", "X-", "", "X+A"],
    ids=["no scale", "no second scale", "no axis", "no offset", "no number", "nothing", "another three"],
)
def test_what_is_no_definition_is_err003(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        scan_definition(Scanner(text), 1)
    assert refusal.value.code == ErrorCode.DATA_ERROR
    with pytest.raises(ProfileError):
        one(f"#1->{text}")


@pytest.mark.parametrize("texts", [["X"], ["#1->X hello"], ["#->X"], ["#0->X"], ["#1->X", "#1->Y"], ["#4->é"]])
def test_a_wrong_entry_of_a_machine_profile_is_named(texts: list[str]) -> None:
    with pytest.raises(ProfileError) as refusal:
        read_definitions(texts)
    (problem,) = refusal.value.problems
    assert (problem.key, problem.value) == ("controller.axis_definitions", f'"{texts[-1]}"')


AXES = st.sampled_from(["X", "Y", "Z", "XY", "YX", "XYZ", "ZX", "U", "VW", "A", "C"])
SCALES = st.floats(-10_000, 10_000).map(lambda value: round(value, 3)).filter(bool)


@given(axes=AXES, scales=st.lists(SCALES, min_size=3, max_size=3), offset=st.integers(-9999, 9999))
def test_what_is_reported_is_read_as_the_same_definition(axes: str, scales: list[float], offset: int) -> None:
    terms = tuple(zip(axes, scales, strict=False))
    definition = AxisDefinition(motor=3, terms=terms, offset=float(offset))
    assert one(f"#3->{definition}") == definition


@given(x=st.floats(-1000, 1000), y=st.floats(-1000, 1000), z=st.floats(-1000, 1000))
def test_axis_positions_are_found_again_from_the_motors(x: float, y: float, z: float) -> None:
    read = read_definitions(["#1->8660X-5000Y+10", "#2->5000X+8660Y", "#3->29.1X-7Y+2000Z-6000"])
    by_motor = {definition.motor: definition for definition in read}
    counts = {motor: d.counts({"X": x, "Y": y, "Z": z}) for motor, d in by_motor.items()}
    found = axis_positions(by_motor, counts)
    assert found == pytest.approx({"X": x, "Y": y, "Z": z}, abs=1e-9)


def test_axes_follow_the_lower_motor_and_are_at_0_without_one() -> None:
    by_motor = {d.motor: d for d in read_definitions(["#3->10Y", "#2->10Y"])}
    assert axis_positions(by_motor, {2: 50.0, 3: 70.0}) == {"Y": 5.0}
    by_motor = {d.motor: d for d in read_definitions(["#1->10X+5Y"])}
    assert axis_positions(by_motor, {1: 50.0}) == {"X": 5.0, "Y": 0.0}


@pytest.mark.parametrize(
    "texts", [["#1->X+Y", "#2->X+Y"], ["#1->X+Y", "#2->2X+2Y-5", "#3->Z"], ["#1->X+Y", "#2->Y+Z", "#3->X+2Y+Z"]]
)
def test_motors_that_depend_on_one_another_are_err003(texts: list[str]) -> None:
    with pytest.raises(PmacError) as refusal:
        refuse_singular(read_definitions(texts))
    assert refusal.value.code == ErrorCode.DATA_ERROR


@pytest.mark.parametrize(
    "texts",
    [["#1->X+Y"], ["#1->X", "#2->X"], ["#1->X+Y", "#2->X-Y", "#3->X+Y"], ["#1->Z", "#2->Z", "#3->X+Y"], []],
    ids=["not yet complete", "a gantry", "a gantry of sums", "one group of two", "none"],
)
def test_gantries_and_what_is_not_yet_complete_are_allowed(texts: list[str]) -> None:
    refuse_singular(read_definitions(texts))


def test_a_preset_axis_is_where_it_was_told_to_be() -> None:
    (definition,) = read_definitions(["#1->100X+50"])
    origins = preset_origins({}, {"X": 3.0}, {"X": 10.0})
    assert origins == {"X": 7.0}
    moved = definition.shift_origins(origins)
    assert moved.counts({"X": 10.0}) == definition.counts({"X": 3.0})
    assert axis_positions({1: moved}, {1: 350.0}) == {"X": 10.0}
    once = preset_origins({}, {"X": 3.0, "Y": 1.0}, {"X": 10.0, "Y": 4.0})
    twice = preset_origins(once, {"X": 12.0, "Y": 4.0}, {"X": 0.0})
    assert twice == {"X": -5.0, "Y": 3.0}
    assert preset_origins(twice, {"X": 1.0, "Y": 4.0}, {"X": 6.0, "Q": 1.0}) == {"Y": 3.0}
