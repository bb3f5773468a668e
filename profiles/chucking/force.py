"""The chucking force of a part against another: that of its clamping, that at which its lobe error was found."""

from __future__ import annotations

from profiles.findings import Finding, Severity, judged
from profiles.job import Job
from profiles.lobe.lobe_conditions import force_as_found
from profiles.problem import Problem

SAME_FORCE = 0.005  # relative difference at which two chucking forces are still the same setting of the wrench


def same_force(one_n: float, other_n: float) -> bool:
    """Whether two chucking forces are the same setting of the wrench."""
    return abs(one_n - other_n) <= SAME_FORCE * max(one_n, other_n)


def force_as_measured(job: Job) -> Finding:
    """Return whether the part is held as when its lobe error was found: the error depends on the force."""
    value, limit = f"{job.chucking_force_n:.6g} N", f"{job.error_force_n:.6g} N"
    problem = Problem(code="rule.force_differs", key="chucking_force_n", value=value, limit=limit)
    return judged(force_as_found(job), problem, Severity.WARNING)
