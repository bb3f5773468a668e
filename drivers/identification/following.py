"""How well the tool follows each order of a turn: the response that is known, and how far off it may be."""

from __future__ import annotations

import math
from collections.abc import Callable

from drivers.cutting.strategy import Strategy
from drivers.identification.nominal import nominal_response
from profiles.axis.response import ServoResponse, Source, model_spread
from profiles.compensations.certificate import Follows
from profiles.machine import MachineProfile
from profiles.problem import ProfileError

UNMODELLED_DELAY_S = 0.0005
"""Delay that a machine profile knows nothing of: current loop, a bending slide. Assumed, about a servo cycle."""


def model_follows(path: Strategy, machine: MachineProfile, frequency_hz: float) -> Follows:
    """Return the response by the profile: masses and gains may be off, and something else may be late."""
    late = 2.0 * math.sin(min(math.pi * frequency_hz * UNMODELLED_DELAY_S, math.pi / 2.0))
    return Follows(
        response=nominal_response(path, machine, frequency_hz), spread=model_spread(machine, frequency_hz) + late
    )


def follows_by_order(
    path: Strategy, machine: MachineProfile, spindle_speed_rpm: float, identified: ServoResponse | None = None
) -> Callable[[int], Follows]:
    """Return a function of the order of a turn: as `identified` within its band, else by the profile."""

    def follows(order: int) -> Follows:
        frequency_hz = order * spindle_speed_rpm / 60.0
        if identified is not None and identified.source is Source.IDENTIFIED:
            try:
                response, spread = identified.at(frequency_hz), identified.relative_95(frequency_hz)
            except ProfileError:  # outside of its band
                pass
            else:
                return Follows(response=response, spread=spread)
        return model_follows(path, machine, frequency_hz)

    return follows
