"""Keys of the palette: what it offers now, the words that are typed, the action that is taken."""

from __future__ import annotations

from collections.abc import Callable

from console.tui.gate import REPEAT_S
from console.tui.keymap import Action, PageName
from console.tui.list_panel import PAGE, ListPanel, WhyNot, entries
from console.tui.ui_context import UiContext

JUDGED_FOR_S = 5.0  # time after which the reasons are found anew: an enable of the jog ends by itself


class PaletteKeys:
    """Keys of the open palette. Its entries are judged anew when something changed that the reasons refer to.

    Not at every tick: some reasons need a look into a folder.
    """

    def __init__(self, ui: UiContext, panel: ListPanel, why_not: WhyNot) -> None:
        self._ui, self._panel, self._why_not = ui, panel, why_not
        self._taken_s = float("-inf")
        self._judged_for: tuple[object, ...] = ()
        self._opening, self._judged_s = 0, float("-inf")

    def offer(self, page: PageName) -> None:
        """Show every action with why it cannot be done now."""
        ui, state, now_s = self._ui, self._ui.control.state, self._ui.control.now_s()
        judged_for: tuple[object, ...] = (
            page,
            ui.work,
            ui.draft,
            state.activity,
            state.stop,
            state.armed,
            state.controls,
            state.alignment,
            state.measured,
            state.cut_done,
            bool(state.alarms),
        )
        before = self._judged_for
        alike = len(before) == len(judged_for) and all(a is b for a, b in zip(before, judged_for, strict=True))
        opening = self._panel.opening
        if not alike or opening != self._opening or now_s - self._judged_s > JUDGED_FOR_S:
            self._judged_for, self._opening, self._judged_s = judged_for, opening, now_s
            self._panel.search(entries(ui.text, page, self._why_not, ui.appearance.keys))

    def write(self, key: str, character: str | None) -> None:
        """Take a key of the entry: a character, or Backspace, which without a character closes the palette."""
        self._ui.key_answer = ()
        if not self._panel.write(key, character):
            self._panel.open(PAGE)

    def take(self, page: PageName, perform: Callable[[Action], None]) -> None:
        """Perform the selected action, or show its page; what moves the machine is left to its key."""
        entry, ui = self._panel.selected_entry, self._ui
        if entry is None:
            return
        action = entry.action
        if action.page not in (None, page):
            assert action.page is not None
            self._taken_s = ui.control.now_s()
            ui.go(action.page)
            ui.say("screen.palette_page", key=action.shown)
        elif ui.answers(self._why_not(action)):
            return
        elif entry.is_started:
            self._taken_s = ui.control.now_s()
            ui.key_answer = ()
            self._panel.open(PAGE)
            perform(action)
        else:
            ui.say("screen.palette_moves", key=action.shown)

    def still_taking(self) -> bool:
        """Whether Enter is still held down since it took an action: it is for no page."""
        now_s = self._ui.control.now_s()
        if now_s - self._taken_s >= REPEAT_S:
            return False
        self._taken_s = now_s
        return True
