"""What is known of a job without any program: the lobe, its command, the drive's load, every rule."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np

from drivers.cutting.planning import nominal_command
from drivers.cutting.strategy import DEFAULT_STRATEGY, Strategy
from drivers.identification.nominal import path_response
from drivers.pmac.motor_settings import MotorSettings
from profiles.axis.margins import bandwidth_hz
from profiles.axis.response import ResponseSource, ServoResponse
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo import DriveNeed, drive_need, eq9_response, sampled_response
from profiles.chucking.grip import centrifugal_loss_n, grip_margin_n, needed_grip_n
from profiles.compensations.learned_compensation import ExpectedPart
from profiles.compensations.path import CutPath, LobedPath, residual_um_pp, target_path
from profiles.findings import Finding
from profiles.job import Job
from profiles.lobe.along import along_cut
from profiles.machine import MachineProfile
from profiles.rules import check

IDENTIFIED_POINTS = 200  # of an identified band, among which its bandwidth is looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """The tool axis at the lobe frequency: gain, phase in radians, and what a plain sine would leave, um p-p."""

    gain: float
    phase_rad: float
    residual_um_pp: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """A demand against the machine's capability, both in the same unit, both peak or both rms."""

    need: float
    limit: float

    @property
    def percent(self) -> float:
        """The demand as a percentage of the limit."""
        return 100.0 * self.need / self.limit


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlook:
    """A job on a machine as far as it needs no program: fast enough to update at every key.

    `strategy` is the chosen one, `response` what it inverts, and `command` the result for `target`; for a
    strategy that inverts nothing these are of the default one. `bandwidth_hz` is that of the loop in which the
    cut runs, see `loop_bandwidth_hz`. `demands` are those of the sine of the command, at the speed of the job.
    `taught` is the result that a measured part predicts for a cut with the path learned from it: the model does
    not include learned corrections. None means the model's prediction.
    """

    job: Job
    machine: MachineProfile
    strategy: Strategy
    response: ServoResponse
    target: LobedPath
    command: LobedPath
    eq9: Response
    sampled: Response
    bandwidth_hz: float | None
    need: DriveNeed
    demands: dict[str, Demand]
    grip_margin_n: float
    findings: tuple[Finding, ...]
    taught: ExpectedPart | None = None


def outlook(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy = DEFAULT_STRATEGY,
    response: ServoResponse | None = None,
    *,
    path: CutPath | None = None,
    taught: ExpectedPart | None = None,
) -> Outlook:
    """Compute the outlook; `response` is that of the path of `strategy`, by default by the machine profile.

    `path` was learned for a cut with `strategy` and carries its own command, as that of
    `drivers.cutting.planning.plan_cut`, and `taught` the result predicted from the part that it was learned from.

    Raises:
        ProblemError: `response.amplified`, `response.outside_band`, `response.too_sparse`: the axis cannot be
            inverted at this speed.
    """
    inverting = strategy if strategy.traits.inverts else DEFAULT_STRATEGY
    inverted = path_response(inverting, machine) if response is None else response
    command = nominal_command(job, machine, inverting, inverted) if path is None else path.command
    frequency_hz = job.lobe_frequency_hz
    along = along_cut(job, machine)
    target = replace(target_path(job) if path is None else path.target, along=along)
    command = replace(command, along=along)
    need = drive_need(machine, command.largest_um, frequency_hz)
    return Outlook(
        job=job,
        machine=machine,
        strategy=strategy,
        response=inverted,
        target=target,
        command=command,
        eq9=response_of(job, complex(eq9_response(machine, frequency_hz))),
        sampled=response_of(job, complex(sampled_response(machine, frequency_hz))),
        bandwidth_hz=loop_bandwidth_hz(machine, inverted),
        need=need,
        demands=demands_of(machine, need),
        grip_margin_n=grip_margin_n(job, machine),
        findings=check(job, machine),
        taught=taught,
    )


def loop_bandwidth_hz(machine: MachineProfile, response: ServoResponse) -> float | None:
    """Return where the loop falls to half its power: as identified, else that of the profile as on page Tune.

    Eq 9 of the paper is another one: it knows no servo cycle. An identified response that stays above half power
    is taken to end where it was measured last. None: a loop of the profile that never falls.
    """
    if response.source is ResponseSource.IDENTIFIED:
        gain = np.vectorize(lambda hz: abs(response.curve(hz)), otypes=[np.float64])
        found = bandwidth_hz(gain, response.highest_hz, response.lowest_hz, IDENTIFIED_POINTS)
        return response.highest_hz if found is None else found
    loop = loop_of(machine)
    return bandwidth_hz(lambda hz: np.abs(loop.closed_loop(hz)), loop.nyquist_hz)


def response_of(job: Job, response: complex) -> Response:
    """Return a response at the lobe frequency with what it would leave of this job."""
    return Response(
        gain=abs(response),
        phase_rad=cmath.phase(response),
        residual_um_pp=residual_um_pp(job.lobe_error_um_pp, response),
    )


def demands_of(machine: MachineProfile, need: DriveNeed) -> dict[str, Demand]:
    """The demands of the sine, by name. All are peak values but `force_rms_n`, which heats the motor.

    The velocity is set against Ix16 of the tool motor, which a program must not exceed (`cut.too_fast`); the
    voltage is included if the machine profile has that of the amplifier.
    """
    tool = machine.tool
    fastest_mm_per_s = MotorSettings(machine, tool.motor).program_speed
    demands = {
        "velocity_mm_per_s": Demand(need=need.velocity_mm_per_s, limit=fastest_mm_per_s),
        "acceleration_m_per_s2": Demand(
            need=need.acceleration_m_per_s2, limit=tool.encoder_max_acceleration_m_per_s2
        ),
        "force_n": Demand(need=need.force_n, limit=tool.peak_force_n),
        "force_rms_n": Demand(need=need.force_n / math.sqrt(2.0), limit=tool.continuous_force_n),
        "current_a": Demand(need=need.current_a, limit=tool.peak_current_a),
    }
    if tool.bus_voltage_v is not None:
        demands["voltage_v"] = Demand(need=need.voltage_v, limit=tool.bus_voltage_v)
    return demands


def grip_demand(job: Job, machine: MachineProfile) -> Demand:
    """Return the centrifugal loss and cutting demand against the usable chucking force at rest, N."""
    taken_n = centrifugal_loss_n(job, machine) + needed_grip_n(job, machine)
    return Demand(need=taken_n, limit=job.chucking_force_n / machine.chuck.safety_factor)
