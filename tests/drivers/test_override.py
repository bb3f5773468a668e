"""The override of a cut: its band by what the inverse leaves, and the polls by the time of the program."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import pytest

from drivers.cutting.bounds import Adjustable, Bounds
from drivers.cutting.override import FeedOverride, PaceLedger, bounds_of
from drivers.cutting.planning import Strategy, plan_cut
from drivers.identification.nominal import nominal_response, path_response
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.dialect import PMAC
from profiles.axis.response import identified_response
from tests.drivers.close_together import machine as machine
from tests.drivers.cut_floor import with_inverter
from tests.drivers.heartbeat_card import SURFACE, TOOL, TURN_MS, begin_cut, cut_program, host_of, leased_loop
from tests.drivers.plc_card import values
from tests.drivers.test_guards import seen, state

if TYPE_CHECKING:
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import JobMaker


def bounds(experiment: JobMaker, machine: MachineProfile, strategy: Strategy, tolerance_um: float = 5.0) -> Bounds:
    job = replace(experiment(1), cut_length_mm=1.0, roundness_tolerance_um=tolerance_um)
    return bounds_of(plan_cut(job, machine, strategy), job, machine, path_response(strategy, machine))


@pytest.mark.parametrize("tolerance_um", [2.0, 5.0, 8.0])
def test_the_band_ends_where_the_inverse_leaves_half_the_tolerance(
    machine: MachineProfile, experiment: JobMaker, tolerance_um: float
) -> None:
    """55 um |T(k f) / T(f) - 1| at a lobe frequency of 50 Hz."""

    def left_um(percent: float) -> float:
        there = nominal_response(Strategy.PVT, machine, 0.5 * percent)
        return 55.0 * abs(there / nominal_response(Strategy.PVT, machine, 50.0) - 1.0)

    band = bounds(experiment, machine, Strategy.PVT, tolerance_um)
    assert left_um(band.low_percent) <= 0.5 * tolerance_um < left_um(band.low_percent - 1)
    assert left_um(band.high_percent) <= 0.5 * tolerance_um < left_um(band.high_percent + 1)
    assert (band.low_by, band.high_by) == ("inverse", "inverse")


def test_an_identified_response_ends_the_band_where_nobody_has_measured(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    points = {hz: nominal_response(Strategy.PVT, machine, hz) for hz in (49.2, 50.0, 51.2)}
    response = identified_response(
        frequency_hz=list(points),
        gain=[abs(point) for point in points.values()],
        phase_deg=[math.degrees(cmath.phase(point)) for point in points.values()],
        gain_ci=[0.0] * 3,
        phase_ci_deg=[0.0] * 3,
        amplitude_um=25.0,
        name="there",
    )
    job = replace(experiment(1), cut_length_mm=1.0)
    band = bounds_of(plan_cut(job, machine, Strategy.PVT), job, machine, response)
    assert (band.low_percent, band.high_percent) == (99, 102)
    assert (band.low_by, band.high_by) == ("response", "response")


def test_a_limit_of_the_machine_ends_the_band_upwards_alone(machine: MachineProfile, experiment: JobMaker) -> None:
    slow = replace(machine, spindle=replace(machine.spindle, max_speed_rpm=1035.0))
    band = bounds(experiment, slow, Strategy.PVT)
    assert (band.high_percent, band.high_by) == (103, "spindle")
    assert band.low_percent == bounds(experiment, machine, Strategy.PVT).low_percent


def test_no_override_drives_a_motor_beyond_its_speed(machine: MachineProfile, experiment: JobMaker) -> None:
    """I116, the most that a program may command the tool, 5.5 % above the peak of this program: 105 %."""
    job = replace(experiment(1), cut_length_mm=1.0)
    peak = plan_cut(job, machine, Strategy.NONE).checked.peak_velocity[1]
    variables = {**machine.controller.variables, "I116": 1.055 * peak}
    limited = replace(machine, controller=replace(machine.controller, variables=variables))
    band = bounds(experiment, limited, Strategy.NONE)
    assert (band.high_percent, band.high_by) == (105, "program_speed")


def test_without_an_inverse_the_widest_band_is_offered(machine: MachineProfile, experiment: JobMaker) -> None:
    band = bounds(experiment, machine, Strategy.NONE)
    assert (band.low_percent, band.low_by) == (80, "widest")


def test_a_spindle_that_is_no_axis_of_the_program_has_no_override(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    for strategy, lathe in ((Strategy.TIMEBASE, machine), (Strategy.CAM, with_inverter(machine))):
        assert bounds(experiment, lathe, strategy).refused(Adjustable.OVERRIDE) == "cut.no_override"


def polls(*percents: float) -> list[Snapshot]:
    """One poll a second, with the carriage at the part from the second on."""
    return [
        seen(float(number), percent=percent, carriage=state(100.0 * number))
        for number, percent in enumerate(percents)
    ]


def test_the_time_of_the_program_is_that_of_the_override() -> None:
    """A second at 100 %, one on the way to 80 %, two at 80 %: 1 + 0.9 + 0.8 + 0.8 s of the program."""
    ledger = PaceLedger(face_counts=50.0)
    times = [ledger.see(poll).at_s for poll in polls(100.0, 100.0, 80.0, 80.0, 80.0)]
    assert times == pytest.approx([0.0, 1.0, 1.9, 2.7, 3.5])
    assert ledger.mean == pytest.approx(3.5 / 4.0)


def test_at_real_time_a_poll_stays_what_it_is() -> None:
    ledger = PaceLedger(face_counts=50.0)
    assert all(ledger.see(poll) is poll for poll in polls(100.0, 100.0, 100.0))
    assert ledger.mean == 1.0


def test_the_slowest_cut_ends_within_the_promise_of_the_heartbeat(machine: MachineProfile) -> None:
    """Its program takes 1.25 times as long for the turn and the way out; the timers of the controller do not."""
    host = host_of(machine, PMAC)
    begin_cut(host, cut_program(leased_loop(PMAC)))
    host.card.tell("&1%80")
    out_s = host.until(lambda: host.place(TOOL) < SURFACE + 500)
    assert out_s <= 0.3 + 1.25 * (TURN_MS + 10 + 5 + 200 + 195 - 88) / 1000.0 + 0.005
    assert host.until(host.still) <= 2.0
    assert host.place(TOOL) == pytest.approx(SURFACE, abs=20)
    assert values(host.card, "M26 P1003 P1004") == [1, 0, 2]


def test_an_override_that_was_commanded_has_two_seconds_to_arrive() -> None:
    """On its way it may be anywhere between; what is elsewhere, or not there by then, is not of this console."""
    free = SimpleNamespace(check=lambda: None, refuse_unless_owner=lambda: None, request=lambda *_: [])
    override = FeedOverride(cast(Any, free), cast(Any, free), cast(Any, free))

    def expected(at_s: float, percent: float) -> tuple[float, float]:
        return override.expected(seen(at_s, percent=percent))

    assert expected(0.0, 100.0) == (100.0, 100.0)
    override.command(80)
    assert expected(0.1, 97.0) == expected(1.9, 97.0) == (80.0, 100.0)
    assert expected(2.1, 97.0) == (80.0, 80.0)
    override.command(110)
    assert expected(2.2, 97.0) == (97.0, 110.0)
    assert expected(2.5, 110.0) == expected(2.6, 100.0) == (110.0, 110.0), "it has arrived"
