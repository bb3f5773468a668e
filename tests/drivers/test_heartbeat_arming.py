"""What is read of the heartbeat before anything moves, and what it forbids; and the proof that it works."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.heartbeat.arming import HeartbeatLook, heartbeat_problems, read_heartbeat
from drivers.pmac.heartbeat.plc import Policy, set_up_lines
from drivers.pmac.heartbeat.watch import WatchdogProof, proof_problems
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.words.sentences import words_of

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
def test_a_plc_for_another_policy_is_refused_with_the_first_difference(
    machine: MachineProfile, dialect: Dialect
) -> None:
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
def test_a_lease_that_counts_at_another_rate_than_i10_says_is_refused(
    machine: MachineProfile, dialect: Dialect
) -> None:
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
def test_what_another_console_guards_is_seen_and_its_lease_left_alone(
    machine: MachineProfile, dialect: Dialect
) -> None:
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
