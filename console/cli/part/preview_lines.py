"""Preview as lines for people."""

from __future__ import annotations

import math

from console.cli.clamping_lines import span_line
from console.cli.finding_lines import MARKS, finding_lines
from console.cli.part.band_reasons import band_reasons
from console.text.catalogue import Catalogue
from console.text.columns import table
from drivers.cutting.planning import CutPlan
from drivers.preview.band import Band, predicted_band
from drivers.preview.preview import Preview, Response
from profiles.axis.envelope import envelope, speed_limits_rpm
from profiles.findings import Severity
from profiles.lobe.lobe_conditions import OTHER_CUT, lobe_source
from profiles.problem import ProblemError


def preview_lines(seen: Preview, text: Catalogue) -> list[str]:
    """Return the preview: the lobe, the servo at its frequency, the drive's needs, every check."""
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
    head = f"{seen.job.name} · {seen.machine.name}"
    band = predicted_band(seen, seen.strategy)
    return [
        head,
        "",
        *table(_facts(seen, band, text)),
        "",
        *_because(seen, band, text),
        *table(loops, numeric=(1, 2, 3)),
        "",
        *table(needs, numeric=(1, 2)),
        "",
        *_judged(seen, text),
    ]


def _facts(seen: Preview, band: Band | None, text: Catalogue) -> list[tuple[str, str]]:
    job = seen.job
    lead_deg = job.lobe_phase_deg - seen.command.crest_deg
    return [
        (
            text("preview.lobe"),
            f"{job.lobe_error_um_pp:.1f} um p-p, {job.jaws}/rev, {job.lobe_frequency_hz:.2f} Hz",
        ),
        (text("preview.source"), _source(seen, text)),
        (text("preview.wanted"), f"{seen.target.mean_um:.1f} ± {seen.target.amplitude_um:.2f} um"),
        (text("preview.command"), f"± {seen.command.amplitude_um:.2f} um, {lead_deg:+z.2f} deg"),
        (text("preview.inverts"), _inverted(seen, text)),
        *_left(seen, band, text),
        (text("preview.grip"), f"{seen.grip_margin_n:.0f} N"),
        (text("predict.force_span"), span_line(seen.job, seen.machine, text)),
        (text("preview.fastest"), _fastest(seen, text)),
    ]


def _source(seen: Preview, text: Catalogue) -> str:
    """Return the source of the lobe; one found on another cut is not called measured on this one."""
    job, machine = seen.job, seen.machine
    source = lobe_source(job, chuck=machine.chuck.name, tool=machine.tool.name)
    own = text(f"source.{job.lobe_error_source}")
    return text("preview.other_cut", source=own) if source == OTHER_CUT else own


def _inverted(seen: Preview, text: Catalogue) -> str:
    """Return what the command inverts, and its uncertainty."""
    response = seen.response
    percent = 100.0 * response.relative_95(seen.job.lobe_frequency_hz)
    return f"{text(f'response.{response.source}')} {response.name}, ± {percent:.2f} %"


def _left(seen: Preview, band: Band | None, text: Catalogue) -> list[tuple[str, str]]:
    if band is None:
        return []
    words = f"{band.after_um:.2f} um ({band.low_um:.1f} … {band.high_um:.1f} um)"
    return [(text("preview.left", strategy=seen.strategy), words)]


def _because(seen: Preview, band: Band | None, text: Catalogue) -> list[str]:
    """Return the contributions to the band, with a line below; nothing without one."""
    if band is None:
        return []
    reasons = band_reasons(band, seen.response.source, text)
    rows = [(text("preview.because"), "um p-p")]
    rows += [(words, "-" if um is None else f"{um:.2f}") for _, um, words in reasons]
    return [*table(rows, numeric=(1,)), ""]


def _fastest(seen: Preview, text: Catalogue) -> str:
    limits = speed_limits_rpm(seen.job, seen.machine, seen.response, envelope(seen.job, seen.machine).at_job)
    binding = min(limits, key=limits.__getitem__)
    return f"{math.floor(limits[binding])} rpm ({text(f'speed_limit.{binding}')})"


def _loop_row(name: str, response: Response) -> tuple[str, ...]:
    return (
        name,
        f"{response.gain:.4f}",
        f"{response.phase_rad:+z.4f} rad",
        f"{response.residual_um_pp:.1f} um p-p",
    )


def _judged(seen: Preview, text: Catalogue) -> list[str]:
    lines = finding_lines(seen.findings, text)
    for name, plan in seen.strategies.items():
        lines += [f"{MARKS[severity]}  {name}: {said}" for severity, said in _said(plan, text)]
    return lines


def _said(plan: CutPlan | ProblemError, text: Catalogue) -> list[tuple[Severity, str]]:
    if isinstance(plan, ProblemError):
        return [(Severity.REFUSAL, text.problem(problem)) for problem in plan.problems]
    said = [(f.severity, text.problem(f.problem)) for f in plan.findings]
    return said or [(Severity.OK, text("preview.clean", duration=f"{plan.duration_s:.1f}"))]
