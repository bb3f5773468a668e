"""Motors and time bases that follow a master."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.master.time_base import (
    UNITS_PER_MS,
    Following,
    FollowingMode,
    FollowingSetup,
    TimeBaseEntry,
    TimeBaseTrigger,
    TriggeredTimeBase,
    entry_of,
    in_counts,
    increment_units,
    nearest_factor,
    parts_of,
    register_change,
)
from drivers.pmac.settings import servo_cycle_ms
from profiles.machine import MachineProfile
from tests.drivers.conftest import Recorder
from tests.drivers.wire_card import Wire, wire

Floats = NDArray[np.float64]

FAMILIES = pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=["pmac", "turbo"])

SPINDLE, CARRIAGE = 2, 3
RTIF = 128.0
"""Counts/ms at which programmed times are true: 768 rpm."""

PROGRAM = ("LINEAR INC TA40 TS10 TM100 P1=0", "WHILE(P1<6)", "Z900", "Z-700", "P1=P1+1", "ENDWHILE")


class Family(NamedTuple):
    """Where things are in a family; `trigger` is the method digit of the triggered entry as an M-variable."""

    encoder: int
    channel: int
    line: int
    trigger: str
    running: int
    armed: int


PLACES = {
    "pmac": Family(0x721, 0xC004, 10, "M199->Y:$72A,16,8", 0xA0, 0xB0),
    # Bit 19 says what the encoder is, and those below it are its address.
    "turbo": Family(0x3502, 0x78008, 8, "M199->Y:$3509,20,4", 0xA, 0xB),
}


def places(dialect: Dialect) -> Family:
    return PLACES[dialect.name]


def card_with(machine: MachineProfile, dialect: Dialect) -> Wire:
    card = wire(machine, dialect)
    card.tell(f"I222={RTIF}", "I219=1", "#1J/#2J/#3J/", "&1#2->0", "OPEN PROG 1 CLEAR", *PROGRAM, "CLOSE")
    card.sim.wait(0.1)
    return card


def time_base(card: Wire, trigger: TimeBaseTrigger | None = None) -> None:
    """Let the spindle lead coordinate system 1."""
    place, dialect = places(card.card.dialect), card.card.dialect
    source = place.encoder if trigger is None else place.channel
    pmac2 = trigger is not None and dialect is TURBO
    entry = TimeBaseEntry(
        line=place.line, source=source, factor=nearest_factor(RTIF), trigger=trigger, pmac2_encoder=pmac2
    )
    card.tell(*entry.commands(dialect))


def record(card: Wire, motor: int) -> Recorder:
    recorder = Recorder(card.card.motors[motor].axis)
    card.card.motors[motor].axis = recorder
    return recorder


def finish(card: Wire) -> None:
    """Let time pass until the program has come to its end; the spindle turns on."""
    system = card.card.systems[1]
    for _ in range(1000):
        card.sim.wait(0.02)
        if not (system.running or system.moving):
            return
    raise AssertionError("the program does not end")


def ripple(card: Wire, share: float) -> None:
    spindle: Any = card.card.motors[SPINDLE].axis
    spindle.speed_ripple = share


def in_real_time(machine: MachineProfile, dialect: Dialect) -> tuple[Floats, Floats]:
    """The path of the program at the time base of the card itself: ms, counts."""
    card = card_with(machine, dialect)
    carriage = record(card, CARRIAGE)
    card.tell("&1B1R")
    finish(card)
    counts = np.array([0.0, *carriage.commands])
    times_ms: Floats = np.asarray(np.arange(len(counts)) * card.card.servo_period_ms, np.float64)
    return times_ms, counts


def led(machine: MachineProfile, dialect: Dialect, share: float) -> tuple[Floats, Floats]:
    """The path of the program with the spindle as its clock: turned counts / RTIF since R in ms, counts."""
    card = card_with(machine, dialect)
    time_base(card)
    card.tell("#2J+")
    card.sim.wait(1.0)
    ripple(card, share)
    spindle, carriage = record(card, SPINDLE), record(card, CARRIAGE)
    card.sim.wait(0.1)
    before = len(spindle.positions)
    card.tell("&1B1R")
    finish(card)
    parts = np.floor(32.0 * np.array(spindle.positions)) / 32.0
    # The counts of the cycle that has just ended are the time of this one.
    turned = parts[before - 1 : -1] - parts[before - 2]
    turned_ms: Floats = np.asarray(turned / RTIF, np.float64)
    return turned_ms, np.array(carriage.commands[before:])


@FAMILIES
def test_on_the_external_time_base_a_program_is_at_its_angle(machine: MachineProfile, dialect: Dialect) -> None:
    path_ms, path = in_real_time(machine, dialect)
    for share in (0.0, 0.05):
        turned_ms, counts = led(machine, dialect, share)
        expected = np.interp(turned_ms, path_ms, path)
        assert counts == pytest.approx(expected, abs=0.05)  # straight lines between two samples of the path
        assert np.ptp(counts) > 800.0
    by_clock = np.interp(np.arange(len(counts)) * 0.4427, path_ms, path)
    assert np.abs(counts - by_clock).max() > 5.0


def test_a_dwell_passes_in_real_time_and_loses_the_phase(machine: MachineProfile) -> None:
    card = card_with(machine, PMAC)
    card.tell("OPEN PROG 2 CLEAR", "LINEAR INC TA40 TS0 TM100", "Z100", "DWELL200", "Z100", "CLOSE")
    time_base(card)
    card.tell("I222=64", "#2J+")
    card.sim.wait(1.0)
    spindle, carriage = record(card, SPINDLE), record(card, CARRIAGE)
    card.tell("&1B2R")
    finish(card)
    still = np.flatnonzero(np.array(carriage.commands) == 100.0)
    # At half the speed moves take twice their time, and the dwell does not.
    assert len(still) * card.card.servo_period_ms == pytest.approx(200.0, abs=1.0)
    moving = np.flatnonzero((np.array(carriage.commands) > 0.0) & (np.array(carriage.commands) < 100.0))
    assert len(moving) * card.card.servo_period_ms == pytest.approx(2 * 140.0, abs=1.5)
    assert spindle.positions[-1] - spindle.positions[0] > 0.0


@FAMILIES
def test_a_triggered_program_begins_exactly_at_the_index(machine: MachineProfile, dialect: Dialect) -> None:
    path_ms, path = in_real_time(machine, dialect)
    card = card_with(machine, dialect)
    card.tell("#2J+")
    card.sim.wait(1.0)
    place = places(dialect)
    card.tell(place.trigger)
    time_base(card, TimeBaseTrigger.FROZEN)
    card.tell("&1B1R")
    spindle, carriage = record(card, SPINDLE), record(card, CARRIAGE)
    card.sim.wait(0.3)  # nearly four turns, and nothing moves
    assert np.ptp(carriage.commands) == 0.0
    card.tell(f"M199={place.armed}")
    armed = len(spindle.positions)
    assert card.ask("M199") == [f"{place.armed}"]
    ripple(card, 0.05)
    finish(card)
    assert card.ask("M199") == [f"{place.running}"]
    machine_counts = np.array(spindle.positions) + card.card.motors[SPINDLE].axis.origin
    turns = np.floor(machine_counts / 10_000.0)
    index = int(np.flatnonzero(turns[1:] > turns[armed])[0]) + 1
    begins = 10_000.0 * turns[index]
    turned_ms = (np.rint(machine_counts[index - 1 : -1]) - begins) / RTIF
    expected = np.interp(np.maximum(turned_ms, 0.0), path_ms, path)
    assert np.array(carriage.commands[index:]) == pytest.approx(expected, abs=0.15)


@FAMILIES
def test_the_time_base_is_reported_and_goes_with_the_master(machine: MachineProfile, dialect: Dialect) -> None:
    card = card_with(machine, dialect)
    time_base(card)
    card.sim.wait(0.1)
    assert float(card.ask("%")[0]) == 0.0
    card.tell("#2J+")
    card.sim.wait(1.0)
    assert float(card.ask("%")[0]) == pytest.approx(100.0, abs=0.1)
    card.tell("%20")
    card.sim.wait(0.1)
    assert float(card.ask("%")[0]) == pytest.approx(100.0, abs=0.1)
    card.tell("I5193=0" if dialect is TURBO else "I193=0")
    card.sim.wait(1.0)
    assert float(card.ask("%")[0]) == pytest.approx(20.0, abs=0.1)


def test_a_master_that_stops_and_turns_back_takes_the_motion_with_it(machine: MachineProfile) -> None:
    card = card_with(machine, PMAC)
    card.tell("OPEN PROG 3 CLEAR", "LINEAR INC TA10 TS0 TM1000", "Z5000", "CLOSE")
    time_base(card)
    card.tell("&1B3R", "#2J=64000")
    card.sim.wait(3.0)
    here = card.card.motors[CARRIAGE].desired
    # 64000 counts are 500 ms of a move of 1010 ms.
    assert here == pytest.approx(5000 * 495 / 1000, abs=3.0)
    card.tell("#2J=32000")
    card.sim.wait(3.0)
    assert card.card.motors[CARRIAGE].desired == pytest.approx(5000 * 245 / 1000, abs=3.0)
    card.tell("#2J=160000")
    card.sim.wait(3.0)
    assert card.card.motors[CARRIAGE].desired == 5000.0


def follow(card: Wire, teeth: int, *, offset: bool = False) -> None:
    dialect = card.card.dialect
    place = places(dialect)
    if dialect is PMAC:
        card.tell(f"I305=${place.encoder + 0x10000 * offset:X}", f"I307={teeth}", "I306=1")
    else:
        card.tell(f"I305=${place.encoder:X}", f"I307={teeth}", f"I306={3 if offset else 1}")


@FAMILIES
def test_a_motor_follows_the_spindle_by_the_ratio_of_its_gears(machine: MachineProfile, dialect: Dialect) -> None:
    card = card_with(machine, dialect)
    follow(card, 48)
    card.tell("#2J=8000")
    card.settle()
    assert card.ask("#3P") == ["4000"]
    follow(card, -24)
    card.tell("#2J=0")
    card.settle()
    assert card.ask("#3P") == ["6000"]
    # What was followed counts as motion of the motor: a move to a place cancels it.
    card.tell("#3J=1000")
    card.settle()
    assert card.ask("#3P") == ["1000"]
    assert card.card.motors[CARRIAGE].actual == 1000.0


@FAMILIES
def test_in_offset_mode_what_is_followed_is_left_out(machine: MachineProfile, dialect: Dialect) -> None:
    card = card_with(machine, dialect)
    follow(card, 48, offset=True)
    card.tell("#2J=8000")
    card.settle()
    assert (card.ask("#3P"), card.card.motors[CARRIAGE].actual) == (["0"], 4000.0)
    card.tell("#3J=1000")
    card.settle()
    assert (card.ask("#3P"), card.card.motors[CARRIAGE].actual) == (["1000"], 5000.0)
    card.tell("M167->" + ("D:$A5" if dialect is PMAC else "D:$18D"))
    assert float(card.ask("M167")[0]) == 4000 * 96 * 32


def test_a_jog_under_way_is_added_to_what_is_followed(machine: MachineProfile) -> None:
    card = card_with(machine, PMAC)
    follow(card, 96)
    card.tell("#2J=2000", "#3J=10000")
    card.settle()
    assert card.card.motors[CARRIAGE].actual == 12_000.0
    assert card.ask("#3F") == ["0"]


def test_following_goes_on_through_the_zero_of_a_home_search_of_the_master(machine: MachineProfile) -> None:
    card = card_with(machine, PMAC)
    follow(card, 96)
    began = card.card.motors[SPINDLE].true_position
    card.tell("#2HM")
    card.settle()
    moved = card.card.motors[SPINDLE].true_position - began
    assert moved > 1000.0
    assert card.card.motors[CARRIAGE].actual == pytest.approx(moved, abs=1 / 32)


@FAMILIES
def test_the_set_up_of_a_time_base_is_saved(machine: MachineProfile, dialect: Dialect, tmp_path: Path) -> None:
    card = wire(machine, dialect, tmp_path / "saved.json")
    time_base(card)
    card.tell("SAVE")
    later = wire(machine, dialect, tmp_path / "saved.json")
    later.tell("#2J/", "#2J+")
    later.sim.wait(1.0)
    assert float(later.ask("%")[0]) > 5.0
    later.raw("$$$***\r")
    later.raw("\x18I3=2 I4=0 I6=1\r")
    assert later.ask("RY$72A" if dialect is PMAC else "I8008") == ["0" if dialect is PMAC else "$0"]


def test_the_conversion_table_of_the_factory(machine: MachineProfile) -> None:
    card = wire(machine)
    assert card.ask("RHY$720,10")[0].split() == [
        *(f"{0xC000 + 4 * channel:06X}" for channel in range(8)),
        "400723",
        "000400",
    ]
    turbo = wire(machine, TURBO)
    assert turbo.ask("I8000..8008") == [*("$78000 $78008 $78010 $78018 $78100 $78108 $78110 $78118".split()), "$0"]
    card.tell("M198->X:$721,0,24,S", "#2J/", "#2J=1000")
    card.settle()
    assert float(card.ask("M198")[0]) == 32 * card.card.motors[SPINDLE].true_position


# Position following: a pair of gears of whole teeth, of which nothing gets lost.

ROLL = 2**24


def setup(teeth: int = 96, own_teeth: int = 96, mode: FollowingMode = FollowingMode.NORMAL) -> FollowingSetup:
    return FollowingSetup(mode=mode, master=0x720, teeth=teeth, own_teeth=own_teeth)


@pytest.mark.parametrize(
    ("dialect", "settings", "mode", "master"),
    [
        (PMAC, {105: 0x721, 106: 0}, FollowingMode.OFF, 0x721),
        (PMAC, {105: 0x721, 106: 1}, FollowingMode.NORMAL, 0x721),
        (PMAC, {105: 0x10721, 106: 1}, FollowingMode.OFFSET, 0x721),
        (PMAC, {105: 0x10721, 106: 0}, FollowingMode.OFF, 0x721),
        (TURBO, {105: 0x3502, 106: 0}, FollowingMode.OFF, 0x3502),
        (TURBO, {105: 0x3502, 106: 1}, FollowingMode.NORMAL, 0x3502),
        (TURBO, {105: 0x3502, 106: 2}, FollowingMode.OFF, 0x3502),
        (TURBO, {105: 0x3502, 106: 3}, FollowingMode.OFFSET, 0x3502),
        (TURBO, {}, FollowingMode.OFF, 0),
    ],
)
def test_where_each_family_keeps_the_mode(
    dialect: Dialect, settings: dict[int, float], mode: FollowingMode, master: int
) -> None:
    read = FollowingSetup.of_motor(1, {**settings, 107: -30, 108: 96}, dialect)
    kept_out = settings.get(105, 0) >= 0x10000 or settings.get(106, 0) >= 2
    assert read == FollowingSetup(mode=mode, master=master, teeth=-30, own_teeth=96, offset=kept_out)


@given(st.integers(-(2**23), 2**23 - 1), st.integers(1, 1000), st.lists(st.integers(-4000, 4000), max_size=40))
def test_the_motor_goes_by_the_exact_ratio(teeth: int, own_teeth: int, changes: list[int]) -> None:
    gears, register = setup(teeth, own_teeth), 0
    following = Following(master_parts=0)
    travelled = 0
    for change in changes:
        register = (register + change) % ROLL
        following, increment = following.step(gears, register)
        travelled += increment
    assert travelled == following.followed
    master_counts = Fraction(sum(changes), 32)
    assert Fraction(following.followed, own_teeth * 32) == master_counts * Fraction(teeth, own_teeth)


def test_a_ratio_leaves_nothing_and_may_change_on_the_way() -> None:
    following, gears = Following(master_parts=0), setup(32, 96)
    for turn in range(1, 4):
        following, increment = following.step(gears, parts_of(1000.0 * turn))
        assert in_counts(increment, gears) == pytest.approx(1000 / 3)
    assert in_counts(following.followed, gears) == 1000.0
    following, _ = Following(master_parts=0).step(setup(96), parts_of(100))
    following, increment = following.step(setup(-192), parts_of(150))
    assert in_counts(increment, setup()) == -100.0
    assert in_counts(following.followed, setup()) == 0.0
    following, increment = Following(master_parts=0).step(setup(mode=FollowingMode.OFF), parts_of(5000))
    assert (increment, following.followed) == (0, 0)
    _, increment = following.step(setup(), parts_of(5001))
    assert in_counts(increment, setup()) == 1.0


@given(st.integers(0, ROLL - 1), st.integers(-(2**23), 2**23 - 1))
def test_the_register_of_the_master_rolls_over(old: int, change: int) -> None:
    assert register_change((old + change) % ROLL, old) == change


def test_only_whole_thirty_seconds_of_a_count_are_seen() -> None:
    assert [parts_of(counts) for counts in (1.0, 0.5, 0.04, 0.02, -0.01)] == [32, 16, 1, 0, -1]


# External time base: trajectory time from the counts of a master, frozen, armed and running.


@pytest.mark.parametrize(("counts_per_ms", "factor"), [(128, 1024), (163.84, 800), (256, 512), (204.8, 640)])
def test_the_scale_factors_of_the_manuals(counts_per_ms: float, factor: int) -> None:
    assert nearest_factor(counts_per_ms) == factor


@pytest.mark.parametrize("counts_per_ms", [128, 163.84, 256])
def test_at_the_real_time_frequency_the_time_base_is_100_percent(counts_per_ms: float) -> None:
    factor = nearest_factor(counts_per_ms)
    # A thousand servo cycles of a master at that speed: the time of the trajectory is the time of the clock.
    cycle_ms = servo_cycle_ms(3_713_707)
    parts = [int(cycle * cycle_ms * counts_per_ms * 32) for cycle in range(1001)]
    units = sum(increment_units(factor, new - old) for old, new in pairwise(parts))
    assert units / UNITS_PER_MS == pytest.approx(1000 * cycle_ms, abs=1 / (32 * counts_per_ms))


@given(st.integers(1, 2**23 - 1), st.lists(st.integers(-(2**10), 2**10), max_size=50))
def test_no_count_of_the_master_is_lost_below_saturation(factor: int, changes: list[int]) -> None:
    small = [change for change in changes if abs(2 * factor * change) < 2**23]
    total = sum(increment_units(factor, change) for change in small)
    assert Fraction(total, 2**23) == Fraction(factor, 2**17) * Fraction(sum(small), 32)


def test_a_thirty_second_of_a_count_is_seen_and_a_cycle_gives_less_than_1_ms() -> None:
    assert increment_units(1024, parts_of(1.0)) == UNITS_PER_MS / 128
    assert increment_units(1024, parts_of(1 / 32)) == UNITS_PER_MS / 4096
    assert increment_units(1024, parts_of(1 / 33)) == 0
    # RTIF 32 counts/ms at 2.25 kHz is full at 72 counts/ms, 32 counts a cycle.
    factor = nearest_factor(32)
    assert increment_units(factor, parts_of(31.0)) == UNITS_PER_MS * 31 / 32
    assert increment_units(factor, parts_of(32.0)) == increment_units(factor, parts_of(50.0)) == 2**23 - 1
    assert increment_units(factor, parts_of(-50.0)) == -UNITS_PER_MS


def test_a_frozen_time_base_stands_and_one_set_running_by_hand_does_not_jump() -> None:
    base = TriggeredTimeBase(state=TimeBaseTrigger.RUNNING, factor=800, counts=1000)
    base, units = replace(base, state=TimeBaseTrigger.FROZEN).step(1072)
    assert (base.state, units) == (TimeBaseTrigger.FROZEN, 0)
    base, units = base.step(1144, captured=1100)
    assert (base.state, units) == (TimeBaseTrigger.FROZEN, 0)
    base, units = replace(base, state=TimeBaseTrigger.ARMED).step(1216)
    assert (base.state, units) == (TimeBaseTrigger.ARMED, 0)
    base, _ = TriggeredTimeBase(state=TimeBaseTrigger.FROZEN, factor=800).step(50_000)
    _, units = replace(base, state=TimeBaseTrigger.RUNNING).step(50_010)
    assert units / UNITS_PER_MS == 10 / 163.84


def test_time_begins_exactly_at_the_captured_count() -> None:
    # 4096 lines at 600 rpm, 163.84 counts/ms: 45 deg behind the index are 2048 counts, 12.5 ms.
    base = TriggeredTimeBase(state=TimeBaseTrigger.ARMED, factor=800, counts=16_300)
    base, units = base.step(16_390, captured=16_384)
    assert base.state is TimeBaseTrigger.RUNNING
    assert units / UNITS_PER_MS == 6 / 163.84
    elapsed = units
    for counts in [*range(16_462, 16_384 + 2048, 72), 16_384 + 2048]:
        base, units = base.step(counts)
        elapsed += units
    assert elapsed / UNITS_PER_MS == 12.5


def test_the_set_up_lines_of_the_manuals() -> None:
    untriggered = TimeBaseEntry(line=9, source=0x723, factor=512)
    assert untriggered.commands(PMAC) == ["WY:$729,$400723,512", "I193=$72A", "I194=8388607"]
    triggered = TimeBaseEntry(line=10, source=0xC00C, factor=800, trigger=TimeBaseTrigger.RUNNING)
    assert triggered.commands(PMAC)[:2] == ["WY:$72A,$A0C00C,800", "I193=$72B"]
    turbo = TimeBaseEntry(line=8, source=0x3504, factor=512)
    assert turbo.commands(TURBO) == ["I8008=$403504", "I8009=512", "I5193=$350A", "I5194=8388607"]
    assert turbo.commands(TURBO, system=2)[2:] == ["I5293=$350A", "I5294=8388607"]
    entry = TimeBaseEntry(line=8, source=0x78018, factor=512, trigger=TimeBaseTrigger.FROZEN, pmac2_encoder=True)
    assert f"{entry.word():06X}" == "9F8018"  # 9, bit 19, and the address below it
    assert entry_of(0, 0xC000, 0) is None


@pytest.mark.parametrize(
    "entry",
    [
        TimeBaseEntry(line=9, source=0x723, factor=512),
        TimeBaseEntry(line=10, source=0xC00C, factor=800, trigger=TimeBaseTrigger.ARMED),
        TimeBaseEntry(line=8, source=0x78018, factor=512, trigger=TimeBaseTrigger.FROZEN, pmac2_encoder=True),
    ],
)
def test_an_entry_is_read_back_from_its_words(entry: TimeBaseEntry) -> None:
    assert entry_of(entry.line, entry.word(), entry.factor) == entry
