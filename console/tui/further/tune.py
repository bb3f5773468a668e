"""Page Tune: the loop of the tool as the controller runs it, the responses measured of it, its health tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from textual.containers import Horizontal, Vertical
from textual.geometry import Size

from console.session.data.health import KeptHealth, kept_tests
from console.session.guide.waiting import waiting
from console.session.station import jogging
from console.session.station.commands import ApplyGains, CheckHealth, Command, IdentifyTool, ReadLoop, RevertGains
from console.session.station.state import Activity, StationState
from console.session.tuning.proposal import GainFacts, gain_facts
from console.session.tuning.standing_trial import Gains, StandingTrial, format_gains
from console.text.catalogue import Catalogue
from console.tui.further.health_lines import (
    armed_lines,
    figure_lines,
    kind_lines,
    other_gain_lines,
    step_picture,
    trend_lines,
)
from console.tui.further.loop_lines import LoopFacts, loop_facts, loop_lines, reason_lines
from console.tui.further.tune_panels import WIDE, LoopPanels, TuneView
from console.tui.keymap import PageName
from console.tui.lines import (
    BLANK,
    NOTHING,
    Line,
    Sheet,
    clip_lines,
    dim,
    entitle,
    fit_text,
    hanging,
    line,
    to_the_right,
)
from console.tui.page import Page, move_selection, rows_moved
from console.tui.plot.trace_view import TraceView
from console.tui.records.background_reader import BackgroundReader, Problems
from console.tui.rows import problem_lines, wrap_problems
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View, refusal
from drivers.cutting.strategy import Strategy
from drivers.identification.health import HealthRequest, health_problems
from drivers.identification.request import AMPLITUDE_UM, IdentificationRequest, request_problems
from drivers.identification.rig import is_homed
from profiles.axis.loop_design import DESIGN_GAIN_MARGIN, DESIGN_SENSITIVITY
from profiles.axis.margins import LEAST_PHASE_MARGIN_DEG, LoopMargins
from profiles.axis.servo_gains import shown_names, stated_settings
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.problem import Problem

MOST_TESTS = 200
BEFORE_A_TEST = {"alignment.drives_off": "align", "alignment.not_homed": "align", "machine.tool_in_part": "away"}
"""What comes before a test, by the reason why it cannot be armed."""

APPLY, REVERT = "tune.apply", "tune.revert"
KINDS = ("health", "pvt", "cam", "timebase")
"""A health test, or an identification of one of these paths."""

ARMED_S = 20.0  # within which F6 starts what F5 has armed
NAME_WIDTH, LABEL_WIDTH, VALUE_WIDTH = 10, 26, 14
DATE = len("2001-11-30 14:05")
Tests = tuple[KeptHealth, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedGains:
    """Gains that the next press of the same key writes until `until_s`, machine time; `before` are those now."""

    action: str
    until_s: float
    moment: tuple[object, ...]
    before: Gains
    after: Gains

    def holds(self, action: str, state: StationState, now_s: float) -> bool:
        """Whether this press of a key is the second one, with everything as it was."""
        return self.action == action and now_s <= self.until_s and self.moment == _trial_moment(state)

    @property
    def command(self) -> Command:
        """What is written."""
        return ApplyGains(settings=self.after, shown=self.before) if self.action == APPLY else RevertGains()


def trial_reasons(
    action: str, state: StationState, facts: GainFacts | Problems | None, *, shown: bool
) -> tuple[Problem, ...]:
    """Return why gains cannot be written now; `shown` is whether the proposal is in front of the operator."""
    if reasons := refusal(state, action):
        return reasons
    if state.armed is not None or state.activity is not Activity.READY:
        return (Problem(code="screen.tune_gains_armed"),)
    if state.snapshot is None or not state.snapshot.loops_open:
        return (Problem(code="screen.tune_drives_on"),)
    if action == REVERT:
        return () if state.trial is not None else (Problem(code="trial.none", key=state.machine),)
    if state.tool_loop is None:
        return (Problem(code="screen.tune_unread"),)
    if not shown or facts is None:
        return (Problem(code="screen.tune_look_first"),)
    found = facts.proposal if isinstance(facts, GainFacts) else None
    if found is None or found.settings == found.present:
        return (Problem(code="screen.tune_no_proposal"),)
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmedTest:
    """A test that may be started until `until_s`, machine time, while nothing happens at the machine."""

    kind: str
    until_s: float
    moment: tuple[object, ...]


def moment_of(state: StationState) -> tuple[object, ...]:
    """Return what must stay as it is from F5 to F6."""
    on = state.snapshot is not None and state.snapshot.loops_closed
    return state.activity, state.stop is None, state.standing, on, state.tested, state.alignment.clamping


def holds(armed: ArmedTest | None, state: StationState, now_s: float) -> bool:
    """Whether a test may still be started."""
    return armed is not None and now_s <= armed.until_s and armed.moment == moment_of(state)


def command_of(kind: str) -> Command:
    """Return the command that starts a test."""
    if kind == KINDS[0]:
        return CheckHealth(step_um=HealthRequest().step_um)
    return IdentifyTool(path=Strategy(kind))


def arm_reasons(kind: str, state: StationState, machine: MachineProfile) -> tuple[Problem, ...]:
    """Return why a test cannot be armed now; the machine asks everything again before it moves."""
    if reasons := refusal(state, "tune.arm"):
        return reasons
    if state.armed is not None or state.activity is not Activity.READY:
        return (Problem(code="screen.tune_cut_armed"),)
    snapshot = state.snapshot
    if snapshot is None or not snapshot.loops_closed:
        return (Problem(code="alignment.drives_off"),)
    if not is_homed(snapshot):
        return (Problem(code="alignment.not_homed"),)
    if jogging.tool_in_part(snapshot, machine, state.alignment):
        return (Problem(code="machine.tool_in_part"),)
    if kind == KINDS[0]:
        return health_problems(HealthRequest(), machine)
    return request_problems(IdentificationRequest(path=Strategy(kind)), machine)


def find_requested_gains(
    action: str, state: StationState, facts: GainFacts | Problems | None, now_s: float
) -> AskedGains | None:
    """Return what a first press asks for."""
    moment, until_s = _trial_moment(state), now_s + ARMED_S
    trial = state.trial
    if action == REVERT and trial is not None:
        return AskedGains(action=action, until_s=until_s, moment=moment, before=trial.found, after=trial.before)
    if action == APPLY and isinstance(facts, GainFacts) and facts.proposal is not None:
        found = facts.proposal
        after = tuple((name, float(value)) for name, value in found.settings.items())
        before = tuple(found.present.items())
        return AskedGains(action=action, until_s=until_s, moment=moment, before=before, after=after)
    return None


def _trial_moment(state: StationState) -> tuple[object, ...]:
    return *moment_of(state), state.tool_loop, state.trial


def gain_proposal_lines(facts: GainFacts, text: Catalogue, width: int) -> list[Line]:
    """Return everything, the settings first: at 80 columns the last lines are in the list of messages."""
    found, plant = facts.proposal, facts.known.loop.plant
    date = printable(facts.known.date.replace("T", " ")[:DATE])
    of = text("tune_page.plant_measured", date=date) if date else text("tune_page.plant_profile")
    a, b = f"a {plant.acceleration_per_v:.4g} m/s2/V", f"b {plant.damping_per_s:.4g} 1/s"
    rests = hanging(dim("  "), f"{of}: {a}, {b}, {1000 * plant.delay_s:.3g} + {1000 * plant.lag_s:.3g} ms", width)
    asked = text(
        "tune_page.asked",
        gain=f"{DESIGN_GAIN_MARGIN:g}",
        phase=f"{LEAST_PHASE_MARGIN_DEG:g}",
        sensitivity=f"{DESIGN_SENSITIVITY:g}",
    )
    rests += hanging(dim("  "), asked, width, Token.DIM)
    if found is None:
        return wrap_problems(facts.reasons, text, width) + rests
    lines = problem_lines(facts.notes, text, width, ("· ", Token.WARNING))
    lines.append(_gain_row("", text("tune_page.present"), text("tune_page.proposed"), head=True))
    for name, was, value in found.changes:
        lines.append(_gain_row(name, f"{was:.11g}", f"{value:.11g}"))
    gains = found.gains.at_rest
    for key, value in (("kp", gains.kp_v_per_m), ("ki", gains.ki_v_per_m_s), ("kd", gains.kd_v_s_per_m)):
        unit = {"kp": "v_per_m", "ki": "v_per_m_s", "kd": "v_s_per_m"}[key]
        lines.append(_gain_row(f"tool.gain_{key}_{unit}", "", f"{value:.4g}"))
    for key, before, after in _margin_rows(found.before, found.after):
        lines.append(_gain_row(text(f"tune_page.{key}"), before, after))
    lines += _stiffness_rows(facts, text)
    return [*lines, *hanging(("▶ ", Token.ACTION), text("tune_page.how_to_apply"), width), *rests]


def _margin_rows(before: LoopMargins, after: LoopMargins) -> list[tuple[str, str, str]]:
    def shown(margins: LoopMargins) -> dict[str, str]:
        if not margins.stable:
            return {}
        values = {
            "gain_margin": (margins.gain_margin, ""),
            "phase_margin": (margins.phase_margin_deg, "°"),
            "delay_margin": (margins.delay_margin_ms, " ms"),
            "sensitivity": (margins.sensitivity_peak, ""),
            "bandwidth": (margins.bandwidth_hz, " Hz"),
        }
        return {key: f"{value:.3g}{unit}" for key, (value, unit) in values.items() if value is not None}

    keys = ("gain_margin", "phase_margin", "delay_margin", "sensitivity", "bandwidth")
    return [(key, shown(before).get(key, NOTHING), shown(after).get(key, NOTHING)) for key in keys]


def _stiffness_rows(facts: GainFacts, text: Catalogue) -> list[Line]:
    """Return how far a force pushes the tool, um/N, at most and at the lobe, and the friction that trips it."""
    if facts.stiffness is None:
        return []
    before, after = facts.stiffness
    lobe = text("tune_page.compliance_at", hz=f"{before.hz[0]:g}")
    return [
        _gain_row(
            text("tune_page.compliance"), f"{before.most_um_per_n:.2f} um/N", f"{after.most_um_per_n:.2f} um/N"
        ),
        _gain_row(lobe, f"{before.um_per_n[0]:.2f} um/N", f"{after.um_per_n[0]:.2f} um/N"),
        _gain_row(text("tune_page.trips"), f"{facts.trips_n[0]:.1f} N", f"{facts.trips_n[1]:.1f} N"),
    ]


def _gain_row(label: str, present: str, proposed: str, *, head: bool = False) -> Line:
    values = to_the_right(present, VALUE_WIDTH), to_the_right(proposed, VALUE_WIDTH)
    return line(
        dim(f"  {fit_text(label, LABEL_WIDTH)}"), dim(values[0]), (values[1], Token.DIM if head else Token.TEXT)
    )


class HealthPanels(Vertical):
    """Everything that is shown of the tests."""

    DEFAULT_CSS = """
    HealthPanels {
        height: 1fr; width: 1fr;
        #tune-upper { height: 1fr; width: 1fr; }
        #tune-figures { width: 57; height: 1fr; }
        #tune-step { width: 1fr; height: 1fr; }
        #tune-trend { height: 6; }
    }
    HealthPanels.-tall #tune-trend { height: 40%; }
    """

    def __init__(self, ui: UiContext) -> None:
        palette = ui.palette
        self._text, self._stated = ui.text, stated_settings(ui.machine.machine)
        self.figures = Sheet(palette, id="tune-figures", classes="panel")
        self.step = TraceView(palette=palette, id="tune-step", classes="panel")
        self.trend = Sheet(palette, id="tune-trend", classes="panel")
        super().__init__(Horizontal(self.figures, self.step, id="tune-upper"), self.trend, id="tune-tests")

    @property
    def sizes(self) -> tuple[Size, ...]:
        """The sizes by which lines are broken."""
        return (self.figures.size, self.trend.size)

    def lay_out(self, size: Size) -> None:
        """Give the trend more room on a tall terminal."""
        self.set_class(size.height >= 30, "-tall")

    def show(self, tests: Tests | Problems | None, selected: int, armed: Sequence[Line], kind: str) -> None:
        """Show the tests; in the place of the figures what F6 will do, where a test is armed.

        Before the first test they say what one of this `kind` does.
        """
        text, size = self._text, self.figures.size
        width = max(size.width, 1)
        kept = [each for each in tests or () if isinstance(each, KeptHealth)]
        problems = [each for each in tests or () if isinstance(each, Problem)]
        test = kept[selected] if selected < len(kept) else None
        before = kept[selected + 1].result if selected + 1 < len(kept) else None
        lines = list(armed) or problem_lines(problems, text, width) or figure_lines(test, before, text, width)
        lines = lines or kind_lines(kind, text, width, step_um=AMPLITUDE_UM)
        if test is not None and not armed:
            lines += other_gain_lines(test, self._stated, text, width)
        if tests is None:
            lines = [line(dim(text("tune_page.computing")))]
        title = "tune_page.armed" if armed else "tune_page.figures"
        self.figures.show(clip_lines(lines, size.height, text("panel.more")), text(title))
        self.step.show(step_picture(None if test is None else test.result, before, text.units))
        entitle(self.step, text("tune_page.step"))
        trend = self.trend.size
        self.trend.show(trend_lines(kept, selected, text, trend.width, trend.height), text("tune_page.trend"))


def asked_lines(asked: AskedGains, text: Catalogue, width: int, left_s: float) -> list[Line]:
    """Return what the next press of the same key writes."""
    key = "apply" if asked.action == APPLY else "revert"
    first = text(f"tune_page.ask.{key}", seconds=f"{left_s:.0f}")
    lines = hanging(("▶ ", Token.ACTION), first, width, Token.ACTION)
    changes = [
        f"{name} {was:.11g} → {value:.11g}"
        for (name, was), (_, value) in zip(asked.before, asked.after, strict=True)
        if was != value
    ]
    lines += hanging(dim("  "), ", ".join(changes) or text("tune_page.ask.nothing"), width)
    return [*lines, *hanging(dim("  "), text("tune_page.ask.how"), width, Token.DIM), BLANK]


def trial_lines(trial: StandingTrial, text: Catalogue, width: int) -> list[Line]:
    """Return what was there before, what was applied, and what stands, where gains are on trial."""
    date, by = printable(trial.date.replace("T", " ")[:DATE]), printable(trial.by, 30)
    token = Token.WARNING
    heading = text("tune_page.on_trial" if trial.whole else "tune_page.trial_broken", date=date, by=by)
    lines = hanging(("! ", token), heading, width, token)
    if not trial.whole:
        lines += wrap_problems(trial.problems, text, width)
    columns = (text("tune_page.before"), text("tune_page.applied"), text("tune_page.in_controller"))
    lines.append(line(dim(_trial_row("", *columns))))
    before, proposed, found = dict(trial.before), dict(trial.proposed), dict(trial.found)
    for name in shown_names(before, proposed, found):
        other = found[name] not in (before[name], proposed[name])
        row = _trial_row(name, *(f"{each[name]:.11g}" for each in (before, proposed, found)))
        lines.append(line((row, token if other else Token.TEXT)))
    return [*lines, BLANK]


def trial_warning(trial: StandingTrial, text: Catalogue, width: int) -> list[Line]:
    """Return the one sentence for the other views."""
    key = "tune_page.on_trial_short" if trial.whole else "tune_page.trial_broken_short"
    return hanging(("! ", Token.WARNING), text(key, names=format_gains(trial.found)), width, Token.WARNING)


def _trial_row(name: str, *values: str) -> str:
    return fit_text(f"  {name}", NAME_WIDTH) + "".join(to_the_right(value, VALUE_WIDTH) for value in values)


class TunePage(Page):
    """What F5 has armed, F6 starts; nothing else on it moves anything. Pressed twice, a and b write gains."""

    name_ = PageName.TUNE

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._loop, self._health = LoopPanels(ui), HealthPanels(ui)
        self._proposal = Sheet(ui.palette, id="tune-proposal", classes="panel")
        self._proposal.styles.height = "1fr"
        self.panels = (self._loop, self._health, self._proposal)
        self._loops: BackgroundReader[LoopFacts] = BackgroundReader()
        self._kept: BackgroundReader[Tests] = BackgroundReader()
        self._gains: BackgroundReader[GainFacts] = BackgroundReader()
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
        elif (by := rows_moved(action, self._list_rows)) is not None:
            self._selected = move_selection(self._selected, by, self._count)
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
                self._proposal.show(clip_lines(lines, size.height, self.ui.text("panel.more")), title)
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
        self._asked = find_requested_gains(action, state, self._proposed, now_s)

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
