"""A motor that follows the spindle, and a program whose time is the spindle's: on the card, in both families."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.master.time_base import TimeBaseEntry, Trigger, nearest_factor
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


def time_base(card: Wire, trigger: Trigger | None = None) -> None:
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
def test_a_program_on_the_external_time_base_is_where_the_angle_says_through_a_ripple(
    machine: MachineProfile, dialect: Dialect
) -> None:
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
    time_base(card, Trigger.FROZEN)
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
def test_in_offset_mode_what_is_followed_is_left_out_of_the_position(
    machine: MachineProfile, dialect: Dialect
) -> None:
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
