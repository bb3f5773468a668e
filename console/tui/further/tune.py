"""Page Tune: the loop of the tool as the controller runs it, its margins, and the responses measured of it."""

from __future__ import annotations

from textual.events import Resize
from textual.geometry import Size

from console.session.station.commands import ReadLoop
from console.session.station.state import Activity, StationState
from console.tui.keymap import PageName
from console.tui.lines import Line, line
from console.tui.page import Page
from console.tui.records.beside import Beside, Problems
from console.tui.theme import Token
from console.tui.tuning.loop_facts import LoopFacts, loop_facts
from console.tui.tuning.loop_lines import loop_lines, reason_lines
from console.tui.tuning.panels import WIDE, LoopPanels, TuneView
from console.tui.tuning.problem_lines import problem_lines
from console.tui.ui_context import UiContext, View, refusal, waiting
from profiles.problem import Problem

STEPS = {"tune.up": -1, "tune.down": 1}


class TunePage(Page):
    """Nothing on it moves anything."""

    name_ = PageName.TUNE

    DEFAULT_CSS = """
    TunePage { .panel { border: round $secondary; border-title-color: $foreground; } }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._loop = LoopPanels(ui)
        self.panels = (self._loop,)
        self._beside: Beside[LoopFacts] = Beside()
        self._view = TuneView.LOOP
        self._facts: LoopFacts | Problems | None = None
        self._selected = 0
        self._visits, self._away = 0, True
        self._shown: object = None

    def act(self, action: str) -> None:
        """Read again, show something else, or choose a response."""
        if self.ui.answers(self.why_not(action, self.ui.view)):
            return
        if action == "tune.read":
            self.ui.control.post(ReadLoop())
            self._visits += 1
        elif action == "tune.view":
            views = tuple(TuneView)
            self._view = views[(views.index(self._view) + 1) % len(views)]
            self.fit()
        elif action in STEPS and isinstance(self._facts, LoopFacts):
            last = max(len(self._facts.responses) - 1, 0)
            self._selected = min(max(self._selected + STEPS[action], 0), last)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why the controller cannot be asked now."""
        return read_reasons(view.state) if action == "tune.read" else ()

    def fit(self) -> None:
        """Choose the layout for the room."""
        self._loop.lay_out(self._view, self.size)

    def on_resize(self, event: Resize) -> None:
        """Adapt to the new size."""
        self.fit()

    def show(self, view: View) -> None:
        """Read the loop when the page is shown, compute beside the screen, and paint what has changed."""
        if self._away:
            self._away, self._visits = False, self._visits + 1
            # It is asked by itself only where the answer can change nothing: a command would disarm a cut.
            if not read_reasons(view.state):
                self.ui.control.post(ReadLoop())
        state, machine, data = view.state, self.ui.machine.machine, self.ui.data
        question = (state.tool_loop, state.simulated, self._visits)
        self._facts = self._beside.answer(
            question, lambda: loop_facts(machine, state.tool_loop, data, simulated=state.simulated)
        )
        shown: tuple[object, ...] = (id(self._facts), self._selected, self._view, self._sizes)
        if shown != self._shown:
            self._shown = shown
            self._loop.show(self._facts, self._selected)

    def leave(self) -> None:
        """Read again when the page is shown the next time."""
        self._away = True

    def next_step(self, view: View) -> Line:
        """Return what the keys show."""
        plots = self._view is TuneView.LOOP and self.size.width < WIDE
        return line((self.ui.text("tune_page.next.plots" if plots else "tune_page.next.read"), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return margins, gains and the reasons against the selected response."""
        facts, text = self._facts, self.ui.text
        if not isinstance(facts, LoopFacts):
            return [] if facts is None else problem_lines(facts, text, width)
        seen = facts.responses[self._selected : self._selected + 1]
        return loop_lines(facts, text, width) + [row for each in seen for row in reason_lines(each, text, width)]

    @property
    def _sizes(self) -> tuple[Size, ...]:
        return (self.size, *self._loop.sizes)


def read_reasons(state: StationState) -> tuple[Problem, ...]:
    """Return why the controller is not asked now; the console that only observes may ask."""
    if state.activity is not Activity.READY or waiting(state) not in ("", "observing"):
        return refusal(state, "tune.read")
    return (Problem(code="screen.tune_armed"),) if state.armed is not None else ()
