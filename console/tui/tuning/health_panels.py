"""The panels of the health tests: figures beside the step, the trend below them."""

from __future__ import annotations

from collections.abc import Sequence

from textual.containers import Horizontal, Vertical
from textual.geometry import Size

from console.session.data.health import KeptHealth
from console.tui.lines import Line, Sheet, clipped, dim, entitle, line
from console.tui.plot.trace_view import TraceView
from console.tui.records.beside import Problems
from console.tui.tuning.health_lines import (
    figure_lines,
    kind_lines,
    other_gain_lines,
    step_picture,
    trend_lines,
)
from console.tui.tuning.problem_lines import problem_lines
from console.tui.ui_context import UiContext
from drivers.identification.request import AMPLITUDE_UM
from profiles.axis.servo_gains import stated_settings
from profiles.problem import Problem

Tests = tuple[KeptHealth, ...]


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
        self.figures.show(clipped(lines, size.height, text("panel.more")), text(title))
        self.step.show(step_picture(None if test is None else test.result, before, text.units))
        entitle(self.step, text("tune_page.step"))
        trend = self.trend.size
        self.trend.show(trend_lines(kept, selected, text, trend.width, trend.height), text("tune_page.trend"))
