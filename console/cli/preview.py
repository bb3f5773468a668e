"""`console preview`: what a job will do, before anything is sent."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import asdict

from console.cli.library import job_of, machine_of
from console.cli.output import print_json
from console.cli.parser import DEFAULT_STRATEGY
from console.session.preview import Preview, Response, preview
from console.text.catalogue import Catalogue
from console.text.columns import table
from drivers.cut import CutPlan, Strategy
from profiles.problem import ProblemError
from profiles.rules import Finding, Severity, refusals

_MARKS = {Severity.OK: "✓", Severity.WARNING: "!", Severity.REFUSAL: "✗"}


def main(options: Namespace, text: Catalogue) -> int:
    """Print the preview; 1 when a rule refuses the job, or when the default strategy cannot cut it."""
    seen = preview(job_of(options).job, machine_of(options).machine)
    if options.json:
        print_json(_fields(seen, text))
    else:
        print("\n".join(_lines(seen, text)))
    return 1 if refusals(seen.findings) or _refused(seen.strategies[Strategy(DEFAULT_STRATEGY)]) else 0


def _fields(seen: Preview, text: Catalogue) -> dict[str, object]:
    return {
        "job": seen.job.name,
        "machine": seen.machine.name,
        "lobe_frequency_hz": seen.job.lobe_frequency_hz,
        "predicted_RONt_um": seen.job.lobe_error_um_pp,
        "lobe_error_source": seen.job.lobe_error_source,
        "wanted_path": asdict(seen.wanted),
        "command": asdict(seen.command),
        "eq9": {**asdict(seen.eq9), **asdict(seen.eq9_loop), "gain_margin": _finite(seen.eq9_loop.gain_margin)},
        "sampled_loop": asdict(seen.sampled),
        "drive": _drive(seen),
        "grip_margin_n": seen.grip_margin_n,
        "findings": [_finding(f, text) for f in seen.findings],
        "strategies": {name: _strategy(plan, text) for name, plan in seen.strategies.items()},
    }


def _drive(seen: Preview) -> dict[str, float]:
    needs = {**asdict(seen.need), **{key: share.need for key, share in seen.shares.items()}}
    limits = {f"{key}_limit": share.limit for key, share in seen.shares.items()}
    return {**needs, **limits, **{f"{key}_percent": share.percent for key, share in seen.shares.items()}}


def _refused(plan: CutPlan | ProblemError) -> bool:
    return isinstance(plan, ProblemError) or bool(refusals(plan.findings))


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _finding(finding: Finding, text: Catalogue) -> dict[str, object]:
    return {
        "severity": finding.severity.value,
        "code": finding.problem.code,
        "text": text.problem(finding.problem) if finding.severity is not Severity.OK else _held(finding, text),
    }


def _held(finding: Finding, text: Catalogue) -> str:
    """A rule that holds has no sentence: its name, and what was met against what is allowed."""
    problem = finding.problem
    return f"{text(f'name.{problem.code}')}: {problem.value} ({problem.limit})"


def _strategy(plan: CutPlan | ProblemError, text: Catalogue) -> dict[str, object]:
    if isinstance(plan, ProblemError):
        return {"refused": [text.problem(problem) for problem in plan.problems]}
    return {
        "spindle_rpm": plan.spindle_speed_rpm,
        "duration_s": plan.duration_s,
        "findings": [_finding(f, text) for f in plan.findings],
    }


def _lines(seen: Preview, text: Catalogue) -> list[str]:
    job = seen.job
    lead_deg = job.lobe_phase_deg - seen.command.crest_deg
    facts = [
        (
            text("preview.lobe"),
            f"{job.lobe_error_um_pp:.1f} um p-p, {job.jaws}/rev, {job.lobe_frequency_hz:.2f} Hz",
        ),
        (text("preview.source"), text(f"source.{job.lobe_error_source}")),
        (text("preview.wanted"), f"{seen.wanted.mean_um:.1f} ± {seen.wanted.amplitude_um:.2f} um"),
        (text("preview.command"), f"± {seen.command.amplitude_um:.2f} um, {lead_deg:+z.2f} deg"),
        (text("preview.grip"), f"{seen.grip_margin_n:.0f} N"),
    ]
    loops = [
        (text("preview.loop"), text("preview.gain"), text("preview.phase"), text("preview.residual")),
        _loop_row(text("preview.eq9", bandwidth=f"{seen.eq9_loop.bandwidth_hz:.1f}"), seen.eq9),
        _loop_row(text("preview.sampled"), seen.sampled),
    ]
    needs = [(text("preview.need"), "", "%")]
    needs += [
        (text(f"need.{key}"), f"{share.need:.3g} / {share.limit:.4g}", f"{share.percent:.1f}")
        for key, share in seen.shares.items()
    ]
    head = f"{job.name} · {seen.machine.name}"
    return [
        head,
        "",
        *table(facts),
        "",
        *table(loops, numeric=(1, 2, 3)),
        "",
        *table(needs, numeric=(1, 2)),
        "",
        *_judged(seen, text),
    ]


def _loop_row(name: str, response: Response) -> tuple[str, ...]:
    return (
        name,
        f"{response.gain:.4f}",
        f"{response.phase_rad:+z.4f} rad",
        f"{response.residual_um_pp:.1f} um p-p",
    )


def _judged(seen: Preview, text: Catalogue) -> list[str]:
    rows = [
        (_MARKS[f.severity], text(f"name.{f.problem.code}"), f.problem.value, f.problem.limit)
        for f in seen.findings
    ]
    lines = table(rows)
    for name, plan in seen.strategies.items():
        lines += [f"{_MARKS[severity]}  {name}: {said}" for severity, said in _said(plan, text)]
    return lines


def _said(plan: CutPlan | ProblemError, text: Catalogue) -> list[tuple[Severity, str]]:
    if isinstance(plan, ProblemError):
        return [(Severity.REFUSAL, text.problem(problem)) for problem in plan.problems]
    said = [(f.severity, text.problem(f.problem)) for f in plan.findings]
    return said or [(Severity.OK, text("preview.clean", duration=f"{plan.duration_s:.1f}"))]
