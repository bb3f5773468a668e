"""How fast a job may be turned: the speed, rpm, at which each limit of tool axis, chuck and spindle is reached."""

from __future__ import annotations

from profiles.axis.envelope import EnvelopeRow
from profiles.axis.response import ServoResponse
from profiles.chucking.grip import most_loss_speed_rpm, speed_of_loss_rpm
from profiles.chucking.job_grip import mass_radius_kg_m, needed_grip_n
from profiles.compensations.path import spindle_speed_rpm
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProfileError

_LEAST_HZ, _BELOW_NYQUIST = 0.05, 0.999
_HALVINGS = 40


def speed_limits_rpm(
    job: Job, machine: MachineProfile, response: ServoResponse, axis: EnvelopeRow
) -> dict[str, float]:
    """Return the highest speed of each limit by its name: those of `axis`, the row of the job, and more.

    "spindle" is the machine's own, "grip" and "grip_loss" are where F_sp0 / S_sp - F_c is what the cut needs and
    where the loss is at its most (F_c = sum(m r) (pi n / 30)^2), "response" is how far that can be inverted.
    0 where a limit is passed at rest already.
    """
    chuck = machine.chuck
    of_jaws = mass_radius_kg_m(job, machine)
    left_n = job.chucking_force_n / chuck.safety_factor - needed_grip_n(job, machine)
    return {
        **axis.rpm,
        "spindle": machine.spindle.max_speed_rpm,
        "grip": speed_of_loss_rpm(left_n, of_jaws),
        "grip_loss": most_loss_speed_rpm(job.chucking_force_n, of_jaws),
        "response": spindle_speed_rpm(_highest_invertible_hz(machine, response), job.jaws),
    }


def _highest_invertible_hz(machine: MachineProfile, response: ServoResponse) -> float:
    """Return the end of the invertible band that begins at the lowest frequency, by bisection."""
    low_hz = max(response.lowest_hz, _LEAST_HZ)
    high_hz = min(response.highest_hz, _BELOW_NYQUIST * 500.0 / machine.controller.servo_period_ms)
    if _invertible(response, high_hz):
        return high_hz
    for _ in range(_HALVINGS):
        middle_hz = (low_hz + high_hz) / 2.0
        if _invertible(response, middle_hz):
            low_hz = middle_hz
        else:
            high_hz = middle_hz
    return low_hz


def _invertible(response: ServoResponse, frequency_hz: float) -> bool:
    try:
        response.invertible(frequency_hz)
    except ProfileError:
        return False
    return True
