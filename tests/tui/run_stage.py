"""What the page Run is shown in its tests: looks at the machine, cuts and stops, and what comes of them."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from console.session.cut.alignment import Alignment
from console.session.cut.telemetry import CutFigures, PhaseLag, SpindleRipple
from console.session.data.measured_part import MadeWith
from console.session.station.progress import CutProgress, CutStage, Synchronisation
from console.session.station.state import Activity, ArmedCut, StationState, StopState, TouchedBlank
from console.session.work import Work
from console.tui.pages.run import RunPage
from console.tui.ui_context import View
from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.snapshot import Snapshot
from profiles.machine import SAFETY_DEVICES
from tests.remembered import once
from tests.tui.page_stage import shown_on
from tests.tui.stage import (
    FRAME_ROWS,
    ON,
    REST,
    FixedControl,
    PageStage,
    aligned,
    experiment,
    grid,
    look_at,
    ui_for,
)

OFF = REST | {"open_loop", "home_complete"}
VALID = aligned(76.0)
SURFACE_COUNTS = 250_000.0
"""50 mm in from a zero at 76 mm: the radius of the part, 26 mm."""

GUARDS = dict.fromkeys(SAFETY_DEVICES, True)

MADE = MadeWith(compensation="none", strategy="pvt", stage="full", inverted="model")
"""By the model."""

FIGURES = CutFigures(
    spindle_speed_rpm=1000.04,
    tool_error_um=1.41,
    tool_error_rms_um=0.44,
    following_error_um=14.12,
    following_error_rms_um=9.02,
    samples=340,
)


OVER_PART_COUNTS = 171_000.0
"""1 mm behind the face of a part that stands out 30 mm from the jaws at 200 mm."""


def look(
    flags: frozenset[str] = ON,
    *,
    tool: float = 240_000.0,
    carriage: float = OVER_PART_COUNTS,
    spindle: float = 350.0,
    at_s: float = 100.0,
    running: bool = False,
) -> Snapshot:
    return look_at(flags, tool=tool, spindle=spindle, carriage=carriage, at_s=at_s, running=running)


def state(alignment: Alignment = VALID, **changes: Any) -> StationState:
    known: dict[str, Any] = {"activity": Activity.READY, "snapshot": look()}
    return StationState(alignment=alignment, **{**known, **changes})


def cut(stage: CutStage = CutStage.CUT, **changes: Any) -> CutProgress:
    angles_deg = np.arange(0.0, 200.0 * 137.0, 137.0) % 360.0
    known: dict[str, Any] = {
        "stage": stage,
        "holding": False,
        "turn": 83.0,
        "turns": 160.0,
        "z_mm": 4.2,
        "length_mm": 8.0,
        "left_s": 4.6,
        "speed_rpm": 1000.3,
        "tool_radius_mm": 25.9271,
        "infeed_um": 72.9,
        "tool_error_um": -0.6,
        "tool_error_peak_um": 1.4,
        "following_error_um": 12.3,
        "phase": PhaseLag(error_deg=0.08, within_deg=0.05),
        "phase_limit_deg": 1.39,
        "synchronisation": Synchronisation.IN_SYNC,
        "ripple": SpindleRipple(1.18, 0.57),
        "angles_deg": angles_deg,
        "errors_um": 0.5 * np.sin(np.radians(3.0 * angles_deg)),
    }
    return CutProgress(**{**known, **changes})


def cutting(**changes: Any) -> StationState:
    return state(activity=Activity.CUTTING, snapshot=look(running=True), cut=cut(**changes))


def stopped(**changes: Any) -> StationState:
    """After a stop that ended a cut."""
    known: dict[str, Any] = {"reason": "space", "killed": False, "sent_s": 98.0, "rest_s": 99.3, "of_cut": True}
    return state(activity=Activity.STOPPED, cut=cut(), stop=StopState(**{**known, **changes}))


@cache
def armed() -> ArmedCut:
    """Experiment 1 armed by cubics, 8.4 s before it ends; its plan is found once for all processes."""
    work = experiment()
    plan = once("armed plan", lambda: plan_cut(work.job, work.machine.machine, Strategy.PVT))
    return ArmedCut(job=work.job, strategy=Strategy.PVT, plan=plan, alignment=VALID, until_s=108.4, made=MADE)


CUT_IN_PART: dict[str, Any] = {"touched": TouchedBlank(to_mm=4.21, of_mm=8.0), "marks_mm": (4.23,)}
"""How a cut leaves the blank that a stop has ended."""

shown = partial(shown_on, RunPage)


STATES = {
    "nothing known": StationState(),
    "ready": state(),
    "not aligned": state(Alignment()),
    "cutting": cutting(),
    "nothing seen yet": cutting(
        stage=CutStage.POSITION,
        phase=None,
        synchronisation=None,
        ripple=None,
        angles_deg=np.empty(0),
        errors_um=np.empty(0),
    ),
    "done": state(cut=cut(CutStage.DONE, figures=FIGURES), cut_done=True),
    "held": state(cut=cut(CutStage.HELD)),
    "queued": cutting(stage=CutStage.RUN_UP, phase=None, synchronisation=Synchronisation.QUEUED),
    "waiting": cutting(stage=CutStage.RUN_UP, phase=None, synchronisation=Synchronisation.WAITING),
    "sync lost": cutting(phase=PhaseLag(error_deg=-1.7, within_deg=0.05), synchronisation=Synchronisation.LOST),
    "guarded": replace(cutting(), snapshot=replace(look(running=True), inputs=GUARDS)),
    "guards open": state(snapshot=replace(look(), inputs=dict.fromkeys(GUARDS, False))),
    "going to the start": state(
        activity=Activity.POSITIONING, cut=cut(CutStage.POSITION, phase=None, synchronisation=None)
    ),
    "not judged": cutting(judged=False, phase=None, synchronisation=None),
    "stopping": stopped(rest_s=None),
    "stop not delivered": stopped(rest_s=None, delivered=False),
    "stop on the way to the start": replace(stopped(tool_in_part=False, of_cut=False), cut=cut(CutStage.POSITION)),
    "lost": replace(stopped(rest_s=None, delivered=False), activity=Activity.LOST, snapshot=look(at_s=88.0)),
    "never found": StationState(activity=Activity.LOST),
    "stopped in the part": stopped(tool_in_part=True, can_retract=True),
    "killed in the part": stopped(tool_in_part=True, killed=True),
    "marked": replace(stopped(tool_in_part=True, can_retract=True, mark_mm=4.23), **CUT_IN_PART),
    "killed and marked": replace(stopped(tool_in_part=True, killed=True, mark_mm=4.23), **CUT_IN_PART),
    "cut in part": state(cut=cut(), **CUT_IN_PART),
}


async def states_shown(page: RunPage, states: Sequence[StationState], work: Work, frames: list[str]) -> None:
    """Show one state after the other, each for one paint."""
    app = PageStage(page, View(state=states[0], work=work, now_s=100.0))
    async with app.run_test(size=(80, 24 - FRAME_ROWS)) as pilot:
        await pilot.pause()
        for now in states:
            page.show(View(state=now, work=work, now_s=100.0))
            await pilot.pause()
            frames.append(grid(app))


def frames_of(states: Sequence[StationState]) -> list[str]:
    work, frames = experiment(), list[str]()
    page = RunPage(ui_for(FixedControl(states[-1]), Path("/nowhere"), "en", work))
    asyncio.run(states_shown(page, states, work, frames))
    return frames
