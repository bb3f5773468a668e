"""What a job will do, computed before anything is sent: prediction, need of the drive, findings."""

from __future__ import annotations

import cmath
import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from drivers.cut import CutPlan, Strategy, plan_cut
from drivers.pmac.check import CheckedProgram
from drivers.pmac.trajectory.pieces import Piece, position_at
from profiles.compensation import Sinusoid, free_state_lobe, invert, residual_um_pp, wanted_path
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.rules import Finding, check, grip_margin_n
from profiles.servo import DriveNeed, Eq9Summary, drive_need, eq9_response, eq9_summary, sampled_response

FloatArray = NDArray[np.float64]

TURN_POINTS = 720
"""Points of a turn at which a path is computed: 120 in each move of the paper's program."""

_STEADY_FROM = 0.4
"""Share of the feed after which the turn that is looked at begins: far from how the cut begins and ends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """The tool axis at the lobe frequency: gain, phase in radians, and what a plain sine would leave, um p-p."""

    gain: float
    phase_rad: float
    residual_um_pp: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """A need of the drive against what the machine has, both in the same unit, both peak or both rms."""

    need: float
    limit: float

    @property
    def percent(self) -> float:
        """The need as a percentage of the limit."""
        return 100.0 * self.need / self.limit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prediction:
    """What one program makes of the part, over one turn of the steady cut; every array has shape (TURN_POINTS,).

    `angle_deg` are spindle angles, rising in [0, 360). `command_um` is the tool as the program has it, `path_um`
    as the nominal servo follows that, both um of infeed from the surface of the blank. `residual_um` is the
    deviation of the released part, positive where it is high, mean 0. The arrays are read only. `response` is that
    of the nominal servo at `lobe_frequency_hz`, `shares` are the needs of a sine with the stroke of the program,
    both at the speed that the program reaches.
    """

    angle_deg: FloatArray
    command_um: FloatArray
    path_um: FloatArray
    residual_um: FloatArray
    lobe_frequency_hz: float
    response: Response
    shares: dict[str, Share]

    @property
    def ront_um(self) -> float:
        """Roundness that is left, peak to peak."""
        return float(np.ptp(self.residual_um))

    @property
    def stroke_um(self) -> float:
        """Way of the tool as the program has it, peak to peak."""
        return float(np.ptp(self.command_um))

    @property
    def mean_um(self) -> float:
        """Mean depth of the cut on the radius."""
        return float(np.mean(self.path_um))


@dataclass(frozen=True, slots=True, kw_only=True)
class Preview:
    """Everything that is known of a job on a machine without moving it.

    `shares` are those of the `pvt` sine; `predictions` has every strategy that can be planned.
    """

    job: Job
    machine: MachineProfile
    wanted: Sinusoid
    command: Sinusoid
    eq9: Response
    eq9_loop: Eq9Summary
    sampled: Response
    need: DriveNeed
    shares: dict[str, Share]
    grip_margin_n: float
    findings: tuple[Finding, ...]
    strategies: dict[Strategy, CutPlan | ProblemError]
    predictions: dict[Strategy, Prediction]


def preview(job: Job, machine: MachineProfile) -> Preview:
    """Compute the preview of a job.

    Raises:
        ProblemError: `response.too_small`, the axis cannot follow at this speed at all.
    """
    wanted = wanted_path(job)
    frequency_hz = job.lobe_frequency_hz
    sampled = complex(sampled_response(machine, frequency_hz))
    command = invert(wanted, sampled)
    need = drive_need(machine, command.amplitude_um, frequency_hz)
    strategies = {s: _planned(job, machine, s) for s in tuple(Strategy)}
    plans = {strategy: plan for strategy, plan in strategies.items() if isinstance(plan, CutPlan)}
    return Preview(
        job=job,
        machine=machine,
        wanted=wanted,
        command=command,
        eq9=_response(job, complex(eq9_response(machine, frequency_hz))),
        eq9_loop=eq9_summary(machine),
        sampled=_response(job, sampled),
        need=need,
        shares=_shares(machine, need),
        grip_margin_n=grip_margin_n(job, machine),
        findings=check(job, machine),
        strategies=strategies,
        predictions={strategy: predict(job, machine, plan) for strategy, plan in plans.items()},
    )


def predict(job: Job, machine: MachineProfile, plan: CutPlan) -> Prediction:
    """Return what a planned cut makes of the part.

    The motion is that of the program, move by move; the spindle follows it exactly, the tool as the nominal
    servo does. Neither the cutting force nor the true machine is in it.
    """
    angle_deg, command_um = _steady_turn(machine, plan)
    path_um = followed(machine, command_um, plan.spindle_speed_rpm)
    missing_um = free_state_lobe(job).at_um(angle_deg) - path_um
    frequency_hz = job.jaws * plan.spindle_speed_rpm / 60.0
    order = np.argsort(angle_deg, kind="stable")
    need = drive_need(machine, 0.5 * float(np.ptp(command_um)), frequency_hz)
    return Prediction(
        angle_deg=_kept(angle_deg[order]),
        command_um=_kept(command_um[order]),
        path_um=_kept(path_um[order]),
        residual_um=_kept((missing_um - missing_um.mean())[order]),
        lobe_frequency_hz=frequency_hz,
        response=_response(job, complex(sampled_response(machine, frequency_hz))),
        shares=_shares(machine, need),
    )


def followed(machine: MachineProfile, command: FloatArray, speed_rpm: float) -> FloatArray:
    """Return how the nominal tool servo follows one turn of a motion that comes again every turn.

    `command` are points at equal times, in any unit; the result is in the same. Each frequency passes through the
    response of the sampled loop; what lies above half of its frequency is left out.
    """
    spectrum = np.fft.rfft(command)
    frequency_hz = np.arange(spectrum.size) * speed_rpm / 60.0
    heard = frequency_hz < 500.0 / machine.controller.servo_period_ms
    spectrum[heard] *= sampled_response(machine, frequency_hz[heard])
    spectrum[~heard] = 0.0
    return np.fft.irfft(spectrum, command.size)


def _steady_turn(machine: MachineProfile, plan: CutPlan) -> tuple[FloatArray, FloatArray]:
    """Return spindle angles (deg, in [0, 360)) and infeed (um) of one turn, at points of equal times."""
    checked = plan.checked
    pieces = [piece for move in checked.moves for piece in move.pieces]
    ends_ms = list(accumulate(piece.duration_ms for piece in pieces))
    carriage = checked.motors.index(machine.carriage.motor)
    begins = plan.carriage_start + _STEADY_FROM * plan.setup.carriage_counts
    first = next(i for i, piece in enumerate(pieces) if piece.cubics[carriage][0] >= begins)
    instants_ms = ends_ms[first] + 60_000.0 / plan.spindle_speed_rpm * np.arange(TURN_POINTS) / TURN_POINTS
    places = [_at(pieces, ends_ms, float(instant)) for instant in instants_ms]
    spindle, tool = (_positions(checked, places, motor) for motor in (machine.spindle.motor, machine.tool.motor))
    return (
        np.mod(360.0 * spindle / machine.spindle.counts_per_rev, 360.0),
        (tool - plan.setup.surface) * machine.tool.count_um,
    )


def _at(pieces: Sequence[Piece], ends_ms: Sequence[float], instant_ms: float) -> tuple[Piece, float]:
    """Return the piece that runs at an instant, and the time since it began, ms."""
    place = min(bisect_right(ends_ms, instant_ms), len(pieces) - 1)
    return pieces[place], instant_ms - (ends_ms[place] - pieces[place].duration_ms)


def _positions(checked: CheckedProgram, places: Sequence[tuple[Piece, float]], motor: int) -> FloatArray:
    index = checked.motors.index(motor)
    return np.array([position_at(piece.cubics[index], time_ms) for piece, time_ms in places])


def _kept(values: FloatArray) -> FloatArray:
    values.setflags(write=False)
    return values


def _response(job: Job, response: complex) -> Response:
    return Response(
        gain=abs(response),
        phase_rad=cmath.phase(response),
        residual_um_pp=residual_um_pp(job.lobe_error_um_pp, response),
    )


def _shares(machine: MachineProfile, need: DriveNeed) -> dict[str, Share]:
    """The needs of the sine, by name. All are peak values but `force_rms_n`, which heats the motor.

    The velocity is set against Ix16 of the tool motor, which a program must not exceed (`cut.too_fast`).
    """
    tool = machine.tool
    fastest_mm_per_s = machine.controller.variables[f"I{tool.motor}16"] / tool.counts_per_mm * 1000.0
    return {
        "velocity_mm_per_s": Share(need=need.velocity_mm_per_s, limit=fastest_mm_per_s),
        "acceleration_m_per_s2": Share(
            need=need.acceleration_m_per_s2, limit=tool.encoder_max_acceleration_m_per_s2
        ),
        "force_n": Share(need=need.force_n, limit=tool.peak_force_n),
        "force_rms_n": Share(need=need.force_n / math.sqrt(2.0), limit=tool.continuous_force_n),
        "current_a": Share(need=need.current_a, limit=tool.peak_current_a),
    }


def _planned(job: Job, machine: MachineProfile, strategy: Strategy) -> CutPlan | ProblemError:
    try:
        return plan_cut(job, machine, strategy)
    except ProblemError as error:
        return error
