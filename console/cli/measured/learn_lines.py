"""Learned compensation as lines for people: the learning step of a part, and the versions of a job."""

from __future__ import annotations

import shlex
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from console.cli.measured.learn_fields import arrival, still_holds
from console.session.data.kept_files import is_ahead
from console.session.learning.learning_steps import Taught
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.compensations.learned import HoldsFor, LearnedCompensation
from profiles.compensations.next_version import Contraction, LearningStep
from profiles.files import printable


def lesson_lines(found: Taught, text: Catalogue) -> list[str]:
    """Return a learning step in words."""
    lesson, made = found.lesson, found.made
    holds, part = lesson.next.holds_for, lesson.next.part
    assert part is not None
    sim = f"{text('sim')}  " if holds.simulated else ""
    head = text("learned.head", made=f"{made.compensation} · {made.strategy} · {text(f'stage.{found.stage}')}")
    expected = f"{lesson.expected_lobe_um_pp:.2f} ± {lesson.expected_half_width_um_pp:.2f}"
    rows = [
        ("", text("learned.measured"), text("learned.next"), ""),
        ("RONt", f"{part.ront_um:.2f}", f"{lesson.expected_ront_um:.2f}", "um"),
        (text("learned.lobe"), f"{2 * part.lobe.amplitude_um:.2f}", expected, "um"),
    ]
    return [
        f"{sim}{holds.job} · {holds.machine}: {head}",
        "",
        *table(rows, numeric=(1, 2)),
        "",
        *table(_facts(lesson, text)),
    ]


def kept_lines(
    version: LearnedCompensation, kept: Path | None, asked: bool, options: Namespace, text: Catalogue
) -> list[str]:
    """Return where a version was kept and how to cut with it; nothing where that was `asked` and failed."""
    if kept is None:
        return [] if asked else ["", text("calibrate.not_kept")]
    words = ["console", "run", options.job, "--strategy", version.holds_for.strategy, "--compensation", "newest"]
    if options.machine:
        words += ["--machine", options.machine]
    if version.holds_for.simulated:
        words.append("--sim")
    file = printable(str(kept))
    return ["", text("learned.kept", version=version.version, file=file, command=shlex.join(words))]


def version_lines(known: Sequence[LearnedCompensation], asked: HoldsFor, text: Catalogue) -> list[str]:
    """Return the versions of a job on a machine as a table, or that there are none."""
    sim = f"{text('sim')}  " if asked.simulated else ""
    head = f"{sim}{asked.job} · {asked.machine}"
    if not known:
        return [f"{head}: {text('learned.no_versions')}"]
    columns = ("version", "date", "strategy", "from", "gain", "ront", "lobe", "now")
    rows = [tuple(text(f"learned.column.{name}") for name in columns)]
    rows += [_row(version, asked, text) for version in known]
    return [head, "", *table(rows, numeric=(0, 4, 5, 6))]


def _row(version: LearnedCompensation, asked: HoldsFor, text: Catalogue) -> tuple[str, ...]:
    part = version.part
    reverts = version.reverts
    return (
        str(version.version),
        f"{version.date} {text('learned.date_ahead')}" if is_ahead(version.date) else version.date,
        version.holds_for.strategy,
        str(version.parent) if reverts is None else text("learned.again", version=reverts),
        f"{version.gain:g}",
        "" if part is None else f"{part.ront_um:.2f}",
        "" if part is None else f"{2 * part.lobe.amplitude_um:.2f}",
        text("learned.holds" if still_holds(version, asked) else "learned.changed"),
    )


def _facts(lesson: LearningStep, text: Catalogue) -> list[tuple[str, str]]:
    waves = ", ".join(str(n) for n in lesson.learned) or text("learned.no_waves")
    rows = [(text("learned.waves"), waves), (text("learned.gain"), f"{lesson.next.gain:g}")]
    lobes, contraction = lesson.next.path.target.lobes, lesson.contraction
    if contraction is not None:
        share, late_deg = arrival(contraction, lobes)
        late = text("learned.arrives_late", share=f"{100 * share:.1f}", late=f"{late_deg:+.2f}")
        rows += [(text("learned.arrives"), late), (text("learned.factor"), _factor(contraction, text))]
    others = sorted((n, each) for n, each in lesson.contractions.items() if n != lobes)
    return [*rows, *((text("learned.factor_of", waves=f"{n}/rev"), _factor(each, text)) for n, each in others)]


def _factor(contraction: Contraction, text: Catalogue) -> str:
    factor = f"{contraction.value:.2f} ± {contraction.half_width:.2f}"
    return f"{factor}: {text(f'learned.verdict.{contraction.verdict}')}"
