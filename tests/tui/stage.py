"""A stage for the screens: a control that does nothing but remember, and the text of what is on the terminal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

from textual.app import App, ComposeResult

from console.session.cut.alignment import Alignment, JawAngle, TouchOff, clamping_of
from console.session.dated_input import ROW, InputAge
from console.session.station.commands import Command, Jog, NoteJog
from console.session.station.state import StationState
from console.session.work import Work, open_work
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.page import Page
from console.tui.theme import COLOUR, DARK_THEME
from console.tui.ui_context import UiContext, View
from drivers.clock import boot_s
from drivers.lathe.snapshot import AxisState, Snapshot
from drivers.requests.side_line import SideLine
from profiles.store import LoadedMachine, load_job, load_machine

SIZES = ((80, 24), (100, 30), (160, 48))
FRAME_ROWS = 6
LANGUAGES = ("en", "ko")
MACHINE = "lee-2001-lathe"
EXPERIMENT = "lee-2001-experiment-1"


def answered_age() -> InputAge:
    """The age of what comes from a terminal that has just answered."""
    age = InputAge()
    age.note_question(1, boot_s())
    age.take_cursor_report(ROW, 1, boot_s())
    return age


class FixedControl:
    """Shows one state, remembers what was ordered."""

    def __init__(self, state: StationState, now_s: float = 100.0) -> None:
        self.state = state
        self.orders: list[Command] = []
        self.stops: list[str] = []
        self.kills: list[str] = []
        self.side: SideLine | None = None
        self.arrives = True
        self._now_s = now_s

    def now_s(self) -> float:
        return self._now_s

    def at(self, now_s: float) -> None:
        """Set machine time."""
        self._now_s = now_s

    def post(self, intent: Command) -> bool:
        """Remember an order; a jog is in position at once, unless it never `arrives`."""
        if isinstance(intent, NoteJog):
            self.state = replace(self.state, jog_enabled=intent.enabled)
            return True
        self.orders.append(intent)
        if isinstance(intent, Jog) and self.arrives:
            self.state = replace(self.state, jogs=self.state.jogs + 1)
        return True

    def stop(self, reason: str) -> None:
        self.stops.append(reason)

    def kill(self, reason: str) -> None:
        self.kills.append(reason)

    def beat(self) -> None:
        pass


@cache
def lathe() -> LoadedMachine:
    """The lathe of the paper; its file is read once."""
    return load_machine(MACHINE)


@cache
def experiment() -> Work:
    """Experiment 1 of the paper, as it is saved, on its machine."""
    return open_work(load_job(EXPERIMENT), lathe())


def ui_for(control: FixedControl, data: Path, language: str = "en", work: Work | None = None) -> UiContext:
    ui = UiContext(
        text=load(language), palette=COLOUR, control=control, machine=lathe(), data=data, go=lambda _: None
    )
    ui.work = work
    return ui


class PageStage(App[None]):
    """One page alone, in the room that the frame leaves it; `view` is shown when it is ready."""

    HORIZONTAL_BREAKPOINTS = ConsoleApp.HORIZONTAL_BREAKPOINTS
    # The page alone has six rows less than the terminal.
    VERTICAL_BREAKPOINTS = [(0, "-low"), (24, "-mid"), (42, "-tall")]  # noqa: RUF012

    def __init__(self, page: Page, view: View) -> None:
        super().__init__()
        self.page, self.view = page, view
        self.register_theme(DARK_THEME)
        self.theme = DARK_THEME.name

    def compose(self) -> ComposeResult:
        yield self.page

    def on_ready(self) -> None:
        self.page.show(self.view)


def grid(app: App[None]) -> str:
    """The characters on the terminal, row by row, without trailing blanks."""
    strips: Iterable[object] = app.screen._compositor.render_strips()
    return "\n".join("".join(s.text for s in strip).rstrip() for strip in strips)  # type: ignore[attr-defined]


REST = frozenset({"desired_velocity_zero", "in_position"})
ON = REST | {"amplifier_enabled", "home_complete"}

CLAMPED = clamping_of(load_job("lee-2001-experiment-1").job, at="08:40")
JAW = JawAngle(angle_deg=12.6, jaws=3, at="08:45")


def aligned(zero_radius_mm: float) -> Alignment:
    """Everything is done; the tip was found at this radius at position zero."""
    touched = TouchOff(zero_radius_mm=zero_radius_mm, diameter_mm=52.0, at="08:46")
    return Alignment(settings=(), drives_on=True, homed=True, clamping=CLAMPED, jaw=JAW, touch_off=touched)


def look_at(
    flags: frozenset[str],
    *,
    tool: float,
    spindle: float,
    carriage: float,
    tool_error: float = 0.0,
    at_s: float = 100.0,
    running: bool = False,
) -> Snapshot:
    """One look; positions in counts."""

    def axis(position: float, error: float = 0.0) -> AxisState:
        return AxisState(position=position, following_error=error, flags=flags)

    return Snapshot(
        asked_s=at_s,
        at_s=at_s,
        tool=axis(tool, tool_error),
        spindle=axis(spindle),
        carriage=axis(carriage),
        program_running=running,
        runtime_error=False,
    )
