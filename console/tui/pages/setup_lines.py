"""Text of the page Set-up: the form, the effect of speed on the grip, and the findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rich.cells import cell_len

from console.session.work import Work
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, clipped, dim, fact, fitted, hanging, line, width_of, wrapped
from console.tui.pages.fields import FORM, FormField, Judged, bounds, named, provenance, with_unit, written
from console.tui.theme import Token
from profiles.chucking.advice import ForceSpan, Stands, force_span
from profiles.chucking.grip import centrifugal_loss_n, grip_margin_n, wrench_force_sd_n
from profiles.chucking.holding import holding_of, torque_or_none_n_m
from profiles.findings import Finding, Severity
from profiles.job import Job
from profiles.lobe.lobe_conditions import changed_conditions, lobe_source
from profiles.machine import MachineProfile
from profiles.problem import Problem

ENTRY_WIDTH = 10
"""Cells of a number entry; a text takes all of its row."""

FOOT_ROWS = 2
LEAST_VALUES = 3
"""Rows of values that stay however long the text below them is."""

_MARK, _LABEL, _UNIT = 2, 15, 8
_SPEED_LABEL, _SPEED_WIDTH = 19, 46
_ROWS_WITH_BAR = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class FormState:
    """State of the form. `typed` is the text of the open entry, None when none is open.

    `naming` is the name typed to save under, `naming_problem` why it is refused.
    """

    work: Work
    selected: int = 0
    typed: str | None = None
    judged: Judged | None = None
    locked: Problem | None = None
    naming: str | None = None
    naming_problem: Problem | None = None

    @property
    def field(self) -> FormField:
        """The selected field."""
        return FORM[self.selected]


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """Lines of the form, and the position (column, row, cells) of the open entry."""

    lines: tuple[Line, ...]
    entry: tuple[int, int, int] | None


def form(state: FormState, text: Catalogue, width: int, height: int) -> Form:
    """Return the form in a size in cells; the selected field is always visible."""
    foot = _foot(state, text, width)
    foot += [BLANK] * (FOOT_ROWS - len(foot))
    # A longer refusal takes rows of the headings, then of the values that are not being changed.
    foot = clipped(foot, max(height - LEAST_VALUES, FOOT_ROWS), text("panel.more"))
    room = max(height - len(foot), 1)
    rows = _rows(room, state.selected)
    lines = [_row(row, state, text, width) for row in rows]
    if len(lines) < room:
        lines.append(BLANK)
    foot_row = len(lines)
    filled = [*lines, *foot, *_file_lines(state.work, text, width, height - foot_row - len(foot))][
        : max(height, 0)
    ]
    if state.naming is not None:
        column = width_of(_name_label(text))
        return Form(lines=tuple(filled), entry=(column + 1, foot_row, max(width - column - 2, 1)))
    if state.typed is None:
        return Form(lines=tuple(filled), entry=None)
    left = _MARK + _label_width(width) + 1
    cells = ENTRY_WIDTH if state.field.numeric else max(width - left - 1, 1)
    return Form(lines=tuple(filled), entry=(left, rows.index(state.field), cells))


def speed_lines(job: Job, machine: MachineProfile, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the effect of the job's force and speed on grip and lobe; the most important rows first."""
    margin_n, span = grip_margin_n(job, machine), force_span(job, machine)
    width = min(width, _SPEED_WIDTH)
    source = text(f"source.{lobe_source(job, chuck=machine.chuck.name, tool=machine.tool.name)}")
    head = [
        _fact(text("setup.grip"), f"{margin_n:.1f} N", width, Token.TEXT if margin_n >= 0 else Token.WARNING),
        _window_line(span, job, text, width),
        *([_window_bar(span, job, machine, width)] if height >= _ROWS_WITH_BAR else []),
        *_wrench_lines(job, machine, text, width),
    ]
    rows = (
        (text("setup.loss"), f"{centrifugal_loss_n(job, machine):.1f} N", Token.TEXT),
        (text("setup.lobe"), f"{job.lobe_frequency_hz:.1f} Hz", Token.TEXT),
        (text("setup.error"), f"{job.lobe_error_um_pp:.1f} um", Token.TEXT),
        (text("setup.error_at", source=source), f"{job.error_force_n:.1f} N", Token.TEXT),
    )
    return [*head, *(_fact(name, value, width, token) for name, value, token in rows)]


def _fact(name: str, value: str, width: int, token: Token) -> Line:
    """Return a label with its value; a longer value takes cells of its label."""
    label = min(_SPEED_LABEL, max(width - max(10, cell_len(value) + 1), 0))
    return fact(name, value, width, label_width=label, token=token)


def _window_line(span: ForceSpan, job: Job, text: Catalogue, width: int) -> Line:
    """Return the allowed forces; the label gives the position of the job's force."""
    least_n, most_n = span.whole_n
    stands = span.stands(job.chucking_force_n)
    token = Token.OK if stands is Stands.INSIDE else Token.WARNING
    return _fact(text(f"setup.window.{stands}"), f"{least_n} … {most_n} N", width, token)


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
    if torque_n_m is None:
        return [_fact(text("setup.wrench"), text("setup.no_torque"), width, Token.WARNING)]
    words = f"{torque_n_m:.2f} N m ±{wrench_force_sd_n(job, machine):.0f} N"
    return [_fact(text("setup.wrench"), words, width, Token.TEXT)]


def finding_lines(
    findings: Sequence[Finding],
    text: Catalogue,
    width: int,
    height: int | None = None,
    told: Sequence[Problem] = (),
) -> list[Line]:
    """Return unmet rules, then the warnings, then how many rules are met, and which if there is room.

    `told` are the warnings of the machine's calibrations, which are no rules. Without a height
    all of that is included.
    """
    refused = [finding.problem for finding in findings if finding.severity is Severity.REFUSAL]
    warned = [finding.problem for finding in findings if finding.severity is Severity.WARNING]
    lines: list[Line] = []
    for problems, mark in ((refused, ("✗ ", Token.ALARM)), ((*warned, *told), ("! ", Token.WARNING))):
        for problem in problems:
            lines += hanging(mark, text.problem(named(problem, text)), width)
    held = [finding for finding in findings if finding.severity is Severity.OK]
    if height is not None and len(lines) >= height:
        return clipped(lines, height, text("panel.more"))
    lines.append(line(("✓ ", Token.OK), text("setup.hold", count=len(held), total=len(findings))))
    names = [text(f"name.{finding.problem.code}") for finding in held]
    fitting = names if height is None else _as_fit(names, height - len(lines), text)
    return [*lines, *((dim(fitted("  " + name, width)),) for name in fitting)]


def _as_fit(names: list[str], rows: int, text: Catalogue) -> list[str]:
    """Return the names that fit; the last row gives the number left out."""
    if len(names) <= rows:
        return names
    kept = names[: max(rows - 1, 0)]
    if not kept:
        return []
    return [*kept, text("setup.more_hold", count=len(names) - len(kept))]


def draft(state: FormState) -> Job:
    """Return the job including the open entry."""
    return (state.judged.work if state.judged else state.work).job


def _rows(room: int, selected: int) -> list[FormField | str]:
    """Return the rows that fit: fields with headings and blanks between, or fewer of these, or a part."""
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
    label = fitted(text(f"setup.{row.key}"), _label_width(width))
    head: Line = (("▸ " if chosen else "  ", Token.ACTION), (label, Token.STRONG if chosen else Token.DIM))
    if chosen and state.typed is not None:
        return (*head, *_open_row(row, state, text, width))
    value = row.mark + written(row, state.work.job)
    token = Token.STRONG if chosen else Token.TEXT
    if not row.numeric and len(value) > ENTRY_WIDTH:
        return (*head, (" " + fitted(value, width - _MARK - len(label) - 2), token))
    shown = fitted(" " * (ENTRY_WIDTH + 1 - len(value)) + value, ENTRY_WIDTH + 1)
    return (*head, (shown, token), dim("  " + fitted(row.rule.unit, _UNIT - 1)), *_beside(row, state, text, width))


def _open_row(row: FormField, state: FormState, text: Catalogue, width: int) -> Line:
    """Return the row of an open entry, typed over the blanks between the brackets; its meaning follows it."""
    if not row.numeric:
        cells = max(width - _MARK - _label_width(width) - 2, 0)
        return line("[" + " " * cells + "]")
    field: Line = line("[" + " " * ENTRY_WIDTH + "]", dim(" " + fitted(row.rule.unit, _UNIT - 1)))
    judged = state.judged
    if judged is None or not (state.typed or "").strip():
        return field
    if judged.problems:
        return (*field, ("✗ " + text("setup.refused"), Token.WARNING))
    return (*field, (text("setup.understood", value=written(row, judged.work.job)), Token.OK))


def _beside(row: FormField, state: FormState, text: Catalogue, width: int) -> Line:
    """Return the text after a value: its limits while it is selected, else a note on it."""
    room = width - _MARK - _label_width(width) - ENTRY_WIDTH - 2 - _UNIT
    if room < ENTRY_WIDTH:
        return BLANK
    if row is state.field and bounds(row):
        return (dim(fitted(bounds(row), room)),)
    if row.key in changed_conditions(state.work.job):
        was = text("setup.lobe_was", value=_of_lobe(row, state.work.job))
        # A truncated number would be read as another one.
        return ((fitted(was if cell_len(was) <= room else text("setup.not_lobes"), room), Token.WARNING),)
    if getattr(state.work.job, row.key) != getattr(state.work.loaded.job, row.key):
        was = text("setup.was", value=written(row, state.work.loaded.job))
        return ((fitted(was, room), Token.WARNING),)
    if row.key in state.work.job.assumed:
        return (dim(fitted(text("setup.assumed"), room)),)
    return BLANK


def _foot(state: FormState, text: Catalogue, width: int) -> list[Line]:
    """Return the rows under the form, mostly two: the refusal in words, or what may be typed."""
    if state.naming is not None:
        brackets = "[" + " " * max(width - width_of(_name_label(text)) - 2, 0) + "]"
        return [(*_name_label(text), (brackets, Token.TEXT)), *_naming_words(state, text, width)]
    if state.typed is not None and state.judged and state.judged.problems:
        words = text.problem(named(state.judged.problems[0], text))
        return wrapped(words, width, Token.WARNING)
    if state.locked is not None:
        return wrapped("! " + text.problem(state.locked), width, Token.WARNING)
    rule, field, work = state.field.rule, state.field, state.work
    allowed = text("setup.allowed", limit=rule.limit) if field.numeric else text("setup.allowed_text")
    notes = []
    if field.key in changed_conditions(draft(state)):
        notes.append(text("setup.lobe_was_long", value=_of_lobe(field, draft(state))))
    elif state.typed is not None:
        notes.append(text("setup.keeps", value=with_unit(field, work.job)))
    elif getattr(work.job, field.key) != getattr(work.loaded.job, field.key):
        notes.append(text("setup.was_long", value=with_unit(field, work.loaded.job)))
    elif field.key in work.job.assumed:
        notes.append(text("setup.assumed_long"))
    return [(dim(fitted(words, width)),) for words in (allowed, *notes)]


def _of_lobe(field: FormField, job: Job) -> str:
    """Return the condition under which the lobe of the job was found, as its field shows it."""
    return with_unit(field, replace(job, **{field.key: changed_conditions(job)[field.key]}))


def _file_lines(work: Work, text: Catalogue, width: int, room: int) -> list[Line]:
    """Return the source of the values, for a form that has room below."""
    job = work.loaded.job
    lines = [
        BLANK,
        (dim(text("setup.file")),),
        line(dim("  " + fitted(text("setup.revision"), _LABEL)), f" {work.loaded.sha256[:6]}"),
        *(line("  ", *pieces) for pieces in wrapped(provenance(job, text), width - 2, Token.DIM)),
    ]
    return lines if len(lines) <= room else []


def _naming_words(state: FormState, text: Catalogue, width: int) -> list[Line]:
    name = (state.naming or "").strip()
    if not name:
        return [(dim(text("setup.name_empty")),)]
    if state.naming_problem is not None:
        return hanging(("✗ ", Token.WARNING), text.problem(state.naming_problem), width, Token.WARNING)
    return wrapped(text("setup.name_file", name=name), width, Token.DIM)


def _name_label(text: Catalogue) -> Line:
    return (("▸ ", Token.ACTION), (text("setup.name") + " ", Token.STRONG))


def _label_width(width: int) -> int:
    """Return the label width: a narrow form shortens its labels before its values."""
    return max(min(_LABEL, width - _MARK - ENTRY_WIDTH - 2 - _UNIT), 4)
