"""Page Calibrate: calibrations of the chuck with their plots, new points, and the lobes that jobs have taken."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from textual.geometry import Size

from console.session.data.calibrated_chuck import HOLD, large_step
from console.session.learning.chuck_calibrating import chuck_calibration, keep_chuck
from console.session.station.state import StationState
from console.tui.calibration.calibration_lines import fit_lines
from console.tui.calibration.chuck_facts import (
    LOBE,
    ChuckFacts,
    KeptCalibration,
    draft_facts,
    kept_facts,
    kept_list,
)
from console.tui.calibration.draft import AGAIN, MODULUS, TYPED_OUT, Draft, import_points, value_of, write_points
from console.tui.calibration.panels import WIDE, CalibratePanels, Kept
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import Line, line
from console.tui.page import Page, move_selection, rows_moved
from console.tui.records.background_reader import BackgroundReader, Problems
from console.tui.rows import problem_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.calibration.table import CalibrationKind
from profiles.fields import Field
from profiles.problem import Problem, ProfileError

KINDS = (CalibrationKind.WRENCH.value, CalibrationKind.DEFLECTION.value, LOBE, HOLD)
OF_PARTS = {LOBE: "screen.calibrate_lobe", HOLD: "screen.calibrate_hold"}  # no points are entered for these
OF_DRAFT = ("calibrate.undo", "calibrate.drop", "calibrate.keep", "calibrate.offset")
WRITES = ("calibrate.new", "calibrate.import", "calibrate.keep")
STATISTICS = "scipy.stats"
NO_FACTS = ChuckFacts()


class CalibratePage(Page):
    """Nothing on it moves anything."""

    name_ = PageName.CALIBRATE

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._all = CalibratePanels(ui)
        self.panels = (self._all,)
        self._lists: BackgroundReader[Kept] = BackgroundReader()
        self._details: BackgroundReader[ChuckFacts] = BackgroundReader()
        self._kind = 0
        self._plots = False
        self._selected = 0
        self._draft: Draft | None = None
        self._before: list[Draft | None] = []
        self._partial: tuple[float, ...] = ()
        self._kept: Kept | Problems | None = None
        self._facts: ChuckFacts | Problems | None = None
        self._fitted: tuple[Draft | None, ChuckFacts | Problems | None] = (None, None)
        self._visits, self._away = 0, True
        self._shown: object = None

    def act(self, action: str) -> None:
        """Choose, enter points, keep them."""
        if self._all.entry.is_open:
            if action == "calibrate.take":
                self._take()
                self.fit()
                return
            self._end_entry()
        if not self.ui.answers(self.why_not(action, self.ui.view)):
            self._do(action)
            self.fit()

    def _do(self, action: str) -> None:
        if (by := rows_moved(action, self._list_rows)) is not None:
            self._selected = move_selection(self._selected, by, self._count)
        elif action == "calibrate.kind":
            self._kind, self._selected = (self._kind + 1) % len(KINDS), 0
        elif action == "calibrate.view":
            self._plots = not self._plots
        elif action == "calibrate.new":
            self._begin_point()
        elif action == "calibrate.import":
            self._all.ask(None, "", self.ui.text("calibrate_page.path"))
        elif action == "calibrate.offset" and self._draft is not None:
            self._change(replace(self._draft, affine=not self._draft.affine))
        elif action == "calibrate.undo":
            self._draft = self._before.pop()
        elif action == "calibrate.drop":
            self._change(None)
        elif action == "calibrate.keep":
            self._keep()

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why there is nothing to keep or to enter now."""
        if action in WRITES and view.state.may_move:
            return (Problem(code="screen.calibrate_moving"),)
        if action in OF_DRAFT and self._draft is None and not (action == "calibrate.undo" and self._before):
            return (Problem(code="screen.calibrate_nothing"),)
        if action in ("calibrate.new", *OF_DRAFT) and KINDS[self._kind] in OF_PARTS:
            return (Problem(code=OF_PARTS[KINDS[self._kind]]),)
        if action == "calibrate.offset" and KINDS[self._kind] != CalibrationKind.WRENCH:
            return (Problem(code="screen.calibrate_offset"),)
        return self._keep_reasons() if action == "calibrate.keep" else ()

    def _keep_reasons(self) -> tuple[Problem, ...]:
        draft, facts = self._fitted
        if draft is not self._draft or facts is None:
            return (Problem(code="screen.calibrate_select"),)
        if not isinstance(facts, ChuckFacts):
            return facts
        return facts.problems or (() if facts.fit is not None else (Problem(code="screen.calibrate_nothing"),))

    def fit(self) -> None:
        """Choose the layout for the room."""
        self._all.lay_out(self.size, plots=self._plots)

    def show(self, view: View) -> None:
        """Read and fit beside the screen, and paint what has changed."""
        if self._away:
            self._away, self._visits = False, self._visits + 1
        if self._all.entry.is_open:
            if view.state.may_move:  # Space is a stop again, and no character
                self._end_entry()
            self._all.entry.keep_focus()
        self.fit()
        if can_fit(view.state):
            self._ask()
        row, draft = self._row, self._shown_draft
        question = (id(self._kept), id(self._facts), row, draft, self._selected, self._plots, self._kind)
        shown = (question, self._sizes, can_fit(view.state), self._all.entry.is_open)
        if shown == self._shown:
            return
        self._shown = shown
        note = "" if can_fit(view.state) else self.ui.text("calibrate_page.at_rest")
        title = self.ui.text(f"calibrate_page.kind.{KINDS[self._kind]}")
        self._all.show_list(self._kept, self._draft_here, self._selected, title, note)
        self._all.show_facts(self._facts, row, draft, KINDS[self._kind])

    @property
    def field(self) -> FieldKind:
        """A number, or the path of a file."""
        if not self._all.entry.is_open:
            return FieldKind.NONE
        return FieldKind.TEXT if self._all.entry.asked is None else FieldKind.NUMBER

    def leave(self) -> None:
        """End an entry; everything is read again when the page is shown the next time."""
        self._end_entry()
        self._away = True

    def next_step(self, view: View) -> Line:
        """Return what to do with what is shown."""
        if self._all.entry.is_open:
            step = "path" if self._all.entry.asked is None else "value"
        elif self._draft_here is not None:
            step = "draft"
        elif KINDS[self._kind] in OF_PARTS:
            step = KINDS[self._kind]
        else:
            step = "plots" if self.size.width < WIDE and not self._plots else "kept"
        return line((self.ui.text(f"calibrate_page.next.{step}"), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return the fit of the selected calibration, and what speaks against it."""
        if not isinstance(self._facts, ChuckFacts):
            return problem_lines(self._facts or (), self.ui.text, width)
        return fit_lines(self._facts, self._row, self.ui.text, width)

    def _ask(self) -> None:
        """Ask for the list and the selected calibration; both are read in threads."""
        machine, data, kind = self.ui.machine, self.ui.data, KINDS[self._kind]
        self._kept = self._lists.answer((kind, self._visits), lambda: kept_list(data, machine, kind))
        row, draft = self._row, self._shown_draft
        if draft is not None:
            self._facts = self._details.answer(draft, lambda: draft_facts(draft, machine.machine))
            self._fitted = draft, self._facts
        elif row is not None:
            self._facts = self._details.answer((row.file, self._visits), lambda: kept_facts(row))
        else:
            self._facts = NO_FACTS

    @property
    def _draft_here(self) -> Draft | None:
        draft = self._draft
        return draft if draft is not None and draft.kind == KINDS[self._kind] else None

    @property
    def _shown_draft(self) -> Draft | None:
        """The draft where it is the selected row."""
        return self._draft_here if self._selected == 0 else None

    @property
    def _row(self) -> KeptCalibration | None:
        kept = [each for each in self._kept or () if isinstance(each, KeptCalibration)]
        place = self._selected - (self._draft_here is not None)
        return kept[place] if 0 <= place < len(kept) else None

    @property
    def _count(self) -> int:
        kept = [each for each in self._kept or () if isinstance(each, KeptCalibration)]
        return len(kept) + (self._draft_here is not None)

    @property
    def _list_rows(self) -> int:
        """Rows that PgUp and PgDn go in the list."""
        return max(self._all.rows.size.height - 1, 1)

    @property
    def _sizes(self) -> tuple[Size, ...]:
        return (self.size, *self._all.sizes)

    def _change(self, draft: Draft | None) -> None:
        """Replace the draft; u brings the last one back."""
        self._before.append(self._draft)
        self._draft, self._selected = draft, 0
        if draft is not None:
            self._kind = KINDS.index(draft.kind)

    def _begin_point(self) -> None:
        kind = CalibrationKind(KINDS[self._kind])
        if self._draft is None or self._draft.kind is not kind:
            self._change(Draft(kind=kind))
        self._selected, self._partial = 0, ()
        self._next_value()

    def _next_value(self) -> None:
        """Ask for the next value of a point; most begin with that of the point before."""
        draft = self._draft
        assert draft is not None  # made when the entry began
        asked: Field = MODULUS if draft.wants_modulus else draft.fields[len(self._partial)]
        same = draft.rows and asked is not MODULUS and asked.key not in AGAIN
        units = self.ui.text.units
        words = self.ui.text(
            "calibrate_page.value",
            name=self.ui.text(f"calibrate_page.of.{asked.key}"),
            unit=units.unit(asked.unit),
            number=len(draft.rows) + 1,
        )
        before = units.format_short(draft.rows[-1][len(self._partial)], asked.unit) if same else ""
        self._all.ask(asked, before, words)

    def _take(self) -> None:
        """Take a value, and ask for the next one; an empty one ends the entry."""
        entry, draft = self._all.entry, self._draft
        words, asked = entry.value.strip(), entry.asked
        if not words:
            self._end_entry()
        elif asked is None:
            draft = import_points(Path(words).expanduser())
            self._end_entry()
            self._change(draft)
        elif asked is TYPED_OUT:
            self._keep(value_of(words, asked))
        elif draft is not None:
            unchanged = words == entry.began  # the value of the point before, which its digits here may round
            before = draft.rows[-1][len(self._partial)] if unchanged else None
            value = value_of(words, asked, self.ui.text.units) if before is None else before
            if asked is MODULUS:
                self._change(replace(draft, modulus_gpa=value))
            else:
                self._partial = (*self._partial, value)
            if len(self._partial) == len(draft.fields):
                self._change(draft.with_row(self._partial))
                self._partial = ()
            self._next_value()

    def _end_entry(self) -> None:
        """Close the entry; one that came to nothing leaves nothing behind."""
        if self._all.entry.is_open and self._draft is not None and self._draft.is_empty:
            self._draft = self._before.pop()
        self._partial = ()
        self._all.entry.close()
        self._all.row.display = False

    def _keep(self, typed: float | None = None) -> None:
        """Keep the fit as the command does, a large step if typed out; entered points get a file of their own."""
        (draft, facts), machine, data = self._fitted, self.ui.machine, self.ui.data
        if draft is None or not isinstance(facts, ChuckFacts) or facts.fit is None or facts.measured is None:
            return
        step = large_step(data, machine, chuck_calibration(machine, facts.measured, facts.fit, ""))
        if step is not None and not step.is_typed(typed):
            self._all.ask(TYPED_OUT, "", self.ui.text("calibrate_page.type_out"))
            raise ProfileError(step.problem())
        self._end_entry()
        file = draft.file or str(write_points(draft, data, machine.machine.name))
        path = keep_chuck(data, chuck_calibration(machine, facts.measured, facts.fit, file), machine, typed)
        self._draft, self._before, self._fitted = None, [], (None, None)
        self._visits += 1
        self.ui.say("screen.calibrate_kept", value=path.name)


def can_fit(state: StationState) -> bool:
    """Whether a fit may be computed: in motion scipy is not loaded, because its import holds up the threads."""
    return not state.may_move or STATISTICS in sys.modules
