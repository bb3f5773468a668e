"""The panels of the page Tune: two plots beside or in the place of the texts, by the room there is."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

import numpy as np
from textual.containers import Horizontal, Vertical
from textual.geometry import Size

from console.tui.further.loop_lines import (
    LoopFacts,
    ResponseCurve,
    heading,
    legend,
    loop_lines,
    reason_lines,
    response_lines,
)
from console.tui.lines import Line, Sheet, clip_lines, dim, entitle, line
from console.tui.plot.frame import nice_limits
from console.tui.plot.trace_view import PointMarks, Series, TracePicture, TraceView
from console.tui.records.background_reader import Problems
from console.tui.rows import problem_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext

WIDE = 130  # columns from which plots and texts stand side by side
POINT, PAPER = "•", "✗"
X_LIMITS = (0.0, 3.0)  # 1 to 1000 Hz
_LEAST_DB, _LEAST_DEG = -30.0, -270.0


class TuneView(StrEnum):
    """What is shown in the place of another where there is no room for both."""

    LOOP = "loop"
    BODE = "bode"
    TESTS = "tests"
    GAINS = "gains"


def _picture(facts: LoopFacts, selected: ResponseCurve | None, name: str, unit: str, least: float) -> TracePicture:
    """Return gain or phase over the frequency; what is far below the band is not shown."""

    def values(curve: ResponseCurve) -> np.ndarray:
        found: np.ndarray = getattr(curve, name)
        return found

    model = values(facts.model)
    # Far above the bandwidth there is nothing to see: the limits are those of the band, and of what was measured.
    shown = [model[model >= least]] + [values(each) for each in (selected, facts.paper) if each is not None]
    every = np.concatenate(shown)
    limits = nice_limits(max(float(every.min()), least), float(every.max()))
    marks = []
    if facts.paper is not None:
        marks.append(PointMarks(x=np.log10(facts.paper.hz), y=values(facts.paper), sign=PAPER, token=Token.MARK))
    if selected is not None:
        marks.append(PointMarks(x=np.log10(selected.hz), y=values(selected), sign=POINT, token=Token.BEFORE))
    series = [Series(x=np.log10(facts.model.hz), y=model, token=Token.AFTER)]
    return TracePicture(
        series=series, x_limits=X_LIMITS, y_limits=limits, y_unit=unit, x_unit="Hz", decades=True, marks=marks
    )


class LoopPanels(Horizontal):
    """The plots of gain and phase, and on their right margins, gains and kept responses."""

    DEFAULT_CSS = """
    LoopPanels {
        height: 1fr; width: 1fr;
        #tune-plots { width: 1fr; height: 1fr; layout: vertical; }
        #tune-legend { height: 1; }
        #tune-both { height: 1fr; width: 1fr; layout: vertical; }
        #tune-gain, #tune-phase { height: 1fr; width: 1fr; }
        #tune-texts { width: 1fr; height: 1fr; }
        #tune-facts { height: 1fr; }
        #tune-responses { height: 5; }
    }
    LoopPanels.-beside #tune-texts { width: 74; }
    LoopPanels.-beside #tune-responses { height: 16; }
    LoopPanels.-flat #tune-both { layout: horizontal; }
    """

    def __init__(self, ui: UiContext) -> None:
        palette = ui.palette
        self._text = ui.text
        self.gain = TraceView(palette=palette, id="tune-gain", classes="panel")
        self.phase = TraceView(palette=palette, id="tune-phase", classes="panel")
        self.legend = Sheet(palette, id="tune-legend")
        self.facts = Sheet(palette, id="tune-facts", classes="panel")
        self.responses = Sheet(palette, id="tune-responses", classes="panel")
        both = Horizontal(self.gain, self.phase, id="tune-both")
        self.plots = Vertical(both, self.legend, id="tune-plots")
        self.texts = Vertical(self.facts, self.responses, id="tune-texts")
        super().__init__(self.plots, self.texts, id="tune-loop")

    @property
    def sizes(self) -> tuple[Size, ...]:
        """The sizes by which lines are broken."""
        return self.facts.size, self.responses.size, self.legend.size

    def lay_out(self, view: TuneView, size: Size) -> None:
        """Show plots, texts, or both."""
        beside = size.width >= WIDE
        self.set_class(beside, "-beside")
        self.set_class(not beside and size.height < size.width // 2, "-flat")
        self.plots.display = beside or view is TuneView.BODE
        self.texts.display = beside or view is TuneView.LOOP

    def show(self, facts: LoopFacts | Problems | None, selected: int, warning: Sequence[Line] = ()) -> None:
        """Show the loop, why there is none, or that it is being computed."""
        text = self._text
        width = max(self.facts.size.width, 1)
        if not isinstance(facts, LoopFacts):
            lines = (
                [line(dim(text("tune_page.computing")))] if facts is None else problem_lines(facts, text, width)
            )
            self.facts.show(lines, text("tune_page.margins"))
            self.responses.show([], text("tune_page.responses"))
            return
        seen = facts.responses[selected] if selected < len(facts.responses) else None
        lines = [*warning, *loop_lines(facts, text, width)]
        self.facts.show(clip_lines(lines, self.facts.size.height, text("panel.more")), heading(facts, text))
        size = self.responses.size
        reasons: list[Line] = [] if seen is None else reason_lines(seen, text, max(size.width, 1))
        room = max(size.height - min(len(reasons), max(size.height - 3, 0)), 1)
        rows = response_lines(facts.responses, selected, text, size.width, room)
        self.responses.show(
            clip_lines([*rows, *reasons], size.height, text("panel.more")), text("tune_page.responses")
        )
        self._draw(facts, selected)

    def _draw(self, facts: LoopFacts, selected: int) -> None:
        text = self._text
        seen = facts.responses[selected] if selected < len(facts.responses) else None
        curve = None if seen is None else seen.curve
        gain = _picture(facts, curve, "gain_db", "dB", _LEAST_DB)
        phase = _picture(facts, curve, "phase_deg", "°", _LEAST_DEG)
        for panel, picture, name in ((self.gain, gain, "gain"), (self.phase, phase, "phase")):
            panel.show(picture)
            entitle(panel, text(f"tune_page.{name}"))
        self.legend.show([legend(facts, seen, text)])
