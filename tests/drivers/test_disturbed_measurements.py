"""What is measured while another host writes a setting is refused: nothing of it is returned to be kept."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.commissioning.proofs.proving import prove
from drivers.cutting.strategy import Strategy
from drivers.errors import DriverError, RefusedError
from drivers.identification.health import HealthRequest, check_health
from drivers.identification.identify import identify
from drivers.identification.request import IdentificationRequest
from drivers.identification.result import Origin
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.store import load_machine
from tests.drivers.commissioned import commissioned
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine  # both families
from tests.drivers.identification_bench import Stand, ready

DATE = "2001-11-30T14:05:00.000Z"


def identified(stand: Stand, origin: Origin) -> object:
    request = IdentificationRequest(path=Strategy.PVT, frequencies_hz=(50.0,))
    return identify(stand.rig, request, origin, DATE)


def table_identified(stand: Stand, origin: Origin) -> object:
    request = IdentificationRequest(path=Strategy.CAM, frequencies_hz=(50.0,))
    return identify(stand.rig, request, origin, DATE)


def checked(stand: Stand, origin: Origin) -> object:
    return check_health(stand.rig, HealthRequest(), origin, DATE)


Measure = Callable[[Stand, Origin], object]
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


def refusal(measured: Measure, stand: Stand, origin: Origin) -> Problem:
    with pytest.raises(DriverError) as ended:
        measured(stand, origin)
    return ended.value.problems[0]


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
def test_a_setting_that_changed_after_it_was_read_moves_nothing(
    machine: MachineProfile, line: str, key: str
) -> None:
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
def test_over_a_slow_line_the_sine_is_gathered_once_it_is_steady(
    machine: MachineProfile, monkeypatch: pytest.MonkeyPatch
) -> None:
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
