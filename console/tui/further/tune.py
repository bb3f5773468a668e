"""Page Tune: the loop of the tool as the controller runs it, the responses measured of it, its health tests."""

from __future__ import annotations

import sys

from textual.events import Resize
from textual.geometry import Size

from console.session.data.health import kept_tests
from console.session.station.commands import ReadLoop
from console.session.station.state import Activity, StationState
from console.session.trial.proposal import GainFacts, gain_facts
from console.tui.keymap import PageName
from console.tui.lines import Line, Sheet, clipped, dim, line
from console.tui.page import Page
from console.tui.records.beside import Beside, Problems
from console.tui.theme import Token
from console.tui.tuning.arming import ARMED_S, KINDS, ArmedTest, arm_reasons, command_of, holds, moment_of
from console.tui.tuning.gain_lines import gain_proposal_lines
from console.tui.tuning.health_lines import armed_lines
from console.tui.tuning.health_panels import HealthPanels, Tests
from console.tui.tuning.loop_facts import LoopFacts, loop_facts
from console.tui.tuning.loop_lines import loop_lines, reason_lines
from console.tui.tuning.panels import WIDE, LoopPanels, TuneView
from console.tui.tuning.problem_lines import problem_lines
from console.tui.tuning.trial_keys import APPLY, REVERT, AskedGains, asked, trial_reasons
from console.tui.tuning.trial_lines import asked_lines, trial_lines, trial_warning
from console.tui.ui_context import UiContext, View, refusal, waiting
from drivers.identification.request import AMPLITUDE_UM
from profiles.problem import Problem

STEPS = {"tune.up": -1, "tune.down": 1, "tune.first": -sys.maxsize, "tune.last": sys.maxsize}
PAGES = {"tune.page_up": -1, "tune.page_down": 1}
MOST_TESTS = 200
BEFORE_A_TEST = {
    "alignment.drives_off": "align",
    "alignment.not_homed": "align",
    "machine.tool_in_part": "away",
}
"""What comes before a test, by the reason why it cannot be armed."""


class TunePage(Page):
    """What F5 has armed, F6 starts; nothing else on it moves anything. Pressed twice, a and b write gains."""

    name_ = PageName.TUNE

    DEFAULT_CSS = """
    TunePage { .panel { border: round $secondary; border-title-color: $foreground; } }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._loop, self._health = LoopPanels(ui), HealthPanels(ui)
        self._proposal = Sheet(ui.palette, id="tune-proposal", classes="panel")
        self._proposal.styles.height = "1fr"
        self.panels = (self._loop, self._health, self._proposal)
        self._loops: Beside[LoopFacts] = Beside()
        self._kept: Beside[Tests] = Beside()
        self._gains: Beside[GainFacts] = Beside()
        self._view = TuneView.LOOP
        self._facts: LoopFacts | Problems | None = None
        self._tests: Tests | Problems | None = None
        self._proposed: GainFacts | Problems | None = None
        self._selected = 0
        self._kind = KINDS[0]
        self._armed: ArmedTest | None = None
        self._asked: AskedGains | None = None
        self._visits, self._away = 0, True
        self._shown: object = None

    def act(self, action: str) -> None:
        """Read again, show something else, choose, or test."""
        if self.ui.answers(self.why_not(action, self.ui.view)):
            return
        if action != "tune.start":
            self._armed = None  # another key is a change of mind
        if action in (APPLY, REVERT):
            self._write(action)
            self.fit()
            return
        self._asked = None
        if action == "tune.read":
            self.ui.control.post(ReadLoop())
            self._visits += 1
        elif action == "tune.view":
            self._next_view()
        elif action in STEPS or action in PAGES:
            by = STEPS[action] if action in STEPS else PAGES[action] * self._list_rows
            self._selected = min(max(self._selected + by, 0), max(self._count - 1, 0))
        elif action == "tune.kind":
            self._kind = KINDS[(KINDS.index(self._kind) + 1) % len(KINDS)]
            self._view = TuneView.TESTS
        elif action == "tune.arm":
            state, now_s = self.ui.control.state, self.ui.control.now_s()
            self._armed = ArmedTest(kind=self._kind, until_s=now_s + ARMED_S, moment=moment_of(state))
            self._view = TuneView.TESTS
        elif action == "tune.start" and self._armed is not None:
            self.ui.control.post(command_of(self._armed.kind))
            self._armed = None
        self.fit()

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why the controller cannot be asked, or the tool not be tested now."""
        if action == "tune.read":
            return read_reasons(view.state)
        if action == "tune.arm":
            return arm_reasons(self._kind, view.state, self.ui.machine.machine)
        if action == "tune.start":
            reasons = arm_reasons(self._kind, view.state, self.ui.machine.machine)
            armed = holds(self._armed, view.state, view.now_s)
            return reasons or (() if armed else (Problem(code="screen.tune_not_armed"),))
        if action in (APPLY, REVERT):
            shown = self._view is TuneView.GAINS
            return trial_reasons(action, view.state, self._proposed, shown=shown)
        return ()

    def fit(self) -> None:
        """Choose the layout for the room."""
        self._health.display = self._view is TuneView.TESTS
        self._proposal.display = self._view is TuneView.GAINS
        self._loop.display = not (self._health.display or self._proposal.display)
        self._loop.lay_out(self._view, self.size)
        self._health.lay_out(self.size)

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
        if not holds(self._armed, view.state, view.now_s):
            self._armed = None
        if self._asked is not None and not self._asked.holds(self._asked.action, view.state, view.now_s):
            self._asked = None
        self.fit()
        self._ask(view.state)
        armed = self._armed_lines(view.now_s)
        trial = self._trial_lines(view)
        found = (id(self._facts), id(self._tests), id(self._proposed))
        shown: tuple[object, ...] = (*found, self._selected, self._view, self._kind, self._sizes)
        if (shown, armed, trial) != self._shown:
            self._shown = (shown, armed, trial)
            if self._view is TuneView.TESTS:
                self._health.show(self._tests, self._selected, armed, self._kind)
            elif self._view is TuneView.GAINS:
                size = self._proposal.size
                lines = [*trial, *self._proposal_lines(max(size.width, 1))]
                title = self.ui.text("tune_page.proposal")
                self._proposal.show(clipped(lines, size.height, self.ui.text("panel.more")), title)
            else:
                standing, width = view.state.trial, max(self._loop.facts.size.width, 1)
                warning = [] if standing is None else trial_warning(standing, self.ui.text, width)
                self._loop.show(self._facts, self._selected, warning)

    def leave(self) -> None:
        """Disarm, and read again when the page is shown the next time."""
        self._away, self._armed, self._asked = True, None, None

    def next_step(self, view: View) -> Line:
        """Return what the keys show, or start."""
        step = "read"
        if self._armed is not None:
            step = "armed"
        elif self._asked is not None:
            step = "write" if self._asked.action == APPLY else "write_back"
        elif self._view is TuneView.TESTS:
            step = self._test_step(view)
        elif self._view is TuneView.GAINS:
            step = "gains" if view.state.trial is None else "trial"
        elif self._view is TuneView.LOOP and self.size.width < WIDE:
            step = "plots"
        kind = self.ui.text(f"tune_page.kind.{self._kind}")
        return line((self.ui.text(f"tune_page.next.{step}", kind=kind), Token.ACTION))

    def _test_step(self, view: View) -> str:
        """Return what comes before a test; what else stands against it F5 says."""
        first = next(iter(arm_reasons(self._kind, view.state, self.ui.machine.machine)), None)
        return "arm" if first is None else BEFORE_A_TEST.get(first.code, "not_now")

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return margins, gains and the reasons against the selected response; or what F6 will do."""
        facts, text = self._facts, self.ui.text
        if self._view is TuneView.TESTS:
            return self._armed_lines(view.now_s, width)
        if self._view is TuneView.GAINS:
            return [*self._trial_lines(view, width), *self._proposal_lines(width)]
        if not isinstance(facts, LoopFacts):
            return [] if facts is None else problem_lines(facts, text, width)
        seen = facts.responses[self._selected : self._selected + 1]
        return loop_lines(facts, text, width) + [row for each in seen for row in reason_lines(each, text, width)]

    def _ask(self, state: StationState) -> None:
        machine, data, version = self.ui.machine.machine, self.ui.data, (self._visits, state.tested)
        if self._view is TuneView.TESTS:
            self._tests = self._kept.answer(version, lambda: kept_tests(data, machine.name, MOST_TESTS))
            return
        loop, simulated, firmware = state.tool_loop, state.simulated, state.firmware
        question = (loop, simulated, firmware, version)
        if self._view is TuneView.GAINS:
            if not state.may_move:  # it is some hundred loops: time that nothing else should lack
                self._proposed = self._gains.answer(
                    question, lambda: gain_facts(machine, loop, data, firmware, simulated=simulated)
                )
            return
        self._facts = self._loops.answer(question, lambda: loop_facts(machine, loop, data, simulated=simulated))

    def _armed_lines(self, now_s: float, width: int | None = None) -> list[Line]:
        armed = self._armed
        if armed is None:
            return []
        room = max(self._health.figures.size.width, 1) if width is None else width
        left_s = max(armed.until_s - now_s, 0.0)
        return armed_lines(armed.kind, self.ui.text, room, step_um=AMPLITUDE_UM, left_s=left_s)

    def _write(self, action: str) -> None:
        """Ask with the first press, write with the second; a revert is shown where its gains are."""
        control = self.ui.control
        state, now_s, waited = control.state, control.now_s(), self._asked
        if waited is not None and waited.holds(action, state, now_s):
            control.post(waited.command)
            self._asked = None
            return
        self._view, self._selected = TuneView.GAINS, 0
        self._asked = asked(action, state, self._proposed, now_s)

    def _trial_lines(self, view: View, width: int | None = None) -> list[Line]:
        trial, waited = view.state.trial, self._asked
        room = max(self._proposal.size.width, 1) if width is None else width
        lines = [] if waited is None else asked_lines(waited, self.ui.text, room, waited.until_s - view.now_s)
        return lines if trial is None else lines + trial_lines(trial, self.ui.text, room)

    def _proposal_lines(self, width: int) -> list[Line]:
        text, found = self.ui.text, self._proposed
        if isinstance(found, GainFacts):
            return gain_proposal_lines(found, text, width)
        return [line(dim(text("tune_page.computing")))] if found is None else problem_lines(found, text, width)

    def _next_view(self) -> None:
        views = tuple(TuneView)
        self._view, self._selected = views[(views.index(self._view) + 1) % len(views)], 0
        if self._view is TuneView.BODE and self.size.width >= WIDE:  # it is beside the texts
            self._next_view()

    @property
    def _count(self) -> int:
        if self._view is TuneView.TESTS:
            return len(self._tests or ())
        if self._view is TuneView.GAINS:
            return 0
        return len(self._facts.responses) if isinstance(self._facts, LoopFacts) else 0

    @property
    def _list_rows(self) -> int:
        """Rows that PgUp and PgDn go in the list that is shown."""
        panel = self._health.trend if self._view is TuneView.TESTS else self._loop.responses
        return max(panel.size.height - 1, 1)

    @property
    def _sizes(self) -> tuple[Size, ...]:
        return (self.size, *self._loop.sizes, *self._health.sizes, self._proposal.size)


def read_reasons(state: StationState) -> tuple[Problem, ...]:
    """Return why the controller is not asked now; the console that only observes may ask."""
    if state.activity is not Activity.READY or waiting(state) not in ("", "observing"):
        return refusal(state, "tune.read")
    return (Problem(code="screen.tune_armed"),) if state.armed is not None else ()
