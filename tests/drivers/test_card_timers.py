"""The timers of the simulated card, in the only unit that they have: servo cycles."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.plc_card import BLOCK, plc_card, reset, run_for, store, values
from tests.drivers.wire_card import Wire

WORDS = ("X:$700", "Y:$700", "X:$701", "Y:$701")
"""Non-Turbo, User Manual, Precise Timing."""

LOWEST = -8_388_608


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """A card whose timers are read and written as M70 to M73, or I5111, I5112, I5211 and I5212."""
    dialect: Dialect = request.param
    made = plc_card(machine, dialect)
    if dialect is PMAC:
        made.tell(*(f"M7{n}->{word},0,24,S" for n, word in enumerate(WORDS)))
    return made


def names(card: Wire) -> tuple[str, ...]:
    return ("M70", "M71", "M72", "M73") if card.card.dialect is PMAC else ("I5111", "I5112", "I5211", "I5212")


def test_timers_count_servo_cycles_down_through_zero(card: Wire) -> None:
    starts = (100, 5, -7, 8_388_607)
    card.tell(*(f"{name}={start}" for name, start in zip(names(card), starts, strict=True)))
    before = card.card.cycles
    for blocks in (0, 1, 10, 100):
        run_for(card, blocks)
        elapsed = card.card.cycles - before
        assert values(card, " ".join(names(card))) == [start - elapsed for start in starts]
    assert elapsed == 111 * BLOCK


def test_a_timer_stays_at_its_lowest_value(card: Wire) -> None:
    name = names(card)[0]
    card.tell(f"{name}={LOWEST + BLOCK + 3}")
    run_for(card)
    assert values(card, name) == [LOWEST + 3]
    run_for(card, 5)
    assert values(card, name) == [LOWEST]
    card.tell(f"{name}=4")
    run_for(card)
    assert values(card, name) == [4 - BLOCK], "and goes on from what is written"


def test_plc_0_reads_a_timer_in_the_servo_cycle_in_which_it_has_its_scan(card: Wire) -> None:
    name = names(card)[1]
    card.tell("I5=1 I8=3", f"{name}=1000")
    store(card, 0, f"P(P1+10)={name}\nP1=P1+1")
    run_for(card, 4)
    count = int(values(card, "P1")[0])
    assert count == 4 * BLOCK // 4
    seen = values(card, f"P10..{9 + count}")
    assert seen == [seen[0] - 4 * scan for scan in range(count)]
    assert 1000 - 4 <= seen[0] < 1000


def test_a_program_waits_by_a_timer(card: Wire) -> None:
    """The timer is looked at once a real-time interrupt (two backward jumps); the wait ends with its zero."""
    name = names(card)[0]
    text = (f"{name}=300", f"WHILE({name}>0)", "P1=P1+1", "ENDWHILE", f"P2={name}")
    card.tell("I8=2 #1J/ #2J/ #3J/", "OPEN PROG 1 CLEAR", *text, "CLOSE", "&1B1R")
    card.tell("P2=999")
    run_for(card, 300 // BLOCK)
    assert values(card, "P2") == [999], "it still waits"
    run_for(card, 2)
    assert -2 * BLOCK < values(card, "P2")[0] <= 0


LEASE_CYCLES = 677
"""300 ms at the factory's servo period."""


def test_a_lease_of_the_host_that_runs_out_stops_the_jog(card: Wire) -> None:
    """The PLC renews the timer at each sign of the host; when it has run out, it stops motor 1, once."""
    timer = names(card)[0]
    beat = f"IF(P100!=P101)\nP101=P100\n{timer}={LEASE_CYCLES}\nENDIF\n"
    card.tell(f"{timer}={LEASE_CYCLES}")
    store(card, 1, beat + f'IF({timer}!>0)\nAND(P102=0)\nP102=1\nCMD"#1J/"\nENDIF')
    card.tell("#1J+")
    for _ in range(100):
        card.tell("P100=P100+1")
        run_for(card, 7)
    motor = card.card.motors[1]
    assert motor.velocity == pytest.approx(50.0)
    card.tell("P100=P100+1")
    run_for(card)
    renewed = card.card.cycles
    while motor.velocity == pytest.approx(50.0):
        run_for(card)
    stopped_after = card.card.cycles - renewed
    # Renewed in the scan behind a block; the first scan at or below zero commands the stop of the next block.
    assert stopped_after == -(-LEASE_CYCLES // BLOCK) * BLOCK + BLOCK
    assert values(card, "P102") == [1]


def test_only_the_timers_of_activated_systems_run(machine: MachineProfile) -> None:
    """Turbo Software Reference, I68: systems 1 to I68 + 1."""
    card = plc_card(machine, TURBO)
    timers = "I5111 I5112 I5211 I5212 I5311 I6612"
    card.tell("I68=1", "I5111..5112=500 I5211..5212=500 I5311=500 I6612=500")
    run_for(card, 10)
    assert values(card, timers) == [390, 390, 390, 390, 500, 500]
    card.tell("I68=15")
    run_for(card, 10)
    assert values(card, timers) == [280, 280, 280, 280, 390, 390]
    card.tell("I68=0")
    run_for(card, 10)
    assert values(card, timers) == [170, 170, 280, 280, 390, 390]


def test_a_timer_of_24_bits_rolls_over_when_it_is_written(card: Wire) -> None:
    name = names(card)[0]
    for written, kept in ((8_388_608, LOWEST), (-5, -5), (2.6, 3)):
        card.tell(f"{name}={written}")
        assert values(card, name) == [kept]


def test_a_part_of_a_timer_word_is_a_part_of_what_it_says(machine: MachineProfile) -> None:
    card = plc_card(machine, PMAC)
    card.tell("M1->X:$700,8,8", "M2->X:$700,24", "M2=65536")
    assert values(card, "M1") == [0]
    run_for(card)
    assert values(card, "M2 M1") == [65536 - BLOCK, 255]
    assert card.ask("RHX$700") == [f"{65536 - BLOCK:06X}"]


def test_a_reset_begins_the_timers_of_a_turbo_at_0_and_save_does_not_keep_them(machine: MachineProfile) -> None:
    card = plc_card(machine, TURBO)
    card.tell("I5111=100000", "SAVE", "I5111=200000")
    reset(card)
    assert values(card, "I5111") == [0]
    run_for(card)
    assert values(card, "I5111") == [-BLOCK]
