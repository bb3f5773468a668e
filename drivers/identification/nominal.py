"""The nominal response of a path by the machine profile: the sampled loop, and the delay of its reference."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

from drivers.cutting.strategy import Strategy
from profiles.axis.response import ResponseSource, ServoResponse, model_response, model_spread
from profiles.axis.servo import sampled_response
from profiles.compensations.certificate import ToolResponse
from profiles.compensations.path import delay_response
from profiles.machine import MachineProfile
from profiles.problem import ProfileError


def nominal_response(path: Strategy, machine: MachineProfile, frequency_hz: float) -> complex:
    """Return the response that a cut on this path inverts where no better one is known."""
    delay_s = path.traits.late_cycles(machine) * machine.controller.servo_period_ms / 1000.0
    return delay_response(complex(sampled_response(machine, frequency_hz)), frequency_hz, delay_s)


def path_response(path: Strategy, machine: MachineProfile) -> ServoResponse:
    """Return the same over all frequencies, with its uncertainty."""
    return model_response(machine, lambda frequency_hz: nominal_response(path, machine, frequency_hz))


def loop_response(
    path: Strategy, machine: MachineProfile, response: ServoResponse, frequency_hz: float
) -> complex:
    """Return the loop alone at a frequency of the band: a response without the delay of the path's reference."""
    lead_s = -path.traits.late_cycles(machine) * machine.controller.servo_period_ms / 1000.0
    return delay_response(response.response_at(frequency_hz), frequency_hz, lead_s)


def phase_difference_deg(phase_deg: float, response: complex) -> float:
    """Return the lead of a phase over that of a response, within half a turn."""
    turned = cmath.rect(1.0, math.radians(phase_deg)) * response.conjugate()
    return math.degrees(cmath.phase(turned))


UNMODELLED_DELAY_S = 0.0005
"""Delay that a machine profile knows nothing of: current loop, a bending slide. Assumed, about a servo cycle."""


def model_follows(path: Strategy, machine: MachineProfile, frequency_hz: float) -> ToolResponse:
    """Return the response by the profile: masses and gains may be off, and something else may be late."""
    late = 2.0 * math.sin(min(math.pi * frequency_hz * UNMODELLED_DELAY_S, math.pi / 2.0))
    return ToolResponse(
        response=nominal_response(path, machine, frequency_hz), spread=model_spread(machine, frequency_hz) + late
    )


def follows_by_order(
    path: Strategy, machine: MachineProfile, spindle_speed_rpm: float, identified: ServoResponse | None = None
) -> Callable[[int], ToolResponse]:
    """Return a function of the order of a turn: as `identified` within its band, else by the profile."""

    def follows(order: int) -> ToolResponse:
        frequency_hz = order * spindle_speed_rpm / 60.0
        if identified is not None and identified.source is ResponseSource.IDENTIFIED:
            try:
                response, spread = identified.response_at(frequency_hz), identified.relative_95(frequency_hz)
            except ProfileError:  # outside of its band
                pass
            else:
                return ToolResponse(response=response, spread=spread)
        return model_follows(path, machine, frequency_hz)

    return follows
