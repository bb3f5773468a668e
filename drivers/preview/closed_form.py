"""Predict a strategy in closed form, without its program: for all but the printed one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drivers.cutting.strategy import Strategy
from drivers.identification.nominal import loop_response, nominal_response
from drivers.preview.outlook import Demand, Outlook, Response, demands_of, response_of
from drivers.preview.program_prediction import TURN_POINTS, FloatArray, left_by
from profiles.axis.response import Source
from profiles.axis.servo import drive_need
from profiles.compensations.path import PathHarmonic

_TURN_DEG: FloatArray = np.linspace(0.0, 360.0, TURN_POINTS, endpoint=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosedForm:
    """A cut at the speed of the job, with the nominal or the identified axis.

    The arrays have the shape (TURN_POINTS,), as those of a program, so that plots of both look alike.
    `angle_deg` are spindle angles, `command_um` is the commanded infeed there, `residual_um` the
    deviation of the released part, positive where it is high, mean 0. `response` is that of the loop at
    `lobe_frequency_hz`, `demands` are the needs of a sine with the amplitude of the command.
    """

    angle_deg: FloatArray
    command_um: FloatArray
    residual_um: FloatArray
    lobe_frequency_hz: float
    response: Response
    demands: dict[str, Demand]

    @property
    def stroke_um(self) -> float:
        """Tool travel, peak to peak."""
        return float(np.ptp(self.command_um))


def closed_form(seen: Outlook, strategy: Strategy) -> ClosedForm | None:
    """Predict a strategy; return None where only its program can tell.

    Of a lobe E the inverse of T_hat leaves E |1 - T / T_hat| (inverse feedforward at the lobe frequency), a plain
    cut all of it.
    """
    if not strategy.traits.follows_lobe:
        command = replace(seen.target, amplitude_um=0.0, overtones=())
    elif strategy.traits.inverts and strategy is seen.strategy:
        command = seen.command
    else:
        return None
    job, machine = seen.job, seen.machine
    path_um = np.full(TURN_POINTS, command.mean_um)
    identified = strategy is seen.strategy and seen.response.source is Source.IDENTIFIED
    for harmonic in command.harmonics:
        frequency_hz = harmonic.lobes * job.spindle_speed_rpm / 60.0
        if identified and harmonic.lobes == job.jaws:
            answer = seen.response.at(frequency_hz)
        else:
            answer = nominal_response(strategy, machine, frequency_hz)
        path_um += PathHarmonic.of(harmonic.lobes, answer * harmonic.coefficient).at_um(_TURN_DEG)
    response = seen.sampled
    if identified:
        response = response_of(job, loop_response(strategy, machine, seen.response, job.lobe_frequency_hz))
    # The command belongs to the angle that the controller read, which the spindle has left since.
    late_deg = (
        strategy.traits.late_cycles(machine) * machine.controller.servo_period_ms * job.spindle_speed_rpm * 0.006
    )
    return ClosedForm(
        angle_deg=_TURN_DEG,
        command_um=command.at_um(_TURN_DEG - late_deg),
        residual_um=left_by(job, _TURN_DEG, path_um),
        lobe_frequency_hz=job.lobe_frequency_hz,
        response=response,
        demands=demands_of(machine, drive_need(machine, command.amplitude_um, job.lobe_frequency_hz)),
    )
