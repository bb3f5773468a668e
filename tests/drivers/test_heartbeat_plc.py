"""The PLC of the heartbeat, what keeps it, what arms it, and its page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS, PMAC, TURBO, Dialect
from drivers.pmac.heartbeat.arming import HeartbeatLook, heartbeat_problems, read_heartbeat
from drivers.pmac.heartbeat.plc import Policy, plc_lines, plc_text, set_up_lines
from drivers.pmac.heartbeat.watch import LOSS_SEEN, NOTHING_GUARDED, Keeper, WatchdogProof, proof_problems
from drivers.pmac.heartbeat.watchdog import (
    cycles_of,
    wait_timer,
    watchdog_condition,
    watchdog_line,
    watchdog_timer,
)
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.store import load_machine
from profiles.words.sentences import words_of
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
    dialect: Dialect, policy: Policy, activity: int, scans: list[tuple[dict[str, float], float]], cycles: int
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


def test_what_the_plc_does_not_tell_a_spindle_on_an_inverter_or_an_unhomed_tool(machine: MachineProfile) -> None:
    inverter = replace(machine, spindle=replace(machine.spindle, drive="inverter"))
    for policy in Policy:
        lines = plc_lines(inverter, PMAC, policy)
        assert any("#1J/#3J/" in line for line in lines)
        assert not any("#2" in line for line in lines)
        assert not any(f"M{number}" in line for line in lines for number in (1002, 1005, 1012, 1013))
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


# The host's side: what a lease is on each family, when it is due, and the lines that carry it.

FACTORY_I10 = 3_713_707


def test_a_lease_is_300_ms_in_a_timer_that_a_program_looks_at() -> None:
    """300 / (3713707 / 8388608) = 677.6, and not a cycle more than 300 ms."""
    assert watchdog_line(TURBO) == "I5111=677"
    assert watchdog_line(PMAC) == "M70=677"
    assert watchdog_line(TURBO, 2**23 / 10) == "I5111=3000"
    assert watchdog_condition(TURBO) == "I5111>0"
    assert watchdog_condition(PMAC) == "M70>0"


@given(st.floats(1e-3, 1e4), st.integers(1, 2**23 - 1))
def test_a_time_is_never_rounded_up(time_ms: float, i10: int) -> None:
    cycles = cycles_of(time_ms, i10)
    assert cycles * i10 / 2**23 <= time_ms * (1 + 1e-12)
    assert (cycles + 1) * i10 / 2**23 > time_ms * (1 - 1e-12)


def test_a_renewal_is_due_every_50_ms_and_a_lease_lapses_after_300() -> None:
    keeper = Keeper(dialect=TURBO, i10=FACTORY_I10)
    assert keeper.due_s(7.0) == 7.0
    assert keeper.record_renewal(7.0).due_s(7.02) == pytest.approx(7.05)
    keeper = Keeper(dialect=TURBO, i10=FACTORY_I10)
    assert keeper.has_lapsed(0.0)
    assert not keeper.record_renewal(1.0).has_lapsed(1.29)
    assert keeper.record_renewal(1.0).has_lapsed(1.3)


def test_what_is_guarded_is_said_behind_the_lease_in_one_short_line() -> None:
    keeper = Keeper(dialect=TURBO, i10=FACTORY_I10)
    assert keeper.jog_line() == "I5111=677 P1003=1"
    assert keeper.cut_line(-10_000.0, 1300.0) == "P1005=-10000 P1007=2936 P1010=790 I5111=677 P1003=2"
    assert Keeper(dialect=PMAC, i10=FACTORY_I10).jog_line() == "M70=677 P1003=1"
    assert (NOTHING_GUARDED, LOSS_SEEN) == ("P1003=0", "P1004=0")
    # 20 a second with their acknowledgements over 9600 baud, 960 characters a second: less than a quarter.
    for dialect in (PMAC, TURBO):
        assert 20 * (len(watchdog_line(dialect)) + len("\r\x06")) < 960 / 4


# The page about the heartbeat: the PLC that it quotes is the one that is sent, and its bounds hold.

PAGE = (Path(__file__).parents[2] / "docs" / "heartbeat.md").read_text(encoding="utf-8")


def quoted() -> str:
    section = PAGE.split("\n## The PLC\n", 1)[1]
    return re.split(r"^```\w*\n", section, maxsplit=2, flags=re.MULTILINE)[1]


def test_the_quoted_plc_is_the_generated_one_and_explained(machine: MachineProfile) -> None:
    assert quoted() == plc_text(machine, PMAC, Policy.RETRACT)
    code = [line.partition(";")[0].strip() for line in quoted().splitlines()]
    assert tuple(line for line in code if line) == plc_lines(machine, PMAC, Policy.RETRACT)
    used = set(re.findall(r"\bP10\d\d\b", quoted()))
    assert used == set(re.findall(r"\bP10\d\d\b", PAGE.split("\n## The PLC\n", 1)[0])) - {"P1000", "P1001"}


# What is read of the heartbeat before anything moves, and what it forbids; and the proof that it works.

FAMILIES = pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)
ROOT = Path(__file__).parents[2]


class Host:
    """A client on a card with the heartbeat, drives on."""

    def __init__(self, machine: MachineProfile, dialect: Dialect, *, loaded: bool = True) -> None:
        self.machine, self.dialect = machine, dialect
        self.sim = SimulatedLathe(machine, dialect=dialect)
        self.port = self.sim.connect()
        self.client = PmacClient(MemoryLink(self.port, self.sim), self.sim)
        self.client.connect()
        self.tell("I5=2", *(set_up_lines(machine, dialect, Policy.RETRACT) if loaded else ()))

    def tell(self, *lines: str) -> None:
        for line in lines:
            assert self.client.request(line) == ()

    def look(self) -> HeartbeatLook:
        return read_heartbeat(self.client, self.sim, self.machine, self.dialect)

    def problems(self, policy: Policy = Policy.RETRACT) -> tuple[Problem, ...]:
        return heartbeat_problems(self.look(), self.machine, self.dialect, policy)

    def codes(self, policy: Policy = Policy.RETRACT) -> list[str]:
        return [problem.code for problem in self.problems(policy)]


@FAMILIES
@pytest.mark.parametrize("i9", [0, 1, 2, 3])
def test_a_heartbeat_in_order_forbids_nothing(machine: MachineProfile, dialect: Dialect, i9: int) -> None:
    """In whatever form I9 has values and definitions reported."""
    host = Host(machine, dialect)
    host.tell(f"I9={i9}")
    assert host.codes() == []


@FAMILIES
@pytest.mark.parametrize(("i5", "refused"), [(0, True), (1, True), (2, False), (3, False)])
def test_i5_must_permit_background_plcs(machine: MachineProfile, dialect: Dialect, i5: int, refused: bool) -> None:
    host = Host(machine, dialect)
    host.tell(f"I5={i5}")
    assert host.codes() == (["heartbeat.plcs_forbidden"] if refused else [])


@FAMILIES
def test_a_card_without_the_plc_is_refused(machine: MachineProfile, dialect: Dialect) -> None:
    codes = Host(machine, dialect, loaded=False).codes()
    assert "heartbeat.plc_missing" in codes
    assert codes.count("heartbeat.definition_differs") == (17 if dialect is PMAC else 15)


@FAMILIES
def test_a_plc_for_another_policy_is_refused_and_named(machine: MachineProfile, dialect: Dialect) -> None:
    host = Host(machine, dialect)
    (problem,) = host.problems(Policy.FINISH)
    assert (problem.code, problem.value, problem.limit) == ("heartbeat.plc_differs", "ELSE", "ENDIF")


@FAMILIES
@pytest.mark.parametrize(
    ("ours", "theirs"),
    [("P1003=0", "P1003=1"), ('CMD"&1A"', 'CMD"&1H"'), ("M26=1", "M26=0"), ("ENDIF", "ENDIF P5=P5+1")],
)
def test_a_text_that_somebody_has_changed_is_refused(
    machine: MachineProfile, dialect: Dialect, ours: str, theirs: str
) -> None:
    host = Host(machine, dialect)
    lines = list(set_up_lines(machine, dialect, Policy.RETRACT))
    begin = lines.index("CLEAR")
    place = lines.index(ours, begin)
    host.tell(*lines[:place], theirs, *lines[place + 1 :])
    assert "heartbeat.plc_differs" in host.codes()


@FAMILIES
def test_a_spelling_of_another_card_is_no_difference(machine: MachineProfile, dialect: Dialect) -> None:
    look = Host(machine, dialect).look()
    assert look.listing is not None
    words = {"ENDWHILE": "ENDW", "ENDIF": "ENDI", "CMD": "COMMAND", "(": " ( "}
    respelled = look.listing
    for ours, theirs in words.items():
        respelled = tuple(line.replace(ours, theirs) for line in respelled)
    assert respelled != look.listing
    assert heartbeat_problems(replace(look, listing=respelled), machine, dialect, Policy.RETRACT) == ()


@FAMILIES
def test_a_text_that_cannot_be_read_is_refused(machine: MachineProfile, dialect: Dialect) -> None:
    host = Host(machine, dialect)
    look = replace(host.look(), listing=("WHAT IS THIS",))
    (problem,) = heartbeat_problems(look, machine, dialect, Policy.RETRACT)
    assert problem.code == "heartbeat.plc_differs"


@FAMILIES
@pytest.mark.parametrize("line", ["M1001->X:$1000,18", "M1009->*", "M26->Y:$1000,3", "M1004->D:$1000"])
def test_a_pointer_that_was_moved_is_refused(machine: MachineProfile, dialect: Dialect, line: str) -> None:
    host = Host(machine, dialect)
    host.tell(line)
    (problem,) = host.problems()
    number, _, target = line.partition("->")
    assert (problem.code, problem.key, problem.value) == ("heartbeat.definition_differs", number, target)


@FAMILIES
def test_a_plc_that_is_off_does_not_echo(machine: MachineProfile, dialect: Dialect) -> None:
    host = Host(machine, dialect)
    host.tell("DISABLE PLC20")
    assert host.codes() == ["heartbeat.plc_silent"]


def test_a_lease_that_is_no_timer_stands(machine: MachineProfile) -> None:
    host = Host(machine, PMAC)
    host.tell("M70->*")
    assert host.codes() == ["heartbeat.definition_differs", "heartbeat.timer_stands"]


@FAMILIES
def test_a_lease_at_another_rate_than_i10_is_refused(machine: MachineProfile, dialect: Dialect) -> None:
    """The hardware keeps its 442 us; a lease that is reckoned with half of that would last 600 ms."""
    host = Host(machine, dialect)
    host.tell(f"I10={3_713_707 // 2}")
    assert "heartbeat.timer_rate" in host.codes()
    host.tell(f"I10={3_713_707 * 2}")
    assert "heartbeat.timer_rate" in host.codes()
    host.tell("I10=3713707")
    assert host.codes() == []


@FAMILIES
def test_a_slow_background_alone_is_no_reason(machine: MachineProfile, dialect: Dialect) -> None:
    host = Host(machine, dialect)
    host.sim.faults.inject("slow-background", cycle_ms=100.0)
    assert host.codes() == []


@FAMILIES
@pytest.mark.parametrize(
    ("line", "code", "value"),
    [
        ("P1004=2", "heartbeat.lost", "program"),
        ("P1004=1", "heartbeat.lost", "jog"),
        ("P1004=7", "heartbeat.lost", "7"),
    ],
)
def test_a_loss_that_nobody_has_seen_forbids_the_next(
    machine: MachineProfile, dialect: Dialect, line: str, code: str, value: str
) -> None:
    host = Host(machine, dialect)
    host.tell(line)
    (problem,) = host.problems()
    assert (problem.code, problem.value) == (code, value)


@FAMILIES
def test_setting_up_anew_does_not_forget_a_loss(machine: MachineProfile, dialect: Dialect) -> None:
    host = Host(machine, dialect)
    host.tell("P1004=2", *set_up_lines(machine, dialect, Policy.RETRACT))
    assert host.codes() == ["heartbeat.lost"]


@FAMILIES
def test_the_guard_of_another_console_is_left_alone(machine: MachineProfile, dialect: Dialect) -> None:
    host = Host(machine, dialect)
    watchdog = "I5111" if dialect is TURBO else "M70"
    host.tell(f"{watchdog}=600 P1003=1")
    look = host.look()
    assert [p.code for p in heartbeat_problems(look, machine, dialect, Policy.RETRACT)] == ["heartbeat.guarding"]
    assert look.pulses[0].watchdog < 600
    assert look.pulses[1].watchdog < look.pulses[0].watchdog


@FAMILIES
def test_an_ending_under_way_forbids_the_next(machine: MachineProfile, dialect: Dialect) -> None:
    host = Host(machine, dialect)
    host.tell("#1J/#2J/#3J/", "OPEN PROG5 CLEAR", "LINEAR INC TA100 TM3000 X1000", "CLOSE", "&1B5")
    host.tell("P1007=3000 P1003=2 R")
    assert host.codes() == ["heartbeat.ending", "heartbeat.lost"]


@pytest.mark.parametrize(
    ("still_going_s", "ended_s", "at_rest_s", "codes"),
    [
        (0.28, 0.30, 0.4, []),
        (0.28, 0.33, 0.43, []),  # a slow link: the end may have been at 0.3
        (0.31, 0.33, 0.43, ["heartbeat.late"]),
        (0.61, None, None, ["heartbeat.not_ended"]),
        (0.28, 0.30, None, ["heartbeat.no_rest"]),
    ],
)
def test_what_a_proof_has_not_shown_is_said(
    still_going_s: float, ended_s: float | None, at_rest_s: float | None, codes: list[str]
) -> None:
    proof = WatchdogProof(still_going_s=still_going_s, ended_s=ended_s, at_rest_s=at_rest_s)
    assert [problem.code for problem in proof_problems(proof)] == codes


@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_refusal_has_a_sentence(language: str) -> None:
    sources = (ROOT / "drivers" / "pmac" / "heartbeat").glob("*.py")
    codes = {
        part.partition('"')[0]
        for source in sources
        for part in source.read_text(encoding="utf-8").split('code="heartbeat.')[1:]
    }
    sentences = words_of(language)
    assert len(codes) == 13
    assert sorted(code for code in codes if f"problem.heartbeat.{code}" not in sentences) == []
