"""Identified response for JSON, beside the machine profile's: lengths in um, angles in degrees."""

from __future__ import annotations

import cmath
import math
from dataclasses import asdict

from drivers.identification.nominal import nominal_response, phase_difference_deg
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse
from profiles.machine import MachineProfile

LEAST_COHERENCE = 0.95
"""Coherence below which a point is marked as doubtful: the response is not due to the excitation alone."""


def response_fields(identified: IdentifiedResponse, machine: MachineProfile, file: str) -> dict[str, object]:
    """Return the result with all its points, nothing rounded."""
    return {
        **asdict(identified.origin),
        "path": identified.path.value,
        "how": identified.how,
        "delay_cycles": identified.delay_cycles,
        "date": identified.date,
        "file": file,
        "points": [_point_fields(identified, point, machine) for point in identified.points],
        "doubtful_hz": [point.frequency_hz for point in doubtful_points(identified)],
    }


def doubtful_points(identified: IdentifiedResponse) -> list[IdentifiedPoint]:
    """Return the points whose coherence is too low."""
    return [point for point in identified.points if point.coherence < LEAST_COHERENCE]


def decibels(gain: float) -> float:
    """Return a gain in dB."""
    return 20.0 * math.log10(max(gain, 1e-12))


def _point_fields(
    identified: IdentifiedResponse, point: IdentifiedPoint, machine: MachineProfile
) -> dict[str, object]:
    nominal = nominal_response(identified.path, machine, point.frequency_hz)
    return {
        **asdict(point),
        "gain_db": decibels(point.gain),
        "nominal_gain": abs(nominal),
        "nominal_phase_deg": math.degrees(cmath.phase(nominal)),
        "gain_difference_percent": 100.0 * (point.gain / abs(nominal) - 1.0),
        "phase_difference_deg": phase_difference_deg(point.phase_deg, nominal),
    }
