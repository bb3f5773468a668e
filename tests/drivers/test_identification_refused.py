"""Measurements that are refused or disturbed."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from drivers.commissioning.proofs.proving import prove
from drivers.cutting.strategy import Strategy
from drivers.errors import DriverError, RefusedError
from drivers.identification.excitation import axis_word, return_hz, wave_counts
from drivers.identification.health import HealthRequest, check_health
from drivers.identification.identify import identify, take_up
from drivers.identification.request import IdentificationRequest, clearance_mm, request_problems
from drivers.identification.result import ResponseOrigin
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError, ProfileError
from profiles.store import load_machine
from tests.drivers.commissioned import Stand, commissioned, ready, stand
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine

MOVES = re.compile(r"#\d+(J|HM|O|K|\$)|R\b|\bA\b|\bS\b|OPEN|DEFINE|GATHER|I51=1")

PVT = IdentificationRequest(path=Strategy.PVT, frequencies_hz=(50.0,))
CAM = replace(PVT, path=Strategy.CAM)


def codes(request: IdentificationRequest, machine: MachineProfile) -> list[str]:
    return [problem.code for problem in request_problems(request, machine)]


def with_variable(machine: MachineProfile, name: str, value: float) -> MachineProfile:
    variables = {**machine.controller.variables, name: value}
    return replace(machine, controller=replace(machine.controller, variables=variables))


def test_what_is_asked_for_by_default_is_allowed_on_the_bundled_lathe(machine: MachineProfile) -> None:
    for path in (Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE):
        assert request_problems(IdentificationRequest(path=path), machine) == ()


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (replace(PVT, amplitude_um=50.1), "identify.amplitude"),
        (replace(PVT, amplitude_um=4.9), "identify.amplitude"),  # 25 counts are 5 um
        (replace(PVT, amplitude_um=float("nan")), "identify.amplitude"),
        (replace(PVT, frequencies_hz=(0.0,)), "identify.frequency"),
        (replace(PVT, frequencies_hz=(-10.0,)), "identify.frequency"),
        (replace(PVT, frequencies_hz=(904.0,)), "identify.frequency"),  # two and a half servo cycles are 1.107 ms
        (replace(PVT, path=Strategy.CAM, frequencies_hz=(226.0,)), "identify.frequency"),  # ten are 4.427 ms
        (replace(PVT, frequencies_hz=()), "identify.frequencies"),
        (replace(PVT, frequencies_hz=(50.0,) * 41), "identify.frequencies"),
        (replace(PVT, periods=3), "identify.periods"),
        (replace(PVT, periods=201), "identify.periods"),
        (replace(PVT, periods=101, frequencies_hz=(10.0, 50.0)), "identify.too_long"),
        (replace(PVT, path=Strategy.PAPER), "identify.path"),
        (replace(PVT, path=Strategy.NONE), "identify.path"),
    ],
)
def test_a_request_out_of_its_range_is_refused(
    machine: MachineProfile, request_: IdentificationRequest, code: str
) -> None:
    assert codes(request_, machine) == [code]


@pytest.mark.parametrize(
    ("name", "value", "frequency_hz", "key"),
    [
        # 50 um at 100 Hz: 31.4 mm/s are 157 counts/ms, 19.7 m/s2 are 98.7 counts/ms2; |1 - T| is 1.2
        ("I116", 157.0, 100.0, "I116"),
        ("I117", 98.0, 100.0, "I117"),
        ("I111", 4000.0, 100.0, "I111"),
    ],
)
def test_a_sine_beyond_what_the_axis_is_set_to_is_refused(
    machine: MachineProfile, name: str, value: float, frequency_hz: float, key: str
) -> None:
    asked = replace(PVT, amplitude_um=50.0, frequencies_hz=(frequency_hz,))
    assert request_problems(asked, machine) == ()
    (problem,) = request_problems(asked, with_variable(machine, name, value))
    assert (problem.code, problem.key) == ("identify.beyond_drive", key)


def test_a_sine_beyond_the_thrust_is_refused_by_its_first_frequency(machine: MachineProfile) -> None:
    """50 um at 200 Hz are 79.0 m/s2: 374.2 N for 4.74 kg, and more for the damping."""
    asked = replace(PVT, amplitude_um=50.0, frequencies_hz=(200.0,))
    weak = replace(machine, tool=replace(machine.tool, continuous_force_n=374.0))
    (problem,) = request_problems(asked, weak)
    assert (problem.code, problem.key) == ("identify.beyond_drive", "tool.continuous_force_n")
    assert request_problems(asked, machine) == ()
    asked = replace(PVT, amplitude_um=50.0, frequencies_hz=(50.0, 210.0, 220.0))
    found = {(problem.key, problem.where) for problem in request_problems(asked, machine)}
    assert found == {("I117", "210 Hz"), ("tool.continuous_force_n", "210 Hz")}


def test_the_tool_must_be_clear_of_the_jaws_and_the_way_back_is_no_higher_frequency(
    machine: MachineProfile,
) -> None:
    """Home at 76 mm, the outside of the jaws at 70 mm."""
    assert clearance_mm(machine, 50.0) == pytest.approx(5.95)
    nearer = replace(machine, tool=replace(machine.tool, home_radius_mm=75.0))
    assert codes(PVT, nearer) == ["identify.not_clear"]
    for highest in (10.0, 50.0, 100.0, 200.0):
        assert return_hz(machine, highest) <= max(highest, 100.0)
        assert wave_counts(machine, highest) * highest <= 25_000.0 + 1e-9  # half of 50 counts/ms
    slow = with_variable(machine, "I317", 5.0)
    slow = replace(slow, carriage=replace(slow.carriage, travel_max_mm=20.0))
    assert codes(CAM, slow) == ["identify.carriage_way"]


@pytest.mark.parametrize("definitions", [("#2->Y", "#3->Z"), ("#1->X+Y", "#2->Y", "#3->Z")])
def test_a_tool_without_its_own_axis_is_refused(machine: MachineProfile, definitions: tuple[str, ...]) -> None:
    other = replace(machine, controller=replace(machine.controller, axis_definitions=definitions))
    with pytest.raises(ProfileError) as refused:
        axis_word(other, machine.tool.motor)
    assert [problem.code for problem in refused.value.problems] == ["identify.axis"]


def test_an_axis_in_millimetres_is_spoken_to_in_millimetres(machine: MachineProfile) -> None:
    other = replace(machine, controller=replace(machine.controller, axis_definitions=("#1->-5000X+100",)))
    word = axis_word(other, machine.tool.motor)
    assert (word.letter, word.position(5100.0), word.length(125.0)) == ("X", -1.0, -0.025)


def jog(made: Stand, motor: int) -> None:
    made.tell(f"#{motor}J+")
    made.sim.wait(0.3)


ALREADY: dict[str, tuple[Callable[[Stand], None], str]] = {
    "drives off": (lambda made: made.rig.lathe.switch_off(), "machine.not_enabled"),
    "one drive off": (lambda made: made.tell("#3K"), "machine.not_enabled"),
    "spindle turning": (lambda made: jog(made, 2), "identify.spindle_turns"),
    "carriage moving": (lambda made: jog(made, 3), "machine.moving"),
    "somebody's program": (lambda made: made.tell("OPEN PROG998", "CLEAR", "X0", "CLOSE"), "identify.in_use"),
    "tables on": (lambda made: made.tell("I51=1"), "cut.table_on"),
    "other gains": (lambda made: made.tell("I130=600"), "controller.setting"),
}


@ON_ONE
@pytest.mark.parametrize("what", ALREADY)
def test_a_machine_that_is_not_ready_is_not_moved(machine: MachineProfile, what: str) -> None:
    made = ready(machine)
    make, code = ALREADY[what]
    make(made)
    made.line.heard = b""
    for path in (Strategy.PVT, Strategy.CAM):
        with pytest.raises(RefusedError) as refused:
            identify(made.rig, replace(PVT, path=path), made.origin, "D")
        assert code in [problem.code for problem in refused.value.problems], path
    assert not any(MOVES.search(line) for line in made.lines if not line.startswith("LIST"))


TABLE = ("#1DEFINE COMP 2,#2,#1,10000", "16 0")


def listed(made: Stand) -> list[str]:
    return [*made.rig.client.question("#1LIST COMP DEF"), *made.rig.client.question("#1LIST COMP")]


@ON_ONE
@pytest.mark.parametrize("path", [Strategy.PVT, Strategy.CAM])
def test_a_table_of_the_tool_is_no_obstacle_and_stands_as_before(machine: MachineProfile, path: Strategy) -> None:
    """A cut by `cam` leaves one, switched off; it may be another host's, too."""
    made = ready(machine)
    made.tell(*TABLE)
    before = listed(made)
    assert identify(made.rig, replace(PVT, path=path), made.origin, "D").points
    assert listed(made) == before == ["2,#2,#1,10000", "16 0"]


@ON_ONE
def test_a_table_that_the_tool_has_is_sent_again_where_the_measurement_ends_early(machine: MachineProfile) -> None:
    made = ready(machine)
    made.tell(*TABLE)

    def stops(_: object) -> None:
        made.rig.lathe.stop.stop("test")

    with pytest.raises(ProblemError):
        identify(made.rig, replace(CAM, frequencies_hz=(50.0, 60.0)), made.origin, "D", tell=stops)
    assert listed(made) == ["2,#2,#1,10000", "16 0"]


@ON_ONE
def test_a_gathering_of_somebody_else_goes_on(machine: MachineProfile) -> None:
    made = ready(machine)
    motor = made.rig.dialect.gathering
    made.tell(f"I{motor.masks[0]}=1", f"I{motor.period}=1000", "DEFINE GATHER 1000", "GATHER")
    with pytest.raises(RefusedError) as refused:
        identify(made.rig, PVT, made.origin, "D")
    assert [problem.code for problem in refused.value.problems] == ["identify.in_use"]
    assert made.sim.controller.gather.running


@ON_ONE
def test_a_link_over_which_a_lost_encoder_is_seen_too_late_is_refused(machine: MachineProfile) -> None:
    """Replies of 80 ms: six of them and two pauses, and 22.8 mm/s is what 50 um push against 201.6 N s/m."""
    made = ready(machine)
    made.sim.faults.inject("late-reply", delay_ms=80)
    made.line.heard = b""
    with pytest.raises(RefusedError) as refused:
        identify(made.rig, replace(PVT, amplitude_um=50.0), made.origin, "D")
    (problem,) = refused.value.problems
    assert problem.code == "identify.link_slow"
    assert 0.9 * 22.8 * 0.5 < float(problem.value.split()[0]) < 1.2 * 22.8 * 0.6
    assert not any(MOVES.search(line) for line in made.lines if not line.startswith("LIST"))


@ON_ONE
def test_nothing_moves_without_a_zero(machine: MachineProfile) -> None:
    made = stand(machine)
    made.rig.lathe.verify()
    made.rig.lathe.enable()
    made.line.heard = b""
    with pytest.raises(RefusedError) as refused:
        identify(made.rig, PVT, made.origin, "D")
    assert [problem.code for problem in refused.value.problems] == ["machine.not_homed"]
    assert not any(MOVES.search(line) for line in made.lines if "LIST" not in line)


@ON_ONE
def test_a_heartbeat_that_is_not_alive_keeps_the_drives_off(machine: MachineProfile) -> None:
    """I5 = 0: no PLC runs, so nothing would end the motion."""
    made = stand(machine)
    made.tell("I5=0")
    with pytest.raises(RefusedError) as refused:
        take_up(made.rig)
    assert any(problem.code.startswith("heartbeat.") for problem in refused.value.problems)
    assert not made.drives_on


@ON_ONE
def test_drives_that_somebody_has_switched_on_are_left_alone(machine: MachineProfile) -> None:
    made = stand(machine)
    made.tell("#3J/")
    made.line.heard = b""
    with pytest.raises(RefusedError) as refused:
        take_up(made.rig)
    assert [problem.code for problem in refused.value.problems] == ["identify.drives_on"]
    assert not any(MOVES.search(line) for line in made.lines)


# What is measured while another host writes a setting is refused: nothing of it is returned to be kept.

DATE = "2001-11-30T14:05:00.000Z"


def identified(stand: Stand, origin: ResponseOrigin) -> object:
    request = IdentificationRequest(path=Strategy.PVT, frequencies_hz=(50.0,))
    return identify(stand.rig, request, origin, DATE)


def table_identified(stand: Stand, origin: ResponseOrigin) -> object:
    request = IdentificationRequest(path=Strategy.CAM, frequencies_hz=(50.0,))
    return identify(stand.rig, request, origin, DATE)


def checked(stand: Stand, origin: ResponseOrigin) -> object:
    return check_health(stand.rig, HealthRequest(), origin, DATE)


Measure = Callable[[Stand, ResponseOrigin], object]
EACH = pytest.mark.parametrize("measured", [identified, table_identified, checked])


def disturb(sim: SimulatedLathe, *lines: tuple[float, str]) -> None:
    """Let another host send each line so many seconds from now."""
    port, wait = sim.connect(), sim.wait
    due = [(sim.now_s() + after_s, line) for after_s, line in lines]

    def waiting(seconds: float) -> None:
        end_s = sim.now_s() + seconds
        while due and due[0][0] <= end_s:
            at_s, line = due.pop(0)
            wait(max(at_s - sim.now_s(), 0.0))
            port.receive(line.encode() + b"\r")
            port.take_output()
        wait(max(end_s - sim.now_s(), 0.0))

    sim.wait = waiting  # type: ignore[method-assign]


def refusal(measured: Measure, stand: Stand, origin: ResponseOrigin) -> Problem:
    with pytest.raises(DriverError) as ended:
        measured(stand, origin)
    return ended.value.problems[0]


@pytest.mark.first(5)
@EACH
@pytest.mark.parametrize(
    ("line", "key", "found", "before"),
    [
        ("I132=2452", "I132", "2452", "4905"),  # the halved feedforward that was kept as 0.79 at -28 degrees
        ("I130=370", "I130", "370", "528"),
        ("I160=1", "I160", "1", "0"),  # a setting that no profile states
    ],
)
def test_a_setting_that_another_host_changes_and_leaves_is_named(
    machine: MachineProfile, measured: Measure, line: str, key: str, found: str, before: str
) -> None:
    stand = ready(machine)
    origin = stand.origin
    disturb(stand.sim, (0.3, line))
    problem = refusal(measured, stand, origin)
    assert (problem.code, problem.key, problem.value, problem.limit) == ("measurement.changed", key, found, before)
    assert not stand.drives_on


@ON_ONE
@pytest.mark.parametrize("measured", [identified, checked])
def test_a_setting_that_is_put_back_before_the_end_is_named(machine: MachineProfile, measured: Measure) -> None:
    stand = ready(machine)
    origin = stand.origin
    disturb(stand.sim, (1.3, "I168=40"), (1.9, "I168=0"))  # friction feedforward, while the tool is moved
    problem = refusal(measured, stand, origin)
    assert (problem.code, problem.key) == ("measurement.changed", "I168")


@ON_ONE
@pytest.mark.parametrize(("line", "key"), [("I132=2452", "I132"), ("I10=3700000", "I10")])
def test_a_setting_that_changed_when_read_moves_nothing(machine: MachineProfile, line: str, key: str) -> None:
    """The origin is read before drives are enabled and axes homed: that takes seconds."""
    stand = ready(machine)
    origin = stand.origin
    disturb(stand.sim, (0.0, line))
    stand.sim.wait(0.1)
    with pytest.raises(RefusedError) as ended:
        identified(stand, origin)
    assert (ended.value.problems[0].code, ended.value.problems[0].key) == ("measurement.changed", key)


@ON_ONE
def test_a_setting_that_no_turn_of_the_readings_has_is_named_at_the_end(machine: MachineProfile) -> None:
    stand = ready(machine)
    origin = stand.origin
    disturb(stand.sim, (1.0, "I117=50"))  # the greatest acceleration of a program
    problem = refusal(identified, stand, origin)
    assert (problem.code, problem.key) == ("measurement.changed", "I117")


@ON_ONE
def test_an_axis_that_another_host_scales_otherwise_is_named_at_the_end(machine: MachineProfile) -> None:
    stand = ready(machine)
    origin = stand.origin
    disturb(stand.sim, (0.2, "&1#1->1.001X"))  # before the program runs: later the controller refuses it
    problem = refusal(checked, stand, origin)
    assert (problem.code, problem.key) == ("measurement.changed", "#1->")
    assert (problem.value, problem.limit) == ("&1 1.001X", "&1 X")


@ON_ONE
def test_stops_that_were_measured_with_another_ramp_are_not_kept(machine: MachineProfile) -> None:
    """The record is kept under the settings that it is valid for, which were read after the last stop alone."""
    card = commissioned(machine)
    verification = card.verify()
    disturb(card.sim, (12.0, "I315=30"))  # the ramp of a stop of the carriage, in mid-test
    with pytest.raises(DriverError) as ended:
        prove(card.client, card.stop, card.sim, verification)
    assert [(each.code, each.key) for each in ended.value.problems] == [("measurement.changed", "I315")]


@ON_ONE
def test_over_a_slow_line_the_sine_is_steady(machine: MachineProfile, monkeypatch: pytest.MonkeyPatch) -> None:
    """Settings are read before the program starts; 30 s would be 9600 baud with an echo."""
    stand = ready(machine)
    note = stand.rig.lathe.program.note_settings

    def slowly() -> None:
        stand.sim.wait(30.0)
        note()

    monkeypatch.setattr(stand.rig.lathe.program, "note_settings", slowly)
    assert identified(stand, stand.origin)


def test_what_is_measured_undisturbed_is_kept() -> None:
    stand = ready(load_machine("lee-2001-lathe").machine)
    assert identified(stand, stand.origin)
