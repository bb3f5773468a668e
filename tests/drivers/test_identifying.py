"""An axis is identified, by the programs that are made for it."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.commissioning.reading import read_configuration, whole_card
from drivers.cutting.strategy import Strategy
from drivers.errors import DriverError, LinkError
from drivers.identification.excitation import COLUMNS, PROGRAM, CamPath, PvtPath, wave_counts
from drivers.identification.identify import identify
from drivers.identification.request import CLEAR_MM, IdentificationRequest
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse
from drivers.identification.standstill import pushed_mm
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StoppedError
from drivers.pmac.client import REPLY_TIMEOUT_S
from drivers.pmac.compensation.table import step_counts
from drivers.pmac.gathering.gather_client import GatheredData
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.program_text import read_program
from drivers.pmac.reserved import OWNER
from drivers.simulator.plant.true_parameters import ideal
from profiles.axis.servo import sampled_response
from profiles.axis.servo_gains import gains_from_variables
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError
from profiles.store import load_machine
from tests.drivers.commissioned import Stand, ready
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine

TABLE_5_HZ = (10.0, 30.0, 50.0, 70.0)
SAMPLED = {10.0: (1.0215, -0.168), 30.0: (0.9811, -0.556), 50.0: (0.8850, -0.903), 70.0: (0.7777, -1.207)}
"""Gain and phase (rad) of the sampled loop at the frequencies of Table 5, calculated apart from this code."""

GAINS = gains_from_variables(load_machine("lee-2001-lathe").machine)
"""As the card has them, in V/m: whatever the iron is."""

FAMILY_AND_PATH = pytest.mark.parametrize(
    ("machine", "path"), [("pmac", Strategy.PVT), ("turbo", Strategy.CAM)], indirect=["machine"]
)
"""Each family and each path: what is said of them is so of every pair."""

CYCLE_S = 3_713_707 / 8_388_608_000
DATE = "2001-11-30T14:05:00.000Z"


def found(of: Stand, path: Strategy, *frequencies_hz: float, **more: float) -> IdentifiedResponse:
    request = IdentificationRequest(path=path, frequencies_hz=frequencies_hz)
    return identify(of.rig, replace(request, **more), of.origin, DATE)  # type: ignore[arg-type]


def off_percent(point: IdentifiedPoint, response: complex) -> float:
    return abs(100.0 * (point.gain / abs(response) - 1.0))


def off_deg(point: IdentifiedPoint, response: complex) -> float:
    turned = cmath.rect(1.0, math.radians(point.phase_deg)) / response
    return abs(math.degrees(cmath.phase(turned)))


def late(response: complex, frequency_hz: float, cycles: int) -> complex:
    return response * cmath.exp(-2j * math.pi * frequency_hz * CYCLE_S * cycles)


@pytest.mark.first(3)
@pytest.mark.parametrize(
    ("machine", "path", "cycles", "how", "frequencies_hz"),
    [
        ("pmac", Strategy.PVT, 0, "measured", TABLE_5_HZ),
        ("pmac", Strategy.CAM, 1, "measured", (30.0, 70.0)),
        ("pmac", Strategy.TIMEBASE, 1, "composed", (30.0, 70.0)),
        ("turbo", Strategy.PVT, 0, "measured", (30.0, 70.0)),
        ("turbo", Strategy.CAM, 1, "measured", (30.0, 70.0)),
    ],
    indirect=["machine"],
)
def test_the_nominal_loop_is_found_on_each_path_with_the_age_of_its_source(
    machine: MachineProfile, path: Strategy, cycles: int, how: str, frequencies_hz: tuple[float, ...]
) -> None:
    identified = found(ready(machine), path, *frequencies_hz)
    assert (identified.path, identified.how, identified.date) == (path, how, DATE)
    assert [point.frequency_hz for point in identified.points] == list(frequencies_hz)
    for point in identified.points:
        target = late(cmath.rect(*SAMPLED[point.frequency_hz]), point.frequency_hz, cycles)
        assert off_percent(point, target) < 0.2
        assert off_deg(point, target) < 0.2
        assert point.coherence > 0.9999
        assert point.amplitude_um == pytest.approx(25.0, rel=0.004)


@ON_ONE
def test_the_confidence_holds_the_nominal_loop(machine: MachineProfile) -> None:
    """95 % each: of sixteen half-widths three may be too small, by what the steps of the encoder make at most.

    The loop answers to these steps, too: up to a tenth of a count of 0.2 um, which no confidence can know of.
    """
    frequencies = (20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0)
    points = found(ready(machine), Strategy.PVT, *frequencies).points
    shares = []
    for point in points:
        target = complex(sampled_response(machine, point.frequency_hz))
        off = (abs(point.gain - abs(target)), math.radians(off_deg(point, target)) * point.gain)
        shares += [each / point.gain_ci for each in off]
        assert max(off) < point.gain_ci + 0.1 * machine.tool.count_um / point.amplitude_um
    assert sorted(shares)[-4] < 1.0


@ON_ONE
def test_a_lathe_that_is_not_its_profile_is_found_as_it_is(machine: MachineProfile) -> None:
    """7 % more mass, 6 % less thrust: the same loop with these numbers, and not with those of the profile."""
    other = replace(ideal(machine), moving_mass_kg=1.07 * 4.74, force_n_per_v=0.94 * 624.025)
    tool = replace(machine.tool, moving_mass_kg=1.07 * 4.74, amplifier_gain_a_per_v=0.94 * 11.45)
    for point in found(ready(machine, other), Strategy.PVT, 40.0, 80.0).points:
        true = complex(sampled_response(replace(machine, tool=tool), point.frequency_hz, GAINS))
        assert off_percent(point, true) < 0.2
        assert off_deg(point, true) < 0.2
        nominal = complex(sampled_response(machine, point.frequency_hz))
        assert abs(cmath.rect(point.gain, math.radians(point.phase_deg)) / nominal - 1.0) > 0.03


@ON_ONE
@pytest.mark.parametrize("path", [Strategy.PVT, Strategy.CAM])
def test_a_lathe_with_a_little_friction_is_found_with_it(machine: MachineProfile, path: Strategy) -> None:
    """Dry friction F takes from a sine of peak speed V what a damping of 4 F / (pi V) does."""
    heavier_kg = 1.05 * machine.tool.moving_mass_kg
    true = replace(ideal(machine), moving_mass_kg=heavier_kg, coulomb_friction_n=0.1, commutation_error_deg=5.0)
    for point in found(ready(machine, true), path, 40.0, 70.0).points:
        speed_m_s = 2e-6 * math.pi * point.frequency_hz * point.amplitude_um * point.gain
        damping = true.viscous_n_s_per_m + 4.0 * true.coulomb_friction_n / (math.pi * speed_m_s)
        thrust = math.cos(math.radians(true.commutation_error_deg))
        tool = replace(
            machine.tool,
            moving_mass_kg=true.moving_mass_kg,
            damping_n_s_per_m=damping,
            amplifier_gain_a_per_v=thrust * machine.tool.amplifier_gain_a_per_v,
        )
        cycles = int(path is Strategy.CAM)
        frequency_hz = point.frequency_hz
        true_response = complex(sampled_response(replace(machine, tool=tool), frequency_hz, GAINS))
        target = late(true_response, frequency_hz, cycles)
        nominal = late(complex(sampled_response(machine, frequency_hz)), frequency_hz, cycles)
        assert off_percent(point, target) < 0.5
        assert off_deg(point, target) < 0.5
        assert off_percent(point, nominal) > 1.5
        assert off_deg(point, nominal) > 1.0


def test_what_it_holds_for_is_read_from_the_card(machine: MachineProfile) -> None:
    of = ready(machine)
    origin = found(of, Strategy.PVT, 50.0, periods=4).origin
    pid = {"I130": 528, "I131": 4905, "I132": 4905, "I133": 811, "I134": 0, "I135": 0}
    assert origin.gains == {**pid, "I136": 0, "I137": 0, "I138": 0, "I139": 0}, "with the notch filter"
    assert (origin.machine, origin.version, origin.kind) == (machine.name, of.version, of.kind)
    assert origin.servo_period_ms == pytest.approx(0.44271, abs=1e-5)


@ON_ONE
def test_other_gains_are_another_origin_and_another_response(machine: MachineProfile) -> None:
    """88 % of the acceleration feedforward that the mass needs, in the loop as it is calculated for the plan."""
    fed = {**machine.controller.variables, "I135": 29671}
    other = replace(machine, controller=replace(machine.controller, variables=fed))
    identified = found(ready(other), Strategy.PVT, 50.0)
    assert identified.origin.gains["I135"] == 29671
    (point,) = identified.points
    target = complex(sampled_response(other, 50.0))
    assert abs(target) > 1.07
    assert off_percent(point, target) < 0.2
    assert off_deg(point, target) < 0.2


@FAMILY_AND_PATH
def test_the_card_is_as_before_and_the_machine_at_rest(machine: MachineProfile, path: Strategy) -> None:
    of = ready(machine)
    of.rig.lathe.program.tables_left()  # points a variable of the console at the correction
    before = read_configuration(of.rig.client, of.rig.dialect, whole_card(of.rig.dialect))
    found(of, path, 40.0, periods=6)
    assert read_configuration(of.rig.client, of.rig.dialect, whole_card(of.rig.dialect)) == before
    snapshot = of.rig.lathe.snapshot()
    assert (snapshot.at_rest, snapshot.loops_closed) == (True, True)
    assert abs(snapshot.tool.position) < 5.0
    assert all(motor.correction == 0.0 for motor in of.sim.controller.motors.values())
    assert not of.sim.controller.tables.tables


@ON_ONE
def test_the_spindle_stands_and_the_tool_stays_out(machine: MachineProfile) -> None:
    """The tool never goes further in than its amplitude and what the servo adds to it, 2.2 % at most."""
    of = ready(machine)
    spindle = of.rig.lathe.snapshot().spindle.position
    furthest: list[float] = []

    def told(_: IdentifiedPoint) -> None:
        furthest.append(of.rig.lathe.snapshot().spindle.position)

    motor = of.sim.controller.motors[machine.tool.motor]
    places: list[float] = []
    follow = motor.axis.follow
    motor.axis.follow = lambda commands: _kept(follow(commands), places)  # type: ignore[method-assign]
    request = IdentificationRequest(path=Strategy.CAM, frequencies_hz=(20.0, 50.0), amplitude_um=50.0, periods=6)
    identify(of.rig, request, of.origin, DATE, told)
    assert furthest == [spindle, spindle]
    assert 45.0 < max(places) * machine.tool.count_um < 50.0 * 1.03
    assert min(places) * machine.tool.count_um > -50.0 * 1.03


def _kept(positions: list[float], places: list[float]) -> list[float]:
    places += positions
    return positions


@FAMILY_AND_PATH
def test_a_stop_ends_it_with_the_drives_off_and_nothing_left(machine: MachineProfile, path: Strategy) -> None:
    of = ready(machine)
    end = of.sim.now_s() + 1.5
    wait = of.clock.wait

    def stopping(seconds: float) -> None:
        wait(seconds)
        if of.sim.now_s() > end and of.stop.reason is None:
            of.stop.stop("SIGINT")

    of.clock.wait = stopping  # type: ignore[method-assign]
    with pytest.raises(StoppedError):
        found(of, path, 20.0, periods=100)
    _left_safe(of)


@ON_ONE
@pytest.mark.parametrize("path", [Strategy.PVT, Strategy.CAM])
def test_what_ends_the_program_itself_leaves_nothing_either(machine: MachineProfile, path: Strategy) -> None:
    """Ctrl-C as Python has it, in the middle of the swing: no error of ours."""
    of = ready(machine)
    end = of.sim.now_s() + 1.5
    wait = of.clock.wait

    def ending(seconds: float) -> None:
        wait(seconds)
        if of.sim.now_s() > end and of.stop.reason is None:
            raise KeyboardInterrupt

    of.clock.wait = ending  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        found(of, path, 20.0, periods=100)
    _left_safe(of)


@ON_ONE
def test_a_line_that_is_lost_while_it_is_put_back_leaves_the_drives_off(machine: MachineProfile) -> None:
    of = ready(machine)
    request, client = of.rig.client.request, of.rig.client

    def once(line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None) -> tuple[str, ...]:
        if line.startswith("OPEN PROG998") and of.rig.lathe.snapshot().loops_closed and measured:
            of.sim.faults.inject("hang", for_s=3.0)
        return request(line, timeout_s, lines=lines)

    measured: list[IdentifiedPoint] = []
    client.request = once  # type: ignore[method-assign]
    asked = IdentificationRequest(path=Strategy.CAM, frequencies_hz=(40.0,), periods=6)
    with pytest.raises(LinkError):
        identify(of.rig, asked, of.origin, DATE, measured.append)
    _left_safe(of)


@ON_ONE
def test_where_rest_is_not_proven_all_is_put_back_but_what_would_throw_the_tool(machine: MachineProfile) -> None:
    of = ready(machine)

    def unproven() -> Snapshot:
        raise DriverError(Problem(code="machine.not_at_rest"))

    def ending(_: IdentifiedPoint) -> None:
        raise OSError

    of.rig.lathe.wait_for_rest = unproven  # type: ignore[method-assign]
    asked = IdentificationRequest(path=Strategy.CAM, frequencies_hz=(40.0,), periods=6)
    with pytest.raises(DriverError) as ended:
        identify(of.rig, asked, of.origin, DATE, ending)
    assert "machine.state_unknown" in [problem.code for problem in ended.value.problems]
    assert not of.sim.controller.gather.size
    assert not of.sim.controller.programs[998]
    assert of.sim.controller.tables.tables and of.sim.controller.variables.i(51) == 1.0


@ON_ONE
def test_a_machine_that_is_anothers_is_stopped_where_it_swings_and_left_as_it_is(machine: MachineProfile) -> None:
    of = ready(machine)
    wait, took_s = of.clock.wait, of.sim.now_s() + 1.5

    def taking(seconds: float) -> None:
        wait(seconds)
        if of.sim.now_s() > took_s and of.sim.controller.variables.get(VariableKind.P, OWNER) != 7.0:
            of.sim.controller.variables.set(VariableKind.P, OWNER, 7.0)
            of.line.heard = b""

    of.clock.wait = taking  # type: ignore[method-assign]
    with pytest.raises(DriverError) as ended:
        found(of, Strategy.PVT, 20.0, periods=100)
    assert ended.value.problems[0].code == "owner.ousted"
    assert of.line.heard.count(b"\x01") >= 1
    assert not of.sim.controller.systems[1].running
    assert not any(line.startswith(("OPEN", "DELETE", "ENDGATHER")) for line in of.lines)


@ON_ONE
@pytest.mark.parametrize("path", [Strategy.PVT, Strategy.CAM])
def test_a_host_that_is_held_up_finds_the_motion_ended(machine: MachineProfile, path: Strategy) -> None:
    of = ready(machine)
    of.clock.at_s, of.clock.for_s = of.sim.now_s() + 1.5, 1.0
    with pytest.raises(ProblemError) as ended:
        found(of, path, 20.0, periods=200)
    assert ended.value.problems[0].code == "heartbeat.lapsed"
    _left_safe(of)


@FAMILY_AND_PATH
def test_without_its_host_the_tool_is_at_rest_within_a_second(machine: MachineProfile, path: Strategy) -> None:
    """The program looks at the lease of 0.3 s in each of its segments, and needs 0.4 s to fade."""
    of = ready(machine)
    motor = of.sim.controller.motors[machine.tool.motor]
    of.clock.at_s, of.clock.for_s = of.sim.now_s() + 1.5, 1.0
    speeds: list[float] = []
    wait = of.sim.wait

    def watched(seconds: float) -> None:
        wait(seconds)
        if seconds > 1.0:
            speeds.append(motor.velocity)
            of.stop.stop("seen")

    of.sim.wait = watched  # type: ignore[method-assign]
    with pytest.raises(ProblemError):
        found(of, path, 20.0, periods=200)
    assert speeds == [0.0]


def _left_safe(of: Stand) -> None:
    assert not of.drives_on
    assert all(motor.correction == 0.0 for motor in of.sim.controller.motors.values())
    assert not of.sim.controller.tables.tables
    assert of.sim.controller.variables.i(51) == 0.0
    assert not of.sim.controller.gather.size
    assert not of.sim.controller.programs[998]


@ON_ONE
@pytest.mark.parametrize("fault", ["jammed", "encoder_lost"])
@pytest.mark.parametrize("frequency_hz", [2.0, 17.1, 51.3, 150.0])
@pytest.mark.first(2)
def test_a_tool_that_does_not_answer_ends_it(machine: MachineProfile, fault: str, frequency_hz: float) -> None:
    """A swing is within the limit of the following error, so nothing trips; and there are 5 mm to the jaws."""
    of = ready(machine)
    motor = of.sim.controller.motors[machine.tool.motor]
    wait, fails_s = of.sim.wait, of.sim.now_s() + 1.2

    def failing(seconds: float) -> None:
        wait(seconds)
        setattr(motor.axis, fault, of.sim.now_s() > fails_s)

    of.sim.wait = failing  # type: ignore[method-assign]
    with pytest.raises(ProblemError) as ended:
        found(of, Strategy.PVT, frequency_hz, periods=20, amplitude_um=40.0)
    assert ended.value.problems[0].code == "identify.no_motion"
    _left_safe(of)
    # The origin of the axis is where the zero of the motor is.
    way_mm = abs(motor.true_position - motor.axis.origin) / machine.tool.counts_per_mm
    assert way_mm < pushed_mm(machine, 40.0, of.rig.lathe.round_trip_s) < CLEAR_MM


@pytest.mark.first(2)
@ON_ONE
@pytest.mark.parametrize("frequency_hz", [34.2, 51.3, 102.6, 205.3])
def test_looks_that_come_once_in_half_a_period_see_it_swing(machine: MachineProfile, frequency_hz: float) -> None:
    """Looks are whole background cycles of 4.87 ms apart here."""
    (point,) = found(ready(machine), Strategy.PVT, frequency_hz, periods=40, amplitude_um=5.0).points
    assert point.coherence > 0.99


# The programs of identification: what a card makes of them, and the table that the carriage goes along.


@pytest.mark.parametrize("frequency_hz", [1.0, 10.0, 50.0, 225.0])
def test_the_card_takes_a_program_with_its_lease(machine: MachineProfile, frequency_hz: float) -> None:
    watchdog = "I5111>0" if machine.controller.family == "turbo" else "M70>0"
    for path in (PvtPath(machine, 25.0), CamPath(machine, 25.0, frequency_hz)):
        sweep = path.sweep(frequency_hz, 8)
        program = read_program(sweep.text)
        assert program.number == PROGRAM
        assert sum(watchdog in line for line in program.lines) == 1
        assert 8.0 / frequency_hz < sweep.longest_s - sweep.steady_s < 8.0 / frequency_hz + 3.0


def test_a_program_ends_by_itself_when_nobody_ends_it(machine: MachineProfile) -> None:
    """Without a heartbeat on the card its lease runs out at once, so it is given one that lasts."""
    made = ready(machine)
    sweep = PvtPath(machine, 50.0).sweep(50.0, 10)
    lathe = made.rig.lathe
    lathe.program.load(read_program(sweep.text))
    began_s = made.sim.now_s()
    lathe.program.start(PROGRAM, 0.0)
    snapshot = lathe.program.follow(lambda _: None, sweep.longest_s + 15.0)
    assert made.sim.now_s() - began_s == pytest.approx(sweep.longest_s, abs=0.5)
    assert abs(snapshot.tool.position) <= 4.0


def test_the_tool_is_told_a_sine_about_its_centre(machine: MachineProfile) -> None:
    """In the steady part: 250 counts of amplitude about -500, within 0.05 um of a sine."""
    made = ready(machine)
    motor = made.sim.controller.motors[machine.tool.motor]
    sweep = PvtPath(machine, 50.0, centre_counts=-500.0).sweep(70.0, 40)
    made.tell(f"#{machine.tool.motor}J=-500")
    made.sim.wait(1.0)
    told: list[float] = []
    follow = motor.axis.follow

    def kept(commands: list[float]) -> list[float]:
        told.extend(commands)
        return follow(commands)

    made.rig.lathe.program.load(read_program(sweep.text))
    motor.axis.follow = kept  # type: ignore[method-assign,assignment]
    made.rig.lathe.program.start(PROGRAM, 0.0)
    made.rig.lathe.program.follow(lambda _: None, sweep.longest_s + 15.0)
    steady = np.array(told[2000:3000])
    time = np.arange(len(steady)) * machine.controller.servo_period_ms / 1000.0
    angle = 2 * np.pi * 70.0 * time
    basis = np.stack([np.cos(angle), np.sin(angle), np.ones_like(time)], axis=1)
    found, *_ = np.linalg.lstsq(basis, steady, rcond=None)
    assert math.hypot(found[0], found[1]) == pytest.approx(250.0, abs=0.25)
    assert found[2] == pytest.approx(-500.0, abs=0.05)
    assert np.abs(steady - basis @ found).max() < 0.25


def test_the_table_is_one_wave_that_begins_and_ends_at_nothing(machine: MachineProfile) -> None:
    path = CamPath(machine, 25.0, 80.0)
    table = path.table
    assert table is not None
    harmonic = wave_counts(machine, 80.0)
    places = np.arange(harmonic) + 0.5
    found = np.array([table.correction(float(place)) for place in places])
    # A chord of a fortieth of a wave is within (pi / 40)^2 / 2 of the sine, entries within 1/32 count.
    target = 125.0 * np.sin(2 * np.pi * places / harmonic)
    assert np.abs(found - target).max() < 125.0 * (math.pi / COLUMNS) ** 2 / 2 + 1 / 32 + 0.05
    assert np.abs(found).max() <= 125.0
    assert step_counts(table, [0.0]) == 0.0
    assert step_counts(table, [3.0]) < 10.0


def test_the_reference_of_a_cam_is_what_the_table_says_for_where_the_carriage_was(machine: MachineProfile) -> None:
    path = CamPath(machine, 25.0, 50.0)
    quarter = wave_counts(machine, 50.0) / 4.0
    data = GatheredData(
        times_ms=np.arange(4.0), values={"#3 actual": quarter * np.arange(4.0), "#1 actual": np.zeros(4)}, units={}
    )
    assert path.reference_counts(data) == pytest.approx([0.0, 125.0, 0.0, -125.0], abs=0.1)


@pytest.mark.parametrize(("motors", "cycles"), [((1, 2, 3), 1), ((3, 1, 2), 0), ((2, 3, 1), 0)])
def test_the_order_of_motors_ages_it(machine: MachineProfile, motors: tuple[int, int, int], cycles: int) -> None:
    """Tool, spindle, carriage: a source of a higher number than the target is seen one cycle late."""
    tool, spindle, carriage = motors
    definitions = tuple(f"#{motor}->{axis}" for motor, axis in zip(motors, "XYZ", strict=True))
    other = replace(
        machine,
        controller=replace(machine.controller, axis_definitions=definitions),
        tool=replace(machine.tool, motor=tool),
        spindle=replace(machine.spindle, motor=spindle),
        carriage=replace(machine.carriage, motor=carriage),
    )
    assert CamPath(other, 25.0, 50.0).late_cycles == cycles
