"""The identification request, and what forbids it before anything is sent: amplitude, times, drive, clearance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from drivers.cutting.strategy import INVERTING, Strategy
from drivers.identification.excitation import (
    CARRIED_CYCLES,
    CARRIER_UM,
    carrier_hz,
    most_alone_hz,
    return_hz,
    way_counts,
)
from drivers.pmac.settings import PARTS_PER_COUNT
from profiles.axis.servo import drive_need, following_error_um, sampled_response
from profiles.machine import MachineProfile
from profiles.problem import Problem

MOST_AMPLITUDE_UM = 50.0
LEAST_AMPLITUDE_COUNTS = 25.0  # encoder resolution; below it a stuck tool looks like a swinging one
FREQUENCIES_HZ = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0)  # 10, 30, 50, 70 Hz: Table 5
AMPLITUDE_UM = 25.0  # the amplitude of Table 5: 50 um peak to peak
PERIODS = 20

LEAST_HZ = 1.0
LEAST_PERIODS, MOST_PERIODS = 4, 200
MOST_FREQUENCIES = 40
MOST_SINE_S = 10.0  # gathering time per sine: limited like the amplitude, and by the controller's memory
CLEAR_MM = 5.0  # minimum clearance of the tool from everything


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationRequest:
    """One path, the frequencies in the order of measurement, the amplitude and the duration of each."""

    path: Strategy
    frequencies_hz: tuple[float, ...] = FREQUENCIES_HZ
    amplitude_um: float = AMPLITUDE_UM
    periods: int = PERIODS


def most_hz(machine: MachineProfile, path: Strategy) -> float:
    """Return the highest frequency of a path: a table swings the tool by one sine alone."""
    if path.traits.by_table:
        return most_alone_hz(machine)
    return 1000.0 / machine.controller.servo_period_ms / CARRIED_CYCLES


def swung_um(request: IdentificationRequest, machine: MachineProfile) -> float:
    """Return how far the tool is commanded from its zero at most."""
    carried = any(carrier_hz(machine, f) for f in request.frequencies_hz)
    return request.amplitude_um + (CARRIER_UM if carried else 0.0)


def clearance_mm(machine: MachineProfile, amplitude_um: float) -> float:
    """Return the clearance of the swinging tool at its zero from the outside of the jaws.

    The jaw is assumed to have its centre of mass in its middle and its inner end on the spindle axis.
    """
    return machine.tool.home_radius_mm - 2.0 * machine.chuck.jaw_radius_mm - amplitude_um / 1000.0


def clearance_problems(machine: MachineProfile, swing_um: float) -> Iterator[Problem]:
    """Check that the tool stays clear of everything on its swing."""
    clear_mm = clearance_mm(machine, swing_um)
    if clear_mm < CLEAR_MM:
        value, limit = f"{clear_mm:.3g} mm", f">= {CLEAR_MM:g} mm"
        yield Problem(code="identify.not_clear", key="tool", value=value, limit=limit)


def request_problems(request: IdentificationRequest, machine: MachineProfile) -> tuple[Problem, ...]:
    """Return everything that forbids this request on this machine; nothing is sent for it."""
    asked = (*_path_and_amplitude(request, machine), *_frequencies(request, machine), *_lengths(request, machine))
    if asked:
        return asked
    swings = request.frequencies_hz
    if request.path.traits.by_table:
        swings = (*swings, return_hz(machine, max(swings)))
    driven = [problem for f in swings for problem in _drive(machine, request.amplitude_um, f)]
    # The first of each kind: where one frequency is too much, so is the next higher one.
    firsts = {problem.key: problem for problem in reversed(driven)}.values()
    return (*firsts, *_clearance(request, machine))


def _path_and_amplitude(request: IdentificationRequest, machine: MachineProfile) -> Iterator[Problem]:
    if request.path not in INVERTING:
        yield Problem(code="identify.path", key="strategy", value=request.path, limit=" | ".join(INVERTING))
    least_um = LEAST_AMPLITUDE_COUNTS * machine.tool.count_um
    if not least_um <= request.amplitude_um <= MOST_AMPLITUDE_UM:
        value, limit = f"{request.amplitude_um:g} um", f"{least_um:g}..{MOST_AMPLITUDE_UM:g} um"
        yield Problem(code="identify.amplitude", key="amplitude", value=value, limit=limit)


def _frequencies(request: IdentificationRequest, machine: MachineProfile) -> Iterator[Problem]:
    count, key = len(request.frequencies_hz), "frequencies"
    if not 1 <= count <= MOST_FREQUENCIES:
        yield Problem(code="identify.frequencies", key=key, value=f"{count}", limit=f"1..{MOST_FREQUENCIES}")
    limit = f"{LEAST_HZ:g}..{most_hz(machine, request.path):.4g} Hz"
    for frequency in request.frequencies_hz:
        if not LEAST_HZ <= frequency <= most_hz(machine, request.path):
            yield Problem(code="identify.frequency", key=key, value=f"{frequency:g} Hz", limit=limit)


def _lengths(request: IdentificationRequest, machine: MachineProfile) -> Iterator[Problem]:
    if not LEAST_PERIODS <= request.periods <= MOST_PERIODS:
        limit = f"{LEAST_PERIODS}..{MOST_PERIODS}"
        yield Problem(code="identify.periods", key="periods", value=f"{request.periods}", limit=limit)
        return
    counted = (carrier_hz(machine, f) or f for f in request.frequencies_hz if f > 0.0)
    slowest = min(counted, default=math.inf)
    if request.periods / slowest > MOST_SINE_S:
        value = f"{request.periods} x {1.0 / slowest:g} s"
        yield Problem(code="identify.too_long", key="periods", value=value, limit=f"<= {MOST_SINE_S:g} s")


def _drive(machine: MachineProfile, amplitude_um: float, frequency_hz: float) -> Iterator[Problem]:
    """Compare a sine with the settings and limits of the axis: Ix16, Ix17, thrust, following-error limit."""
    tool, variables = machine.tool, machine.controller.variables
    error_um, carrier = following_error_um(machine, amplitude_um, frequency_hz), carrier_hz(machine, frequency_hz)
    if carrier is not None:  # so fast, what the loop makes of a command is what the axis does
        error_um += following_error_um(machine, CARRIER_UM, carrier)
        amplitude_um *= float(abs(sampled_response(machine, frequency_hz)))
    need = drive_need(machine, amplitude_um, frequency_hz)
    per_mm, motor = tool.counts_per_mm, tool.motor
    quantities = (
        ("16", need.velocity_mm_per_s * per_mm / 1000.0, variables[f"I{motor}16"], "counts/ms"),
        ("17", need.acceleration_m_per_s2 * per_mm / 1000.0, variables[f"I{motor}17"], "counts/ms2"),
        ("11", error_um, variables[f"I{motor}11"] / PARTS_PER_COUNT * tool.count_um, "um"),
        ("", need.force_n, tool.continuous_force_n, "N"),
    )
    for number, needed, limit, unit in quantities:
        if needed >= limit:
            yield Problem(
                code="identify.beyond_drive",
                key=f"I{motor}{number}" if number else "tool.continuous_force_n",
                where=f"{frequency_hz:g} Hz",
                value=f"{needed:.4g} {unit}",
                limit=f"< {limit:.4g} {unit}",
            )


def _clearance(request: IdentificationRequest, machine: MachineProfile) -> Iterator[Problem]:
    """Check that the tool swings clear, and that the travel of a table's path fits the axis."""
    yield from clearance_problems(machine, swung_um(request, machine))
    if not request.path.traits.by_table:
        return
    highest = max(request.frequencies_hz)
    way = max(way_counts(machine, highest, f, request.periods) for f in request.frequencies_hz)
    way_mm = way / machine.carriage.counts_per_mm
    if way_mm > machine.carriage.travel_max_mm:
        value, limit = f"{way_mm:.4g} mm", f"<= {machine.carriage.travel_max_mm:g} mm"
        yield Problem(code="identify.carriage_way", key="carriage", value=value, limit=limit)
