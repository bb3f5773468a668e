"""Predict what one planned program makes of the part: its motion, the servo that follows it, and the residual."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from drivers.cutting.planning import CutPlan
from drivers.identification.nominal import loop_response
from drivers.pmac.trajectory.pieces import position_at
from drivers.preview.outlook import Demand, Response, demands_of, response_of
from profiles.axis.response import ResponseSource, ServoResponse
from profiles.axis.servo import drive_need, sampled_response
from profiles.compensations.path import free_state_lobe
from profiles.job import Job
from profiles.machine import MachineProfile

FloatArray = NDArray[np.float64]

TURN_POINTS = 720  # points per turn at which a path is computed: 120 in each move of the paper's program


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProgramPrediction:
    """What one program makes of the part, over one turn of the steady cut; every array has shape (TURN_POINTS,).

    `angle_deg` are spindle angles, rising in [0, 360). `command_um` is the programmed tool path, `path_um` the
    servo's actual path, both um of infeed from the surface of the blank. `residual_um` is the deviation of the
    released part, positive where it is high, mean 0; the clamped blank is taken as round. The arrays are read
    only. `response` is that of the loop at `lobe_frequency_hz`, `demands` are the needs of a sine with the
    stroke of the program, both at the actual speed of the program.
    """

    angle_deg: FloatArray
    command_um: FloatArray
    path_um: FloatArray
    residual_um: FloatArray
    lobe_frequency_hz: float
    response: Response
    demands: dict[str, Demand]

    @property
    def ront_um(self) -> float:
        """Roundness that is left, peak to peak."""
        return float(np.ptp(self.residual_um))

    @property
    def stroke_um(self) -> float:
        """Programmed tool travel, peak to peak."""
        return float(np.ptp(self.command_um))

    @property
    def mean_um(self) -> float:
        """Mean depth of the cut on the radius."""
        return float(np.mean(self.path_um))


def predict(
    job: Job, machine: MachineProfile, plan: CutPlan, response: ServoResponse | None = None
) -> ProgramPrediction:
    """Predict what a planned cut makes of the part.

    The motion is that of the program, move by move; the spindle follows exactly, the tool as the nominal servo
    does, and at the lobe frequency as identified, if `response` was identified on the path of this plan.
    Cutting force and unmeasured properties of the machine are not included.
    """
    angle_deg, command_um = _steady_turn(machine, plan)
    known = {}  # the loop by its order (UPR), where it was identified
    if response is not None and response.source is ResponseSource.IDENTIFIED:
        known[job.jaws] = loop_response(plan.strategy, machine, response, job.lobe_frequency_hz)
    path_um = predict_following(machine, command_um, plan.spindle_speed_rpm, known)
    frequency_hz = job.jaws * plan.spindle_speed_rpm / 60.0
    order = np.argsort(angle_deg, kind="stable")
    need = drive_need(machine, 0.5 * float(np.ptp(command_um)), frequency_hz)
    return ProgramPrediction(
        angle_deg=_freeze_array(angle_deg[order]),
        command_um=_freeze_array(command_um[order]),
        path_um=_freeze_array(path_um[order]),
        residual_um=_freeze_array(left_by(job, angle_deg, path_um)[order]),
        lobe_frequency_hz=frequency_hz,
        response=response_of(job, known.get(job.jaws, complex(sampled_response(machine, frequency_hz)))),
        demands=demands_of(machine, need),
    )


def left_by(job: Job, angle_deg: FloatArray, path_um: FloatArray) -> FloatArray:
    """Return the deviation of the released part after a cut of these depths at these angles, mean 0, um.

    Where the tool is clear of the part (a depth below 0) it removes nothing.
    """
    left_um = free_state_lobe(job).at_um(angle_deg) - np.maximum(path_um, 0.0)
    return np.asarray(left_um - left_um.mean(), dtype=np.float64)


def predict_following(
    machine: MachineProfile, command: FloatArray, speed_rpm: float, known: Mapping[int, complex] | None = None
) -> FloatArray:
    """Return how the tool servo follows one turn of a periodic motion.

    `command` are points at equal times, in any unit; the result is in the same. Each frequency passes through
    the response of the sampled loop, or through that of `known` for its order (UPR); frequencies above half the
    loop's are left out.
    """
    spectrum = np.fft.rfft(command)
    frequency_hz = np.arange(spectrum.size) * speed_rpm / 60.0
    below = frequency_hz < 500.0 / machine.controller.servo_period_ms
    loop = np.zeros(spectrum.size, dtype=np.complex128)
    loop[below] = sampled_response(machine, frequency_hz[below])
    for order, response in (known or {}).items():
        loop[order] = response
    return np.fft.irfft(loop * spectrum, command.size)


def _steady_turn(machine: MachineProfile, plan: CutPlan) -> tuple[FloatArray, FloatArray]:
    """Return spindle angles (deg, in [0, 360)) and infeed (um) of the turn mid-cut, at equal time steps."""
    checked = plan.checked
    pieces = [piece for move in checked.moves for piece in move.pieces]
    ends_ms = list(accumulate(piece.duration_ms for piece in pieces))
    carriage = checked.motors.index(machine.carriage.motor)
    begins = plan.setup.carriage_middle - 0.5 * plan.setup.carriage_per_turn
    first = next(i for i, piece in enumerate(pieces) if piece.cubics[carriage][0] >= begins)
    instants_ms = ends_ms[first] + 60_000.0 / plan.spindle_speed_rpm * np.arange(TURN_POINTS) / TURN_POINTS
    running = [min(bisect_right(ends_ms, instant), len(pieces) - 1) for instant in instants_ms.tolist()]

    def positions(motor: int) -> FloatArray:
        index = checked.motors.index(motor)
        since_ms = (t - (ends_ms[i] - pieces[i].duration_ms) for i, t in zip(running, instants_ms, strict=True))
        return np.array([position_at(pieces[i].cubics[index], t) for i, t in zip(running, since_ms, strict=True)])

    spindle, tool = positions(machine.spindle.motor), positions(machine.tool.motor)
    return (
        np.mod(360.0 * spindle / machine.spindle.counts_per_rev, 360.0),
        (tool - plan.setup.surface) * machine.tool.count_um,
    )


def _freeze_array(values: FloatArray) -> FloatArray:
    values.setflags(write=False)
    return values
