"""Required and allowed clamping force of a job, in words: the same in every command that judges a job."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from profiles.chucking.advice import force_span
from profiles.chucking.grip import wrench_force_sd_n
from profiles.chucking.holding import holding_of, torque_or_none_n_m
from profiles.job import Job
from profiles.machine import MachineProfile


def force_line(job: Job, machine: MachineProfile, text: Catalogue) -> str:
    """Return the sentence about a job's force: its uncertainty, its torque where there is one, and the span."""
    wrench = holding_of(machine).wrench
    torque_n_m = None if wrench is None else torque_or_none_n_m(wrench, job.chucking_force_n)
    return text(
        "clamping.force" if torque_n_m is None else "clamping.force_and_torque",
        force=f"{job.chucking_force_n:.0f}",
        sd=f"{wrench_force_sd_n(job, machine):.0f}",
        torque="" if torque_n_m is None else f"{torque_n_m:.2f}",
        span=span_line(job, machine, text),
    )


def span_line(job: Job, machine: MachineProfile, text: Catalogue) -> str:
    """Return the span in whole newtons, with the limit at which it ends."""
    span = force_span(job, machine)
    least_n, most_n = span.whole_n
    return f"{least_n} … {most_n} N ({text(f'clamp_limit.{span.binding}')})"
