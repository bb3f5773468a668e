"""Text of a recorded run: verdict, figures, set-up, job, learning, alarms, commands, most important first."""

from __future__ import annotations

from console.session.data.measured_part import RecordedPart
from console.session.data.run_facts import FactKind, origin_facts, setup_facts
from console.session.data.run_rows import RunOutcome, RunRow, recorded_problems
from console.session.learning.opened_run import JobNow, OpenedRun
from console.session.part_identity import identity_of
from console.text.along_length import form_words, ront_words, section_rows, stretch_words
from console.text.catalogue import Catalogue
from console.text.columns import table
from console.text.part_sentences import verdict_words
from console.text.recorded_words import (
    Layout,
    ending_words,
    fact_rows,
    fact_words,
    identity_rows,
    local,
    problem_words,
    timed_words,
)
from console.text.run_debrief import debrief_sections
from console.tui.lines import BLANK, NOTHING, Line, dim, fact, hanging, line, wrap_line
from console.tui.pages.inspect_lines import FRONT_MULTIPLES, judged_line, roundness_facts
from console.tui.pages.jobs_lines import job_lines
from console.tui.pages.learn_lines import cut_words
from console.tui.rows import problem_lines
from console.tui.theme import Token
from profiles.files import printable
from profiles.forecast import forecast_um
from profiles.strict_values import number_or_none

_LABEL = 15
_WIDEST = 60
_UNNAMED = ("software", "controller")  # told by what they are


def story_lines(run: OpenedRun, text: Catalogue, width: int) -> list[Line]:
    """Return all text on a run."""
    room = min(width, _WIDEST)
    lines = [*verdict_lines(run, text, width), *_damage_lines(run, text, width), *_cut_lines(run, text, room)]
    for title, said in debrief_sections(run.debrief, text) if run.debrief else ():
        told = [each for row in said for each in hanging(("· ", Token.TEXT), row, width)]
        lines += [BLANK, line((title, Token.TITLE)), *told]
    for name, rows in (
        ("figures", _figure_lines(run, text, room)),
        ("setup", _setup_lines(run, text, room)),
        ("job", _job_lines(run, text, width, room)),
        ("learning", _learning_lines(run, text, width)),
        *((name, _timed_lines(rows, width)) for name, rows in timed_words(run.story, text).items()),
        ("software", _software_lines(run, text, width)),
    ):
        if rows:
            lines += [BLANK, line((text(f"records_page.of.{name}"), Token.TITLE)), *rows]
    return lines


def verdict_lines(run: OpenedRun, text: Catalogue, width: int) -> list[Line]:
    """Return whether the part is good, and how the cut ended."""
    part, row = run.story.product, run.story.row
    lines = _verdict(part, text, width) if part is not None else [line(dim(text("records.not_measured")))]
    ended = ending_words(row.ended, text, Layout.PAGE)
    lines += wrap_line(ended, width, Token.TEXT if row.ended.how is RunOutcome.DONE else Token.WARNING)
    if judged := verdict_words(run.story.cut_verdict, text):
        lines += wrap_line(f"{text('run.cut_verdict')}: {judged}", width, Token.TEXT)
    if along := stretch_words(run.story.cut_verdict, text):
        lines += wrap_line(f"{text('stretches.title')}: {along}", width, Token.TEXT)
    if row.simulated:
        lines += wrap_line(text("inspect_page.simulated"), width, Token.SIM)
    return lines


def _verdict(part: RecordedPart, text: Catalogue, width: int) -> list[Line]:
    """Return RONt of a part against its tolerance, and its diameter if that has one, as they were judged."""
    judged, nominal_mm = part.judged, part.nominal_diameter_mm or 0.0
    if (worst_um := part.worst[0]) is not None and part.passed is None and not part.is_open:
        facts = roundness_facts(worst_um, part.tolerance_um, text)
        judged = tuple(each for each in judged if each.passes is None)
        rows = [line((text("records_page.not_judged", **facts), Token.TEXT))]
        return [*rows, *(judged_line(each, nominal_mm, text, width) for each in judged)]
    return [judged_line(each, nominal_mm, text, width) for each in judged]


def made_of(row: RunRow, text: Catalogue) -> str:
    """Return how the part of a run was cut: strategy, compensation, stage."""
    return cut_words(text, row.strategy, row.compensation, row.stage, row.inverted)


def _damage_lines(run: OpenedRun, text: Catalogue, width: int) -> list[Line]:
    lines: list[Line] = []
    if run.story.damaged:
        what = printable(", ".join(run.story.damaged), 80)
        lines += hanging(("! ", Token.WARNING), text("records.damaged", what=what), width, Token.WARNING)
    if run.story.complete is False:
        lines += hanging(("! ", Token.WARNING), text("records_page.incomplete"), width, Token.WARNING)
    return lines + problem_lines(run.problems, text, width, token=Token.WARNING)


def _cut_lines(run: OpenedRun, text: Catalogue, width: int) -> list[Line]:
    row = run.story.row
    rows = {
        "time": local(row.started),
        "operator": printable(row.operator or NOTHING, 30),
        "machine": printable(row.machine, 40),
        "made": made_of(row, text),
    }
    return [_fact(text(f"fact.{name}"), value, width) for name, value in rows.items()]


def _figure_lines(run: OpenedRun, text: Catalogue, width: int) -> list[Line]:
    part = run.story.product
    if part is None:
        return []
    rows = [_fact(name, value, width) for name, value in figures(part, run, text)]
    for other in run.story.parts:
        if not other.product:
            rows.append(_fact(f"RONt {printable(other.part, 10)}", ront_words(other.ront_um, text), width))
    rows += wrap_line(form_words(part.data, text), width)
    rows += [line(each) for each in table(section_rows(part.data, text), numeric=(0, 1, 2))]
    if part.trace_name:
        rows.append(_fact(text("records_page.trace"), printable(part.trace_name, 40), width))
    return rows


def figures(part: RecordedPart, run: OpenedRun, text: Catalogue) -> list[tuple[str, str]]:
    """Return the figures of a part with their names, as they were evaluated."""
    rows = [("RONt", ront_words(part.ront_um, text))]
    for name in ("RONp", "RONv", "RONq"):
        value = number_or_none(part.data.get(f"{name}_um"))
        if value is not None:
            rows.append((name, text.units.show(value, "um", 2)))
    if part.diameter_mm is not None:
        rows.append((text("fact.diameter"), text.units.show(part.diameter_mm, "mm", 3)))
        if (off_um := part.off_nominal_um) is not None:
            allowed_um = part.diameter_tolerance_um
            judged = "" if allowed_um is None else f" (± {text.units.format_short(allowed_um, 'um')})"
            rows.append((text("records_page.off_nominal"), f"{text.units.show(off_um, 'um', 1, '+')}{judged}"))
    of_jaws = jaw_harmonics(part, run)
    rows += [
        (text("inspect_page.harmonic", n=n), f"{text.units.show(um_pp, 'um', 2)} p-p") for n, um_pp in of_jaws
    ]
    if not of_jaws and part.lobe_um_pp is not None:
        rows.append((text("records_page.lobe"), f"{text.units.show(part.lobe_um_pp, 'um', 2)} p-p"))
    return rows


def jaw_harmonics(part: RecordedPart, run: OpenedRun) -> list[tuple[int, float]]:
    """Return the recorded harmonics of the jaws: undulations per revolution, um p-p; none of an unknown job."""
    listed, found = part.data.get("harmonics"), []
    wanted = [] if run.job is None else [run.job.jaws * multiple for multiple in range(1, FRONT_MULTIPLES + 1)]
    for each in listed if isinstance(listed, list) else []:
        n = each.get("n") if isinstance(each, dict) else None
        amplitude_um = number_or_none(each.get("amplitude_um")) if isinstance(each, dict) else None
        if isinstance(n, int) and n in wanted and amplitude_um is not None:
            found.append((n, 2.0 * amplitude_um))
    return found


def _setup_lines(run: OpenedRun, text: Catalogue, width: int) -> list[Line]:
    identity = identity_of(run.story)
    rows = [] if identity is None else identity_rows(identity, text)
    rows += fact_rows(setup_facts(run.story), text, Layout.PAGE)
    lines = [_fact(name, value, width) for name, value in rows]
    if run.story.setup.get("aligned") is False:
        lines += wrap_line(text("records_page.not_aligned"), width, Token.DIM)
    return lines


def _job_lines(run: OpenedRun, text: Catalogue, width: int, room: int) -> list[Line]:
    note = {JobNow.SAME: Token.DIM, JobNow.CHANGED: Token.WARNING, JobNow.GONE: Token.DIM}[run.job_now]
    lines = wrap_line(printable(run.story.row.job), width, Token.STRONG)
    lines += wrap_line(text(f"records_page.job_now.{run.job_now}"), width, note)
    if run.machine_changed:
        lines += wrap_line(text("records_page.machine_changed"), width, Token.WARNING)
    return [*lines, *([] if run.job is None else job_lines(run.job, text, room))]


def _learning_lines(run: OpenedRun, text: Catalogue, width: int) -> list[Line]:
    """Return the proposed learning step, or why there is none, and the accepted ones."""
    lines: list[Line] = []
    proposed = None if run.story.product is None else run.story.product.data.get("learning")
    if isinstance(proposed, dict):
        if proposed.get("version") is not None:
            left = number_or_none(proposed.get("expected_ront_um"))
            expected = NOTHING if left is None else text.units.figure(forecast_um(left), "um", 2)
            version = printable(str(proposed["version"]), 10)
            lines += wrap_line(text("records_page.proposed", version=version, expected=expected), width)
        for problem in recorded_problems(proposed):
            lines += hanging(("· ", Token.TEXT), problem_words(problem, text), width)
    for event in run.story.accepted_steps:
        facts = {"version": printable(str(event.data.get("version", NOTHING)), 10), "at": local(event.at)}
        by = printable(str(event.data.get("by") or ""), 30)
        lines += wrap_line(f"{text('records_page.accepted', **facts)} {by}".rstrip(), width)
    return lines


def _timed_lines(rows: list[tuple[str, str]], width: int) -> list[Line]:
    return [row for at, words in rows for row in hanging(dim(f"{at} "), words, width)]


def _software_lines(run: OpenedRun, text: Catalogue, width: int) -> list[Line]:
    facts = [each for each in origin_facts(run.story) if each.kind is not FactKind.HASH]
    named = [each for each in facts if each.key not in _UNNAMED]
    said = [fact_words(each, text, Layout.PAGE) for each in facts if each.key in _UNNAMED]
    said += [" ".join(row) for row in fact_rows(named, text, Layout.PAGE)]
    return [each for row in said if row for each in wrap_line(row, width, Token.DIM)]


def _fact(label: str, value: str, width: int) -> Line:
    return fact(label, value, width, label_width=min(_LABEL, max(width - 10, 0)))
