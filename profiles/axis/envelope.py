"""How fast a job may be cut: the speed at which each limit of tool axis, chuck and spindle is reached.

For y = A sin(w t): F = (-M w^2 + j B w) A, I = F / Kt, V = (R + j w L) I + Kb j w A, with a steady cutting force
taken off first. Speeds in rpm, amplitudes in um (half of peak to peak).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from profiles.arrays import Floats
from profiles.axis.response import AMPLIFICATION_LIMIT, ServoResponse
from profiles.axis.servo import drive_need, sampled_response
from profiles.axis.servo_gains import error_limit_um, program_speed_mm_per_s
from profiles.chucking.grip import mass_radius_kg_m, most_loss_speed_rpm, needed_grip_n, speed_of_loss_rpm
from profiles.compensations.path import spindle_speed_rpm
from profiles.job import Job
from profiles.lobe.along import largest_lobe
from profiles.machine import MachineProfile, ToolAxis
from profiles.problem import ProfileError

AMPLITUDES_UM = (5.0, 16.5, 27.5, 50.0, 100.0, 200.0, 500.0, 1000.0)
RESERVED_N = 100.0  # cutting force that is reserved
_LEAST_HZ, _MOST_HZ, _GRID = 0.05, 1e5, 4000
_LEAST_AMPLITUDE_UM = 0.01
"""A job without a lobe has no limit; nor has a hundredth of a micrometre."""
_REFINED, _PARTS = 7, 64  # a crossing is found to 64^-7 of a step of the grid


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopeRow:
    """The highest speeds for one amplitude, by the name of the limit; unknown limits are left out.

    "peak_thrust", "heat", "current", "encoder_acceleration", "encoder_velocity", "velocity" (Ix16), "voltage",
    "following_error" (Ix11, the lag inverted) and "loop" (a command of `AMPLIFICATION_LIMIT` times the motion).
    """

    amplitude_um: float
    rpm: dict[str, float]

    @property
    def binding(self) -> str:
        """The limit that is reached first."""
        return min(self.rpm, key=self.rpm.__getitem__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """The rows over the amplitudes, and the row of the job with its speed as a percentage of each limit.

    A limit of 0 rpm, of a tool without force beyond the reserve, has no percentage (None). `plain_sine_rpm` is how
    fast the job could be cut within its tolerance without inverting the servo; None where it always can.
    """

    rows: tuple[EnvelopeRow, ...]
    at_job: EnvelopeRow
    percent: dict[str, float | None]
    plain_sine_rpm: float | None


def envelope(job: Job, machine: MachineProfile) -> Envelope:
    """Return the envelope of a machine for the jaws of a job."""
    rows = tuple(envelope_row(machine, each, job.jaws) for each in AMPLITUDES_UM)
    amplitude_um = max(largest_lobe(job, machine)[0], _LEAST_AMPLITUDE_UM)
    at_job = envelope_row(machine, amplitude_um, job.jaws)
    fraction = job.roundness_tolerance_um / job.lobe_error_um_pp if job.lobe_error_um_pp > 0 else math.inf
    plain_hz = first_beyond(lambda f: np.abs(1 - sampled_response(machine, f)), fraction, nyquist_hz(machine))
    return Envelope(
        rows=rows,
        at_job=at_job,
        percent={name: 100 * job.spindle_speed_rpm / rpm if rpm else None for name, rpm in at_job.rpm.items()},
        plain_sine_rpm=None if plain_hz is None else spindle_speed_rpm(plain_hz, job.jaws),
    )


def envelope_row(machine: MachineProfile, amplitude_um: float, jaws: int) -> EnvelopeRow:
    """Return the highest speed for each limit at one amplitude."""
    tool = machine.tool
    amplitude_m = amplitude_um * 1e-6
    heat_n = math.sqrt(2 * max(tool.continuous_force_n**2 - RESERVED_N**2, 0.0))
    fastest_m_per_s = program_speed_mm_per_s(machine) / 1000
    hz = {
        "peak_thrust": _of_force(tool, amplitude_m, tool.peak_force_n - RESERVED_N),
        "heat": _of_force(tool, amplitude_m, heat_n),
        "current": _of_force(tool, amplitude_m, tool.peak_current_a * tool.thrust_constant_n_per_a - RESERVED_N),
        "encoder_acceleration": math.sqrt(tool.encoder_max_acceleration_m_per_s2 / amplitude_m) / (2 * math.pi),
        "encoder_velocity": tool.encoder_max_velocity_m_per_min / 60 / amplitude_m / (2 * math.pi),
        "velocity": fastest_m_per_s / amplitude_m / (2 * math.pi),
        **_of_voltage(machine, amplitude_um),
        **_of_loop(machine, amplitude_um),
    }
    return EnvelopeRow(
        amplitude_um=amplitude_um, rpm={name: spindle_speed_rpm(each, jaws) for name, each in hz.items()}
    )


def speed_limits_rpm(
    job: Job, machine: MachineProfile, response: ServoResponse, axis: EnvelopeRow
) -> dict[str, float]:
    """Return the highest speed of each limit by its name: those of `axis`, the row of the job, and more.

    "spindle" is the machine's own, "grip" and "grip_loss" are where F_sp0 / S_sp - F_c is what the cut needs and
    where the loss is at its most (F_c = sum(m r) (pi n / 30)^2), "response" is how far that can be inverted.
    0 where a limit is passed at rest already.
    """
    of_jaws = mass_radius_kg_m(job, machine)
    left_n = job.chucking_force_n / machine.chuck.safety_factor - needed_grip_n(job, machine)
    return {
        **axis.rpm,
        "spindle": machine.spindle.max_speed_rpm,
        "grip": speed_of_loss_rpm(left_n, of_jaws),
        "grip_loss": most_loss_speed_rpm(job.chucking_force_n, of_jaws),
        "response": spindle_speed_rpm(_highest_invertible_hz(machine, response), job.jaws),
    }


def highest_safe_speed(job: Job, machine: MachineProfile, response: ServoResponse) -> tuple[dict[str, float], str]:
    """Return `speed_limits_rpm` of a job, and the name of the lowest, which is its highest safe speed."""
    amplitude_um = max(largest_lobe(job, machine)[0], _LEAST_AMPLITUDE_UM)
    limits = speed_limits_rpm(job, machine, response, envelope_row(machine, amplitude_um, job.jaws))
    return limits, min(limits, key=limits.__getitem__)


def first_beyond(measure: Callable[[Floats], Floats], limit: float, top_hz: float) -> float | None:
    """Return the lowest frequency below `top_hz` at which `measure` exceeds a limit, None where it never does.

    The crossing lies between two points of a grid and is refined in parts of parts.
    """
    grid = np.geomspace(_LEAST_HZ, top_hz, _GRID)
    above = measure(grid) > limit
    if not above.any():
        return None
    place = int(np.argmax(above))
    low, high = float(grid[max(place - 1, 0)]), float(grid[place])
    for _ in range(_REFINED):
        between = np.linspace(low, high, _PARTS + 1)
        first = int(np.argmax(~(measure(between[1:]) <= limit))) + 1
        low, high = float(between[first - 1]), float(between[first])
    return high


def nyquist_hz(machine: MachineProfile) -> float:
    """Return the highest frequency at which the sampled loop is evaluated, just below half its rate."""
    return 0.999 * 500 / machine.controller.servo_period_ms


def _bisect_condition(
    holds: Callable[[float], bool], low: float, high: float, halvings: int
) -> tuple[float, float]:
    """Return where a condition that holds at `low` and not at `high` begins to fail: just below, just above."""
    for _ in range(halvings):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def _of_force(tool: ToolAxis, amplitude_m: float, force_n: float) -> float:
    """Solve |-M w^2 + j B w| A = F for the frequency; 0 where no force is left."""
    mass2, damping2 = tool.moving_mass_kg**2, tool.damping_n_s_per_m**2
    target = (max(force_n, 0.0) / amplitude_m) ** 2
    omega2 = (math.sqrt(damping2**2 + 4 * mass2 * target) - damping2) / (2 * mass2)
    return math.sqrt(omega2) / (2 * math.pi)


def _of_voltage(machine: MachineProfile, amplitude_um: float) -> dict[str, float]:
    tool = machine.tool
    if tool.bus_voltage_v is None:
        return {}
    left_v = tool.bus_voltage_v - tool.coil_resistance_ohm * RESERVED_N / tool.thrust_constant_n_per_a

    def bears(frequency_hz: float) -> bool:
        return drive_need(machine, amplitude_um, frequency_hz).voltage_v <= left_v

    return {"voltage": _bisect_condition(bears, 0.0, _MOST_HZ, 60)[0]}


def _of_loop(machine: MachineProfile, amplitude_um: float) -> dict[str, float]:
    """The command is A / |T|, and lags by A |1/T - 1|; where |T| vanishes nothing can be inverted."""
    top_hz = nyquist_hz(machine)
    following = first_beyond(
        lambda f: amplitude_um * np.abs(1 / sampled_response(machine, f) - 1), error_limit_um(machine), top_hz
    )
    loop = first_beyond(lambda f: 1 / np.abs(sampled_response(machine, f)), AMPLIFICATION_LIMIT, top_hz)
    return {"following_error": following or top_hz, "loop": loop or top_hz}


def _highest_invertible_hz(machine: MachineProfile, response: ServoResponse) -> float:

    def invertible(frequency_hz: float) -> bool:
        try:
            response.invertible(frequency_hz)
        except ProfileError:
            return False
        return True

    high_hz = min(response.highest_hz, nyquist_hz(machine))
    if invertible(high_hz):
        return high_hz
    return _bisect_condition(invertible, max(response.lowest_hz, _LEAST_HZ), high_hz, 40)[0]
