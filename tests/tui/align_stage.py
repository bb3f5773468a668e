"""A stage for the page Align: states of the machine, and what comes of keys and of time."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from console.session.alignment import Alignment, Clamping, JawAngle, TouchOff
from console.session.intents import (
    Intent,
)
from console.session.state import Activity, StationState
from console.session.work import Work
from console.tui.desk import View
from console.tui.pages.align import AlignPage
from drivers.simulator.shop_view import ShopView
from drivers.snapshot import AxisState, Snapshot
from tests.tui.stage import FRAME_ROWS, FixedControl, PageStage, desk_for, experiment, grid

REST = frozenset({"desired_velocity_zero", "in_position"})
ON = REST | {"amplifier_enabled", "home_complete"}
OFF = REST | {"open_loop"}

# 50 mm in from the zero at 76 mm: the surface of the part; a turn and 12.6 degrees.
TOOL_COUNTS, SPINDLE_COUNTS = 250_000.0, 10_350.0
CLAMPED = Clamping(force_n=1314.0, diameter_mm=52.0, overhang_mm=30.0, at="08:40")
JAW = JawAngle(angle_deg=12.6, at="08:45")
TOUCHED = TouchOff(zero_radius_mm=76.5, at="08:46")
VALID = Alignment(settings=(), drives_on=True, homed=True, clamping=CLAMPED, jaw=JAW, touch_off=TOUCHED)
NO_JAW = replace(VALID, jaw=None, touch_off=None)
NEAR, FAR = (ShopView(jaw_1_past_mark_deg=past_deg, tool_gap_mm=0.25) for past_deg in (0.04, 12.34))


def look(
    flags: frozenset[str] = ON, *, running: bool = False, error: float = 3.0, carriage_mm: float = 41.2
) -> Snapshot:
    def axis(position: float, error: float = 0.0) -> AxisState:
        return AxisState(position=position, following_error=error, flags=flags)

    return Snapshot(
        at_s=100.0,
        tool=axis(TOOL_COUNTS, error),
        spindle=axis(SPINDLE_COUNTS),
        carriage=axis(1000.0 * carriage_mm),
        program_running=running,
        runtime_error=False,
    )


def state(alignment: Alignment = NO_JAW, **changes: Any) -> StationState:
    known: dict[str, Any] = {
        "activity": Activity.READY,
        "looked_s": 100.0,
        "snapshot": look(),
        "seen": FAR,
    }
    return StationState(alignment=alignment, **{**known, **changes})


def words_of(text: str) -> str:
    """What the right column of a page says, without its frames and line ends."""
    return " ".join(" ".join(row.split("│")[-2] for row in text.splitlines() if row.endswith("│")).split())


@dataclass(frozen=True)
class Shown:
    """What came of some keys."""

    text: str
    next_step: str
    orders: Sequence[Intent]
    stops: Sequence[str]
    said: Sequence[str]


def shown(
    now: StationState,
    *actions: str,
    size: tuple[int, int] = (80, 24),
    language: str = "en",
    work: Work | None = None,
    no_job: bool = False,
    then_s: float = 0.0,
    leave: bool = False,
) -> Shown:
    """Show a state, press keys, wait `then_s`, and look at the page."""
    control = FixedControl(now)
    job = None if no_job else work or experiment()
    desk = desk_for(control, Path("/nowhere"), language, job)
    page = AlignPage(desk)
    view = View(state=now, work=job, now_s=100.0)

    async def run() -> str:
        app = PageStage(page, view)
        async with app.run_test(size=(size[0], size[1] - FRAME_ROWS)) as pilot:
            await pilot.pause()
            for action in actions:
                page.act(action)
            if leave:
                page.leave()
            for _ in range(2):
                page.show(replace(view, now_s=100.0 + then_s))
                await pilot.pause()
            return grid(app)

    text = asyncio.run(run())
    return Shown(
        text=text,
        next_step="".join(words for words, _ in page.next_step(view)),
        orders=control.orders,
        stops=control.stops,
        said=[problem.code for problem in desk.said],
    )


@dataclass(frozen=True)
class Pressed:
    """What was ordered, and what the last key was answered."""

    orders: Sequence[Intent]
    said: Sequence[str]


class TimedControl(FixedControl):
    """A control whose time is set by the test."""

    def at(self, now_s: float) -> None:
        self._now_s = now_s


def later(now: StationState, *presses: tuple[float, str]) -> Pressed:
    """Press keys of the page at these times, s after the first look."""
    control = TimedControl(now)
    desk = desk_for(control, Path("/nowhere"), work=experiment())
    page = AlignPage(desk)
    for after_s, action in presses:
        control.at(100.0 + after_s)
        desk.said = ()
        page.act(action)
    return Pressed(orders=control.orders, said=[problem.code for problem in desk.said])


IN_PART = look(carriage_mm=172.0)
OTHER = replace(VALID, clamping=replace(CLAMPED, diameter_mm=53.0, overhang_mm=30.0))
"""The blank in the chuck is 53 mm, so that the tip at R 26.5 mm touches it; the job in hand wants 52 mm."""
