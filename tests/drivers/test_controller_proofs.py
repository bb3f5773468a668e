"""What `doctor --prove` does: on a simulated card of either family everything holds, and nothing is left."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from drivers.commissioning.check import Check
from drivers.commissioning.fingerprint import fingerprint_problems, ours, read_fingerprint
from drivers.commissioning.proofs.bench import names_of
from drivers.commissioning.proofs.proving import (
    compensation_edge,
    prove,
    pvt_rounding,
    roll_over,
    servo_rate,
    table_zero,
)
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.errors import DriverError, LinkError
from drivers.lathe.stop import StoppedError
from drivers.pmac.heartbeat.watchdog import definitions
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import OWNER
from drivers.simulator.card.leads import Leads
from drivers.simulator.card.motor import Motor
from drivers.simulator.machine import SimulatedLathe
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.drivers.commissioned import Commissioned, Watched, commissioned
from tests.drivers.families import machine as machine  # both families

LIMITS = re.compile(r"I[1-3](00|01|02|03|04|1[1-9]|24|25|6[379]|7\d|8[0-3])=")


def proofs(card: Commissioned) -> dict[str, Check]:
    proven = prove(card.client, card.stop, card.sim, card.verify())
    return {check.code: check for check in proven.checks}


@pytest.mark.first(1)
def test_everything_holds_with_the_numbers_of_the_family_and_the_card_is_as_before(
    machine: MachineProfile,
) -> None:
    card = commissioned(machine)
    card.tell(f"M{card.dialect.highest_index}->Y:$5,3")
    before = read_configuration(card.client, card.dialect, whole_card(card.dialect))
    fingerprint = read_fingerprint(card.client, machine, card.dialect)
    card.line.heard = b""
    found = proofs(card)
    assert {code for code, check in found.items() if check.severity is Severity.OK} == {
        f"proof_{name}" for name in names_of(machine)
    }
    assert [line for line in card.lines if LIMITS.match(line) or "SAV" in line] == []
    assert not any(motor.amplifier_enabled for motor in card.sim.controller.motors.values())
    assert all(motor.correction == 0.0 for motor in card.sim.controller.motors.values())
    now = read_configuration(card.client, card.dialect, whole_card(card.dialect))
    # The heartbeat stays, and what it looks at.
    other = {index for index, _ in now.pointers.items() ^ before.pointers.items()}
    assert other <= definitions(machine, card.dialect).keys()
    assert now.plcs.keys() - before.plcs.keys() == {20}
    assert replace(now, plcs={}, pointers={}) == replace(before, plcs={}, pointers={})
    again = read_fingerprint(card.client, machine, card.dialect)
    assert fingerprint_problems(fingerprint, again, ours(machine, card.dialect)) == ()
    assert found["proof_source_delay"].found == "tool 1, carriage 0"  # the spindle is motor 2, between them
    exact = machine.controller.family == "turbo"
    assert found["proof_pvt_rounding"].wanted == ("10.4 ms" if exact else "10 ms")


def test_nothing_is_proven_on_a_card_that_fails(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("I115=0")
    verification = card.verify()
    card.line.heard = b""
    checks = prove(card.client, card.stop, card.sim, verification).checks
    assert checks[0].code == "proofs_refused"
    assert {check.severity for check in checks[1:]} == {Severity.NOTICE}
    assert card.line.heard == b""


@pytest.mark.parametrize("lines", [("#3J/",), ("#1DEFINE COMP 2,#2,#1,10000", "16 0")])
def test_nothing_is_proven_with_drives_on_or_with_somebodys_table(
    machine: MachineProfile, lines: tuple[str, ...]
) -> None:
    card = commissioned(machine)
    card.tell(*lines)
    verification = card.verify()
    card.line.heard = b""
    assert prove(card.client, card.stop, card.sim, verification).checks[0].code == "proofs_refused"
    assert card.line.heard == b""


def jogging(card: Commissioned) -> bool:
    return any(motor.jogging for motor in card.sim.controller.motors.values())


SITUATIONS: dict[str, Callable[[Commissioned], bool]] = {
    "the spindle turns under a table": lambda card: card.sim.controller.motors[2].jogging,
    "a program of the proofs runs": lambda card: card.sim.controller.systems[1].running,
    "an axis is homed on its lease": lambda card: jogging(card) and b"HM" in card.line.heard[-150:],
    "all axes jog on their lease": lambda card: jogging(card) and b"J+" in card.line.heard[-150:],
}


@pytest.mark.parametrize("situation", SITUATIONS)
def test_what_moves_is_stopped_when_another_console_takes_the_machine(situation: str) -> None:
    card = commissioned(load_machine("lee-2001-lathe").machine)
    card.tell("P1000=5")
    verification = card.verify()
    said: list[int] = []
    seen: list[float] = []

    def take() -> None:
        if not said and SITUATIONS[situation](card):
            card.sim.controller.variables.set(VariableKind.P, OWNER, 77.0)
            said.append(len(card.line.heard))

    with pytest.raises(DriverError) as ended:
        prove(card.client, card.stop, Watched(card.sim, take), verification, 5, lambda held: seen.append(held))
    assert [(p.code, p.value, p.limit) for p in ended.value.problems] == [("owner.ousted", "77", "5")]
    # Questions, one lease at most, and the stop: no motion, no setting, nothing that is put back.
    after = card.line.heard[said[0] :]
    assert seen == [77.0], "a signal from now on stops nobody"
    assert after.endswith(b"\x0b") and after.count(b"\x0b") == 1
    assert after.count(b"=") <= 1 and b"J" not in after and b"OPEN" not in after and b"DELETE" not in after
    card.sim.wait(1.0)
    assert not jogging(card)
    assert not card.sim.controller.systems[1].running


def test_at_rest_nothing_at_all_goes_to_a_machine_that_is_anothers() -> None:
    card = commissioned(load_machine("lee-2001-lathe").machine)
    verification = card.verify()
    said: list[int] = []

    def take() -> None:
        if not said and card.sim.controller.variables.i(51) == 1.0:
            card.sim.controller.variables.set(VariableKind.P, OWNER, 77.0)
            said.append(len(card.line.heard))

    with pytest.raises(DriverError) as ended:
        prove(card.client, card.stop, Watched(card.sim, take), verification)
    assert ended.value.problems[0].code == "owner.ousted"
    assert card.line.heard[said[0] :].strip(b"\r") == b"P1000"


def test_a_stop_ends_the_proofs_with_every_drive_killed(machine: MachineProfile) -> None:
    card = commissioned(machine)
    verification = card.verify()
    end = card.sim.now_s() + 3.0

    def press() -> None:
        if card.sim.now_s() > end and card.stop.reason is None:
            card.stop.stop("SIGINT")

    with pytest.raises(StoppedError):
        prove(card.client, card.stop, Watched(card.sim, press), verification)
    assert not any(motor.amplifier_enabled for motor in card.sim.controller.motors.values())
    assert card.sim.controller.variables.i(51) == 0.0
    assert not card.sim.controller.tables.tables


def test_a_servo_that_runs_at_another_rate_is_found(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("I10=4000000")
    check = servo_rate(card.bench())
    # The iron goes on at 442.7 us; 4000000 / 8388608 ms are 476.8 us.
    assert (check.severity, check.wanted) == (Severity.REFUSAL, "476.84 us")
    assert float(check.found.removesuffix(" us")) == pytest.approx(442.7, rel=0.02)


def test_a_card_whose_correction_vanishes_with_the_switch_is_found(
    machine: MachineProfile, monkeypatch: pytest.MonkeyPatch
) -> None:
    look = Leads.refresh

    def forgetful(self: Leads) -> bool:
        if not self._variables.i(51):
            for motor in self._motors.values():
                motor.correction = 0.0
        return look(self)

    monkeypatch.setattr(Leads, "refresh", forgetful)
    check = compensation_edge(commissioned(machine).bench())
    assert (check.severity, check.found) == (Severity.REFUSAL, "10, 0, 0")


def test_a_card_on_which_the_zero_of_a_table_is_zero_is_found(
    machine: MachineProfile, monkeypatch: pytest.MonkeyPatch
) -> None:
    correct = Leads.correct

    def zeroed(self: Leads, motor: Motor) -> None:
        correct(self, motor)
        if motor.number in self._corrected:
            motor.correction = 0.0

    monkeypatch.setattr(Leads, "correct", zeroed)
    monkeypatch.setattr(Leads, "corrections", lambda self, motor, cycles, _: [0.0] * cycles)
    check = table_zero(commissioned(machine).bench())
    assert (check.severity, check.found, check.wanted) == (Severity.REFUSAL, "0", "100")


def test_a_spindle_at_its_zero_cannot_prove_the_roll_over(machine: MachineProfile) -> None:
    assert roll_over(commissioned(machine).bench()).code == "unproven_roll_over"


def closed(machine: MachineProfile) -> Commissioned:
    card = commissioned(machine)
    card.tell("#1J/", "#2J/", "#3J/")
    return card


def test_pvt_times_of_the_other_kind_are_found(machine: MachineProfile) -> None:
    card = closed(machine)
    made = card.bench()
    if card.dialect.segment_time_switch is None:
        return  # this family has only the one kind
    card.tell(f"I{card.dialect.segment_time_switch}=1")
    check = pvt_rounding(made)
    assert (check.severity, check.wanted) == (Severity.REFUSAL, "10.4 ms")


def test_somebodys_program_is_not_overwritten(machine: MachineProfile) -> None:
    card = closed(machine)
    made = card.bench()
    card.tell("OPEN PROG999", "CLEAR", "DWELL1", "CLOSE")
    assert pvt_rounding(made).code == "unproven_pvt_rounding"
    assert card.client.request("LIST PROG999") == ("DWE1", "RET")


def test_a_cable_that_is_cut_ends_the_proofs(machine: MachineProfile) -> None:
    def cut(sim: SimulatedLathe) -> None:
        sim.faults.inject("cut-cable", after_s=3.0)

    card = commissioned(machine, cut)
    with pytest.raises(LinkError):
        proofs(card)
