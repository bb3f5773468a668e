"""Result of a run, or of a series of learning parts, for people and for JSON: unrounded, null is not measured."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict

from console.cli.judgement import span_fields
from console.cli.measured.roundness_report import roundness_fields
from console.cli.output import fields_of, harmonics_of
from console.session.cut.run import RunResult
from console.session.cut.simulated_parts import LatheParts
from console.session.data.made_parts import FINGERPRINT, tool_lobe_event
from console.session.force_record import force_event
from console.session.learning.learning_beside import TRIM_LIMIT_UM
from console.session.learning.row_result import LearnedPart, LearnResult
from console.session.stages import Stage
from console.session.station.alarms import collision_problems
from console.text.catalogue import Catalogue
from console.text.certificate import certificate_fields, certificate_lines
from console.text.columns import table
from console.text.fingerprint import clamped_fields
from console.text.force import force_words
from profiles.compensations.certificate import Standing
from profiles.compensations.path import PathHarmonic
from profiles.roundness import RoundnessResult


def result_fields(result: RunResult | LearnResult, warnings: list[str]) -> dict[str, object]:
    """Return a run, with the warnings that were printed; a series is its last part, with all parts beside it."""
    if isinstance(result, RunResult):
        return _run_fields(result, warnings)
    return {
        **_run_fields(result.last, warnings),
        "passes": [_part_fields(part) for part in result.parts],
        "floor": roundness_fields(result.floor),
    }


def _run_fields(result: RunResult, warnings: list[str]) -> dict[str, object]:
    plan, figures = result.plan, result.figures
    return {
        "job": plan.job.name,
        "machine": plan.machine.name,
        "simulated": result.simulated,
        "strategy": plan.cut.strategy.value,
        "stage": plan.stage.value,
        "compensation": plan.compensation,
        "inverted": plan.inverted or "model",
        **({FINGERPRINT: plan.fingerprint} if plan.fingerprint else {}),
        "expected": None if plan.expected is None else harmonics_of(plan.expected),
        "clamping": span_fields(plan.job, plan.machine),
        "spindle_rpm": figures.spindle_speed_rpm,
        "lobe_frequency_hz": result.lobe_frequency_hz,
        "before": None if result.before is None else roundness_fields(result.before),
        "after": None if result.after is None else roundness_fields(result.after),
        "improvement_percent": result.improvement_percent,
        "roundness_tolerance_um": plan.job.roundness_tolerance_um,
        "within_tolerance": result.within_tolerance,
        **fields_of(figures, "tool_error_um", "tool_error_rms_um", "following_error_um", "following_error_rms_um"),
        **tool_lobe_event(figures.tool_lobe_um),
        **force_event(result.force),
        "telemetry_samples": figures.samples,
        "segment_ms": plan.cut.segment_ms,
        "cut_duration_s": plan.cut.duration_s,
        "warnings": warnings,
        "collisions": list(result.collisions),
    }


def _part_fields(part: LearnedPart) -> dict[str, object]:
    path = part.path
    return {
        **roundness_fields(part.roundness),
        "mean_deviation_um": part.roundness.mean_deviation_um,
        "learned": {
            "air_lobe_error_um_pp": list(part.air_um),
            "wanted_mean_um": path.target.mean_um,
            "wanted": _harmonic_fields(path.target.harmonics),
            "command_mean_um": path.command.mean_um,
            "command": _harmonic_fields(path.command.harmonics),
            "trim": _harmonic_fields([PathHarmonic.of(path.target.lobes, part.trim_um)]),
            "tool_mean_error_um": part.tool_off.mean_um,
            "tool_error": _harmonic_fields(
                PathHarmonic.of(n, um) for n, um in sorted(part.tool_off.coefficients_um.items())
            ),
            "part_gain": part.part_gain,
            "learned_waves": list(part.learned),
            "certificate": certificate_fields(part.certificate),
            "trim_short": [{"n": n, "short_um": um} for n, um in sorted(part.trim_short.items())],
            "lobe_left": None if part.left is None else asdict(part.left),
            "fingerprint": None if part.clamped is None else clamped_fields(part.clamped, path.target.lobes),
            "frozen": [{"n": each.order, **fields_of(each, "best_um", "grown_um")} for each in part.grown],
        },
    }


def _harmonic_fields(harmonics: Iterable[PathHarmonic]) -> list[dict[str, object]]:
    return [{"n": h.lobes, "amplitude_um": h.amplitude_um, "crest_deg": h.phase_deg} for h in harmonics]


def result_lines(result: RunResult | LearnResult, text: Catalogue) -> list[str]:
    """Return the result in words."""
    if isinstance(result, RunResult):
        closing = "run.cut_air" if result.plan.stage is Stage.AIR else "run.measure_it"
        return [*_run_lines(result, text), text("run.simulated" if result.simulated else closing)]
    last = result.parts[-1]
    certificate = [*certificate_lines(last.certificate, text), *_left_lobe(result, text), *_own(result, text)]
    return [*_run_lines(result.last, text), "", *_series(result, text), "", *certificate, text("run.simulated")]


def _left_lobe(result: LearnResult, text: Catalogue) -> list[str]:
    """Return what of the lobe that the last part has left repeats, and what was of its clamping alone."""
    left = result.parts[-1].left
    if left is None:
        return []
    figures = {"left": left.left_um_pp, "own": left.own_um_pp, "rest": left.repeats_um_pp}
    words = {name: f"{um_pp:.2f}" for name, um_pp in figures.items()}
    force = f"{100.0 * left.force_deviation:+.1f}"
    return [text("learn.left", n=result.plan.job.jaws, part=len(result.parts), force=force, **words)]


def _own(result: LearnResult, text: Catalogue) -> list[str]:
    """Return which orders of the last part are mostly of its own blank, or of what else varies."""
    number, short = len(result.parts), result.parts[-1].trim_short
    lines = []
    for each in result.own:
        heights = {"left": each.on_part_um, "tool": each.tool_off_um, "rest": each.left_um}
        words = {name: f"{2.0 * (um or 0.0):.2f}" for name, um in heights.items()}
        key = "learn.varies" if each.standing is Standing.VARIES else "learn.of_blank"
        limit = text("learn.trim_limit", most=f"{TRIM_LIMIT_UM:g}") if each.order in short else ""
        lines.append(text(key, n=each.order, part=number, **words) + limit)
    return lines


def lathe_line(parts: LatheParts, text: Catalogue) -> str:
    """Return which parts of a simulated lathe are cut, and from the second on how to cut the first again."""
    first, last = parts.part, parts.part + parts.parts - 1
    number = f"{first} … {last}" if last > first else f"{first}"
    said = text("run.lathe_part", lathe=parts.lathe, number=number)
    return said if first == 1 else f"{said} · {text('run.lathe_part_again')}"


def _run_lines(result: RunResult, text: Catalogue) -> list[str]:
    plan, figures = result.plan, result.figures
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
        verdict = "run.within" if result.within_tolerance else "run.outside"
        facts.append((text("run.verdict"), text(verdict, limit=f"{plan.job.roundness_tolerance_um:g}")))
    facts += [(text("run.collision"), text.problem(problem)) for problem in collision_problems(result.collisions)]
    sim = f"{text('sim')}  " if result.simulated else ""
    head = f"{sim}{plan.job.name} · {plan.machine.name} · {plan.cut.strategy}"
    force = [] if result.force is None else ["", force_words(result.force, text)]
    return ["", head, "", *_parts(result, text), *table(facts), *force]


def _parts(result: RunResult, text: Catalogue) -> list[str]:
    """Return the table of the measured parts, with a line below it; nothing without any."""
    after = "partial" if result.plan.stage is Stage.PARTIAL else "after"
    parts = {"before": result.before, after: result.after}
    measured = {name: part for name, part in parts.items() if part is not None}
    if not measured:
        return []
    jaws, first = result.plan.job.jaws, next(iter(measured.values()))
    circle = f"RONt ({first.reference_circle}, {first.filter_upr:g} UPR, {text(f'state.{first.state}')})"
    lobes = [f"{part.amplitude_um(jaws):.2f}" for part in measured.values()]
    rows = [
        ("", *(text(f"part.{name}") for name in measured), ""),
        (circle, *(f"{part.ront_um:.2f}" for part in measured.values()), "um"),
        (text("run.harmonic", n=jaws), *lobes, "um"),
    ]
    return [*table(rows, numeric=tuple(range(1, 1 + len(measured)))), ""]


def _series(result: LearnResult, text: Catalogue) -> list[str]:
    lobes = result.plan.job.jaws
    head = ("", "RONt", text("run.harmonic", n=lobes), text("learn.air"), text("learn.trim"), "")
    rows = [
        (*head, text("learn.grown")),
        (text("part.before"), *_figures(result.before, lobes), "", "", "um", ""),
        *(
            (
                f"{text('part.part')} {number}",
                *_figures(part.roundness, lobes),
                " ".join(f"{error_um:.2f}" for error_um in part.air_um),
                f"{abs(part.trim_um):.2f}",
                "um",
                " ".join(f"{each.order}/rev" for each in part.grown),
            )
            for number, part in enumerate(result.parts, start=1)
        ),
        (text("part.floor"), *_figures(result.floor, lobes), "", "", "um", ""),
    ]
    return table(rows, numeric=(1, 2, 4))


def _figures(roundness: RoundnessResult, lobes: int) -> tuple[str, str]:
    return f"{roundness.ront_um:.2f}", f"{roundness.amplitude_um(lobes):.2f}"
