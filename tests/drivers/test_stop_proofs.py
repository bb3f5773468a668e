"""How the stops of a machine are measured: what is entered, what is refused, and that nothing goes on alone."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from drivers.commissioning.check import Check
from drivers.commissioning.proofs.air_cut import air_cut
from drivers.commissioning.proofs.stopping import MeasuredStops, prove_stops
from drivers.commissioning.stop_record import Origin, StopEntry, Way, needed_stops
from drivers.errors import DriverError
from drivers.lathe.stop import StoppedError
from drivers.simulator.machine import SimulatedLathe
from profiles.findings import Severity
from profiles.machine import MachineProfile
from tests.drivers.commissioned import Commissioned, Watched, commissioned
from tests.drivers.cut_floor import with_inverter
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine  # both families


def measured(card: Commissioned) -> MeasuredStops:
    return prove_stops(card.bench())


def entry(found: MeasuredStops, way: Way, origin: Origin, axis: str) -> StopEntry:
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
    jogged = entry(found, Way.ABORT, Origin.JOG, "tool")
    assert jogged.speed_mm_per_s == pytest.approx(10.0)  # I122 is 50 counts/ms of 0.2 um
    # 10 mm/s at 8 m/s2 are 6.25 um of ramp; the rest is what passes up to the stop, 0.1 s at most.
    assert jogged.distance_mm is not None and 0.00625 <= jogged.distance_mm <= 1.0
    spindle = entry(found, Way.ABORT, Origin.CUT, "spindle")
    assert spindle.speed_rpm == pytest.approx(1000.0)
    # 166.67 counts/ms down at I215 = 0.5: 27778 counts, which are 1000 deg, in a third of a second.
    assert spindle.distance_deg is not None and 1000.0 <= spindle.distance_deg <= 1000.0 + 600.0
    assert 1.0 / 3.0 <= spindle.time_s <= 0.5
    (watchdog,) = [check for check in found.checks if check.code == "proof_heartbeat"]
    assert 0.28 <= float(watchdog.found.split()[0]) <= 0.3
    silent = entry(found, Way.WATCHDOG, Origin.JOG, "carriage")
    # 300 ms at 10 mm/s less the margin of the PLC, and half of a ramp of 0.1 s.
    assert silent.distance_mm is not None and 2.8 <= silent.distance_mm <= 3.6
    cut = entry(found, Way.WATCHDOG, Origin.CUT, "spindle")
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
    assert {(each.way, each.origin) for each in found.entries} == {(Way.WATCHDOG, Origin.JOG)}, "proven before"
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
    assert (Way.WATCHDOG, Origin.CUT) not in {(each.way, each.origin) for each in found.entries}


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
    assert {e.origin for e in found.entries} == {Origin.JOG}
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
        (way, axis) for way in (Way.KILL, Way.WATCHDOG) for axis in ("tool", "carriage")
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
