"""Series of learning parts as lines for people."""

from __future__ import annotations

from console.cli.machine.run_lines import run_lines
from console.session.learning.learning import LearnResult
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.roundness import RoundnessResult


def learning_lines(result: LearnResult, text: Catalogue) -> list[str]:
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
        *run_lines(result.last, text)[:-1],
        "",
        *table(rows, numeric=(1, 2, 4)),
        text("run.simulated"),
    ]


def _figures(roundness: RoundnessResult, lobes: int) -> tuple[str, str]:
    return f"{roundness.ront_um:.2f}", f"{roundness.amplitude_um(lobes):.2f}"
