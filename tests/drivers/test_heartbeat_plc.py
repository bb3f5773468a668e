"""The PLC by itself, whatever the card shows it: one command a scan, and none that would close a loop."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import DIALECTS, PMAC, TURBO, Dialect
from drivers.pmac.heartbeat.plc import Policy, plc_lines, plc_text
from drivers.pmac.heartbeat.watchdog import wait_timer, watchdog_line, watchdog_timer
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.drivers.plc_bench import PlcBench

WATCHDOG, SCAN_CYCLES = 677, 11
"""300 ms and a background cycle of 5 ms at the 442 us of the factory's I10."""

OPEN = {1: "M1001", 2: "M1002", 3: "M1003"}
AMPLIFIER = {1: "M1004", 2: "M1005", 3: "M1006"}
STATUS = ("M1000", *OPEN.values(), *AMPLIFIER.values(), "M1007", "M1008", "M1012", "M1013", "M1014")
CLOSED = {**dict.fromkeys(OPEN.values(), 0.0), **dict.fromkeys(AMPLIFIER.values(), 1.0)}
COUNT = 96 * 32
"""I108 = 96: the registers of the tool are in 1/3072 count."""

OUT_AT = 1000.0

families = st.sampled_from(sorted(DIALECTS)).map(DIALECTS.__getitem__)
CUTTING = {**CLOSED, **dict.fromkeys(("M1000", "M1008", "M1014"), 1.0)}
statuses = st.sets(st.sampled_from(STATUS)).map(
    lambda turned: {name: float((CUTTING.get(name, 0.0) == 1.0) != (name in turned)) for name in STATUS}
)
"""A cut with every loop closed, and any of its bits turned round."""

places = st.floats(-5000.0, 20_000.0)


class Card:
    """Background cycles of a card: its timers count, then the PLC has a scan."""

    def __init__(self, machine: MachineProfile, dialect: Dialect, policy: Policy) -> None:
        self.bench = PlcBench(plc_text(machine, dialect, policy), dialect, I108=96, P1005=OUT_AT, P1007=500)
        self.watchdog = watchdog_timer(dialect).name
        self._timers = (self.watchdog, wait_timer(dialect).name)

    def show(self, status: Mapping[str, float]) -> None:
        for name, value in status.items():
            self.bench.set(name, value)

    def scan(self, cycles: int = SCAN_CYCLES) -> list[str]:
        """Return the commands that the scan has given."""
        for name in self._timers:  # they stay at their lowest value (Turbo Software Reference, Isx11)
            self.bench.set(name, max(self.bench.value(name) - cycles, -(2.0**23)))
        assert self.bench.scan() is None
        return [str(said[1]) for said in self.bench.said()]


def may_be_given(command: str, shown: Mapping[str, float], place: float) -> bool:
    """Whether a command closes nothing, by the manuals: J/, J= and A close the loops of their motors."""
    closed = {motor for motor in OPEN if not shown[OPEN[motor]] and shown[AMPLIFIER[motor]]}
    if command == "&1A":
        return closed == {1, 2, 3}
    if command == "&1Q":
        return True
    if command == "#1J=*":
        return 1 in closed and place > OUT_AT and bool(shown["M1014"])
    stopped = {int(motor) for motor in re.findall(r"#(\d)J/", command)}
    assert re.fullmatch(r"(#\dJ/)+", command)
    return stopped <= closed


@given(
    dialect=families,
    policy=st.sampled_from(Policy),
    activity=st.sampled_from([1, 2]),
    scans=st.lists(st.tuples(statuses, places), min_size=1, max_size=40),
    cycles=st.integers(1, 400),
)
def test_whatever_it_sees_it_gives_one_command_a_scan_and_closes_nothing(
    dialect: Dialect,
    policy: Policy,
    activity: int,
    scans: list[tuple[dict[str, float], float]],
    cycles: int,
) -> None:
    card = Card(load_machine("lee-2001-lathe").machine, dialect, policy)
    card.bench.set("P1003", activity)
    silent_scans = 0
    for shown, place in scans:
        card.show({**shown, "M1009": place * COUNT})
        echo = card.bench.value("P1002")
        given_now = card.scan(cycles)
        assert len(given_now) <= 1
        assert all(may_be_given(command, shown, place) for command in given_now)
        if activity == 2 and policy is Policy.FINISH:
            assert given_now == []
        # Only a scan in which a wait ends may pass without a count.
        silent_scans = silent_scans + 1 if card.bench.value("P1002") == echo else 0
        assert silent_scans <= 1
    assert card.bench.value("P1003") == 0
    assert card.bench.value("P1004") == activity


@pytest.mark.parametrize("closed", range(8))
def test_a_jog_is_ended_by_one_command_for_every_closed_motor(machine: MachineProfile, closed: int) -> None:
    card = Card(machine, TURBO, Policy.RETRACT)
    bits = {motor: closed >> motor - 1 & 1 for motor in OPEN}
    card.show({OPEN[motor]: 1.0 - bit for motor, bit in bits.items()})
    card.show({AMPLIFIER[motor]: float(bit) for motor, bit in bits.items()})
    card.bench.set("P1003", 1)
    commands = [command for _ in range(5) for command in card.scan()]
    everyone = [motor for motor in (1, 2, 3) if bits[motor]]
    assert commands == (["".join(f"#{motor}J/" for motor in everyone)] if everyone else [])


def test_a_spindle_on_an_inverter_is_never_told_anything(machine: MachineProfile) -> None:
    inverter = replace(machine, spindle=replace(machine.spindle, drive="inverter"))
    for policy in Policy:
        lines = plc_lines(inverter, PMAC, policy)
        assert any("#1J/#3J/" in line for line in lines)
        assert not any("#2" in line for line in lines)
        assert not any(f"M{number}" in line for line in lines for number in (1002, 1005, 1012, 1013))


def test_an_unhomed_tool_is_not_sent_to_a_place(machine: MachineProfile) -> None:
    for homed, sent in ((0.0, []), (1.0, ["#1J=*"])):
        card = Card(machine, PMAC, Policy.STOP)
        card.show({**CLOSED, "M1000": 1.0, "M1007": 1.0, "M1009": 9000.0 * COUNT, "M1012": 1.0, "M1014": homed})
        card.bench.set("P1003", 2)
        commands = [command for _ in range(20) for command in card.scan()]
        assert commands == ["&1A", *sent]


def test_the_abort_the_way_out_and_the_spindle_are_scans_apart(machine: MachineProfile) -> None:
    """Although every bit already says what is waited for: what a command does is not seen in its own scan."""
    card = Card(machine, PMAC, Policy.STOP)
    card.show({**CLOSED, "M1000": 1.0, "M1007": 1.0, "M1009": 9000.0 * COUNT, "M1014": 1.0})
    card.bench.set("P1003", 2)
    assert card.scan() == ["&1A"]
    waited = [card.scan() for _ in range(4)]
    assert waited == [[]] * 4, "20 ms"
    assert card.scan() == ["#1J=*"]
    card.show({"M1009": OUT_AT * COUNT})
    assert [card.scan() for _ in range(5)] == [[]] * 5
    assert card.scan() == ["#2J/"]


def test_a_spindle_that_is_just_coming_to_rest_is_not_told_to(machine: MachineProfile) -> None:
    card = Card(machine, PMAC, Policy.RETRACT)
    card.show({**CLOSED, "M1014": 1.0})
    card.bench.set("P1003", 2)
    assert card.scan() == []
    card.show({"M1012": 1.0})
    assert [card.scan() for _ in range(20)] == [[]] * 20


def test_the_place_of_the_tool_counts_with_the_bias_of_its_axis(machine: MachineProfile) -> None:
    """P reports the register and the bias together: 9000 - 8400 is further out than 1000."""
    card = Card(machine, PMAC, Policy.STOP)
    card.show({**CLOSED, "M1000": 1.0, "M1007": 1.0, "M1012": 1.0, "M1014": 1.0})
    card.show({"M1009": 9000.0 * COUNT, "M1010": -8400.0 * COUNT})
    card.bench.set("P1003", 2)
    assert [command for _ in range(20) for command in card.scan()] == ["&1A"]


@pytest.mark.parametrize(("dialect", "activity"), [(PMAC, 1), (TURBO, 2)], ids=["pmac jog", "turbo cut"])
def test_a_lease_renewed_for_ten_minutes_ends_nothing(
    machine: MachineProfile, dialect: Dialect, activity: int
) -> None:
    """Every 50 ms, the scan at the worst moment: right in front of the next renewal."""
    card = Card(machine, dialect, Policy.RETRACT)
    card.show({**CLOSED, "M1000": 1.0})
    card.bench.set("P1003", activity)
    name, _, value = watchdog_line(dialect).partition("=")
    for _ in range(600 * 20):
        card.bench.set(name, float(value))
        assert card.scan(112) == []
    assert card.bench.value("P1003") == activity
    assert card.bench.value("P1004") == 0
    assert card.bench.value("P1002") == 600 * 20


@pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)
def test_a_lease_that_nobody_renews_does_not_roll_over(machine: MachineProfile, dialect: Dialect) -> None:
    """A timer of 24 bits that counts on down would be positive again after 2^23 servo cycles, an hour."""
    card = Card(machine, dialect, Policy.RETRACT)
    for _ in range(10):
        card.scan(5000)
        assert card.bench.value(card.watchdog) == 0


def test_silence_is_280_ms(machine: MachineProfile) -> None:
    """677 - 632 servo cycles of 442.7 us; the rest of the 300 ms is for the background cycle."""
    card = Card(machine, TURBO, Policy.RETRACT)
    card.show(CLOSED)
    card.bench.set("P1003", 1)
    card.bench.set(card.watchdog, WATCHDOG)
    passed = 0
    while not card.scan(1):
        passed += 1
    assert passed + 1 == 632
    assert 632 * 3_713_707 / 2**23 == pytest.approx(279.8, abs=0.05)
