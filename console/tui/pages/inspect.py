"""Page Inspect: release the part, measure it, and compare it with the part before compensation."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from console.session.data.trace_folder import export_trace
from console.session.guide.measured_part import (
    causes_along,
    fails,
    fails_in_mark,
    follows_lobe,
    is_taken,
    run_id_of,
)
from console.session.guide.refusals import LOOKS, find_refusals
from console.session.guide.rows import INSPECT, row_of
from console.session.guide.situation import Situation
from console.session.learning.calibrating import PartLobe
from console.session.station.commands import CorrectTouchOff, Measure, MeasureTurned
from console.session.station.state import MeasuredPart, StationState
from console.session.work import Work
from console.text.catalogue import Catalogue
from console.tui.calibration.draft import TYPED_OUT, value_of
from console.tui.entry import CalibrateEntry
from console.tui.gate import FieldKind
from console.tui.inspection.comparison import (
    VERDICT,
    DisplayFilter,
    PartComparison,
    compare_parts,
    list_supported_upr,
    next_circle,
    next_filter,
)
from console.tui.inspection.panels import MOST_ZOOM, InspectCharts, PartView, full_lines
from console.tui.inspection.part_chooser import OPEN_KEYS, PartChooser
from console.tui.inspection.part_form import PartForm
from console.tui.keymap import PageName, RowKey, row_keys
from console.tui.lines import BLANK, Line, Sheet, clip_lines, hanging, line, wrap_line
from console.tui.page import ChartPage
from console.tui.pages.inspect_lines import form_lines
from console.tui.pages.learn_lines import certified_lines, force_lines, head_lines, learn_lines, learn_title
from console.tui.pages.learning_keys import accept_part, revert_version
from console.tui.pages.stop_lines import mark_lines
from console.tui.pages.trace_chooser import ANSWERS, TraceChooser
from console.tui.theme import Token
from console.tui.ui_context import KEYS, UiContext, View
from profiles.calibration.lobe import FoundLobe
from profiles.calibration.plausible import LARGE_STEP
from profiles.files import printable
from profiles.metrology.cylindricity import few_sections
from profiles.problem import Problem, ProfileError
from profiles.traces import Trace

_BORDER_ROWS = 2
_STEP_ROWS = 2
STEPS = {"inspect.up": -1, "inspect.down": 1, "inspect.first": -sys.maxsize, "inspect.last": sys.maxsize}
PAGES = {"inspect.page_up": -1, "inspect.page_down": 1}
ZOOMS = {"inspect.larger": 1, "inspect.smaller": -1}
_ALONG = {PartView.STACK: PartView.MAP, PartView.MAP: PartView.ROUNDNESS}
_MARK = ("! ", Token.WARNING)


def lobe_lines(lobe: PartLobe, work: Work | None, text: Catalogue, width: int) -> list[Line]:
    """Return the fitted lobe with its confidence, why the job cannot take it, and what to know before it does."""
    lines = _plain_lines(lobe, work, text, width)
    lines += [] if lobe.found is None else wrap_line(_found_words(lobe.found, text), width)
    problems = (*lobe.reasons, *(() if lobe.found is None else lobe.found.warnings))
    for problem in problems:
        lines += hanging(_MARK, text.problem(problem), width, Token.WARNING)
    return lines


def _plain_lines(lobe: PartLobe, work: Work | None, text: Catalogue, width: int) -> list[Line]:
    """Return in plain words what the lobe is for, or that there is none."""
    if lobe.found is None or (lobe.reasons and not is_taken(lobe, work)):
        return wrap_line(text("inspect_page.plain.no_lobe"), width, Token.STRONG)
    if is_taken(lobe, work) and work is not None:
        word = "lobe_taken" if follows_lobe(work) else "lobe_in_job"
        words = text(f"inspect_page.{word}", job=work.job.name, strategy=work.strategy)
        return wrap_line(words, width, Token.STRONG)
    error = text.units.figure(lobe.found.fit.error_um_pp, "um", 1)
    return wrap_line(text("inspect_page.plain.lobe", error=error), width, Token.STRONG)


def _found_words(found: FoundLobe, text: Catalogue) -> str:
    fit = found.fit
    error, ci, noise = (
        text.units.figure(each, "um", 2) for each in (fit.error_um_pp, 2 * fit.lobe.ci_um, fit.noise_um)
    )
    words = text("inspect_page.lobe", n=fit.jaws, error=error, ci=ci)
    if found.past_jaw_deg is not None:
        past = f"{found.past_jaw_deg:+z.1f}"
        words += " · " + text("inspect_page.lobe_at", past=past, ci=f"{fit.lobe.ci_deg:.1f}")
    return words + " · " + text("inspect_page.lobe_noise", noise=noise)


class InspectPage(ChartPage):
    """Before and after on one scale, with every figure as a number beside it."""

    name_ = PageName.INSPECT

    DEFAULT_CSS = """
    InspectPage {
        layout: vertical; layers: base entry;
        #calibrate-entry {
            layer: entry; position: absolute; offset: 50 0; width: 24; height: 1;
            background: $background; color: $foreground;
        }
        #inspect-message { height: 1fr; padding: 1 2; }
        #inspect-learn { height: 5; }
        #inspect-charts { height: 1fr; }
        #inspect-left { width: 58%; height: 1fr; }
        #inspect-roundness { height: 1fr; }
        #inspect-spectrum { height: 1fr; display: none; }
        #inspect-numbers { width: 1fr; height: 1fr; }
        #inspect-polar { height: 1fr; }
        #inspect-caption { height: 3; }
        #inspect-result { width: 1fr; height: 1fr; }
        #inspect-harmonics { width: 1fr; height: 1fr; display: none; }
        #inspect-beside { width: 1fr; height: 1fr; display: none; }
    }
    InspectPage.-roomy #inspect-learn { height: 6; }
    InspectPage.-tall #inspect-learn { height: 8; }
    InspectPage.-bare #inspect-learn { height: 4; }
    InspectPage.-roomy #inspect-result { height: 12; }
    InspectPage.-roomy #inspect-harmonics { display: block; }
    InspectPage.-tall #inspect-result { height: 16; }
    InspectPage.-tall #inspect-harmonics { height: 9; }
    InspectPage.-tall #inspect-beside { display: block; }
    InspectPage.-spectrum #inspect-spectrum { display: block; }
    InspectPage.-spectrum #inspect-roundness { display: none; }
    InspectPage.-spectrum #inspect-beside { display: none; }
    InspectPage.-spectrum #inspect-result { display: none; }
    InspectPage.-spectrum #inspect-harmonics { display: block; height: 1fr; }
    InspectPage.-spectrum.-roomy #inspect-result { display: block; }
    InspectPage.-bare #inspect-left { display: none; }
    InspectPage.-bare #inspect-numbers { layout: horizontal; }
    InspectPage.-bare #inspect-result, InspectPage.-bare #inspect-harmonics { display: block; height: 1fr; }
    InspectPage #inspect-stack, InspectPage #inspect-map { height: 1fr; display: none; }
    InspectPage.-stack #inspect-stack, InspectPage.-map #inspect-map { display: block; }
    InspectPage.-along #inspect-roundness, InspectPage.-along #inspect-numbers { display: none; }
    InspectPage.-along #inspect-left { display: block; width: 100%; }
    InspectPage.-along.-roomy #inspect-left { width: 58%; }
    InspectPage.-along.-roomy #inspect-numbers { display: block; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        palette = ui.palette
        self._charts = InspectCharts(ui)
        self._learn = Sheet(palette, id="inspect-learn", classes="panel")
        self._message = Sheet(palette, id="inspect-message")
        self._chooser, self._parts, self._form = TraceChooser(ui), PartChooser(ui), PartForm(ui)
        self._entry = CalibrateEntry()
        self.panels = (
            self._learn,
            self._charts,
            self._message,
            self._chooser,
            self._parts,
            self._form,
            self._entry,
        )
        self.texts = (self._learn, self._message, *self._charts.texts)
        self._seen: PartComparison | None = None
        self._of: tuple[object, ...] = ()
        self._looked, self._zoom, self._drawn = VERDICT, 0, PartView.ROUNDNESS
        self._trace: Trace | None = None
        self._looks: tuple[object, ...] = ()
        self._least = 0
        self._charts.display = self._learn.display = False

    def news(self, view: View) -> tuple[object, ...]:
        """Return the job, the measured parts and the blank."""
        state, parts = view.state, (id(view.state.measured), id(view.state.uncompensated), id(view.state.form))
        return id(view.work), parts, state.cut_done, state.simulated, state.marks_mm, self._asks

    def act(self, action: str) -> None:
        """Measure the part, keep its learning step or revert, or continue with the next one."""
        post = self.ui.control.post
        does: dict[str, Callable[[], object]] = {
            "inspect.measure": lambda: post(Measure()),  # the station refuses for the same reasons
            "inspect.turned": self._measure_turned,
            "inspect.offset": lambda: post(CorrectTouchOff()),
            "inspect.import": self._chooser.open,
            "inspect.export": self._export,
            "inspect.accept": self._accept,
            "inspect.revert": lambda: revert_version(self.ui),
            "inspect.next": lambda: self.ui.go(PageName.ALIGN),
        }
        with self.ui.answering():
            if self._entry.is_open:
                self._answer(action)
            elif self.ui.answers(self.why_not(action, self.ui.view)):
                return
            elif self._chooser.is_open:
                self._choose(action)
            elif self._parts.is_open:
                self._choose_part(action)
            elif self._form.is_open:
                self._form.act(action)
            elif action == "inspect.identify":
                self._form.open(run_id_of(self.ui.view.state) or "")
            elif action in LOOKS:
                self._look(action)
            elif action in does:
                does[action]()

    def show(self, view: View) -> None:
        """Show the newest state; also a chooser, in the place of everything else."""
        self._forget_with(view.state.measured)
        if view.state.may_move:
            self._entry.close()
        self._entry.keep_focus()
        for chooser in (self._chooser, self._parts, self._form):
            if chooser.display is not chooser.is_open:
                chooser.display = chooser.is_open
                self._charts.display = self._learn.display = self._message.display = False
                self._painted_for = []
        if self._chooser.is_open:
            self._chooser.refresh_choice(view)
        elif self._parts.is_open:
            self._parts.refresh_list()
        elif self._form.is_open:
            self._form.refresh_fields()
        else:
            for each in (PartView.SPECTRUM, PartView.STACK, PartView.MAP):
                self.set_class(self._drawn is each, f"-{each}")
            self.set_class(self._drawn.is_along, "-along")
            looks = (self._looked, self._zoom, self._drawn, self._parts.take_choice())
            if looks != self._looks:
                self._looks, self._painted_for = looks, []
            super().show(view)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why nothing can be measured, kept, read or written now; in a chooser, what it lacks."""
        if self._chooser.is_open:
            return self._chooser.why_not(action)
        if self._parts.is_open:
            return self._parts.why_not(action)
        if self._form.is_open:
            return self._form.why_not(action)
        if action in LOOKS and view.state.measured is not None:
            return self._why_not_looked(action, view)
        return find_refusals(action, self._present_situation(view), KEYS[action])

    def _present_situation(self, view: View) -> Situation:
        return Situation(state=view.state, work=view.work, machine=self.ui.machine.machine, now_s=view.now_s)

    @property
    def keys(self) -> tuple[RowKey, ...]:
        """Those of an open chooser; without a gauge no key measures."""
        if self._chooser.is_open or self._parts.is_open:
            return self._chooser.keys if self._chooser.is_open else OPEN_KEYS
        if self._form.is_open:
            return self._form.keys
        if self.ui.view.state.simulated:
            return ()
        return tuple(key for key in row_keys(self.name_) if key.action != "inspect.measure")

    @property
    def field(self) -> FieldKind:
        """Free text while a path or a name is typed, a number while a large step is typed out."""
        if self._entry.is_open:
            return FieldKind.NUMBER
        return FieldKind.TEXT if self._chooser.is_typing or self._form.is_typing else FieldKind.NONE

    def leave(self) -> None:
        """Close the choosers."""
        self._chooser.close()
        self._parts.close()
        self._form.close()
        self._entry.close()

    def next_step(self, view: View) -> Line:
        """Return what comes next: cut, measure, or the next part."""
        if self._entry.is_open:
            return line((self.ui.text("calibrate_page.type_out"), Token.ACTION))
        if self._chooser.is_open:
            return self._chooser.next_step()
        if self._parts.is_open:
            return line((self._parts.next_words(), Token.ACTION))
        if self._form.is_open:
            return line((self._form.next_words(), Token.ACTION))
        if self._asks and view.state.measured is not None:
            return line((self.ui.text("inspect_page.next_question"), Token.ACTION))
        return line((self.ui.text(row_of(INSPECT, self._present_situation(view)).sentence), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return the learning step of the last part or why none, and every figure of it; or how to get a part."""
        text, part = self.ui.text, view.state.measured
        if self._chooser.is_open:
            return self._chooser.in_full(width)
        if self._parts.is_open:
            return self._parts.in_full(width)
        if self._form.is_open:
            return self._form.in_full(width)
        if part is None:
            return self._message_lines(view.state, width)
        rows: list[Line] = []
        if self._asks:
            rows = wrap_line(text("inspect_page.next_question"), width)
        elif part.lobe is not None:
            rows = lobe_lines(part.lobe, view.work, text, width)
        elif part.learning is not None:
            rows = learn_lines(part.learning, view.work, text, width, **_how(part))
            rows += force_lines(part, view.state.force, text, width)
            rows += certified_lines(part.learning, text, width)
        if self._seen is not None:
            rows += [BLANK, *full_lines(self._seen, text, width, simulated=view.state.simulated)]
        return rows

    @property
    def _asks(self) -> bool:
        """Whether a lesson asks what is wrong with the part: until that is answered, only the plot says so."""
        return self.ui.attempt is not None and self.ui.attempt.asks

    def _accept(self, typed: float | None = None) -> None:
        """Keep what the part teaches; a lobe that is a large step has to be typed out."""
        try:
            accept_part(self.ui, typed)
        except ProfileError as refused:
            if refused.problems[0].code == LARGE_STEP:
                self._entry.open(TYPED_OUT)
            raise

    def _measure_turned(self) -> None:
        """Measure the part turned on the simulated gauge, or choose the file of that."""
        if self.ui.view.state.simulated:
            self.ui.control.post(MeasureTurned())
        else:
            self._chooser.open(turned=True)

    def _answer(self, action: str) -> None:
        """Take what was typed out (Enter); any other key ends the entry."""
        typed = self._entry.value.strip()
        self._entry.close()
        if action == "inspect.next" and typed:
            self._accept(value_of(typed, TYPED_OUT))

    def _choose(self, action: str) -> None:
        if action == "inspect.import":
            self._chooser.close()
        elif action in STEPS:
            self._chooser.step(STEPS[action])
        elif action in PAGES:
            self._chooser.step(PAGES[action] * self._chooser.page_rows)
        elif action in ANSWERS:
            self._chooser.answer(action)
        elif action == "inspect.path":
            self._chooser.type_path()
        elif action == "inspect.together":
            self._chooser.mark()
        else:
            self._chooser.take()

    def _choose_part(self, action: str) -> None:
        if action == "inspect.beside":
            self._parts.close()
        elif action == "inspect.next":
            self._parts.take()
        elif action in STEPS:
            self._parts.step(STEPS[action])
        else:
            self._parts.step(PAGES[action] * self._parts.page_rows)

    def _look(self, action: str) -> None:
        """Look at the part in another way; its verdict stays."""
        part = self.ui.control.state.measured
        if part is None:
            return
        if action == "inspect.circle":
            self._looked = next_circle(self._looked)
        elif action == "inspect.filter":
            self._looked = self._next_filter(part)
        elif action == "inspect.view":
            spectrum = self._drawn is PartView.SPECTRUM
            self._drawn, self._zoom = PartView.ROUNDNESS if spectrum else PartView.SPECTRUM, 0
        elif action == "inspect.length":
            self._drawn, self._zoom = _ALONG.get(self._drawn, PartView.STACK), 0
        elif action == "inspect.whole":
            self._zoom = 0
        elif action in ZOOMS:
            self._zoom += ZOOMS[action]
        else:
            self._parts.open(part)

    def _why_not_looked(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why the measured part cannot be looked at in another way."""
        part = view.state.measured
        if action in ZOOMS and abs(self._zoom + ZOOMS[action]) > MOST_ZOOM:
            return (Problem(code="screen.zoom_end"),)
        if action == "inspect.length" and part is not None and part.whole is None:
            return (few_sections(max(len(part.sections), 1)),)
        if action == "inspect.filter" and part is not None:
            if self._next_filter(part) == self._looked:
                return (Problem(code="screen.one_filter", value=str(part.trace.angle_deg.size)),)
        return ()

    def _next_filter(self, part: MeasuredPart) -> DisplayFilter:
        """Return the part with the next filter that all shown traces allow."""
        supported = list_supported_upr([part.trace]) if self._seen is None else self._seen.supported
        return next_filter(self._looked, part.result.filter_upr, supported)

    def _forget_with(self, part: MeasuredPart | None) -> None:
        """Forget zoom and the part beside it when another part was measured."""
        trace = None if part is None else part.trace
        if trace is not self._trace:
            self._trace, self._zoom = trace, 0
            if self._drawn.is_along and (part is None or part.whole is None):
                self._drawn = PartView.ROUNDNESS
            self._entry.close()
            self._parts.forget()

    def _export(self) -> None:
        """Write the trace of the part to a file of its own."""
        part = self.ui.control.state.measured
        assert part is not None
        path = export_trace(self.ui.data, part.trace, job=part.job.name)
        self.ui.say("trace.exported", value=printable(str(path)))

    def paint(self, view: View) -> None:
        """Show the last part that was measured; not under a chooser, which may have opened since."""
        if self._chooser.is_open or self._parts.is_open or self._form.is_open:
            return
        state = view.state
        self._compare(state)
        part = state.measured
        learning = part is not None and (part.learning is not None or part.lobe is not None) and not self._asks
        learning = learning and (self.has_class("-roomy") or not self._drawn.is_along)
        if self._learn.display is not learning:
            self._learn.display = learning
            self.call_after_refresh(self.paint_again)
        self.see(self._message if self._seen is None else self._charts, (self._charts, self._message))
        if self._seen is None:
            self._message.show(self._message_lines(state, max(self._message.size.width, 1)))
            return
        self._show_step(view)
        self._charts.show(self._seen, self._zoom, view=self._drawn, simulated=state.simulated)

    def _show_step(self, view: View) -> None:
        """Show what can be learned from the part, or the lobe that a plain one has."""
        part, text, room = view.state.measured, self.ui.text, self._learn.size
        if part is not None and part.lobe is not None:
            rows = lobe_lines(part.lobe, view.work, text, max(room.width, 1))
            self._learn.show(clip_lines(rows, room.height, text("panel.more")), text("inspect_page.lobe_title"))
            self._grant(len(rows))
            return
        if part is None or part.learning is None:
            return
        how, width, learning = {**_how(part), "brief": True}, max(room.width, 1), part.learning
        # The plain words, and why nothing is learned, are shown in full, at the cost of the plot.
        head = head_lines(learning, view.work, text, width, **how)
        force = force_lines(part, view.state.force, text, width)
        rows = learn_lines(learning, view.work, text, width, **how)
        rows[len(head) : len(head)] = force
        more = text("panel.more") if len(rows) > room.height else ""
        self._learn.show(rows[: room.height], learn_title(learning, text), more)
        step = _STEP_ROWS if how["failed"] else 0  # what a part that fails teaches
        self._grant(len(head) + len(force) + step)

    def _grant(self, rows: int) -> None:
        """Give the words on the part this many rows at least, up to half of the page."""
        least = min(rows + _BORDER_ROWS, max(self.size.height // 2, 1))
        if least != self._least:
            self._least, self._learn.styles.min_height = least, least
            if self.is_attached:
                self.call_after_refresh(self.paint_again)  # they are clipped for the room that there was

    def _compare(self, state: StationState) -> None:
        """Compare the part anew where anything of it or of how it is looked at has changed."""
        other = self._parts.take_choice()
        of = (state.measured, state.uncompensated, self._looked, other)
        if len(of) == len(self._of) and all(a is b for a, b in zip(of, self._of, strict=True)):
            return
        self._of = of
        try:
            self._seen = compare_parts(state, self._looked, other)
        except ProfileError as error:  # only what is looked at: the part itself was judged
            self.ui.key_answer = tuple(error.problems)
            self._looked = VERDICT
            self._parts.forget()
            self._of = (state.measured, state.uncompensated, VERDICT, None)
            self._seen = compare_parts(state)
        if self._seen is not None:
            self._looked = self._seen.looked

    def _message_lines(self, state: StationState, width: int) -> list[Line]:
        text = self.ui.text
        if state.form is not None:
            return form_lines(state.form, text, width)
        lines = wrap_line(text("inspect_page.nothing"), width)
        what = "how_measure" if state.cut_done else "how_cut"
        how = wrap_line(text(f"inspect_page.{what}{'' if state.simulated else '_outside'}"), width)
        return [*lines, BLANK, *how, *mark_lines(text, state.marks_mm, width, "inspect_page")]


def _how(part: MeasuredPart) -> dict[str, Any]:
    """Return how the words on a part are to be said, see `learn_lines`."""
    return {"failed": fails(part), "along": causes_along(part), "marked": fails_in_mark(part)}
