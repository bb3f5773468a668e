"""The apps that `benchmarks.run_page` compares: the console on its page Run, and the same from stock widgets.

The third, a single line of text that changes, is the least that Textual takes for a frame.

python -m benchmarks.run_page_apps (console|stock|line) FILE: shows the moments of a cut that FILE holds, pickled:
the first one for some ticks, then one at each tick. Leaves then, and prints the bytes that it sent to its terminal
for all moments but the first, and the processor time that it took for them, s.
"""

from __future__ import annotations

import pickle
import sys
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
from rich.text import Text
from textual.app import App, ComposeResult
from textual.containers import Horizontal, Vertical
from textual.widgets import Static
from textual_plotext import PlotextPlot

from console.session.station.commands import Command
from console.session.station.progress import CutProgress
from console.session.station.state import StationState
from console.session.work import open_work
from console.text.catalogue import load
from console.tui.app import TICK_S, ConsoleApp
from console.tui.driver import StopDriver
from console.tui.frame import ROWS, Frame
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import Line, line
from console.tui.pages.cut_lines import live_lines, mean_error_um, progress_line
from console.tui.pages.run import LEAST_POLAR_ROWS
from console.tui.run.error_band import band_series
from console.tui.run.panels import FULL_TURN_DEG, WIDEST_FACT
from console.tui.theme import COLOUR, DARK_THEME, Token
from drivers.requests.side_line import SideLine
from profiles.store import load_job, load_machine

MACHINE = "lee-2001-lathe"
EXPERIMENT = "lee-2001-experiment-1"
TICKS_BEFORE = 8
"""Ticks on the first moment: the page is there and at rest before anything moves."""
CLOCK = datetime(2026, 11, 21, 10, 0)
RING = 6.0
"""Radius of the reference ring in the stock plot, in um of deviation."""
FRAME_HEIGHT = len(ROWS)


class CountingDriver(StopDriver):
    """The terminal of the console; it knows how many bytes went there."""

    sent_bytes = 0

    def write(self, data: str) -> None:
        """Count and send."""
        CountingDriver.sent_bytes += len(data.encode())
        super().write(data)


class Replay:
    """A control that shows recorded moments, one at each beat once all is ready, and does nothing else."""

    def __init__(
        self,
        moments: Sequence[StationState],
        leave: Callable[[], None],
        ready: Callable[[], bool] = lambda: True,
    ) -> None:
        self.side: SideLine | None = None
        self._moments = moments
        self._leave = leave
        self._ready = ready
        self._at = -TICKS_BEFORE
        self._before = (0, 0.0)
        self.sent_bytes, self.cpu_s = 0, 0.0

    @property
    def state(self) -> StationState:
        """The moment that is shown."""
        return self._moments[min(max(self._at, 0), len(self._moments) - 1)]

    def now_s(self) -> float:
        """Return the time of that moment."""
        return self.state.at_s

    def beat(self) -> None:
        """Go on to the next moment; leave when the last one was painted."""
        if self._at < 0 and not self._ready():
            return
        self._at += 1
        if self._at == 1:
            self._before = (CountingDriver.sent_bytes, time.process_time())
        if self._at == len(self._moments):
            sent_bytes, cpu_s = self._before
            self.sent_bytes = CountingDriver.sent_bytes - sent_bytes
            self.cpu_s = time.process_time() - cpu_s
            self._leave()

    def post(self, intent: Command) -> bool:
        """Take no order."""
        return False

    def stop(self, reason: str) -> None:
        """Nothing moves."""

    def kill(self, reason: str) -> None:
        """Nothing moves."""


def console(moments: Sequence[StationState]) -> tuple[App[None], Replay]:
    """Return the console itself, as `console --sim` makes it, on the page Run.

    The preview of the job is computed once, beside the screen; the cut waits for it.
    """
    app: ConsoleApp
    replay = Replay(
        moments,
        leave=lambda: app.exit(),
        ready=lambda: app.ui.work is not None and app.ui.work.preview is not None,
    )
    app = ConsoleApp(
        text=load("en"),
        palette=COLOUR,
        control=replay,
        machine=load_machine(MACHINE),
        data=Path(),
        begin=lambda: app.go(PageName.RUN),
        local_time=lambda: CLOCK,
        driver_class=CountingDriver,
    )
    app.ui.work = open_work(load_job(EXPERIMENT), load_machine(MACHINE))
    return app, replay


class Stock(App[None]):
    """The same words at the same places, and the same data, with the widgets that are there already.

    A text is handed to its widget only when it has changed, and without a new layout.
    """

    ENABLE_COMMAND_PALETTE = False
    CSS = """
    Screen { layout: vertical; background: $background; color: $foreground; }
    .row { height: 1; width: 1fr; }
    .panel { border: round $secondary; border-title-color: $foreground; background: $background; }
    #progress { height: 3; padding: 0 1; }
    #moment { height: 1fr; }
    #values { width: 47fr; height: 1fr; padding: 0 1; }
    #plots { width: 53fr; height: 1fr; }
    PlotextPlot { height: 1fr; }
    """

    def __init__(self, moments: Sequence[StationState]) -> None:
        super().__init__(driver_class=CountingDriver)
        self.register_theme(DARK_THEME)
        self.theme = DARK_THEME.name
        self.replay = Replay(moments, self.exit)
        self._text = load("en")
        self._machine = load_machine(MACHINE).machine
        self._job = load_job(EXPERIMENT).job
        self._shown: dict[str, tuple[Line, ...]] = {}

    def compose(self) -> ComposeResult:
        """Lay the page out as the console does."""
        names = list(ROWS)
        yield from (Static(id=name, classes="row") for name in names[:3])
        yield Static(id="progress", classes="panel")
        with Horizontal(id="moment"):
            yield Static(id="values", classes="panel")
            with Vertical(id="plots"):
                yield PlotextPlot(id="errors", classes="panel")
                if self.size.height - FRAME_HEIGHT >= LEAST_POLAR_ROWS:
                    yield PlotextPlot(id="polar", classes="panel")
        yield from (Static(id=name, classes="row") for name in names[3:])

    def on_mount(self) -> None:
        """Start the clock."""
        self.set_interval(TICK_S, self.tick)

    def tick(self) -> None:
        """Show the newest moment."""
        before = self.replay.state
        self.replay.beat()
        state = self.replay.state
        self._show_rows(state)
        if state.cut is None:
            return
        width = {name: self.query_one(f"#{name}").content_size.width for name in ("progress", "values")}
        self._say("progress", [progress_line(self._text, state.cut, width["progress"])])
        self._say("values", live_lines(self._text, state.cut, self._job, min(width["values"], WIDEST_FACT)))
        if state is not before or "plots" not in self._shown:
            self._shown["plots"] = ()
            self._plot_errors(state.cut)
            for polar in self.query("#polar").results(PlotextPlot):
                _plot_polar(polar, state.cut)

    def _show_rows(self, state: StationState) -> None:
        frame = Frame(
            text=self._text,
            state=state,
            machine=self._machine,
            page=PageName.RUN,
            field=FieldKind.NONE,
            next_step=line((self._text("run_page.next.cutting"), Token.STRONG)),
            said=(),
            clock=CLOCK,
            now_s=state.at_s,
        )
        for name, row in ROWS.items():
            self._say(name, row(frame, self.size.width))

    def _say(self, name: str, lines: Sequence[Line]) -> None:
        if self._shown.get(name) == tuple(lines):
            return
        self._shown[name] = tuple(lines)
        rows = [Text.assemble(*((words, COLOUR[token]) for words, token in pieces)) for pieces in lines]
        self.query_one(f"#{name}", Static).update(Text("\n").join(rows), layout=False)

    def _plot_errors(self, cut: CutProgress) -> None:
        _, limits_um = band_series(cut, None)
        widget = self.query_one("#errors", PlotextPlot)
        widget.plt.clear_data()
        widget.plt.xlim(*FULL_TURN_DEG)
        widget.plt.ylim(*limits_um)
        widget.plt.scatter(cut.angles_deg.tolist(), cut.errors_um.tolist(), marker="braille")
        widget.refresh()


def _plot_polar(widget: PlotextPlot, cut: CutProgress) -> None:
    angles_deg, errors_um = mean_error_um(cut)
    widget.plt.clear_data()
    for angle_deg, deviation_um in ((np.arange(360.0), np.zeros(360)), (angles_deg, -errors_um)):
        angle = np.radians(np.append(angle_deg, angle_deg[:1]))
        radius = RING + np.append(deviation_um, deviation_um[:1])
        widget.plt.plot((radius * np.cos(angle)).tolist(), (radius * np.sin(angle)).tolist(), marker="braille")
    widget.refresh()


class OneLine(App[None]):
    """A line that says how far the cut is, and nothing else."""

    CSS = "Static { height: 1; }"

    def __init__(self, moments: Sequence[StationState]) -> None:
        super().__init__(driver_class=CountingDriver)
        self.replay = Replay(moments, self.exit)

    def compose(self) -> ComposeResult:
        """Lay the line out."""
        yield Static()

    def on_mount(self) -> None:
        """Start the clock."""
        self.set_interval(TICK_S, self.tick)

    def tick(self) -> None:
        """Show the newest moment."""
        before = self.replay.state
        self.replay.beat()
        cut = self.replay.state.cut
        widget = self.query_one(Static)
        if cut is not None and (self.replay.state is not before or not widget.content):
            widget.update(f"turn {cut.turn:.0f} of {cut.turns:.0f}, {cut.left_s:.1f} s left", layout=False)


def one_line(moments: Sequence[StationState]) -> tuple[App[None], Replay]:
    """Return the least that there is."""
    app = OneLine(moments)
    return app, app.replay


def stock(moments: Sequence[StationState]) -> tuple[App[None], Replay]:
    """Return the same from stock widgets."""
    app = Stock(moments)
    return app, app.replay


APPS = {"console": console, "stock": stock, "line": one_line}


def main() -> int:
    """Run the app that the arguments name, say what it cost, and return its exit code."""
    name, file = sys.argv[1:]
    app, replay = APPS[name](pickle.loads(Path(file).read_bytes()))
    app.run(mouse=False)
    print(f"{replay.sent_bytes} bytes, {replay.cpu_s} s")
    return app.return_code or 0


if __name__ == "__main__":
    sys.exit(main())
