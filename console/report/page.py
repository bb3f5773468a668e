"""The report of a run as one HTML page: nothing is fetched, nothing runs, the same run gives the same bytes."""

from __future__ import annotations

from console.report.certificate import write_certificate
from console.report.course_section import write_course
from console.report.history_sections import write_chart, write_debrief, write_learning
from console.report.markup import Markup, element
from console.report.measured_section import write_measurement
from console.report.quantities import date_in
from console.report.record_sections import (
    write_gaps,
    write_program,
    write_provenance,
    write_request,
    write_sent,
    write_setup,
)
from console.session.learning.opened_run import OpenedRun
from console.text.catalogue import Catalogue

SHORT_ID = 8
STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
html { background: #fff; color: #1a1a1a; font: 15px/1.45 "Helvetica Neue", Arial, "Noto Sans", "Noto Sans KR",
  "Noto Sans CJK KR", "Apple SD Gothic Neo", "Malgun Gothic", sans-serif; }
body { margin: 0; overflow-wrap: anywhere; }
:lang(ko) body { word-break: keep-all; }
.sheet { max-width: 186mm; margin: 0 auto; padding: 12px; }
.running { display: flex; flex-wrap: wrap; gap: 0 1em; justify-content: space-between; align-items: baseline;
  border-bottom: 1px solid #6b6b6b; padding-bottom: 4px; margin-bottom: 10px; font-size: 12px; }
.simulated { flex: 1 0 100%; border: 3px solid #1a1a1a; text-align: center; font-weight: 700; font-size: 28px;
  line-height: 1.25; letter-spacing: 0.08em; padding: 2px 6px; margin-bottom: 4px;
  background: repeating-linear-gradient(45deg, #fff 0 10px, #e4e4e4 10px 20px); }
.simulated span { background: #fff; padding: 0 8px; }
.simulated small { display: block; font-size: 12px; font-weight: 400; letter-spacing: 0; }
.simulated small b { background: #fff; font-weight: 400; padding: 0 6px; }
h1 { font-size: 24px; line-height: 1.2; margin: 0 0 8px; }
h2 { font-size: 18px; margin: 24px 0 6px; border-bottom: 2px solid #1a1a1a; break-after: avoid; }
h3 { font-size: 15px; margin: 14px 0 4px; break-after: avoid; }
p { margin: 6px 0; }
ul { margin: 6px 0; padding-left: 20px; }
.note { color: #4a4a4a; font-size: 13px; }
.verdict { border: 2px solid #1a1a1a; padding: 8px 12px; margin: 10px 0; break-inside: avoid; }
.verdict strong { font-size: 22px; }
.verdict.bad, .verdict.doubtful { border-width: 5px; }
.verdict.open { border-style: dashed; }
table { border-collapse: collapse; width: 100%; margin: 10px 0; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 700; padding: 2px 0; }
th, td { text-align: left; vertical-align: top; padding: 2px 8px 2px 0; border-bottom: 1px solid #c9c9c9; }
th { font-weight: 400; color: #4a4a4a; }
thead th { font-weight: 700; color: #1a1a1a; border-bottom: 1px solid #1a1a1a; }
.facts th { width: 40%; }
tbody .number { white-space: nowrap; }
.events th { white-space: nowrap; }
.events td:nth-child(2) { min-width: 6.5em; }
.number { text-align: right; padding: 2px 14px 2px 4px; }
tr, figure, figcaption, caption { break-inside: avoid; }
thead { display: table-header-group; }
figure { margin: 12px 0; }
figure svg { display: block; width: 100%; max-width: 560px; height: auto; margin: 0 auto; }
figure.round svg { max-width: 340px; }
figcaption { font-size: 13px; color: #4a4a4a; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(260px, 1fr)); gap: 0 16px;
  break-inside: avoid; }
#certificate { break-after: page; font-size: 12px; line-height: 1.35; }
#certificate h1 { font-size: 20px; margin: 0 0 2px; }
#certificate table { margin: 4px 0; }
#certificate caption { padding: 0; }
#certificate th, #certificate td { padding-top: 1px; padding-bottom: 1px; }
#certificate .verdict { margin: 6px 0; padding: 2px 12px; }
#certificate .verdict strong { font-size: 18px; }
#certificate .verdict p { margin: 2px 0; }
#certificate .facts th { width: 1%; white-space: nowrap; padding-right: 12px; }
#certificate .figures td, #certificate .figures th { vertical-align: middle; }
#certificate .pair { align-items: start; }
@media (max-width: 639px) { .figures { display: block; overflow-x: auto; white-space: nowrap; } }
@media (min-width: 640px) {
  #certificate .figures td, #certificate .figures th { overflow-wrap: normal; padding-right: 6px; }
  #certificate .figures tbody th, #certificate .figures tbody td:nth-child(2) { white-space: nowrap; }
  .shown { display: grid; grid-template: auto 1fr / 55mm 1fr; gap: 0 4mm; align-items: start;
    break-inside: avoid; }
  .shown figure { display: contents; }
  .shown figure > * { grid-row: 1 / 3; }
  .shown figure svg { width: 55mm; margin: 2px 0; }
  .shown table, .shown figcaption { grid-column: 2; grid-row: auto; }
}
.shown figcaption { font-size: 11px; }
#certificate .signatures { break-inside: avoid; }
.signatures caption { font-size: 0; }
.gps svg { width: 1.4em; height: 1.4em; vertical-align: -0.3em; }
.frame { display: inline-block; border: 1.5px solid #1a1a1a; white-space: nowrap; line-height: 1.5; }
.frame .gps { border-right: 1.5px solid #1a1a1a; padding: 0 3px; }
.frame b { padding: 0 5px; }
#certificate .signatures tbody td, #certificate .signatures tbody th { height: 7mm; vertical-align: bottom; }
.signatures tbody td { border-left: 1px solid #c9c9c9; padding-left: 6px; }
summary { cursor: pointer; margin: 6px 0; break-after: avoid; }
pre { font: 11px/1.35 "DejaVu Sans Mono", Menlo, Consolas, "Noto Sans Mono CJK KR", monospace; margin: 6px 0;
  white-space: pre-wrap; overflow-wrap: anywhere; }
@page { size: A4; margin: 14mm 12mm 16mm; @bottom-right { content: counter(page) " / " counter(pages);
  font: 9pt sans-serif; } }
@media print {
  html { font-size: 10.5pt; }
  .sheet { display: table; width: 100%; max-width: none; padding: 0; }
  .head { display: table-header-group; break-inside: avoid; }
  .body { display: table-row-group; }
  .running { margin-bottom: 4mm; }
  figure svg { max-width: 130mm; }
  figure.round svg { max-width: 88mm; }
  .pair { grid-template-columns: 1fr 1fr; }
  #certificate { font-size: 8.5pt; line-height: 1.3; }
  .shown figcaption { font-size: 7.5pt; }
  pre { font-size: 7.5pt; }
  details::details-content { content-visibility: visible; display: block; block-size: auto; }
  summary { list-style: none; }
}
"""


def write_report(run: OpenedRun, text: Catalogue) -> str:
    """Write a run as the text of an HTML file."""
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
        write_certificate(run, text),
        element("h1", text("report.certificate.process")),
        write_request(run, text),
        write_setup(run, text),
        write_sent(run, text),
        write_measurement(run, text),
        write_course(run, text),
        write_debrief(run, text),
        write_learning(run, text),
        write_chart(run, text),
        write_provenance(run, text),
        write_gaps(run, text),
        write_program(run, text),
    )
    running = element("div", _running(run, text), class_="head")
    sheet = element("div", running, element("main", *sections, class_="body"), class_="sheet")
    return f"<!DOCTYPE html>\n{element('html', head, element('body', sheet), lang=text.language)}\n"


def _running(run: OpenedRun, text: Catalogue) -> Markup:
    """Return the header of each printed page: SIMULATED, the job and the run."""
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
