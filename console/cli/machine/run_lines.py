"""Result of a run as lines for people."""

from __future__ import annotations

from console.session.cut.run import RunResult
from console.session.stages import Stage
from console.session.station.alarms import collision_problems
from console.text.catalogue import Catalogue
from console.text.columns import table


def run_lines(result: RunResult, text: Catalogue) -> list[str]:
    """Return the result in words."""
    plan, figures = result.plan, result.figures
    sim = f"{text('sim')}  " if result.simulated else ""
    head = f"{sim}{plan.job.name} · {plan.machine.name} · {plan.cut.strategy}"
    facts = [
        (text("run.spindle"), f"{figures.spindle_speed_rpm:.1f} rpm, {result.lobe_frequency_hz:.2f} Hz"),
        (text("run.tool_error"), f"{figures.tool_error_um:.2f} um, rms {figures.tool_error_rms_um:.2f} um"),
        (
            text("run.following"),
            f"{figures.following_error_um:.2f} um, rms {figures.following_error_rms_um:.2f} um",
        ),
    ]
    if result.improvement_percent is not None:
        facts.insert(0, (text("run.improvement"), f"{result.improvement_percent:.1f} %"))
    if plan.expected is not None:
        right, wrong = f"{plan.expected.right_um_pp:.1f}", f"{plan.expected.wrong_um_pp:.1f}"
        facts.append((text("run.expected"), text("run.expected_lobe", right=right, wrong=wrong)))
    if result.within_tolerance is not None:
        facts.append((text("run.verdict"), _verdict(result, text)))
    facts += [(text("run.collision"), text.problem(met)) for met in collision_problems(result.collisions)]
    measure = "run.cut_air" if plan.stage is Stage.AIR else "run.measure_it"
    closing = text("run.simulated" if result.simulated else measure)
    return ["", head, "", *_parts(result, text), *table(facts), closing]


def _verdict(result: RunResult, text: Catalogue) -> str:
    key = "run.within" if result.within_tolerance else "run.outside"
    return text(key, limit=f"{result.plan.job.roundness_tolerance_um:g}")


def _parts(result: RunResult, text: Catalogue) -> list[str]:
    """Return the table of the measured parts, with a line below it; nothing without any."""
    after = "partial" if result.plan.stage is Stage.PARTIAL else "after"
    parts = {"before": result.before, after: result.after}
    measured = {name: part for name, part in parts.items() if part is not None}
    if not measured:
        return []
    job, first = result.plan.job, next(iter(measured.values()))
    circle = f"RONt ({first.reference_circle}, {first.filter_upr:g} UPR, {text(f'state.{first.state}')})"
    rows = [
        ("", *(text(f"part.{name}") for name in measured), ""),
        (circle, *(f"{part.ront_um:.2f}" for part in measured.values()), "um"),
        (
            text("run.harmonic", n=job.jaws),
            *(f"{part.amplitude_um(job.jaws):.2f}" for part in measured.values()),
            "um",
        ),
    ]
    return [*table(rows, numeric=tuple(range(1, 1 + len(measured)))), ""]
