"""The report of a run as one HTML page: nothing is fetched, nothing runs, the same run gives the same bytes."""

from __future__ import annotations

from console.report.course_section import course
from console.report.history_sections import chart, debriefed, learned
from console.report.markup import Markup, element, facts_table, listed, paragraph
from console.report.measured_section import measured
from console.report.quantities import date_in, exact
from console.report.record_sections import missing, missing_lines, program, provenance
from console.report.reported_run import ReportedRun
from console.report.request_sections import asked, sent, set_up
from console.report.style import STYLE
from console.report.verdict import SIGNS, verdict
from console.text.catalogue import Catalogue

SHORT_ID = 8


def report_page(run: ReportedRun, text: Catalogue) -> str:
    """Return the text of the HTML file of a run."""
    row = run.story.row
    title = text("report.title", job=row.job, run=row.run_id[:SHORT_ID])
    if row.simulated:
        title = f"{text('report.simulated')} · {title}"
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="generator", content=run.story.software),
        element("title", title),
        element("style", Markup(STYLE)),
    )
    sections = (
        _head(run, text),
        asked(run, text),
        set_up(run, text),
        sent(run, text),
        measured(run, text),
        course(run, text),
        debriefed(run, text),
        learned(run, text),
        chart(run, text),
        provenance(run, text),
        missing(run, text),
        program(run, text),
    )
    running = element("div", _running(run, text), class_="head")
    sheet = element("div", running, element("main", *sections, class_="body"), class_="sheet")
    return f"<!DOCTYPE html>\n{element('html', head, element('body', sheet), lang=text.language)}\n"


def _running(run: ReportedRun, text: Catalogue) -> Markup:
    """Return what stands at the top of each printed page: that it is simulated, the job and the run."""
    row = run.story.row
    banner = None
    if row.simulated:
        words = element("span", text("report.simulated"))
        long = element("small", element("b", text("report.simulated_long")))
        banner = element("div", words, long, class_="simulated")
    names = (
        row.job,
        row.machine,
        date_in(run.zone, row.started),
        text("report.run_short", run=row.run_id[:SHORT_ID]),
    )
    return element("div", banner, *(element("span", each) for each in names), class_="running")


def _head(run: ReportedRun, text: Catalogue) -> Markup:
    """Return who, what and when, and the verdict."""
    row = run.story.row
    rows = [
        (text("report.job"), row.job),
        (text("report.part"), _part(run, text)),
        (text("report.machine"), row.machine),
        (text("report.operator"), row.operator or text("report.not_recorded")),
        (text("report.started"), date_in(run.zone, row.started)),
        (text("report.run_id"), row.run_id),
    ]
    found = verdict(run, text)
    sign = f"{SIGNS[found.judgement]} {text(f'report.verdict.{found.judgement}')}"
    gaps = list(missing_lines(run, text))
    return element(
        "header",
        element("h1", text("report.heading")),
        element(
            "div",
            paragraph(element("strong", sign)),
            listed(found.reasons) if found.reasons else None,
            paragraph(text("report.simulated_long")) if row.simulated else None,
            class_=f"verdict {found.judgement}",
        ),
        facts_table(text("report.who"), rows),
        paragraph(element("strong", text("report.gaps", count=len(gaps)))) if gaps else None,
    )


def _part(run: ReportedRun, text: Catalogue) -> str:
    job = run.job
    if job is None:
        return text("report.not_recorded")
    facts = {"diameter": exact(job.diameter_mm), "wall": exact(job.wall_thickness_mm), "jaws": job.jaws}
    return text("report.part_words", material=job.material, **facts)
