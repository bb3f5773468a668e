"""The heartbeat that the host keeps, and what it finds changed before a cut."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.commissioning.fingerprint import (
    ControllerFingerprint,
    console_facts,
    fingerprint_problems,
    read_fingerprint,
)
from drivers.cutting.planning import plan_cut
from drivers.cutting.strategy import Strategy
from drivers.errors import DriverError, RefusedError
from drivers.lathe.guards import accept_any_state
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StopPath, StoppedError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.program_load import load_program
from drivers.pmac.program_text import read_program
from drivers.pmac.reserved import ECHO, LOST, OWNER
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.store import load_job
from tests.drivers.commissioned import Commissioned, commissioned
from tests.drivers.families import machine as machine

SLOW = "OPEN PROG 3\nCLEAR\nINC\nTA100 TS0 TM60000\nZ60000\nCLOSE\n"


class Kept:
    """A lathe over a wire that can be told to fall silent: the card's time passes, this host's does not act."""

    def __init__(self, machine: MachineProfile) -> None:
        self.sim = SimulatedLathe(machine)
        self.link = MemoryLink(self.sim.connect(), self.sim)
        self.client = PmacClient(self.link, self.sim)
        self.stop = StopPath(self.link)
        heartbeat = Heartbeat(self.client, self.sim, machine)
        self.lathe = Lathe(self.client, machine, self.sim, self.stop, self._seen, heartbeat)
        self.on_look: Callable[[], None] = lambda: None
        self.lathe.connect()
        assert self.lathe.verify() == ()

    def _seen(self, snapshot: Snapshot) -> None:
        if snapshot.moving:
            self.on_look()

    def silent_once(self, seconds: float) -> None:
        """Sleep through the next look at something that moves."""

        def sleep() -> None:
            self.on_look = lambda: None
            self.sim.wait(seconds)

        self.on_look = sleep


@pytest.fixture
def kept(machine: MachineProfile) -> Kept:
    made = Kept(machine)
    made.lathe.enable()
    return made


def code(error: pytest.ExceptionInfo[DriverError]) -> str:
    return error.value.problems[0].code


def test_a_jog_arrives_with_its_lease_renewed(kept: Kept) -> None:
    kept.lathe.home()
    kept.lathe.jog_to(AxisName.CARRIAGE, 60_000.0)  # 6 s: twenty leases
    assert kept.lathe.snapshot().carriage.position == pytest.approx(60_000, abs=1)


def test_a_host_that_sleeps_in_a_jog_finds_it_ended_and_says_so(kept: Kept) -> None:
    kept.lathe.home()
    kept.silent_once(2.0)
    with pytest.raises(DriverError) as failed:
        kept.lathe.jog_to(AxisName.CARRIAGE, 60_000.0)
    assert code(failed) == "heartbeat.lapsed"
    carriage = kept.sim.controller.motors[3]
    assert carriage.desired < 10.0 * 600 + 2000, "10 counts/ms, ended within 0.3 s and its ramp"
    assert not carriage.jogging


def test_a_program_that_knows_no_lease_is_ended_by_the_card_when_this_host_is_silent(kept: Kept) -> None:
    kept.lathe.home()
    kept.lathe.program.load(read_program(SLOW))
    kept.lathe.program.start(3, 0.0)
    assert kept.client.numbers("P1003") == (2.0,), "the card guards a cut"
    kept.silent_once(3.0)
    with pytest.raises(DriverError) as failed:
        kept.lathe.program.follow(lambda _: None, 60.0)
    assert code(failed) == "heartbeat.lapsed"
    kept.sim.wait(1.0)
    assert kept.lathe.snapshot().at_rest and kept.lathe.snapshot().lost == 2
    assert kept.lathe.snapshot().carriage.position < 3000, "at 1 count/ms for the lease, the grace and the ramp"
    assert not kept.stop.reason, "it was left to the card"


def test_a_cut_that_lost_its_host_is_watched_until_the_controller_has_ended_it(kept: Kept) -> None:
    """A host that is back in time still passes on that the cut shall end early: it is called with each poll."""
    kept.lathe.home()
    kept.lathe.program.load(read_program(SLOW))
    kept.lathe.program.start(3, 0.0)
    kept.silent_once(0.5)  # the lease of 0.3 s has run out, the grace of the program has not
    seen: list[Snapshot] = []
    with pytest.raises(DriverError) as failed:
        kept.lathe.program.follow(seen.append, 60.0)
    assert code(failed) == "heartbeat.lapsed"
    lost = [snapshot for snapshot in seen if snapshot.lost]
    assert len(lost) > 10 and lost[0].moving and lost[-1].at_rest


def test_what_was_ended_is_acknowledged_before_anything_moves_again(kept: Kept) -> None:
    kept.silent_once(2.0)
    with pytest.raises(DriverError):
        kept.lathe.jog_to(AxisName.CARRIAGE, 60_000.0)
    kept.stop.stop("heartbeat")
    kept.lathe.wait_for_rest()
    kept.stop.release()
    kept.lathe.confirm_nobody_inside()
    with pytest.raises(RefusedError) as refused:
        kept.lathe.enable()
    assert code(refused) == "heartbeat.lost"
    kept.lathe.acknowledge_loss()
    kept.lathe.enable()
    kept.lathe.jog_to(AxisName.CARRIAGE, kept.sim.controller.motors[3].position + 500.0)


def test_without_permission_for_plcs_no_drive_is_switched_on(machine: MachineProfile) -> None:
    variables = {**machine.controller.variables, "I5": 0.0}
    made = Kept(replace(machine, controller=replace(machine.controller, variables=variables)))
    with pytest.raises(RefusedError) as refused:
        made.lathe.enable()
    assert "heartbeat.plcs_forbidden" in [problem.code for problem in refused.value.problems]
    assert not any(motor.enabled for motor in made.sim.controller.motors.values())


def test_a_stop_ends_the_guard_so_that_the_card_moves_nothing_behind_it(kept: Kept) -> None:
    kept.lathe.home()
    kept.lathe.program.load(read_program(SLOW))
    kept.lathe.program.start(3, 0.0)
    kept.sim.wait(0.1)
    kept.stop.stop("operator")
    kept.lathe.wait_for_rest()
    tool = kept.sim.controller.motors[1].desired
    kept.sim.wait(5.0)
    assert kept.sim.controller.motors[1].desired == tool
    assert kept.lathe.snapshot().at_rest


def test_a_plc_that_shows_the_same_count_twice_gets_its_time(kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy controller scans its PLC less often than it answers: it has 0.3 s to count."""
    numbers, told = kept.client.numbers, list[float]()

    def slowly(*items: str, **more: Any) -> tuple[float, ...]:
        found = numbers(*items, **more)
        if f"P{ECHO}" not in items or len(told) > 3:
            return found
        at = items.index(f"P{ECHO}")
        told.append(told[0] if told else found[at])
        return (*found[:at], told[0], *found[at + 1 :])

    kept.lathe.home()
    monkeypatch.setattr(kept.client, "numbers", slowly)
    kept.lathe.jog_to(AxisName.CARRIAGE, 500.0)
    assert len(told) == 4 and kept.lathe.snapshot().carriage.position == pytest.approx(500, abs=1)


@pytest.mark.parametrize("held_counts", [0.0, 40.0])
def test_a_step_of_the_tool_is_as_long_with_what_a_table_has_left(kept: Kept, held_counts: float) -> None:
    """Its commanded position has the correction, and that of a jog has not: it must count once."""
    kept.lathe.home()
    before = kept.lathe.snapshot().tool.commanded_position
    kept.sim.controller.motors[1].correction = held_counts
    kept.sim.wait(0.5)
    assert kept.lathe.snapshot().tool.commanded_position == pytest.approx(before + held_counts, abs=1)
    kept.lathe.jog_by(AxisName.TOOL, 500.0)
    assert kept.lathe.snapshot().tool.commanded_position == pytest.approx(before + held_counts + 500.0, abs=1)


@pytest.mark.parametrize(("policy", "within_s"), [("retract", 6.35), ("stop", 6.35), ("finish", float("inf"))])
def test_a_lost_cut_is_waited_for_long_enough(machine: MachineProfile, policy: str, within_s: float) -> None:
    """Its grace, here 3 s, 0.35 s for the program to end, 2 s for the tool to come out, and 1 s of allowance."""
    sim = SimulatedLathe(machine)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    given = replace(machine, heartbeat=replace(machine.heartbeat, policy=policy, grace_ms=3000.0))
    assert Heartbeat(client, sim, given).ends_within_s == pytest.approx(within_s)


@pytest.mark.parametrize("number", [13, 14, 15, 19, 20, 21, 22, 23])
def test_no_axis_is_jogged_with_other_limits_ramps_or_speeds_than_the_profile_has(kept: Kept, number: int) -> None:
    """Travel, the ramp of a stop, the ramps and speeds of a jog and of a home search."""
    kept.lathe.refuse_other_jog(AxisName.CARRIAGE)
    (value,) = kept.client.numbers(f"I3{number}")
    kept.client.request(f"I3{number}={value + 1.0}", lines=0)
    with pytest.raises(RefusedError) as refused:
        kept.lathe.refuse_other_jog(AxisName.CARRIAGE)
    assert [(each.code, each.key) for each in refused.value.problems] == [("controller.setting", f"I3{number}")]


def test_a_stop_while_the_controller_ends_a_lost_cut_is_obeyed_at_once(kept: Kept) -> None:
    kept.lathe.home()
    kept.lathe.program.load(read_program(SLOW))
    kept.lathe.program.start(3, 0.0)
    kept.silent_once(0.5)
    polls_after: list[Snapshot] = []

    def stopping(snapshot: Snapshot) -> None:
        if kept.stop.reason is not None:
            polls_after.append(snapshot)
        elif snapshot.lost:
            kept.stop.stop("space")

    with pytest.raises(StoppedError):
        kept.lathe.program.follow(stopping, 60.0)
    assert polls_after == []


def test_a_jog_whose_plc_falls_silent_is_stopped_by_this_host(kept: Kept) -> None:
    """Nothing else would end it any more: to 60 mm at 10 mm/s it has moved for some seconds at most."""
    kept.lathe.home()
    other = kept.sim.connect()
    kept.on_look = lambda: other.receive(b"DISABLE PLC20\r")
    with pytest.raises(DriverError) as failed:
        kept.lathe.jog_to(AxisName.CARRIAGE, 60_000.0)
    assert (code(failed), kept.stop.reason) == ("heartbeat.plc_silent", "heartbeat.plc_silent")
    kept.sim.wait(1.0)
    assert kept.lathe.snapshot().at_rest and kept.lathe.snapshot().carriage.position < 30_000


def test_no_drive_is_enabled_while_a_stop_is_in_force(machine: MachineProfile) -> None:
    made = Kept(machine)
    made.stop.stop("space")
    with pytest.raises(StoppedError):
        made.lathe.enable()
    assert not any(motor.amplifier_enabled for motor in made.sim.controller.motors.values())


@pytest.mark.parametrize(
    ("waited_s", "line", "lapses"),
    [
        (0.0, "", False),  # the line was held up on its way: the controller still counts down from 300 ms
        (0.2, "", False),  # 100 ms are left of its watchdog, enough for a renewal
        (0.27, "", True),  # 30 ms are left, fewer than the 50 ms between two renewals
        (0.0, f"P{LOST}=1", True),
        (0.0, f"P{OWNER}=4711", True),
    ],
)
def test_a_late_host_renews_only_its_own_watchdog(kept: Kept, waited_s: float, line: str, lapses: bool) -> None:
    """By its own clock it is 0.4 s late. Ended motions stay ended, and those of another console are its own."""
    late: Any = SimpleNamespace(s=0.0, wait=kept.sim.wait)
    late.now_s = lambda: kept.sim.now_s() + late.s
    heartbeat = Heartbeat(kept.client, late, kept.lathe.machine)
    heartbeat.prepare()
    kept.client.request(heartbeat.jog(line), lines=0)
    kept.sim.wait(waited_s)
    late.s = 0.4
    if not lapses:
        assert heartbeat.renewal()
        return
    with pytest.raises(DriverError) as failed:
        heartbeat.renewal()
    assert (code(failed), heartbeat.guarding) == ("heartbeat.lapsed", False)


def test_a_pause_renews_the_watchdog_every_50_ms(kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    heartbeat = Heartbeat(kept.client, kept.sim, kept.lathe.machine)
    heartbeat.prepare()
    began_s = kept.sim.now_s()
    heartbeat.pause(0.5)
    assert kept.sim.now_s() - began_s == pytest.approx(0.5, abs=0.01), "nothing is guarded"
    kept.client.request(heartbeat.jog(""), lines=0)
    request, sent = kept.client.request, list[str]()

    def record(line: str, *rest: Any, **more: Any) -> tuple[str, ...]:
        sent.append(line)
        return request(line, *rest, **more)

    monkeypatch.setattr(kept.client, "request", record)
    began_s = kept.sim.now_s()
    heartbeat.pause(0.5)
    assert kept.sim.now_s() - began_s == pytest.approx(0.5, abs=0.05)
    assert len(sent) == pytest.approx(10, abs=1) and len(set(sent)) == 1


@pytest.mark.parametrize(
    ("policy", "ends_early", "reason"),
    [
        ("stop", False, "heartbeat.plc_silent"),
        ("retract", True, "program: 3 s"),  # the program of this test knows no early end: its time runs out
        ("finish", False, "program: 3 s"),
    ],
)
def test_a_cut_whose_plc_falls_silent_is_ended_by_its_policy(
    machine: MachineProfile, policy: str, ends_early: bool, reason: str
) -> None:
    kept = Kept(replace(machine, heartbeat=replace(machine.heartbeat, policy=policy)))
    kept.lathe.enable()
    kept.lathe.home()
    kept.lathe.program.load(read_program(SLOW))
    kept.lathe.program.start(3, 0.0)
    other = kept.sim.connect()
    kept.on_look = lambda: other.receive(b"DISABLE PLC20\r")
    with pytest.raises(DriverError) as failed:
        kept.lathe.program.follow(lambda _: None, 3.0)
    assert code(failed) == "heartbeat.plc_silent"
    assert (kept.lathe.program.held, kept.stop.reason) == (ends_early, reason)


@pytest.mark.parametrize("guarded", [True, False])
def test_the_polls_of_a_cut_are_uneven_so_that_every_angle_is_seen(kept: Kept, guarded: bool) -> None:
    """23 ms on average, spread by 60 % either way; a program that is no cut has nothing to be seen at an angle."""
    kept.lathe.home()
    kept.lathe.program.load(read_program(SLOW.replace("60000", "2000")))
    kept.lathe.program.start(3, 0.0)
    polls: list[Snapshot] = []
    kept.lathe.program.follow(polls.append, 60.0, (lambda _: ()) if guarded else accept_any_state)
    asked_s = [poll.asked_s for poll in polls if poll.moving]
    apart_s = sorted(after - before for before, after in pairwise(asked_s))
    tenth = len(apart_s) // 10
    assert (apart_s[-tenth] - apart_s[tenth] > 0.015) is guarded


# What is compared before each cut: what a stranger changes is named, what the console does is no change.


def taken(card: Commissioned, since: ControllerFingerprint | None = None) -> ControllerFingerprint:
    return read_fingerprint(card.client, card.machine, card.dialect, since)


def told(card: Commissioned, before: ControllerFingerprint) -> list[tuple[str, str, str, str]]:
    """What is said of a card, once by a whole reading and once by the quick one: the same."""
    own = console_facts(card.machine, card.dialect)
    whole = fingerprint_problems(before, taken(card), own)
    assert fingerprint_problems(before, taken(card, before), own) == whole
    return [(p.code.removeprefix("fingerprint."), p.key, p.value, p.limit) for p in whole]


@pytest.fixture(scope="module")
def before(machine: MachineProfile) -> ControllerFingerprint:
    """That of a card to which nothing was done."""
    return taken(commissioned(machine))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("I116=400", ("changed", "I116", "400 counts/ms (80 mm/s)", "500 counts/ms (100 mm/s)")),
        ("I51=1", ("changed", "I51", "1", "0")),
        ("#3->100Z", ("changed", "#3->", "&1 100Z", "&1 Z")),
        ("#2->0", ("gone", "#2->", "", "&1 Y")),
        ("#4->A", ("appeared", "#4->", "&1 A", "")),
        ("I400=1", ("changed", "I400", "1", "0")),
        ("M26->Y:$FFC2,3", ("appeared", "M26->", "Y:$FFC2,3", "")),
    ],
)
def test_what_a_stranger_writes_is_named_with_both_values(
    machine: MachineProfile, before: ControllerFingerprint, line: str, said: tuple[str, str, str, str]
) -> None:
    card = commissioned(machine)
    card.tell(line)
    assert told(card, before) == [said]


def test_a_stranger_who_sends_programs_and_plcs_is_found(
    machine: MachineProfile, before: ControllerFingerprint
) -> None:
    card = commissioned(machine)
    card.tell("OPEN PLC3 CLEAR", "P1=1", "CLOSE", "OPEN PROG7 CLEAR", "X1", "CLOSE")
    assert [(code, key) for code, key, _, _ in told(card, before)] == [
        ("appeared", "PLC 3"),
        ("appeared", "PROG 7"),
    ]
    again = taken(card)
    card.tell("OPEN PLC3 CLEAR", "P1=2", "CLOSE")
    assert [(code, key) for code, key, _, _ in told(card, again)] == [("changed", "PLC 3")]
    card.tell("DELETE PLC3")
    assert [(code, key) for code, key, _, _ in told(card, again)] == [("gone", "PLC 3")]


def test_a_strangers_table_is_found_by_its_entries(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("#3DEFINE COMP 2,#2,#3,10000", "16 0")
    before = taken(card)
    card.tell("#3DELETE COMP", "#3DEFINE COMP 2,#2,#3,10000", "32 0")
    assert [(code, key) for code, key, _, _ in told(card, before)] == [("changed", "#3 COMP")]


def test_a_conversion_turned_to_another_encoder_is_found(
    machine: MachineProfile, before: ControllerFingerprint
) -> None:
    card = commissioned(machine)
    table = card.dialect.conversion_table
    if table.first_setting is None:
        card.tell(f"WY:${table.first_address:X},$C004")
        name = f"Y:${table.first_address:X}"
    else:
        name = f"I{table.first_setting}"
        card.tell(f"{name}={table.channels[1]}")
    assert [(code, key) for code, key, _, _ in told(card, before)] == [("changed", name)]


def test_another_card_is_found(
    machine: MachineProfile, before: ControllerFingerprint, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = commissioned(machine)
    card.update_firmware(monkeypatch)
    assert told(card, before) == [("changed", "VERSION", "9.99", before.configuration.version)]


@pytest.mark.parametrize(
    ("machine", "strategy"),
    [*(("pmac", each) for each in Strategy), ("turbo", Strategy.CAM), ("turbo", Strategy.TIMEBASE)],
    indirect=["machine"],
)
@pytest.mark.first(2)
def test_what_the_console_does_for_a_cut_is_no_change(
    machine: MachineProfile, before: ControllerFingerprint, strategy: Strategy
) -> None:
    card = commissioned(machine)
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.5)
    plan = plan_cut(job, machine, strategy)
    Heartbeat(card.client, card.sim, machine).prepare()
    load_program(card.client, plan.program, card.dialect)
    card.tell(*plan.restore, "P1000=77", "P11=3", "M26=1", f"I{card.dialect.system_index(1, 87)}=10")
    assert told(card, before) == []


def test_nothing_is_written_and_the_second_reading_is_short(machine: MachineProfile) -> None:
    card = commissioned(machine)
    before = taken(card)
    whole = len(card.line.heard)
    card.line.heard = b""
    taken(card, before)
    assert not any("=" in line and not line.startswith("P1001=") for line in card.lines)
    # At 38400 baud a character takes 0.26 ms; the host's half of the line stays below half a second.
    assert len(card.line.heard) < min(whole / 2, 1900)
