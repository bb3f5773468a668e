"""Eight fixed scenes, one for each page, on the whole application, without clock and chance."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from textual.pilot import Pilot

from console.session.appearance import Appearance
from console.session.configuration import Configuration
from console.session.cut.alignment import Alignment, JawAngle, TouchOff, aligned_job, clamping_of
from console.session.cut.telemetry import PhaseLag, SpindleRipple
from console.session.data import records
from console.session.data.kept_files import jobs_folder
from console.session.data.measured_part import MadeWith
from console.session.data.record_file import FILE_NAME
from console.session.learning.learning_steps import learn_from_part
from console.session.learning.part_learning import PartLearning
from console.session.station.alarms import FAULT, Alarms, Priority, clear_alarms, raise_alarm
from console.session.station.alarms import acknowledge_shown_alarms as seen_alarms
from console.session.station.commands import Command
from console.session.station.history.alarm_history import Instant
from console.session.station.history.session_log import SessionLog, command_entry, with_state
from console.session.station.progress import AxisToGo, CutPhase, CutProgress, CutStage, PhaseLeft, Synchronisation
from console.session.station.state import Activity, MeasuredPart, StationState
from console.session.work import Work, edit_field
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.controller import errand
from console.tui.keymap import ACTIONS, DIGITS, PageName
from console.tui.pages import job_shelf as shelf
from console.tui.pages import jobs
from console.tui.records import background_reader
from console.tui.theme import COLOUR, Palette
from drivers.cutting.bounds import Bounds, CutAdjustment
from drivers.cutting.planning import Strategy
from drivers.cutting.program_reports import ProgramPlace
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot
from drivers.preview.preview import Preview, preview
from drivers.requests.side_line import SideLine
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.job import Job
from profiles.problem import Problem
from profiles.roundness import evaluate
from profiles.store import LoadedJob, load_job, save_job
from profiles.traces import Trace
from tests.record_clock import set_dates
from tests.tui import records_stage, tune_stage
from tests.tui.page_stage import run_apart
from tests.tui.side_stage import DirectSide
from tests.tui.stage import EXPERIMENT, MACHINE, FixedControl, experiment, lathe

CLOCK = datetime(2026, 1, 2, 8, 52)
NOW_S = 100.0
RECORDED_AT = "2025-12-30T09:15:00.000+00:00"
SHA256 = "3f9a1c" + "0" * 58

ALIKE = 3
"""So often it must stay: a page that was just mounted may not know its size for a tick or two."""

MOST_TICKS = 20

ON = frozenset({"amplifier_enabled", "home_complete"})
REST = ON | {"desired_velocity_zero", "in_position"}
CLAMPED = clamping_of(experiment().job, at="2 Jan 08:40")
FOUND = JawAngle(angle_deg=12.63, jaws=3, at="2 Jan 08:45")
TOUCHED = TouchOff(zero_radius_mm=76.013, diameter_mm=52.0, at="2 Jan 08:46")
AT_JAW = Alignment(settings=(), drives_on=True, homed=True, clamping=CLAMPED)
ALIGNED = replace(AT_JAW, jaw=FOUND, touch_off=TOUCHED)

# What the operator's own folder has besides the bundled jobs, and RONt of the parts that were measured, um.
OWN_JOBS = {"ring-52": {"material": "S45C", "spindle_speed_rpm": 800.0}, "고리-60": {"diameter_mm": 60.0}}
MEASURED_UM = {"lee-2001-experiment-2": 3.412, EXPERIMENT: 2.634}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A page with what the machine, the job in hand and some keys make of it."""

    page: PageName
    state: StationState
    work: Work | None = None
    keys: tuple[str, ...] = ()
    log: SessionLog = field(default_factory=SessionLog)
    side: SideLine | None = None


def scene_of(page: PageName) -> Scene:
    """The scene that is told of a page."""
    match page:
        case PageName.JOBS:
            return Scene(page=page, state=machine(Activity.READY))
        case PageName.SETUP:
            # Another force than that of the lobe error, which is a warning; a comma that may mean thousands.
            work, keys = edit_field(signed(), "chucking_force_n", "1400"), (*["down"] * 8, "enter", *"1,200")
            return Scene(page=page, state=machine(Activity.READY), work=work, keys=keys)
        case PageName.PREVIEW:
            return Scene(page=page, state=machine(Activity.READY), work=signed())
        case PageName.ALIGN:
            state = replace(machine(Activity.READY), alignment=AT_JAW, seen=seen())
            return Scene(page=page, state=state, work=signed(), keys=("j", "+"))
        case PageName.RUN:
            state = replace(machine(Activity.CUTTING), alignment=ALIGNED, cut=cut())
            return Scene(page=page, state=state, work=signed())
        case PageName.RECORDS:
            return Scene(page=page, state=machine(Activity.READY), work=signed(), keys=("down", "b", "down"))
        case PageName.ALARMS:
            alarms, log = alarmed()
            return Scene(page=page, state=replace(machine(Activity.READY), alarms=alarms), work=signed(), log=log)
        case PageName.MORE | PageName.SETTINGS | PageName.TRAIN:
            return Scene(page=page, state=machine(Activity.READY), work=signed())
        case PageName.LOG:
            alarms, log = alarmed()
            return Scene(page=page, state=replace(machine(Activity.READY), alarms=alarms), work=signed(), log=log)
        case PageName.TUNE:
            state = replace(machine(Activity.READY), tool_loop=tune_stage.tool_loop())
            return Scene(page=page, state=state, work=signed())
        case PageName.CALIBRATE:
            return Scene(page=page, state=machine(Activity.READY), work=signed())
        case PageName.SCOPE:
            return Scene(
                page=page, state=machine(Activity.READY), work=signed(), keys=("o", "enter", "n", "right")
            )
        case PageName.CONTROLLER:
            side = DirectSide(lathe().machine)
            return Scene(page=page, state=machine(Activity.READY), work=signed(), keys=("right",), side=side)
        case PageName.INSPECT:
            after, before = taught_part(), part(Strategy.NONE, BEFORE)
            state = replace(machine(Activity.READY), alignment=ALIGNED, measured=after, uncompensated=before)
            return Scene(page=page, state=state, work=signed())


# What the scenes are made of ------------------------------------------------------------------------------------


def signed() -> Work:
    """Experiment 1 with a revision that stays when a word of its file changes."""
    work = experiment()
    return replace(work, loaded=replace(work.loaded, sha256=SHA256))


def alarmed() -> tuple[Alarms, SessionLog]:
    """Three alarms that stand, each in another state, the first of a group among them; and one that is over."""
    ready = machine(Activity.READY)
    fault = Problem(code=FAULT, key="poll", value="tool: amplifier_fault, tool: fatal_following_error")
    log, alarms = SessionLog(), raise_alarm((), Problem(code="cut.spindle_stands"), Priority.MEDIUM, 20.0)
    stands = alarms
    alarms = raise_alarm(alarms, fault, Priority.HIGH, 41.0)
    alarms = raise_alarm(alarms, Problem(code="stops.connection_lost"), Priority.HIGH, 42.5)
    alarms = raise_alarm(alarms, Problem(code="record.lost", value="disk full"), Priority.LOW, 60.0)
    acked = clear_alarms(seen_alarms(alarms, (alarms[0].problem, alarms[3].problem)), "cut.spindle_stands")
    last = raise_alarm(clear_alarms(acked, "stops.connection_lost"), fault, Priority.HIGH, 80.0)
    for now_s, now in ((20.0, stands), (60.0, alarms), (70.0, acked), (90.0, last)):
        clock = CLOCK - timedelta(seconds=NOW_S - now_s)
        log = log.with_entries(command_entry("Acknowledge", taken=True, at=clock)) if now is acked else log
        log = with_state(log, replace(ready, alarms=now), (), Instant(now_s=now_s, clock=clock))
    return last, log


def seen() -> WorkshopView:
    return WorkshopView(jaw_1_past_mark_deg=-17.36, tool_gap_mm=1.043)


def machine(activity: Activity) -> StationState:
    """The simulated lathe half a second after its last look but one, R 27.2346 mm, Z 41.287 mm."""
    flags = REST if activity is Activity.READY else ON
    snapshot = Snapshot(
        asked_s=NOW_S,
        at_s=NOW_S,
        tool=AxisState(position=243_827.0, following_error=3.0, flags=flags),
        spindle=AxisState(position=10_351.0, following_error=-2.0, flags=flags),
        carriage=AxisState(position=41_287.0, following_error=1.0, flags=flags),
        program_running=activity is Activity.CUTTING,
        runtime_error=False,
    )
    return StationState(
        activity=activity,
        machine=MACHINE,
        controller="Turbo PMAC (simulated)",
        at_s=NOW_S,
        round_trip_ms=5.0,
        snapshot=snapshot,
    )


def cut() -> CutProgress:
    """The middle of a cut in phase; two waves, so that no two looks are the same."""
    angles_deg = (np.arange(240.0) * 137.0 + 0.37) % 360.0
    harmonics = 0.61 * np.sin(np.radians(3.0 * angles_deg + 20.0)) + 0.23 * np.sin(
        np.radians(7.0 * angles_deg + 50.0)
    )
    return CutProgress(
        stage=CutStage.CUT,
        holding=False,
        turn=83.2,
        turns=160.0,
        z_mm=4.16,
        length_mm=8.0,
        left_s=4.6,
        speed_rpm=1000.31,
        tool_radius_mm=25.92713,
        infeed_um=72.87,
        tool_error_um=-0.587,
        tool_error_peak_um=1.423,
        following_error_um=12.34,
        phase=PhaseLag(error_deg=0.083, within_deg=0.05),
        phase_limit_deg=1.389,
        synchronisation=Synchronisation.IN_SYNC,
        ripple=SpindleRipple(1.183, 0.568),
        angles_deg=angles_deg,
        errors_um=harmonics + 0.13 * np.cos(1.7 * np.arange(240.0)),
        phases=(PhaseLeft(CutPhase.CUT, 4.6), PhaseLeft(CutPhase.RETRACT, 0.41), PhaseLeft(CutPhase.HOME, 0.83)),
        to_go=(AxisToGo(AxisName.CARRIAGE, 3.84),),
        place=ProgramPlace(program=2, text="X(P11+P12*P55*COS(P27)):(-P15*P55*SIN(P27))", line=31, lines=66),
        adjusted=CutAdjustment(bounds=Bounds(low_percent=95, high_percent=105, gain_percent=10, phase_deg=5.0)),
    )


# Undulations a turn, amplitude in um, angle of a crest in deg: none stands upright on the screen.
BEFORE = ((3, 27.1, 14.3), (2, 1.31, 67.0), (6, 0.83, 31.0), (5, 0.57, 11.0))
AFTER = ((3, 0.91, 21.7), (2, 0.47, 33.0), (6, 0.29, 7.0), (4, 0.23, 49.0), (7, 0.17, 3.0))


def part(strategy: Strategy, harmonics: tuple[tuple[int, float, float], ...]) -> MeasuredPart:
    """A part that was measured off centre, by 4.3 um."""
    angle_deg = np.arange(3600) / 10.0
    deviation_um = 2.7 + 4.3 * np.cos(np.radians(angle_deg - 57.0))
    for n, amplitude_um, phase_deg in harmonics:
        deviation_um = deviation_um + amplitude_um * np.cos(n * np.radians(angle_deg - phase_deg))
    return MeasuredPart(
        job=aligned_job(signed().job, ALIGNED),
        strategy=strategy,
        trace=Trace(angle_deg=angle_deg, deviation_um=deviation_um),
        result=evaluate(angle_deg, deviation_um, 50.0, state="free"),
        jaw_1_deg=FOUND.angle_deg,
    )


def taught(part: MeasuredPart) -> MeasuredPart:
    """The part with what it teaches, when it was cut by the model."""
    meta = {"simulated": "yes", "direction": "spindle", "start_mark": "spindle index"}
    made = MadeWith(
        compensation="none",
        strategy=part.strategy.value,
        stage="full",
        inverted="model",
        cut_jaw_1_deg=str(part.jaw_1_deg),
    )
    trace, work = replace(part.trace, meta=meta), signed()
    found = learn_from_part(
        trace, work.loaded, work.machine, Path("/nowhere"), made, gain=None, robust=False, date=CLOCK.isoformat()
    )
    return replace(part, learning=PartLearning(made=made, taught=found))


@cache
def taught_part(harmonics: tuple[tuple[int, float, float], ...] = AFTER) -> MeasuredPart:
    """The part with these harmonics and what it teaches, found once: some modules name it when they are read."""
    return taught(part(Strategy.CAM, harmonics))


@cache
def previewed(job: Job) -> Preview:
    return preview(job, lathe().machine)


def fill(data: Path) -> None:
    """Save jobs and results in an operator's folder."""
    shutil.copytree(_filled().name, data, dirs_exist_ok=True)


@cache
def _filled() -> tempfile.TemporaryDirectory[str]:
    """A folder that is filled once, to be copied: to write its files takes half as long as to show a page."""
    kept = tempfile.TemporaryDirectory()
    data = Path(kept.name)
    folder = jobs_folder(data)
    folder.mkdir(parents=True)
    for name, changes in OWN_JOBS.items():
        save_job(replace(load_job(EXPERIMENT).job, name=name, **changes), folder / f"{name}.toml")  # type: ignore[arg-type]
    (folder / "unfinished.toml").write_text("name = 3\n", encoding="utf-8")
    (data / FILE_NAME).write_bytes(recorded())
    records_stage.keep_scope_record(data)
    tune_stage.fill(data)
    records_stage.fill_calibrations(data)
    return kept


@cache
def recorded() -> bytes:
    """The file of the run records: last results of some jobs, and four runs of this lathe."""
    names = ("software", "job", "job_sha256", "machine", "machine_sha256", "strategy", "program")
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        set_dates(patch, lambda: RECORDED_AT)  # kept for all tests, whichever asks first
        data = Path(folder)
        run = records.RunRecord(data, {**dict.fromkeys(names, ""), "simulated": 1})
        for job, ront_um in MEASURED_UM.items():
            run.add("measured", {"job": job, "strategy": "pvt", "ront_um": ront_um})
        run.close()
        records_stage.run(data, 27.1, strategy="none", kind="part")
        records_stage.run(data, 0.91, kind="part")
        ring = replace(experiment().job, name="고리-60")
        records_stage.run(data, None, job=ring, end=("stopped", {"reason": "space", "turn": 31.2, "by": "kim"}))
        records_stage.run(data, 1.3, strategy="cam", compensation=2, kind="part")
        return (data / FILE_NAME).read_bytes()


# The application that shows them --------------------------------------------------------------------------------


@contextmanager
def fixed_world() -> Iterator[None]:
    """The day of the records, the time zone and the revisions of the files are always the same."""

    def signed_job(where: str) -> LoadedJob:
        return replace(load_job(where), sha256=SHA256)

    with pytest.MonkeyPatch.context() as patch:
        set_dates(patch, lambda: RECORDED_AT)
        for module in (shelf, jobs):
            patch.setattr(module, "load_job", signed_job)
        patch.setattr(errand, "SHORT_S", 60.0)
        patch.setattr(background_reader, "SHORT_S", 60.0)  # no thread decides what is seen
        patch.setenv("TZ", "UTC")
        time.tzset()
        yield
    time.tzset()


def application(
    scene: Scene,
    data: Path,
    *,
    language: str = "en",
    palette: Palette = COLOUR,
    appearance: Appearance | None = None,
    configuration: Configuration | None = None,
    client: str = "",
) -> tuple[ConsoleApp, FixedControl]:
    """The console as it is started, but for the machine and the clock."""
    control = FixedControl(scene.state, NOW_S)
    control.side = scene.side
    app = ConsoleApp(
        text=load(language),
        palette=palette,
        control=control,
        machine=lathe(),
        data=data,
        local_time=lambda: CLOCK,
        ticking=False,
        appearance=appearance,
        configuration=configuration,
        client=client,
    )
    app.ui.work = scene.work
    app.logs.log = scene.log
    answer(app, scene)
    return app, control


def answer(app: ConsoleApp, scene: Scene) -> None:
    """Have the preview computed before it is asked for: no thread decides what is seen."""
    if scene.work is not None:
        alignment = scene.state.alignment
        job = aligned_job(scene.work.job, alignment)
        made = previewed(job) if scene.page is PageName.PREVIEW else None
        work = replace(scene.work, outlook=made, preview=made)
        app.ui.work = work
        app._previewer._settled = (work, alignment, None)


def keys_to(page: PageName) -> tuple[str, ...]:
    """The keys that show a page: its digit, or that of More and its letter there."""
    if page in DIGITS:
        return (DIGITS[page],)
    letter = next(action.keys[0] for action in ACTIONS if action.id == f"more.{page}")
    return DIGITS[PageName.MORE], letter


@asynccontextmanager
async def played(app: ConsoleApp, scene: Scene, size: tuple[int, int]) -> AsyncIterator[Pilot[None]]:
    """Run the application, go to the page of the scene, press its keys, and wait until nothing changes."""
    async with app.run_test(size=size) as pilot:
        await pilot.pause()
        await pilot.press(*keys_to(scene.page), *scene.keys)
        await settle(app, pilot)
        yield pilot


@asynccontextmanager
async def console_on(
    scene: Scene, data: Path, size: tuple[int, int] = (80, 24), *, filled: bool = True, **given: Any
) -> AsyncIterator[tuple[ConsoleApp, Pilot[None], FixedControl]]:
    """Run the console on the page of a scene, with jobs and results in its folder; no fault may come of it."""
    if filled:
        fill(data)
    app, control = application(scene, data, **given)
    async with played(app, scene, size) as pilot:
        yield app, pilot, control
    assert app.fault is None


def console_at(
    data: Path, page: PageName, state: StationState, *keys: str, **given: Any
) -> AbstractAsyncContextManager[tuple[ConsoleApp, Pilot[None], FixedControl]]:
    """Run the console on a page with the machine in a state and experiment 1 open, some keys pressed already."""
    return console_on(Scene(page=page, state=state, work=experiment(), keys=keys), data, **given)


@dataclass(frozen=True)
class Pressed:
    """The console after some presses; `answers` has the codes after each."""

    app: ConsoleApp
    control: FixedControl
    answers: list[str]

    @property
    def orders(self) -> list[Command]:
        return self.control.orders

    @property
    def said(self) -> list[str]:
        return [problem.code for problem in self.app.ui.key_answer]


def pressed(
    data: Path, now: StationState, page: PageName, *presses: tuple[float, str], settles_s: float = 0.0
) -> Pressed:
    """Press keys at these times, s after the first look; then let some time pass."""
    answers = list[str]()

    async def run() -> Pressed:
        async with console_at(data, page, now) as (app, pilot, control):
            for after_s, key in presses:
                control.at(100.0 + after_s)
                await pilot.press(key)
                await pilot.pause()
                answers.append(" ".join(problem.code for problem in app.ui.key_answer))
            if settles_s:
                control.at(control.now_s() + settles_s)
                app.tick()
        return Pressed(app, control, answers)

    return run_apart(run)


async def settle(app: ConsoleApp, pilot: Pilot[None]) -> None:
    """Tick by hand until the screen stays as it is."""
    before: list[str] = []
    alike = 0
    for _ in range(MOST_TICKS):
        app.tick()
        await pilot.pause()
        now = rows_of(app)
        alike = alike + 1 if now == before else 0
        if alike == ALIKE:
            return
        before = now
    raise AssertionError(f"the screen still changes after {MOST_TICKS} ticks")


def rows_of(app: ConsoleApp) -> list[str]:
    """The characters on the terminal, row by row, with their blanks."""
    return ["".join(segment.text for segment in strip) for strip in app.screen._compositor.render_strips()]
