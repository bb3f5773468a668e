"""Text of the page Set-up: the form, the effect of speed on the grip, and the findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rich.cells import cell_len

from console.session.cut.interlocks import of_lobe
from console.session.work import Work, lobe_choices
from console.text.catalogue import Catalogue
from console.text.job_words import lobe_number, span_ends
from console.tui.lines import (
    BLANK,
    NOTHING,
    Line,
    clip_lines,
    dim,
    fact,
    fit_text,
    hanging,
    line,
    width_of,
    wrap_line,
)
from console.tui.pages.fields import (
    FORM,
    EntryResult,
    FormField,
    bounds,
    format_field,
    limit_of,
    name_field,
    provenance,
    with_unit,
)
from console.tui.theme import Token
from drivers.cutting.strategy import Strategy
from profiles.chucking.advice import ForcePosition, ForceSpan, force_span
from profiles.chucking.grip import centrifugal_loss_n, grip_margin_n, wrench_force_sd_n
from profiles.chucking.holding import holding_of, torque_or_none_n_m
from profiles.findings import Finding, Severity
from profiles.job import NO_LOBE, Job
from profiles.lobe.lobe_conditions import OTHER_CUT, changed_conditions, lobe_source
from profiles.machine import MachineProfile
from profiles.problem import Problem

ENTRY_WIDTH = 10  # cells of a number entry; a text takes all of its row
FOOT_ROWS = 2
LEAST_VALUES = 3  # rows of values that stay however long the text below them is
_MARK, _LABEL, _UNIT = 2, 15, 8
_SPEED_LABEL, _SPEED_WIDTH = 19, 46
_ROWS_WITH_BAR = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class FormState:
    """State of the form. `typed` is the open entry; `naming` the name to save under, `over` that of its file."""

    work: Work
    selected: int = 0
    typed: str | None = None
    judged: EntryResult | None = None
    locked: Problem | None = None
    naming: str | None = None
    naming_problem: Problem | None = None
    over: str | None = None

    @property
    def field(self) -> FormField:
        """The selected field."""
        return FORM[self.selected]


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupForm:
    """Lines of the form, and the position (column, row, cells) of the open entry."""

    lines: tuple[Line, ...]
    entry: tuple[int, int, int] | None


def form(state: FormState, text: Catalogue, width: int, height: int) -> SetupForm:
    """Return the form in a size in cells; the selected field is always visible."""
    foot = _foot(state, text, width)
    foot += [BLANK] * (FOOT_ROWS - len(foot))
    # A longer refusal takes rows of the headings, then of the values that are not being changed.
    foot = clip_lines(foot, max(height - LEAST_VALUES, FOOT_ROWS), text("panel.more"))
    room = max(height - len(foot), 1)
    rows = _rows(room, state.selected)
    lines = [_row(row, state, text, width) for row in rows]
    if len(lines) < room:
        lines.append(BLANK)
    foot_row = len(lines)
    lines += [*foot, *_file_lines(state.work, text, width, height - foot_row - len(foot))]
    entry = None
    if state.naming is not None:
        column = width_of(_name_label(text))
        entry = column + 1, foot_row, max(width - column - 2, 1)
    elif state.typed is not None:
        left = _MARK + _label_width(width) + 1
        entry = left, rows.index(state.field), ENTRY_WIDTH if state.field.numeric else max(width - left - 1, 1)
    return SetupForm(lines=tuple(lines[: max(height, 0)]), entry=entry)


def speed_lines(job: Job, machine: MachineProfile, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the effect of the job's force and speed on grip and lobe; the most important rows first."""
    margin_n, span = grip_margin_n(job, machine), force_span(job, machine)
    stands = span.stands(job.chucking_force_n)
    inside = Token.OK if stands is ForcePosition.INSIDE else Token.WARNING
    width = min(width, _SPEED_WIDTH)
    source = text(f"source.{lobe_source(job, chuck=machine.chuck.name, tool=machine.tool.name)}")
    return [
        _fact(text("setup.grip"), f"{margin_n:.1f} N", width, Token.TEXT if margin_n >= 0 else Token.WARNING),
        # The label gives the position of the job's force between the allowed ones.
        _fact(text(f"setup.window.{stands}"), span_ends(span, text), width, inside),
        *([_window_bar(span, job, machine, width)] if height >= _ROWS_WITH_BAR else []),
        *_wrench_lines(job, machine, text, width),
        _fact(text("setup.loss"), f"{centrifugal_loss_n(job, machine):.1f} N", width),
        _fact(text("setup.lobe"), f"{job.lobe_frequency_hz:.1f} Hz", width),
        *_error_lines(job, source, text, width),
    ]


def _error_lines(job: Job, source: str, text: Catalogue, width: int) -> list[Line]:
    """Return the lobe error and the force at which it was found; of an unknown one that it is."""
    if job.lobe_error_source == NO_LOBE:
        return [_fact(text("setup.error"), source, width, Token.WARNING)]
    return [
        _fact(text("setup.error"), f"{lobe_number(job, text.units)} {text.units.unit('um')}", width),
        _fact(text("setup.error_at", source=source), f"{job.error_force_n:.1f} N", width),
    ]


def _fact(name: str, value: str, width: int, token: Token = Token.TEXT) -> Line:
    """Return a label with its value; a longer value takes cells of its label."""
    label = min(_SPEED_LABEL, max(width - max(10, cell_len(value) + 1), 0))
    return fact(name, value, width, label_width=label, token=token)


def _window_bar(span: ForceSpan, job: Job, machine: MachineProfile, width: int) -> Line:
    """Return the same on a scale from zero to the chuck's maximum; a force beyond it is at its end."""
    ends = "0 ├", f"┤ {machine.chuck.max_force_n:.0f} N"
    cells = width - sum(cell_len(end) for end in ends)
    if cells < ENTRY_WIDTH:
        return BLANK
    last_n = machine.chuck.max_force_n / cells
    low, high, at = (
        int(min(force_n / last_n, cells - 1)) for force_n in (span.least_n, span.most_n, job.chucking_force_n)
    )
    bar = "".join("●" if cell == at else "■" if low <= cell <= high else "─" for cell in range(cells))
    return line(dim(ends[0]), bar, dim(ends[1]))


def _wrench_lines(job: Job, machine: MachineProfile, text: Catalogue, width: int) -> list[Line]:
    """Return the torque for the force, and the uncertainty of the force, one sd; nothing without a wrench line."""
    wrench = holding_of(machine).wrench
    if wrench is None:
        return []
    torque_n_m = torque_or_none_n_m(wrench, job.chucking_force_n)
    words, token = text("setup.no_torque"), Token.WARNING
    if torque_n_m is not None:
        words, token = f"{torque_n_m:.2f} N m ±{wrench_force_sd_n(job, machine):.0f} N", Token.TEXT
    return [_fact(text("setup.wrench"), words, width, token)]


def finding_lines(
    findings: Sequence[Finding],
    text: Catalogue,
    width: int,
    height: int | None = None,
    told: Sequence[Problem] = (),
    stops: Sequence[Problem] = (),
) -> list[Line]:
    """Return unmet rules, warnings (`told`: those of calibrations), and the rules met, as far as they fit.

    `stops` is why this machine may not cut at all.
    """
    refused, warned, held = (
        [finding.problem for finding in findings if finding.severity is severity]
        for severity in (Severity.REFUSAL, Severity.WARNING, Severity.OK)
    )
    marked = [(problem, ("✗ ", Token.ALARM)) for problem in (*refused, *stops)]
    marked += [(problem, ("! ", Token.WARNING)) for problem in (*warned, *told)]
    lines: list[Line] = []
    for problem, mark in marked:
        lines += hanging(mark, text.problem(name_field(problem, text)), width)
    if height is not None and len(lines) >= height:
        return clip_lines(lines, height, text("panel.more"))
    lines.append(line(("✓ ", Token.OK), text("setup.hold", count=len(held), total=len(findings))))
    names = [text(f"name.{problem.code}") for problem in held]
    if height is not None and len(names) > (room := height - len(lines)):
        # The last row gives the number left out.
        names = [*names[: room - 1], text("setup.more_hold", count=len(names) - room + 1)] if room > 1 else []
    return [*lines, *((dim(fit_text("  " + name, width)),) for name in names)]


def missing_lines(state: FormState, text: Catalogue, width: int) -> list[Line]:
    """Return the values that a new job still needs, one a row."""
    work = state.judged.work if state.judged else state.work
    names = (text(f"setup.{field.key}") for field in FORM if field.key in work.missing)
    return [line(("· ", Token.WARNING), fit_text(name, max(width - 2, 1))) for name in names]


def lobe_word(work: Work, machine: MachineProfile, *, simulated: bool) -> str:
    """Return the word for what a cut of this job lacks of its lobe; empty where nothing."""
    if work.job.lobe_error_source == NO_LOBE:
        return "plain"
    lacks = of_lobe(work.job, machine, Strategy(work.strategy), simulated=simulated)
    return "" if lacks.holds else "lobe"


def draft(state: FormState) -> Job:
    """Return the job including the open entry."""
    return (state.judged.work if state.judged else state.work).job


def _rows(room: int, selected: int) -> list[FormField | str]:
    spaced: list[FormField | str] = []
    for field in FORM:
        if field.heading not in spaced:
            spaced += ["", field.heading] if spaced else [field.heading]
        spaced.append(field)
    close = [row for row in spaced if row]
    for rows in (spaced, close, list[FormField | str](FORM)):
        if len(rows) <= room:
            return rows
    first = min(max(selected - room // 2, 0), len(FORM) - room)
    return list(FORM[first : first + room])


def _row(row: FormField | str, state: FormState, text: Catalogue, width: int) -> Line:
    if not isinstance(row, FormField):
        return (dim(text(f"setup.{row}")),) if row else BLANK
    chosen = row is state.field and state.naming is None
    label = fit_text(text(f"setup.{row.key}"), _label_width(width))
    head = line(("▸ " if chosen else "  ", Token.ACTION), (label, Token.STRONG if chosen else Token.DIM))
    if chosen and state.typed is not None:
        return (*head, *_open_row(row, state, text, width))
    if row.has_choices:
        return (*head, *_lobe(state.work.job, text, width - _MARK - cell_len(label) - 1, chosen=chosen))
    if row.key in state.work.missing:
        return (*head, (fit_text(" " * ENTRY_WIDTH + NOTHING, ENTRY_WIDTH + 1), Token.WARNING))
    value, token = row.mark + format_field(row, state.work.job, text.units), Token.STRONG if chosen else Token.TEXT
    if not row.numeric and len(value) > ENTRY_WIDTH:
        return (*head, (" " + fit_text(value, width - _MARK - len(label) - 2), token))
    shown = fit_text(" " * (ENTRY_WIDTH + 1 - len(value)) + value, ENTRY_WIDTH + 1)
    return (
        *head,
        (shown, token),
        dim("  " + fit_text(text.units.unit(row.rule.unit), _UNIT - 1)),
        *_row_note(row, state, text, width),
    )


def _lobe(job: Job, text: Catalogue, width: int, *, chosen: bool) -> Line:
    """Return the lobe of the job with its source, and whether it is that of this cut."""
    source = lobe_source(job)
    words = text(f"setup.lobe_from.{source}", error=lobe_number(job, text.units))
    token = Token.WARNING if source in (NO_LOBE, OTHER_CUT) else Token.STRONG if chosen else Token.TEXT
    return line(" ", (fit_text(words, max(width - 1, 1)), token))


def _open_row(row: FormField, state: FormState, text: Catalogue, width: int) -> Line:
    """Return the row of an open entry, typed over the blanks between the brackets; its meaning follows it."""
    if not row.numeric:
        cells = max(width - _MARK - _label_width(width) - 2, 0)
        return line("[" + " " * cells + "]")
    field: Line = line(
        "[" + " " * ENTRY_WIDTH + "]", dim(" " + fit_text(text.units.unit(row.rule.unit), _UNIT - 1))
    )
    if state.judged is None or not (state.typed or "").strip():
        return field
    if state.judged.problems:
        return (*field, ("✗ " + text("setup.refused"), Token.WARNING))
    return (
        *field,
        (text("setup.understood", value=format_field(row, state.judged.work.job, text.units)), Token.OK),
    )


def _row_note(row: FormField, state: FormState, text: Catalogue, width: int) -> Line:
    """Return the text after a value: its limits while it is selected, else a note on it."""
    room = width - _MARK - _label_width(width) - ENTRY_WIDTH - 2 - _UNIT
    job, filed, words, token = state.work.job, state.work.loaded.job, "", Token.WARNING
    if row is state.field and bounds(row, text.units):
        words, token = bounds(row, text.units), Token.DIM
    elif row.key in changed_conditions(job):
        words = text("setup.lobe_was", value=_of_lobe(row, job, text))
        if cell_len(words) > room:  # a truncated number would be read as another one
            words = text("setup.not_lobes")
    elif not state.work.is_new and getattr(job, row.key) != getattr(filed, row.key):
        words = text("setup.was", value=format_field(row, filed, text.units))
    elif row.key in job.assumed:
        words, token = text("setup.assumed"), Token.DIM
    return line((fit_text(words, room), token)) if words and room >= ENTRY_WIDTH else BLANK


def _foot(state: FormState, text: Catalogue, width: int) -> list[Line]:
    """Return the rows under the form, mostly two: the refusal in words, or what may be typed."""
    if state.naming is not None:
        brackets = "[" + " " * max(width - width_of(_name_label(text)) - 2, 0) + "]"
        return [(*_name_label(text), (brackets, Token.TEXT)), *_naming_words(state, text, width)]
    if state.typed is not None and state.judged and state.judged.problems:
        return wrap_line(text.problem(name_field(state.judged.problems[0], text)), width, Token.WARNING)
    if state.locked is not None:
        return wrap_line("! " + text.problem(state.locked), width, Token.WARNING)
    field, job, filed, note = state.field, state.work.job, state.work.loaded.job, ""
    if field.has_choices:
        return _lobe_foot(state.work, text, width)
    if field.key in state.work.missing:
        return [(dim(fit_text(_describe_limits(field, text), width)),)]
    allowed = _describe_limits(field, text)
    if field.key in changed_conditions(draft(state)):
        note = text("setup.lobe_was_long", value=_of_lobe(field, draft(state), text))
    elif state.typed is not None:
        note = text("setup.keeps", value=with_unit(field, job, text.units))
    elif not state.work.is_new and getattr(job, field.key) != getattr(filed, field.key):
        note = text("setup.was_long", value=with_unit(field, filed, text.units))
    elif field.key in job.assumed:
        note = text("setup.assumed_long")
    return [(dim(fit_text(words, width)),) for words in (allowed, note) if words]


def _describe_limits(field: FormField, text: Catalogue) -> str:
    if not field.numeric:
        return text("setup.allowed_text")
    return text(
        "setup.allowed_or_none" if field.rule.optional else "setup.allowed", limit=limit_of(field, text.units)
    )


def _lobe_foot(work: Work, text: Catalogue, width: int) -> list[Line]:
    """Return what Enter does to the lobe, and under which conditions it was measured where those differ."""
    choices = " → ".join(text(f"setup.lobe_choice.{choice}") for choice in lobe_choices(work))
    lines: list[Line] = [(dim(fit_text(text("setup.lobe_choices", choices=choices), width)),)]
    differing = [field for field in FORM if field.key in changed_conditions(work.job)]
    if differing:
        where = ", ".join(f"{text(f'setup.{field.key}')} {_of_lobe(field, work.job, text)}" for field in differing)
        lines.append((dim(fit_text(text("setup.lobe_of", conditions=where), width)),))
    elif work.job.lobe_error_source == NO_LOBE:
        lines.append((dim(fit_text(text("setup.lobe_first"), width)),))
    return lines


def _of_lobe(field: FormField, job: Job, text: Catalogue) -> str:
    """Return the condition under which the lobe of the job was found, as its field shows it."""
    return with_unit(field, replace(job, **{field.key: changed_conditions(job)[field.key]}), text.units)


def _file_lines(work: Work, text: Catalogue, width: int, room: int) -> list[Line]:
    job = work.loaded.job
    lines = [
        BLANK,
        (dim(text("setup.file")),),
        line(dim("  " + fit_text(text("setup.revision"), _LABEL)), f" {work.loaded.sha256[:6]}"),
        *(line("  ", *pieces) for pieces in wrap_line(provenance(job, text), width - 2, Token.DIM)),
    ]
    return lines if len(lines) <= room else []


def _naming_words(state: FormState, text: Catalogue, width: int) -> list[Line]:
    if state.naming_problem is not None:
        return hanging(("✗ ", Token.WARNING), text.problem(state.naming_problem), width, Token.WARNING)
    name = (state.naming or "").strip()
    if name and name == state.over:
        return wrap_line(text("setup.name_over", name=name), width, Token.DIM)
    if name:
        return wrap_line(text("setup.name_file", name=name), width, Token.DIM)
    return [(dim(text("setup.name_empty")),)]


def _name_label(text: Catalogue) -> Line:
    return (("▸ ", Token.ACTION), (text("setup.name") + " ", Token.STRONG))


def _label_width(width: int) -> int:
    """Return the label width: a narrow form shortens its labels before its values."""
    return max(min(_LABEL, width - _MARK - ENTRY_WIDTH - 2 - _UNIT), 4)
