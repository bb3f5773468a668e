"""What every command that judges a job says alike: findings, clamping force, the position of the lobe."""

from __future__ import annotations

from collections.abc import Iterable

from console.text.catalogue import Catalogue
from console.text.checks import MARKS
from console.text.columns import table
from console.text.job_words import span_words
from profiles.chucking.advice import force_span
from profiles.chucking.diagnosis import Diagnosis
from profiles.chucking.grip import wrench_force_sd_n
from profiles.chucking.holding import holding_of, torque_or_none_n_m
from profiles.findings import Finding, Severity
from profiles.job import Job
from profiles.machine import MachineProfile


def finding_lines(findings: Iterable[Finding], text: Catalogue) -> list[str]:
    """Return one line for each finding: mark, name, actual value, limit."""
    return table(
        [(MARKS[f.severity], text(f"name.{f.problem.code}"), f.problem.value, f.problem.limit) for f in findings]
    )


def finding_fields(finding: Finding, text: Catalogue) -> dict[str, object]:
    """Return a finding with its sentence; that of a rule which is met is its name, value and limit."""
    problem = finding.problem
    if finding.severity is Severity.OK:
        sentence = f"{text(f'name.{problem.code}')}: {problem.value} ({problem.limit})"
    else:
        sentence = text.problem(problem)
    return {"severity": finding.severity.value, "code": problem.code, "text": sentence}


def span_fields(job: Job, machine: MachineProfile) -> dict[str, float | str]:
    """Return minimum and maximum static force, N, what limits the maximum, and where the job's force is."""
    span = force_span(job, machine)
    return {
        "force_least_n": span.least_n,
        "force_most_n": span.most_n,
        "force_limit": span.binding,
        "force_stands": span.stands(job.chucking_force_n).value,
    }


def span_line(job: Job, machine: MachineProfile, text: Catalogue) -> str:
    """Return the span of the clamping force with the limit at which it ends, or that no force holds the part."""
    return span_words(force_span(job, machine), text)


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


def lobe_place_line(seen: Diagnosis, text: Catalogue) -> str:
    """Return the position of a lobe with the mechanism that it suggests, or that neither is clear."""
    if seen.high_at_jaws is None:
        return text("place.between")
    place = text("predict.high" if seen.high_at_jaws else "predict.low")
    if seen.mechanism is None:
        return text("place.no_mechanism", place=place)
    return text("place.mechanism", place=place, mechanism=text(f"mechanism.{seen.mechanism}"))
