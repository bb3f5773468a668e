"""`console records debrief RUN`: what a run cost, why, what to do next time; for people and for JSON."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict

from console.cli.library import data_of
from console.cli.measured.records_report import INDENT, WIDTH, row_fields, row_lines
from console.cli.output import show
from console.session.data.run_facts import setup_facts
from console.session.data.run_reader import RunStory, story
from console.session.learning.run_debrief import RunDebrief, run_debrief
from console.text.catalogue import Catalogue
from console.text.columns import broken, table
from console.text.recorded_words import Layout, fact_rows
from console.text.run_debrief import debrief_sections, told_words


def debrief_run(options: Namespace, text: Catalogue) -> None:
    """Print the debrief of one run."""
    data = data_of(options)
    found = story(data, options.run)
    debrief = run_debrief(found, data)
    show(
        options,
        lambda: debrief_fields(found, debrief, text),
        lambda: [
            *row_lines(found.row, text),
            *table(fact_rows(setup_facts(found), text, Layout.COMMAND)),
            *debrief_lines(debrief, text),
        ],
    )


def debrief_lines(debrief: RunDebrief, text: Catalogue) -> list[str]:
    """Return the debrief, a section after the other."""
    lines: list[str] = []
    for title, rows in debrief_sections(debrief, text):
        lines += ["", title, *(" " * INDENT + part for row in rows for part in broken(row, WIDTH - INDENT))]
    return lines


def debrief_fields(found: RunStory, debrief: RunDebrief, text: Catalogue) -> dict[str, object]:
    """Return the debrief for JSON, with codes beside the sentences."""
    return {
        **row_fields(found.row),
        "setup": found.setup,
        "causes": [asdict(cause) for cause in debrief.causes],
        "next": [each.value for each in debrief.advice],
        "happened": [{"at_s": each.at_s, "text": told_words(each, text)} for each in debrief.happened],
        "unknown": [each.code for each in debrief.unknown],
        "text": dict(debrief_sections(debrief, text)),
    }
