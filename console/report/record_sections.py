"""What the record rests on: hashes and versions, what is missing from it, and the program in full."""

from __future__ import annotations

from collections.abc import Iterator

from console.report.markup import Markup, element, facts_table, listed, paragraph, plain, section
from console.report.quantities import DEG_DIGITS, MM_DIGITS, UM_DIGITS
from console.report.reported_run import ReportedRun
from console.session.data.run_facts import origin_facts
from console.session.data.run_reader import How
from console.text.catalogue import Catalogue
from console.text.recorded_words import Layout, fact_rows, part_words
from profiles.job import hash_of_job


def provenance(run: ReportedRun, text: Catalogue) -> Markup:
    """Return versions and hashes, by which everything can be found again, and how numbers are rounded."""
    story = run.story
    rows = [
        *fact_rows(origin_facts(story), text, Layout.REPORT),
        *(
            (text("report.trace_hash", part=part_words(part.part or "part", text)), part.trace_sha256)
            for part in (each.recorded for each in run.parts)
            if part.trace_sha256
        ),
    ]
    digits = text("report.digits", um=10**-UM_DIGITS, mm=10**-MM_DIGITS, deg=10**-DEG_DIGITS)
    return section(
        "provenance",
        text("report.provenance"),
        facts_table(text("report.provenance_table"), rows),
        paragraph(_as_filed(run, text)),
        paragraph(digits, class_="note"),
    )


def _as_filed(run: ReportedRun, text: Catalogue) -> str:
    """Return whether the job as cut is that of its file."""
    story = run.story
    if story.job_text is None:
        return text("report.job_not_kept")
    same = hash_of_job(story.job_text.encode("utf-8", "replace")) == story.job_sha256
    return text("report.job_as_filed" if same else "report.job_changed")


def missing(run: ReportedRun, text: Catalogue) -> Markup:
    """Return what the record does not have, or what of it cannot be read."""
    lines = list(missing_lines(run, text))
    body = listed(lines) if lines else paragraph(text("report.nothing_missing"))
    return section("missing", text("report.missing"), body)


def missing_lines(run: ReportedRun, text: Catalogue) -> Iterator[str]:  # noqa: C901 - one branch a case
    """Yield one sentence for each gap of the record."""
    story, row = run.story, run.story.row
    for what in story.damaged:
        word, _, number = what.partition(" ")
        yield text("report.damaged", what=" ".join((text(f"report.damaged.{word}"), number)).strip())
    if row.damaged and not story.damaged:
        yield text("report.damaged_row")
    if story.python is None:
        yield text("report.older_console")
    else:
        if row.operator is None:
            yield text("report.no_operator")
        if story.job_text is None and "job" not in story.damaged:
            yield text("report.job_not_kept")
        if story.machine_text is None and "machine" not in story.damaged:
            yield text("report.machine_not_kept")
    if story.complete is False and row.ended.how is not How.OPEN:
        yield text("report.telemetry_incomplete")
    if row.ended.how is How.OPEN and "events" not in story.damaged:
        yield text("report.no_end")
    for part in run.parts:
        if part.recorded.trace is None:
            yield text("report.no_trace", part=part_words(part.recorded.part or "part", text))
        elif part.doubtful:
            yield text("report.trace_doubtful", part=part_words(part.recorded.part or "part", text))
    for problem in run.job_problems:
        yield text.problem(problem)
    if run.points is None:
        yield text("report.no_points")
    if run.contradicts_itself:
        yield text("report.contradiction")


def program(run: ReportedRun, text: Catalogue) -> Markup:
    """Return the program in full; it can be folded, and is printed."""
    content = run.story.program
    if not content.strip():
        return section("program", text("report.program_text"), paragraph(text("report.no_program")))
    summary = text("report.program_summary", count=len(content.splitlines()))
    # A line feed right behind <pre> is no part of the text: one is written, so that none of the program is lost.
    shown = element("pre", plain("\n" + content))
    return section(
        "program",
        text("report.program_text"),
        element("details", element("summary", summary), shown, open="open"),
    )
