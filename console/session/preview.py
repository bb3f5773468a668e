"""What a job will do, computed before anything is sent: prediction, need of the drive, findings."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

from drivers.cut import CutPlan, Strategy, plan_cut
from profiles.compensation import Sinusoid, invert, residual_um_pp, wanted_path
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.rules import Finding, check, grip_margin_n
from profiles.servo import DriveNeed, Eq9Summary, drive_need, eq9_response, eq9_summary, sampled_response


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Preview:
    """Everything that is known of a job on a machine without moving it."""

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
        strategies={strategy: _planned(job, machine, strategy) for strategy in (Strategy.PAPER, Strategy.PVT)},
    )


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
