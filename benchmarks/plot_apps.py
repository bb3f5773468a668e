"""The small apps that `benchmarks.plots` compares: one page with a trace and a roundness plot.

python -m benchmarks.plot_apps (ours|stock) FRAMES: redraws ten times a second and leaves after FRAMES frames;
with 0 frames it shows the page once and leaves after the time of IDLE_FRAMES.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from textual.app import App, ComposeResult
from textual.containers import Horizontal
from textual_plotext import PlotextPlot

from console.tui.plot.polar_view import AngleMark, PolarTrace, PolarView
from console.tui.plot.trace_view import Series, TracePicture, TraceView
from console.tui.theme import Token

FRAME_S = 0.1
IDLE_FRAMES = 5
LIMIT_UM = 3.0
DEG_PER_FRAME = 18
"""A spindle at 30 rpm, seen ten times a second."""
FULL_TURN = 360


@dataclass(slots=True)
class Sweep:
    """A measured trace that is written over turn by turn, as on an oscilloscope."""

    angle_deg: NDArray[np.float64] = field(default_factory=lambda: np.arange(float(FULL_TURN)))
    error_um: NDArray[np.float64] = field(default_factory=lambda: np.zeros(FULL_TURN))
    at_deg: int = 0
    noise: np.random.Generator = field(default_factory=lambda: np.random.default_rng(1))

    def __post_init__(self) -> None:
        for _ in range(FULL_TURN // DEG_PER_FRAME):
            self.turn()

    @property
    def mean_um(self) -> NDArray[np.float64]:
        """What does not change from turn to turn."""
        return 1.5 * np.cos(np.radians(3.0 * self.angle_deg))

    def turn(self) -> None:
        """Measure what passes the tool in one frame."""
        new = (self.at_deg + np.arange(DEG_PER_FRAME)) % FULL_TURN
        self.error_um[new] = self.mean_um[new] + self.noise.normal(0.0, 0.25, DEG_PER_FRAME)
        self.at_deg = (self.at_deg + DEG_PER_FRAME) % FULL_TURN


class Page(App[None]):
    """Two plots side by side over the whole screen."""

    ENABLE_COMMAND_PALETTE = False

    def __init__(self, frames: int) -> None:
        super().__init__()
        self._moving = frames > 0
        self._left = frames or IDLE_FRAMES
        self._sweep = Sweep()

    def on_mount(self) -> None:
        """Start the clock."""
        self.call_after_refresh(self.show, self._sweep)
        self.set_interval(FRAME_S, self.tick)

    def tick(self) -> None:
        """Show one frame more, or leave."""
        if self._left == 0:
            self.exit()
            return
        self._left -= 1
        if self._moving:
            self._sweep.turn()
            self.show(self._sweep)

    def show(self, sweep: Sweep) -> None:
        """Put the data into the plots."""


class OurPage(Page):
    """The plots of the console."""

    def compose(self) -> ComposeResult:
        """Lay the plots out."""
        with Horizontal():
            yield TraceView()
            yield PolarView()

    def show(self, sweep: Sweep) -> None:
        """Put the data into the plots."""
        series = [
            Series(x=sweep.angle_deg, y=sweep.mean_um, token=Token.COMMAND),
            Series(x=sweep.angle_deg, y=sweep.error_um, token=Token.AFTER),
        ]
        limits = (-LIMIT_UM, LIMIT_UM)
        picture = TracePicture(series=series, x_limits=(0.0, 360.0), y_limits=limits, y_unit="um")
        self.query_one(TraceView).show(picture)
        self.query_one(PolarView).show(
            [
                PolarTrace(angle_deg=sweep.angle_deg, deviation_um=sweep.mean_um, token=Token.BEFORE),
                PolarTrace(angle_deg=sweep.angle_deg, deviation_um=sweep.error_um, token=Token.AFTER),
            ],
            um_per_division=2.0,
            marks=[AngleMark(angle_deg=0.0, label="1")],
        )


class StockPage(Page):
    """The same with the widget that textual-plotext brings."""

    def compose(self) -> ComposeResult:
        """Lay the plots out."""
        with Horizontal():
            yield PlotextPlot(id="trace")
            yield PlotextPlot(id="polar")

    def show(self, sweep: Sweep) -> None:
        """Put the data into the plots."""
        angle_deg = sweep.angle_deg.tolist()
        trace = self.query_one("#trace", PlotextPlot)
        trace.plt.clear_data()
        trace.plt.xlim(0.0, 360.0)
        trace.plt.ylim(-LIMIT_UM, LIMIT_UM)
        trace.plt.plot(angle_deg, sweep.mean_um.tolist(), marker="braille")
        trace.plt.plot(angle_deg, sweep.error_um.tolist(), marker="braille")
        trace.refresh()
        polar = self.query_one("#polar", PlotextPlot)
        polar.plt.clear_data()
        angle = np.radians(np.append(sweep.angle_deg, 0.0))
        for deviation in (np.zeros(FULL_TURN), sweep.mean_um, sweep.error_um):
            radius = 6.0 + np.append(deviation, deviation[:1])
            polar.plt.plot((radius * np.cos(angle)).tolist(), (radius * np.sin(angle)).tolist(), marker="braille")
        polar.refresh()


PAGES: dict[str, Callable[[int], Page]] = {"ours": OurPage, "stock": StockPage}


def main() -> None:
    """Run the app that the arguments name."""
    name, frames = sys.argv[1:]
    PAGES[name](int(frames)).run(mouse=False)


if __name__ == "__main__":
    main()
