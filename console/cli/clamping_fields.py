"""Allowed clamping force of a job, for JSON: the same in every command that judges a job."""

from __future__ import annotations

from profiles.chucking.advice import force_span
from profiles.job import Job
from profiles.machine import MachineProfile


def span_fields(job: Job, machine: MachineProfile) -> dict[str, float | str]:
    """Return minimum and maximum static force, N, what limits the maximum, and where the job's force is."""
    span = force_span(job, machine)
    return {
        "force_least_n": span.least_n,
        "force_most_n": span.most_n,
        "force_limit": span.binding,
        "force_stands": span.stands(job.chucking_force_n).value,
    }
