"""Keys of the entry of the page Align: which number is asked for, and what becomes of it.

The entry lies over the panel that says how the number is understood.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from console.session.station.commands import Indicate, NoteSkim, TakeFingerprint, TakeTouchOff
from console.session.station.state import StationState
from console.tui.align.align_jog import JOGS, JogKeys
from console.tui.align.answers import interpret_entry
from console.tui.align.entry_context import (
    AXES,
    CLAMPING,
    ENTRY_WIDTH,
    ClampTyping,
    EntryContext,
    EntryKind,
    EntryValue,
)
from console.tui.controller.errand import Errand
from console.tui.entry import EntryLine
from console.tui.ui_context import KEYS, UiContext, View, refusal
from profiles.problem import Problem

if TYPE_CHECKING:
    from drivers.link.indicator import IndicatorReading

TARGETS, FORCES, DIAMETER = (EntryKind.Z, EntryKind.C), (EntryKind.TORQUE, EntryKind.FORCE), (EntryKind.DIAMETER,)
"""What one key asks for, one after the other."""

_NOTHING_TYPED = {
    EntryKind.DIAMETER: Problem(code="screen.no_diameter"),
    EntryKind.PLACES: Problem(code="screen.no_places"),
    EntryKind.READING: Problem(code="screen.no_reading"),
}
_NOT_MEANWHILE = (*JOGS, "align.step")
"""Keys that would move something else while a number is typed."""


_CAP_CHARACTERS = 12


class AlignEntry(EntryLine):
    """One number; `entry_kind` says which."""

    DEFAULT_CSS = f"AlignEntry {{ width: {ENTRY_WIDTH}; }}"

    def __init__(self) -> None:
        super().__init__(id="align-entry", cap_characters=_CAP_CHARACTERS)
        self.asked = EntryKind.NOTHING

    def open(self, asked: EntryKind) -> None:
        """Ask for a number."""
        self.asked = asked
        self.begin()

    def close(self) -> str:
        """Ask for nothing more; what was typed is forgotten."""
        typed = super().close()
        self.asked, self.value = EntryKind.NOTHING, ""
        return typed


class AskKeys:
    """Entry of one page. Nothing moves while a number is typed; F6 alone goes to a target."""

    def __init__(self, ui: UiContext, entry: AlignEntry, jog: JogKeys) -> None:
        self.ui, self._entry, self._jog = ui, entry, jog
        self._clamp = ClampTyping()
        self._errand: Errand[tuple[ClampTyping, IndicatorReading]] = Errand()

    @property
    def entry_kind(self) -> EntryKind:
        """What is asked for now."""
        return self._entry.asked

    @property
    def is_open(self) -> bool:
        """Whether a number is asked for."""
        return self._entry.asked is not EntryKind.NOTHING

    @property
    def asks_readings(self) -> bool:
        """Whether readings of an indicator on the part are asked for."""
        return self.entry_kind in CLAMPING

    def question(self, view: View) -> EntryContext:
        """Return what the entry is judged by."""
        return EntryContext(
            asked=self._entry.asked,
            typed=self._entry.value,
            state=view.state,
            job=view.job,
            machine=self.ui.machine.machine,
            units=self.ui.text.units,
            clamp=self._clamp,
            reads_itself=self.indicator is not None,
        )

    @property
    def indicator(self) -> str | None:
        """The line of the indicator that reads itself, None without one."""
        return None if self.ui.configuration is None else self.ui.configuration.value("indicator")

    def keep(self, state: StationState) -> None:
        """Keep the keys in the entry; close it where the machine takes no command any more."""
        clamping = state.alignment.clamping
        at = "" if clamping is None else clamping.at
        if at != self._clamp.at:  # what was typed is of a clamping that is no more
            self._clamp = ClampTyping(at=at)
            if self.asks_readings:
                self.close()
        if self.is_open and refusal(state, "align.goto"):
            self.close()
        if self._errand.has_news:
            self._show_read()
        self._entry.keep_focus()

    def close(self) -> None:
        """Close the entry."""
        self._entry.close()

    def ask(self, key: str, view: View) -> None:
        """Ask for what a key asks for, or close the entry after its last number. Nothing moves."""
        match key:
            case "align.goto":
                self._step(TARGETS)
            case "align.force":
                self._step(FORCES)
            case "align.skim":
                self._skim(view)
            case "align.clamping" if self.asks_readings:
                self.close()
            case "align.clamping":
                self._ask_clamp()
            case "align.flank":
                self._read()

    def _step(self, order: tuple[EntryKind, ...]) -> None:
        """Ask for the first of these, then for the next one, then for nothing."""
        place = order.index(self.entry_kind) + 1 if self.entry_kind in order else 0
        if place < len(order):
            self._entry.open(order[place])
        else:
            self.close()

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why a key is not taken because of the entry, or of what is typed."""
        if action == "align.go":
            return self._against_go(view)
        if self.is_open and action in _NOT_MEANWHILE:
            closing = KEYS["align.clamping" if self.asks_readings else "align.goto"]
            return (Problem(code="screen.entry_open", key=KEYS[action], value=closing),)
        if self.asks_readings and action == "align.flank":
            return self._against_reading()
        if not self.is_open or action != "align.take":
            return ()
        if self.entry_kind in TARGETS:
            return (Problem(code="screen.f6_goes"),)
        answer = self._answer(view)
        if answer.value is None and not answer.problems and self.entry_kind in _NOTHING_TYPED:
            return (_NOTHING_TYPED[self.entry_kind],)
        return answer.problems

    def take(self, view: View) -> None:
        """Take the diameter of a skim cut; a torque or a force was only asked for. Nothing moves."""
        asked, answer = self.entry_kind, self._answer(view)
        if asked in CLAMPING:
            self._take_clamp(view, answer.value)
            return
        self.close()
        if asked is EntryKind.DIAMETER and answer.value is not None:
            self.ui.control.post(TakeTouchOff(radius_mm=answer.value / 2.0, skimmed=True))

    def drop(self) -> bool:
        """Drop the last reading that was typed, if readings are asked for; return whether they are."""
        if not self.asks_readings:
            return False
        self._clamp = self._clamp.drop_last()
        self._ask_clamp()
        return True

    def _ask_clamp(self) -> None:
        """Ask for the readings of an indicator on the part, from where they were left."""
        typing = self._clamp
        asked = (
            EntryKind.INDICATED if typing.complete else EntryKind.READING if typing.places else EntryKind.PLACES
        )
        self._entry.open(asked)

    def _against_reading(self) -> tuple[Problem, ...]:
        """Return why the indicator cannot be read into the entry now."""
        if self.entry_kind is not EntryKind.READING:
            return (Problem(code="screen.no_flank_now"),)
        if self.indicator is None:
            return (Problem(code="screen.no_indicator_line"),)
        return (Problem(code="screen.indicator_read"),) if self._errand.running else ()

    def _read(self) -> None:
        """Ask the indicator for a reading, in a thread of its own: an instrument may take seconds."""
        from drivers.link.indicator import parse_indicator, read_indicator

        with self.ui.answering():
            line, typing = parse_indicator(self.indicator or ""), self._clamp
            self._entry.value = ""
            self._errand.start(None, lambda: (typing, read_indicator(line)))

    def _show_read(self) -> None:
        """Show in the entry what the indicator has read, if that reading is still asked for; or why nothing."""
        if self._errand.problems or self._errand.found is None:
            self.ui.key_answer = self._errand.problems
            return
        typing, read = self._errand.found
        if typing is self._clamp and self.entry_kind is EntryKind.READING and not self._entry.value:
            self._clamp = replace(typing, last_digit_um=max(typing.last_digit_um, read.resolution_um))
            self._entry.value = self.ui.text.units.figure(read.value_um, "um", 2, "+z")

    def _take_clamp(self, view: View, value: float | None) -> None:
        """Take a number of places, a reading, or all of them."""
        simulated = view.state.simulated
        if self.entry_kind is EntryKind.INDICATED and view.job is not None:
            readings = self._clamp.readings(simulated=simulated, inch=self.ui.text.units.is_inch)
            self.close()
            self._clamp = ClampTyping(at=self._clamp.at)
            self.ui.control.post(TakeFingerprint(job=view.job, readings=readings))
        elif value is not None:
            if self.entry_kind is EntryKind.PLACES and simulated:
                self.ui.control.post(Indicate(places=round(value)))
            self._clamp = self._clamp.with_value(value)
            self._ask_clamp()

    def _skim(self, view: View) -> None:
        """Note the skim cut where the tool stands; once it is noted, ask for its diameter."""
        if view.state.alignment.skim_counts is None and not self.is_open:
            self.ui.control.post(NoteSkim())
        else:
            self._step(DIAMETER)

    def go(self, view: View) -> None:
        """Go to the typed target, or show why not."""
        if self.ui.answers(self._against_go(view)):
            return
        asked, answer = self.entry_kind, self._answer(view)
        self.close()
        if answer.value is not None:
            self._jog.go(AXES[asked], answer.value)

    def _against_go(self, view: View) -> tuple[Problem, ...]:
        if reasons := refusal(view.state, "align.go"):
            return reasons
        if self.entry_kind not in TARGETS:
            return (Problem(code="screen.nothing_typed"),)
        answer = self._answer(view)
        if answer.problems:
            return answer.problems
        if answer.value is None:
            return (Problem(code="screen.nothing_typed"),)
        return self._jog.why_not_go(view.state, view.now_s)

    def _answer(self, view: View) -> EntryValue:
        return interpret_entry(self.question(view))
