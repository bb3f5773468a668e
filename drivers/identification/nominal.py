"""The nominal response of a path by the machine profile: the sampled loop, and the delay of its reference."""

from __future__ import annotations

import cmath
import math

from drivers.cutting.strategy import Strategy
from profiles.axis.response import ServoResponse, model_response
from profiles.axis.servo import sampled_response
from profiles.compensations.path import delayed
from profiles.machine import MachineProfile


def nominal_response(path: Strategy, machine: MachineProfile, frequency_hz: float) -> complex:
    """Return the response that a cut on this path inverts where no better one is known."""
    delay_s = path.traits.late_cycles(machine) * machine.controller.servo_period_ms / 1000.0
    return delayed(complex(sampled_response(machine, frequency_hz)), frequency_hz, delay_s)


def path_response(path: Strategy, machine: MachineProfile) -> ServoResponse:
    """Return the same over all frequencies, with its uncertainty."""
    return model_response(machine, lambda frequency_hz: nominal_response(path, machine, frequency_hz))


def loop_response(
    path: Strategy, machine: MachineProfile, response: ServoResponse, frequency_hz: float
) -> complex:
    """Return the loop alone at a frequency of the band: a response without the delay of the path's reference."""
    lead_s = -path.traits.late_cycles(machine) * machine.controller.servo_period_ms / 1000.0
    return delayed(response.at(frequency_hz), frequency_hz, lead_s)


def phase_difference_deg(phase_deg: float, response: complex) -> float:
    """Return the lead of a phase over that of a response, within half a turn."""
    turned = cmath.rect(1.0, math.radians(phase_deg)) * response.conjugate()
    return math.degrees(cmath.phase(turned))
