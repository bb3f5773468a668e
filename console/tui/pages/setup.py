"""Page Set-up: the values of the job, checked as they are typed."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum, auto

from textual.containers import Vertical

from console.session.data.calibrated_chuck import warnings_of
from console.session.data.kept_files import jobs_folder
from console.session.work import Work, lobe_choices, save_work, saved_as, undone, with_lobe_from
from console.tui.entry import NUMBER_CAP_CHARACTERS, EntryLine
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import NOTHING, Line, Sheet, clip_lines, dim, hanging, line, name_in, wrap_line
from console.tui.page import Page
from console.tui.pages import setup_lines
from console.tui.pages.fields import (
    FORM,
    LOCKED,
    STEPS,
    FormField,
    entry_of,
    free_name,
    judge,
    name_field,
    name_problem,
    suggested_name,
    why_not_changed,
    with_unit,
)
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View, find_job_lock
from profiles.fields import TEXT_CAP_CHARACTERS
from profiles.files import printable
from profiles.findings import Severity, refusals
from profiles.problem import Problem
from profiles.rules import check
from profiles.store import list_jobs

_TIGHT_BELOW_ROWS = 16


class OpenEntry(Enum):
    """Kind of open entry."""

    NOTHING = auto()
    VALUE = auto()
    NAME = auto()


class SetupPage(Page):
    """A form, and beside it the consequences of its values."""

    name_ = PageName.SETUP
    SCOPED_CSS = False  # the size classes are set on the screen

    DEFAULT_CSS = """
    SetupPage {
        layout: horizontal;
        layers: base entry;
        Sheet { border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground; }
        .form { width: 62%; height: 1fr; }
        .side { width: 1fr; height: 1fr; }
        .speed { height: 9; }
        .findings { height: 1fr; }
        .entry { width: 10; }
    }
    SetupPage.tight .speed { height: 5; }
    .-mid SetupPage .speed { height: 10; }
    .-tall SetupPage .speed { height: 10; }
    .-medium SetupPage .form { width: 54; }
    .-wide SetupPage .form { width: 72; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._form = Sheet(ui.palette, classes="form")
        self._speed = Sheet(ui.palette, classes="speed")
        self._findings = Sheet(ui.palette, classes="findings")
        self._entry = EntryLine(classes="entry")
        self.panels = (self._form, Vertical(self._speed, self._findings, classes="side"), self._entry)
        self._entering = OpenEntry.NOTHING
        self._selected = 0
        self._taken: frozenset[str] = frozenset()
        self._over: str | None = None
        self._uncommissioned: tuple[Problem, ...] = ()
        self._locked: Problem | None = None
        self._placed: tuple[int, int, int] | None = None
        self._shown: object = None
        self._shown_work: Work | None = None
        self._machine = ui.machine.machine
        self._warnings = warnings_of(ui.machine)

    def fit(self) -> None:
        """Keep room for the findings on a low terminal."""
        self.set_class(self.size.height < _TIGHT_BELOW_ROWS, "tight")

    @property
    def field(self) -> FieldKind:
        """A number, or free text, while an entry is open."""
        if self._entering is OpenEntry.NOTHING:
            return FieldKind.NONE
        return FieldKind.NUMBER if self._entering is OpenEntry.VALUE and self._field.numeric else FieldKind.TEXT

    def show(self, view: View) -> None:
        """Show the job, with the open entry."""
        self._locked = find_job_lock(view.state, *LOCKED)
        self._uncommissioned = view.state.uncommissioned
        if self.ui.copying and self.ui.work is not None:
            self.ui.copying = False
            self._ask_name(self.ui.work, copying=True)
        if self._locked is not None and self._entering is not OpenEntry.NOTHING:
            self._drop()
        self._entry.keep_focus()
        self._paint()

    def act(self, action: str) -> None:
        """Select, change, undo or save; an open entry first gets the characters that came before."""
        if self._entering is OpenEntry.NOTHING:
            self._do(action)
        else:
            self._entry.call_later(self._do, action)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why a key of the form has no effect now; an open entry is judged when it ends."""
        return why_not_changed(action, self._work, view.state)

    def next_step(self, view: View) -> Line:
        """Return what to do with the form."""
        return line((self._next_words(), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return why the values are locked or the entry is refused, then every finding."""
        work, text = self._work, self.ui.text
        if work is None:
            return []
        state = self._state(work)
        refused = () if state.judged is None else state.judged.problems
        rows: list[Line] = []
        if work.missing:
            return setup_lines.missing_lines(state, text, width)
        for problem in filter(None, (*refused, self._locked)):
            rows += hanging(("! ", Token.WARNING), text.problem(name_field(problem, text)), width)
        found = check(setup_lines.draft(state), self._machine)
        return [
            *rows,
            *setup_lines.finding_lines(found, text, width, told=self._warnings, stops=self._uncommissioned),
        ]

    def leave(self) -> None:
        """End an open entry: accept a good value, drop another one and report it."""
        if self._entering is OpenEntry.NAME or not self._take():
            self._drop()
        self._paint()

    def on_input_changed(self) -> None:
        """Check the entry at every keystroke."""
        self._paint()

    # What the keys do ------------------------------------------------------------------------------------------

    def _do(self, action: str) -> None:
        work, idle = self._work, self._entering is OpenEntry.NOTHING
        if work is None or (idle and self.why_not(action, self.ui.view)):
            self.ui.answers(self.why_not(action, self.ui.view))
        elif action in STEPS:
            self._step(STEPS[action])
        elif action == "setup.edit":
            match self._entering:
                case OpenEntry.NOTHING:
                    self._begin()
                case OpenEntry.VALUE:
                    self._take()
                case OpenEntry.NAME:
                    self._save()
        elif action == "setup.undo" and not idle:
            self._close()
        elif action == "setup.undo":
            self._keep(undone(work))
        elif action == "setup.save_as" and self._take():
            self._ask_name(self._work or work)
        self._paint()

    @property
    def _work(self) -> Work | None:
        """The job in the form: the new one, or the open one."""
        return self.ui.draft or self.ui.work

    def _keep(self, work: Work) -> None:
        """Take a change of the job in the form."""
        if self.ui.draft is not None:
            self.ui.draft = work
        else:
            self.ui.work = work

    def _step(self, by: int) -> None:
        """Select the next or previous field; an open entry moves along, and ends after the last entry."""
        typing = self._entering is OpenEntry.VALUE
        if self._entering is OpenEntry.NAME or not self._take():
            return
        before, self._selected = self._selected, min(max(self._selected + by, 0), len(FORM) - 1)
        if typing and self._selected != before and not self._field.has_choices:
            self._begin()

    def _begin(self) -> None:
        """Open an entry in the selected field, with its value marked so that typing replaces it."""
        work, field = self._work, self._field
        if work is None or self._refused_by_lock():
            return
        if field.has_choices:
            self._choose_lobe(work)
            return
        self._entry.max_length = NUMBER_CAP_CHARACTERS if field.numeric else TEXT_CAP_CHARACTERS
        self._open(OpenEntry.VALUE, entry_of(field, work, self.ui.text.units))

    def _choose_lobe(self, work: Work) -> None:
        """Take the lobe from its next source; one that cannot be is reported, and passed over."""
        choices = lobe_choices(work)
        now = choices.index(work.job.lobe_error_source) if work.job.lobe_error_source in choices else 0
        for source in (*choices[now + 1 :], *choices[:now]):
            with self.ui.answering():
                self._keep(with_lobe_from(work, source))
                return

    def _take(self) -> bool:
        """End an open entry with its value; False, with the reason shown, if it does not parse."""
        work = self._work
        if self._entering is not OpenEntry.VALUE or work is None:
            return True
        if self._refused_by_lock():
            return False
        judged = judge(work, self._field, self._entry.value, self.ui.text.units)
        if judged.problems:
            self.ui.key_answer = tuple(name_field(problem, self.ui.text) for problem in judged.problems)
            return False
        self._keep(judged.work)
        self._close()
        return True

    def _ask_name(self, work: Work, *, copying: bool = False) -> None:
        """Ask for a name: that of its own file for changes to it, else a free one; none for an unfinished job."""
        if self._entering is OpenEntry.NAME or self._refused_by_lock():
            return
        if work.missing:
            self.ui.say("screen.values_missing", value=str(len(work.missing)))
            return
        self._taken = frozenset(entry.name for entry in list_jobs(jobs_folder(self.ui.data)))
        self._entry.max_length = TEXT_CAP_CHARACTERS
        own, self._over = work.loaded.path.stem, None
        if work is self.ui.draft:
            suggested = suggested_name(work.job)
            own = free_name(suggested, self._taken) if suggested in self._taken else suggested
        elif work.is_own and work.edited and not copying:
            self._over = own
            self._taken -= {own}
        else:
            own = free_name(own, self._taken)
        self._open(OpenEntry.NAME, own)

    def _save(self) -> None:
        name = self._entry.value.strip()
        problem = name_problem(name, self._taken) if name else None
        if problem is not None:
            self.ui.key_answer = (problem,)
        elif not name or (work := self._work) is None:
            self._close()
        else:
            with self.ui.answering():
                over = name == self._over
                self.ui.work = save_work(work) if over else saved_as(work, name, jobs_folder(self.ui.data))
                self.ui.draft = None
                self._close()

    def _drop(self) -> None:
        if self._entering is OpenEntry.NAME:
            self.ui.say("screen.not_saved")
        elif (work := self._work) is not None:
            field = self._field
            kept = NOTHING if field.key in work.missing else with_unit(field, work.job, self.ui.text.units)
            value = printable(self._entry.value)
            dropped = Problem(code="screen.entry_dropped", key=field.key, value=value, limit=kept)
            self.ui.key_answer = (name_field(dropped, self.ui.text),)
        self._close()

    def _refused_by_lock(self) -> bool:
        if lock := find_job_lock(self.ui.control.state, *LOCKED):
            self.ui.key_answer = (lock,)
        return lock is not None

    def _open(self, entering: OpenEntry, value: str) -> None:
        self._entering = entering
        self._entry.begin(value, marked=True)

    def _close(self) -> None:
        self._entering = OpenEntry.NOTHING
        self._entry.close()

    # What is shown ---------------------------------------------------------------------------------------------

    @property
    def _field(self) -> FormField:
        return FORM[self._selected]

    def _state(self, work: Work) -> setup_lines.FormState:
        state = setup_lines.FormState(work=work, selected=self._selected, locked=self._locked)
        value = self._entry.value
        if self._entering is OpenEntry.VALUE:
            return replace(state, typed=value, judged=judge(work, self._field, value, self.ui.text.units))
        if self._entering is OpenEntry.NAME:
            problem = name_problem(value.strip(), self._taken) if value.strip() else None
            return replace(state, naming=value, naming_problem=problem, over=self._over)
        return state

    def _paint(self) -> None:
        work = self._work
        sizes = (self._form.size, self._speed.size, self._findings.size)
        shown = (self._entering, self._entry.value, self._selected, self._locked, self._uncommissioned, sizes)
        if work is self._shown_work and shown == self._shown:
            return
        self._shown_work, self._shown = work, shown
        text = self.ui.text
        if work is None:
            how = [line(text("setup.no_job")), line(dim(text("setup.how_to_open")))]
            self._form.show(how, text("setup.no_title"))
            self._speed.show((), "")
            self._findings.show((), "")
            return
        state = self._state(work)
        layout = setup_lines.form(state, text, *self._form.size)
        title = text("setup.title", name=name_in(printable(work.job.name), self._form.size.width - 12))
        title = title if work.job.name else text("setup.new_title")
        self._form.show(layout.lines, title, text("setup.edited") if work.edited else "")
        self._place(layout.entry)
        job = setup_lines.draft(state)
        if (state.judged.work if state.judged else work).missing:
            self._speed.show(wrap_line(text("setup.no_figures"), max(self._speed.size.width, 1), Token.DIM), "")
            rows = setup_lines.missing_lines(state, text, max(self._findings.size.width, 1))
            self._findings.show(
                clip_lines(rows, self._findings.size.height, text("panel.more")), text("setup.missing")
            )
            return
        speed = setup_lines.speed_lines(job, self._machine, text, *self._speed.size)
        self._speed.show(speed, text("setup.at_speed", speed=f"{job.spindle_speed_rpm:.1f}"))
        found, stops = check(job, self._machine), self._uncommissioned
        findings = setup_lines.finding_lines(found, text, *self._findings.size, self._warnings, stops)
        self._findings.show(findings, text("setup.findings" if job is work.job else "setup.findings_draft"))

    def _place(self, entry: tuple[int, int, int] | None) -> None:
        """Place the entry over the brackets that the form keeps for it; the frame takes a cell on each side."""
        if entry is not None and entry != self._placed:
            column, row, cells = self._placed = entry
            self._entry.styles.offset = (column + 1, row + 1)
            self._entry.styles.width = cells

    def _next_words(self) -> str:
        text, work = self.ui.text, self._work
        if work is None:
            return text("setup.next.no_job")
        if self._entering is OpenEntry.NAME:
            over = self._over is not None and self._entry.value.strip() == self._over
            return text("setup.next.naming_over" if over else "setup.next.naming")
        if self._entering is OpenEntry.VALUE:
            refused = judge(work, self._field, self._entry.value, self.ui.text.units).problems
            return text("setup.next.refused_entry") if refused else text("setup.next.entry")
        if self._locked is not None:
            return text("setup.next.locked")
        if work.missing:
            return text("setup.next.missing", count=len(work.missing))
        findings = check(work.job, self._machine)
        if refusing := refusals(findings):
            return text("setup.next.refused", count=len(refusing))
        if work is self.ui.draft:
            return text("setup.next.save_new")
        if self._uncommissioned:
            return text("setup.next.uncommissioned")
        if lobe := setup_lines.lobe_word(work, self._machine, simulated=self.ui.control.state.simulated):
            return text(f"setup.next.{lobe}")
        warned = self._warnings or any(finding.severity is Severity.WARNING for finding in findings)
        return text("setup.next.warned") if warned else text("setup.next.ready")
