"""A cut that inverts what was identified: its command, whose response it takes, and what it refuses."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drivers.cutting.planning import Strategy, nominal_command, plan_cut
from drivers.identification.nominal import nominal_response
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, Origin, as_response, unfit_problems
from profiles.axis.servo import sampled_response
from profiles.problem import ProfileError

if TYPE_CHECKING:
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import JobMaker

Curve = Callable[[float], complex]


def identified(
    machine: MachineProfile, path: Strategy, curve: Curve, *frequencies_hz: float
) -> IdentifiedResponse:
    """What the console would have kept of an axis that answers like this."""
    variables = machine.controller.variables
    origin = Origin(
        machine=machine.name,
        simulated=True,
        version="1.17",
        kind="PMAC1, X1",
        gains={f"I{number}": variables[f"I{number}"] for number in range(130, 136)},
        servo_period_ms=machine.controller.servo_period_ms,
    )
    points = tuple(
        IdentifiedPoint(
            frequency_hz=frequency_hz,
            gain=abs(curve(frequency_hz)),
            phase_deg=math.degrees(cmath.phase(curve(frequency_hz))),
            gain_ci=0.001,
            phase_ci_deg=0.06,
            coherence=1.0,
            amplitude_um=25.0,
        )
        for frequency_hz in frequencies_hz
    )
    date = "2001-11-30T14:05:00.000Z"
    return IdentifiedResponse(origin=origin, path=path, how="measured", delay_cycles=0, date=date, points=points)


def test_the_command_is_divided_by_the_gain_and_leads_by_the_phase(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """Half a gain and 60 deg of lag: twice the amplitude, and 20 deg of spindle earlier."""
    found = identified(machine, Strategy.PVT, lambda _: cmath.rect(0.5, math.radians(-60.0)), 50.0)
    job = experiment(1)
    command = nominal_command(job, machine, Strategy.PVT, as_response(found, "there"))
    assert command.amplitude_um == pytest.approx(55.0)
    assert command.phase_deg == pytest.approx(job.lobe_phase_deg - 20.0)
    assert command.mean_um == pytest.approx(100.0)


@pytest.mark.parametrize("path", [Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE])
def test_what_the_model_would_have_answered_makes_the_command_of_the_model(
    machine: MachineProfile, experiment: JobMaker, path: Strategy
) -> None:
    """The age of a path is in what was identified, and no cycle of it is counted twice."""
    found = identified(machine, path, lambda hz: nominal_response(path, machine, hz), 50.0)
    command, model = (
        nominal_command(experiment(1), machine, path, response) for response in (as_response(found, "there"), None)
    )
    assert command.amplitude_um == pytest.approx(model.amplitude_um, rel=1e-9)
    assert command.phase_deg == pytest.approx(model.phase_deg, abs=1e-9)


@pytest.mark.parametrize("path", [Strategy.PVT, Strategy.CAM])
def test_the_program_of_an_identified_axis_is_another(
    machine: MachineProfile, experiment: JobMaker, path: Strategy
) -> None:
    found = identified(machine, path, lambda hz: 0.9 * complex(sampled_response(machine, hz)), 40.0, 60.0)
    job = replace(experiment(1), cut_length_mm=1.0)
    plan, by_model = (plan_cut(job, machine, path, response=r) for r in (as_response(found, "there"), None))
    assert (plan.text, plan.table) != (by_model.text, by_model.table)
    assert plan.target == by_model.target


def test_a_speed_that_was_not_identified_makes_no_program(machine: MachineProfile, experiment: JobMaker) -> None:
    found = identified(machine, Strategy.CAM, lambda _: 0.9 + 0j, 40.0, 60.0)
    job = replace(experiment(1), spindle_speed_rpm=1300.0)
    with pytest.raises(ProfileError) as caught:
        plan_cut(job, machine, Strategy.CAM, response=as_response(found, "there"))
    (problem,) = caught.value.problems
    assert (problem.code, problem.where, problem.value) == ("response.outside_band", "there", "65 Hz")


def test_a_response_holds_for_its_machine_path_gains_and_world(machine: MachineProfile) -> None:
    found = identified(machine, Strategy.PVT, lambda _: 0.9 + 0j, 50.0)
    assert unfit_problems(found, machine, Strategy.PVT, simulated=True) == ()
    assert unfit_problems(found, machine, Strategy.PVT) == ()
    origin = found.origin
    variables = {**machine.controller.variables, "I133": 0.0}
    others = {
        "strategy": (found, machine, Strategy.CAM),
        "machine": (found, replace(machine, name="another"), Strategy.PVT),
        "controller": (replace(found, origin=replace(origin, kind="TURBO PMAC2")), machine, Strategy.PVT),
        "I133": (
            found,
            replace(machine, controller=replace(machine.controller, variables=variables)),
            Strategy.PVT,
        ),
        "servo_period_ms": (replace(found, origin=replace(origin, servo_period_ms=0.2214)), machine, Strategy.PVT),
    }
    for key, differing in others.items():
        (problem,) = unfit_problems(*differing, simulated=True, where="file")
        assert (problem.code, problem.where, problem.key) == ("response.of_another", "file", key)
    (world,) = unfit_problems(found, machine, Strategy.PVT, simulated=False)
    assert (world.value, world.limit) == ("simulated", "real")


def test_a_response_that_names_no_filter_was_measured_without_one(machine: MachineProfile) -> None:
    """As they were kept before there was a filter: Ix30 to Ix35 alone."""
    found = identified(machine, Strategy.PVT, lambda _: 0.9 + 0j, 50.0)
    assert not any(name >= "I136" for name in found.origin.gains)
    variables = {**machine.controller.variables, "I136": -1.09375, "I139": 0.125}
    filtered = replace(machine, controller=replace(machine.controller, variables=variables))
    problems = unfit_problems(found, filtered, Strategy.PVT)
    assert [(each.key, each.value, each.limit) for each in problems] == [
        ("I136", "0", "-1.09375"),
        ("I139", "0", "0.125"),
    ]
