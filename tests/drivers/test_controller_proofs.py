"""Proofs on a controller, and of its stops."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from drivers.commissioning.check import Check
from drivers.commissioning.fingerprint import console_facts, fingerprint_problems, read_fingerprint
from drivers.commissioning.proofs.air_cut import air_cut
from drivers.commissioning.proofs.bench import names_of
from drivers.commissioning.proofs.proving import (
    compensation_edge,
    prove,
    pvt_rounding,
    roll_over,
    servo_rate,
    table_zero,
)
from drivers.commissioning.proofs.stopping import MeasuredStops, prove_stops
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.commissioning.stop_record import PriorMotion, StopEntry, StopMethod, needed_stops
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
from tests.drivers.cut_floor import with_inverter
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine

LIMITS = re.compile(r"I[1-3](00|01|02|03|04|1[1-9]|24|25|6[379]|7\d|8[0-3])=")


def proofs(card: Commissioned) -> dict[str, Check]:
    proven = prove(card.client, card.stop, card.sim, card.verify())
    return {check.code: check for check in proven.checks}


@pytest.mark.first(1)
def test_everything_holds_with_the_numbers_of_the_family_and_stays(machine: MachineProfile) -> None:
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
    assert fingerprint_problems(fingerprint, again, console_facts(machine, card.dialect)) == ()
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


def test_a_table_whose_zero_is_zero_is_found(machine: MachineProfile, monkeypatch: pytest.MonkeyPatch) -> None:
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


# How the stops of a machine are measured: what is entered, what is refused, and that nothing goes on alone.


def measured(card: Commissioned) -> MeasuredStops:
    return prove_stops(card.bench())


def entry(found: MeasuredStops, way: StopMethod, origin: PriorMotion, axis: str) -> StopEntry:
    (met,) = [e for e in found.entries if (e.way, e.origin, e.axis) == (way, origin, axis)]
    return met


def failed(found: MeasuredStops) -> list[Check]:
    return [check for check in found.checks if check.severity is Severity.REFUSAL]


def no_motion(card: Commissioned) -> bool:
    return not any(motor.jogging for motor in card.sim.controller.motors.values())


def test_every_stop_is_entered_with_what_the_ramps_make_of_it(machine: MachineProfile) -> None:
    """The tool makes its lobe in air meanwhile, and the spindle turns."""
    card = commissioned(machine)
    track: list[tuple[float, float]] = []

    def look() -> None:
        motors = card.sim.controller.motors
        if card.sim.controller.systems[1].running:
            track.append((motors[1].position, motors[2].position))

    found = prove_stops(replace(card.bench(), clock=Watched(card.sim, look)))
    assert {(e.way, e.origin, e.axis) for e in found.entries} == needed_stops(machine)
    assert failed(found) == []
    for met in found.entries:
        (way,) = [way for way in (met.distance_mm, met.distance_deg) if way is not None]
        assert 0.0 < way < math.inf
        assert 0.0 < met.time_s < 60.0
    jogged = entry(found, StopMethod.ABORT, PriorMotion.JOG, "tool")
    assert jogged.speed_mm_per_s == pytest.approx(10.0)  # I122 is 50 counts/ms of 0.2 um
    # 10 mm/s at 8 m/s2 are 6.25 um of ramp; the rest is what passes up to the stop, 0.1 s at most.
    assert jogged.distance_mm is not None and 0.00625 <= jogged.distance_mm <= 1.0
    spindle = entry(found, StopMethod.ABORT, PriorMotion.CUT, "spindle")
    assert spindle.speed_rpm == pytest.approx(1000.0)
    # 166.67 counts/ms down at I215 = 0.5: 27778 counts, which are 1000 deg, in a third of a second.
    assert spindle.distance_deg is not None and 1000.0 <= spindle.distance_deg <= 1000.0 + 600.0
    assert 1.0 / 3.0 <= spindle.time_s <= 0.5
    (watchdog,) = [check for check in found.checks if check.code == "proof_heartbeat"]
    assert 0.28 <= float(watchdog.found.split()[0]) <= 0.3
    silent = entry(found, StopMethod.WATCHDOG, PriorMotion.JOG, "carriage")
    # 300 ms at 10 mm/s less the margin of the PLC, and half of a ramp of 0.1 s.
    assert silent.distance_mm is not None and 2.8 <= silent.distance_mm <= 3.6
    cut = entry(found, StopMethod.WATCHDOG, PriorMotion.CUT, "spindle")
    assert 0.3 < cut.time_s < 2.0  # docs/heartbeat.md: all at rest within 2 s
    tool = [position for position, _ in track]
    # Never further in than a millimetre and half of 55 um, with a tenth for the servo; never behind its home.
    assert 5000.0 + 100.0 < max(tool) < 5000.0 + 137.5 * 1.1
    assert min(tool) > -20.0
    assert max(position for _, position in track) - min(position for _, position in track) > 3 * 100_000


def test_the_lobe_in_air_is_the_fastest_of_the_machine(machine: MachineProfile) -> None:
    cut = air_cut(machine)
    # 27.5 um at 50 Hz: 8.64 mm/s, which are 43.2 counts/ms of 0.2 um; a turn of 60 ms is 1000 rpm.
    assert (cut.turn_ms, round(cut.tool, 1), round(cut.spindle, 2)) == (60, 43.2, 166.67)
    slow = replace(machine, spindle=replace(machine.spindle, max_speed_rpm=500.0))
    assert air_cut(slow).turn_ms == 120


def test_nothing_moves_where_no_plc_may_run(machine: MachineProfile) -> None:
    card = commissioned(machine)
    made = card.bench()
    card.tell("I5=0")
    (check,) = prove_stops(made).checks
    assert (check.code, check.severity) == ("proof_heartbeat", Severity.REFUSAL)
    assert "heartbeat.plcs_forbidden" in check.found
    assert not any(motor.amplifier_enabled for motor in card.sim.controller.motors.values())


@ON_ONE
def test_an_axis_that_runs_on_too_far_is_found_and_nothing_else_is_moved(machine: MachineProfile) -> None:
    card = commissioned(machine)
    made = card.bench()
    card.tell("I215=0.002")  # somebody has made it softer than what was read
    found = prove_stops(made)
    (check,) = failed(found)
    assert check.code == "proof_stop_abort_jog"
    assert {(each.way, each.origin) for each in found.entries} == {(StopMethod.WATCHDOG, PriorMotion.JOG)}, (
        "proven before"
    )
    assert found.checks[-1] is check


@ON_ONE
def test_without_a_heartbeat_the_jog_is_stopped_in_another_way(machine: MachineProfile) -> None:
    card = commissioned(machine)
    made = card.bench()

    def spoil() -> None:
        """Somebody switches the PLC off when the lease is to be proven in a cut."""
        if card.stop.mark == 2:  # behind control-A and control-K in the jogs
            card.sim.controller.plcs.disable((20,))

    found = prove_stops(replace(made, clock=Watched(card.sim, spoil)))
    assert {check.code for check in failed(found)} == {"proof_stop_lease_cut"}
    card.sim.wait(1.0)
    assert no_motion(card)
    assert (StopMethod.WATCHDOG, PriorMotion.CUT) not in {(each.way, each.origin) for each in found.entries}


@ON_ONE
@pytest.mark.parametrize("after_s", [0.5, 2.5, 3.2, 14.0, 18.0])
@pytest.mark.first(2)
def test_a_stop_at_any_time_ends_it_and_stays_in_force(machine: MachineProfile, after_s: float) -> None:
    card = commissioned(machine)
    made = card.bench()
    end_s = card.sim.now_s() + after_s

    def press() -> None:
        if card.sim.now_s() > end_s and not pressed:
            pressed.append("SIGINT")
            card.stop.stop("SIGINT")

    pressed: list[str] = []
    with pytest.raises(StoppedError):
        prove_stops(replace(made, clock=Watched(card.sim, press)))
    assert card.stop.reason is not None
    card.sim.wait(3.0)
    assert no_motion(card)
    assert not card.sim.controller.systems[1].running


@ON_ONE
def test_somebodys_program_is_left_and_the_cuts_are_not_measured(machine: MachineProfile) -> None:
    card = commissioned(machine)
    made = card.bench()
    card.tell("OPEN PROG999", "CLEAR", "DWELL1", "CLOSE")
    found = prove_stops(made)
    assert {e.origin for e in found.entries} == {PriorMotion.JOG}
    assert card.client.request("LIST PROG999") == ("DWE1", "RET")


@ON_ONE
def test_a_host_that_is_held_up_begins_anew(machine: MachineProfile) -> None:
    card = commissioned(machine)
    made = card.bench()
    held: list[float] = []

    def hold_up() -> None:
        if not held and card.sim.controller.motors[3].jogging and card.sim.now_s() > 3.0:
            held.append(card.sim.now_s())
            card.sim.wait(0.5)

    found = prove_stops(replace(made, clock=Watched(card.sim, hold_up)))
    assert held
    assert failed(found) == []
    assert len(found.entries) == 18


@ON_ONE
def test_a_spindle_on_an_inverter_is_not_aborted_and_not_turned(machine: MachineProfile) -> None:
    inverter = with_inverter(machine)
    card = commissioned(inverter)
    found = measured(card)
    assert {(e.way, e.origin, e.axis) for e in found.entries} == needed_stops(inverter)
    assert {(e.way, e.axis) for e in found.entries} == {
        (way, axis) for way in (StopMethod.KILL, StopMethod.WATCHDOG) for axis in ("tool", "carriage")
    }
    assert b"\x01" not in card.line.heard
    assert not any("#2J" in line or "#2HM" in line for line in card.lines)


def test_a_cable_that_is_cut_ends_it_and_the_card_ends_the_motion(machine: MachineProfile) -> None:
    def cut(sim: SimulatedLathe) -> None:
        sim.faults.inject("cut-cable", after_s=2.8)

    card = commissioned(machine, cut)
    with pytest.raises(DriverError):
        measured(card)
    card.sim.wait(1.5)
    assert no_motion(card)
