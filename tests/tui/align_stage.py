"""A stage for the page Align: states of the machine, and what comes of keys and of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from console.session.cut.alignment import Alignment
from console.session.station.commands import Command
from console.session.station.state import Activity, StationState
from console.tui.pages.align import AlignPage
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.plant.workshop_view import WorkshopView
from tests.tui.page_stage import shown_on
from tests.tui.stage import CLAMPED, ON, REST, FixedControl, aligned, experiment, look_at, ui_for

OFF = REST | {"open_loop"}

# 50 mm in from the zero at 76 mm: the surface of the part; a turn and 12.6 degrees.
TOOL_COUNTS, SPINDLE_COUNTS = 250_000.0, 10_350.0
VALID = aligned(76.5)
NO_JAW = replace(VALID, jaw=None, touch_off=None)
NEAR, FAR = (WorkshopView(jaw_1_past_mark_deg=past_deg, tool_gap_mm=0.25) for past_deg in (0.04, 12.34))


def look(
    flags: frozenset[str] = ON, *, running: bool = False, error: float = 3.0, carriage_mm: float = 41.2
) -> Snapshot:
    return look_at(
        flags,
        tool=TOOL_COUNTS,
        spindle=SPINDLE_COUNTS,
        carriage=1000.0 * carriage_mm,
        tool_error=error,
        running=running,
    )


def state(alignment: Alignment = NO_JAW, **changes: Any) -> StationState:
    known: dict[str, Any] = {"activity": Activity.READY, "snapshot": look(), "seen": FAR}
    return StationState(alignment=alignment, **{**known, **changes})


def words_of(text: str) -> str:
    """What the right column of a page says, without its frames and line ends."""
    return " ".join(" ".join(row.split("│")[-2] for row in text.splitlines() if row.endswith("│")).split())


shown = partial(shown_on, AlignPage)


@dataclass(frozen=True)
class Pressed:
    """What was ordered, and what the last key was answered."""

    orders: Sequence[Command]
    said: Sequence[str]


def later(now: StationState, *presses: tuple[float, str]) -> Pressed:
    """Press keys of the page at these times, s after the first look."""
    control = FixedControl(now)
    ui = ui_for(control, Path("/nowhere"), work=experiment())
    page = AlignPage(ui)
    for after_s, action in presses:
        control.at(100.0 + after_s)
        ui.key_answer = ()
        page.act(action)
    return Pressed(orders=control.orders, said=[problem.code for problem in ui.key_answer])


IN_PART = look(carriage_mm=172.0)
OTHER = replace(VALID, clamping=replace(CLAMPED, diameter_mm=53.0, overhang_mm=30.0))
"""The blank in the chuck is 53 mm, so that the tip at R 26.5 mm touches it; the job in hand wants 52 mm."""
