"""What is told of parts in a row that learn: a value for each key of the JSON, and lines for people."""

from __future__ import annotations

from collections.abc import Iterable

from console.cli import run_report
from console.cli.measured.roundness_fields import roundness_fields
from console.session.cut.run import RunResult
from console.session.learning.learning import LearnedPart, LearnResult
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.compensations.path import Wave
from profiles.roundness import RoundnessResult


def fields(result: LearnResult, warnings: list[str]) -> dict[str, object]:
    """Return the result for JSON, unrounded: a run whose part is the last one, with all parts beside it."""
    return {
        **run_report.fields(_last(result), warnings),
        "passes": [_part(part) for part in result.parts],
        "floor": roundness_fields(result.floor),
    }


def lines(result: LearnResult, text: Catalogue) -> list[str]:
    """Return the result in words."""
    lobes = result.plan.job.jaws
    rows = [
        (
            "",
            "RONt",
            text("run.harmonic", n=lobes),
            text("learn.air"),
            text("learn.trim"),
            "",
            text("learn.grown"),
        ),
        (text("part.before"), *_figures(result.before, lobes), "", "", "um", ""),
    ]
    rows += [
        (
            f"{text('part.part')} {number}",
            *_figures(part.roundness, lobes),
            " ".join(f"{error_um:.2f}" for error_um in part.air_um),
            f"{abs(part.trim_um):.2f}",
            "um",
            " ".join(f"{each.waves}/rev" for each in part.grown),
        )
        for number, part in enumerate(result.parts, start=1)
    ]
    rows.append((text("part.floor"), *_figures(result.floor, lobes), "", "", "um", ""))
    return [
        *run_report.lines(_last(result), text)[:-1],
        "",
        *table(rows, numeric=(1, 2, 4)),
        text("run.simulated"),
    ]


def _figures(roundness: RoundnessResult, lobes: int) -> tuple[str, str]:
    return f"{roundness.ront_um:.2f}", f"{roundness.amplitude_um(lobes):.2f}"


def _last(result: LearnResult) -> RunResult:
    last = result.parts[-1]
    return RunResult(
        plan=result.plan,
        simulated=True,
        before=result.before,
        after=last.roundness,
        figures=last.figures,
        collisions=tuple(dict.fromkeys(met for part in result.parts for met in part.collisions)),
    )


def _part(part: LearnedPart) -> dict[str, object]:
    return {
        **roundness_fields(part.roundness),
        "mean_deviation_um": part.roundness.mean_deviation_um,
        "learned": {
            "air_lobe_error_um_pp": list(part.air_um),
            "wanted_mean_um": part.path.wanted.mean_um,
            "wanted": _waves(part.path.wanted.waves),
            "command_mean_um": part.path.command.mean_um,
            "command": _waves(part.path.command.waves),
            "trim": _waves((Wave.of(part.path.wanted.lobes, part.trim_um),)),
            "tool_mean_error_um": part.tool_off.mean_um,
            "tool_error": _waves(Wave.of(n, c) for n, c in sorted(part.tool_off.coefficients_um.items())),
            "part_gain": part.part_gain,
            "learned_waves": list(part.learned),
            "frozen": [
                {"n": each.waves, "best_um": each.best_um, "grown_um": each.grown_um} for each in part.grown
            ],
        },
    }


def _waves(waves: Iterable[Wave]) -> list[dict[str, object]]:
    return [{"n": w.lobes, "amplitude_um": w.amplitude_um, "crest_deg": w.crest_deg} for w in waves]
