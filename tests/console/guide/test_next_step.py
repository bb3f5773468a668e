"""The next step: one row in every situation, with words and a key; it leads to a part that was learned from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.cut.alignment import ENDED_EARLY, Alignment
from console.session.cut.compensated_cut import using
from console.session.data.measured_part import MadeWith
from console.session.force_record import ForceCheck
from console.session.guide.refusals import AGAINST, find_refusals
from console.session.guide.rows import ALIGN, INSPECT, RUN, Row, next_step, row_of
from console.session.guide.situation import Situation
from console.session.learning.calibrating import PartLobe, lobe_of
from console.session.learning.part_learning import PartLearning, accept
from console.session.learning.row_faults import RowFaults
from console.session.station.commands import Approach, Arm, Command, ConfirmClamping, Jog, NoteJog, TakeTouchOff
from console.session.station.progress import CutStage
from console.session.station.state import (
    Activity,
    MeasuredForm,
    MeasuredPart,
    StationState,
    StopState,
    TouchedBlank,
)
from console.session.work import Work, open_work
from console.text.catalogue import load
from console.tui.keymap import ACTIONS
from drivers.cutting.feed_hold import HoldReport, HoldState
from drivers.cutting.planning import Strategy
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.workshop_view import CollisionKind, WorkshopView
from profiles.arrays import floats
from profiles.compensations.hypotheses import LatheFault
from profiles.metrology.conformity import DecisionRule, FigureUncertainty
from profiles.metrology.cylindricity import evaluate_points
from profiles.metrology.uncertainty import BudgetRow, UncertaintyBudget
from profiles.problem import Problem
from profiles.store import load_job, load_machine
from profiles.trace_files.sections import SurfacePoints, no_sections
from tests.console.floor import Floor, known, open_floor
from tests.system.lathe_sites import compact_text
from tests.tui import align_stage, run_stage, scenes
from tests.tui.run_stage import VALID, look
from tests.tui.stage import REST, experiment, lathe
from tests.tui.test_faults_on_inspect import FAILED, diagnosis
from tests.tui.test_learning_keys import WRONG

OFF_UNHOMED = REST | {"open_loop"}
ON_UNHOMED = REST | {"amplifier_enabled"}
SNAPSHOTS = (
    None,
    look(tool=250_000.0),  # at the surface
    look(carriage=41_000.0),  # beside the part
    look(tool=0.0),  # at home
    look(run_stage.OFF, tool=250_000.0),
    look(OFF_UNHOMED),
    look(ON_UNHOMED),
)
UNCLAMPED = replace(VALID, clamping=None)
EARLY = replace(UNCLAMPED, lost=(Problem(code=ENDED_EARLY),))
TABLE_ON, TABLE_HOLDS = (Problem(code=f"cut.table_{kind}", key="I51", value="1") for kind in ("on", "holds"))
ALIGNMENTS = (
    Alignment(),
    VALID,
    UNCLAMPED,
    EARLY,
    replace(EARLY, homed=False),
    replace(VALID, drives_on=False),
    replace(VALID, homed=False),
    replace(VALID, jaw=None, touch_off=None),
    replace(VALID, jaw=None, touch_off=None, flanks=(1.0,)),
    replace(VALID, jaw=None, touch_off=None, flanks=(1.0, 2.0, 1.0, 2.0, 1.0, 2.0)),
    replace(VALID, touch_off=None),
    replace(VALID, skim_counts=1.0),
    replace(VALID, tables=(TABLE_ON,)),
    replace(VALID, tables=(TABLE_HOLDS,), homed=False),
)
VIEWS = (
    None,
    WorkshopView(jaw_1_past_mark_deg=-12.34, tool_gap_mm=0.25),
    WorkshopView(jaw_1_past_mark_deg=0.04, tool_gap_mm=0.0),
    WorkshopView(jaw_1_past_mark_deg=0.04, tool_gap_mm=-0.1, collisions=(CollisionKind.STANDING_PART,)),
)
STOP = StopState(reason="space", killed=False, sent_s=1.0)
HOLDS = (HoldState.GOES_OUT, HoldState.COMES_IN)


@cache
def works() -> tuple[Work | None, ...]:
    """Nothing open; a job that may be cut, in air, without compensation, that does not fit, that was edited."""
    work = experiment()
    strange = replace(work, job=replace(work.job, spindle_speed_rpm=1e6))
    forced = replace(work, job=replace(work.job, chucking_force_n=2.0 * work.job.chucking_force_n))
    air = replace(work, stage="air")
    return (
        None,
        work,
        air,
        replace(air, strategy="none"),
        strange,
        forced,
        replace(work, strategy="none", stage="partial"),
    )


def moments() -> Iterator[dict[str, Any]]:
    """Every activity at rest or in motion, stops, the stages of a cut, what is armed and loaded."""
    for activity in Activity:
        yield {"activity": activity}
    for rest_s in (None, 2.0):
        yield {"activity": Activity.STOPPED, "stop": replace(STOP, rest_s=rest_s), "cut": run_stage.cut()}
    for stage, activity in product(CutStage, (Activity.CUTTING, Activity.READY)):
        for changes in ({}, {"holding": True}, {"in_air": True}):
            yield {"activity": activity, "cut": run_stage.cut(stage, **changes)}
    for state in HOLDS:
        yield {"activity": Activity.CUTTING, "cut": run_stage.cut(hold=HoldReport(state=state))}
    yield {"armed": run_stage.armed()}
    yield {"activity": Activity.ARMING, "loading_until_s": 101.0}
    yield {"standing": ConsoleRole.OBSERVER}


def parts() -> Iterator[MeasuredPart | None]:
    """Measured parts: good and bad ones, of half and full compensation, plain ones, each with what it teaches."""
    yield None
    good = scenes.taught_part()
    assert good.learning is not None and good.learning.taught is not None
    learning, taught = good.learning, good.learning.taught
    sure = replace(taught, step=replace(taught.step, expected_half_width_um_pp=0.0))
    turned = RowFaults(diagnosis=diagnosis(LatheFault.ANGLE, LatheFault.DRIFT, 1.0))
    elsewhere = replace(taught, warnings=(Problem(code="learned.lobe_elsewhere"),))
    nothing = [Problem(code=f"learned.{code}") for code in ("worse", "diverges", "nothing")]
    lessons = [
        learning,
        *(replace(learning, taught=each) for each in (sure, elsewhere)),
        replace(learning, taught=sure, faults=turned),
        *(PartLearning(made=learning.made, problems=(each,)) for each in nothing),
    ]
    for lesson, stage, most_um in product(lessons, ("full", "partial"), (2.0, 10.0)):
        made = replace(lesson.made, stage=stage)
        job = replace(good.job, roundness_tolerance_um=most_um, diameter_tolerance_um=20.0)
        part = replace(good, job=job, learning=replace(lesson, made=made))
        for diameter_mm, is_taken in ((None, False), (job.finished_diameter_mm + 0.1, False)):
            yield replace(part, diameter_mm=diameter_mm, offset_taken=is_taken)
        yield replace(part, diameter_mm=job.finished_diameter_mm + 0.1, offset_taken=True)
    yield replace(good, job=replace(good.job, roundness_tolerance_um=10.0, cylindricity_tolerance_um=10.0))
    unknown = FigureUncertainty(rule=DecisionRule.ISO_2017)
    yield replace(good, budget=UncertaintyBudget(gauge="a gauge", rows=(), expanded=unknown))
    yield turned_next()
    worse = RowFaults(worse=(Problem(code="learning.worse"),))
    yield replace(good, learning=replace(learning, faults=worse))
    yield replace(FAILED, marks_mm=(FAILED.job.overhang_mm - 22.0,))
    plain = scenes.part(Strategy.NONE, scenes.BEFORE)
    yield plain
    yield replace(plain, lobe=found_lobe())


def turned_next() -> MeasuredPart:
    """A part on a gauge whose file does not state the error of its spindle."""
    spindle = BudgetRow(source="spindle", roundness_um=None, cylindricity_um=None, diameter_um=0.0)
    unknown = FigureUncertainty(rule=DecisionRule.ISO_2017)
    return replace(
        scenes.taught_part(), budget=UncertaintyBudget(gauge="a gauge", rows=(spindle,), expanded=unknown)
    )


@cache
def found_lobe() -> PartLobe:
    """The lobe of the part that was cut without compensation."""
    plain = scenes.part(Strategy.NONE, scenes.BEFORE)
    filed = PartLobe(loaded=load_job("lee-2001-experiment-1"), file="x", file_sha256="")
    return lobe_of(plain.trace, plain.job, filed, phase_known=True, simulated=True)


def works_after() -> Iterator[Work | None]:
    """What is open after a part: nothing, a job, one that uses what was learned, one that has its lobe or not."""
    work, learning = experiment(), scenes.taught_part().learning
    assert learning is not None and learning.taught is not None
    yield None
    yield replace(work, stage="air")
    yield replace(work, stage="air", strategy="none")
    yield replace(work, compensation=learning.taught.step.next)
    found = known(found_lobe().found)
    fitted = replace(work.job, lobe_error_source="fitted", lobe_error_um_pp=found.fit.error_um_pp)
    yield replace(work, job=fitted)
    yield replace(work, job=fitted, strategy="none")


def situation(state: StationState, work: Work | None, *, jog_enabled: bool = False) -> Situation:
    state = replace(state, jog_enabled=jog_enabled)
    return Situation(state=state, work=work, machine=lathe().machine, now_s=100.0)


def before_the_cut() -> Iterator[Situation]:
    """What the alignment asks for."""
    for alignment, snapshot, seen, work, jogs in product(ALIGNMENTS, SNAPSHOTS, VIEWS, works(), (False, True)):
        state = align_stage.state(alignment, snapshot=snapshot, seen=seen)
        yield situation(state, work, jog_enabled=jogs)


def around_the_cut() -> Iterator[Situation]:
    """What a cut asks for, from its arming on."""
    blanks: tuple[dict[str, Any], ...] = (
        {},
        {"cut_done": True},
        {"cut_done": True, "simulated": False},
        {"touched": TouchedBlank(to_mm=4.0, of_mm=8.0)},
        {"uncommissioned": (Problem(code="stops.none"),)},
    )
    alignments = [each for each in ALIGNMENTS if not each.flanks and each.skim_counts is None]
    for moment, alignment, snapshot in product(moments(), alignments, SNAPSHOTS):
        yield situation(run_stage.state(alignment, **{"snapshot": snapshot, **moment}), experiment())
    for moment, blank, work in product(moments(), blanks, works()):
        yield situation(run_stage.state(VALID, **{**moment, **blank}), work)


def after_the_cut() -> Iterator[Situation]:
    """What a part asks for, once it is cut or measured."""
    air = run_stage.cut(CutStage.DONE, in_air=True)
    activities = (Activity.READY, Activity.MEASURING, Activity.CUTTING)
    for part, work, wrong, done in product(parts(), works_after(), (False, True), (False, True)):
        force = ForceCheck(job=part.job, found=WRONG) if wrong and part is not None else None
        for activity, cut, simulated in product(activities, (None, air), (False, True)):
            changes: dict[str, Any] = {"activity": activity, "cut": cut, "simulated": simulated, "cut_done": done}
            yield situation(run_stage.state(UNCLAMPED, measured=part, force=force, **changes), work)


def after_points() -> Iterator[Situation]:
    """A part that was measured by a helix, within its cylindricity or not."""
    angle = np.arange(0.0, 3600.0, 10.0)
    helix = SurfacePoints(
        strategy="helix",
        angle_deg=floats(angle % 360.0),
        z_mm=floats(22.0 + angle / 450.0),
        deviation_um=floats(np.cos(np.radians(3.0 * angle))),
        meta={},
    )
    for limit_um in (1.0, 5.0):
        form = MeasuredForm(
            job=replace(experiment().job, cylindricity_tolerance_um=limit_um),
            made=MadeWith(compensation="none", strategy="cam", stage="full", inverted="model"),
            whole=evaluate_points(helix),
            meta=helix.meta,
            no_sections=no_sections(helix, ""),
        )
        yield situation(run_stage.state(UNCLAMPED, form=form, cut_done=False), experiment())


def all_situations() -> Iterator[Situation]:
    yield from after_points()
    yield from before_the_cut()
    yield from around_the_cut()
    yield from after_the_cut()


TABLES = {"align": ALIGN, "run": RUN, "inspect": INSPECT}
FACTS = {"force": "1314", "radius": "26.000", "angle": "12.60", "left": "8"}


@pytest.mark.timeout(180)  # forty thousand situations
def test_every_row_is_the_next_step_in_some_situation() -> None:
    """In each situation each page has its row; `row_of` raises where none applies."""
    reached: Counter[int] = Counter()
    for now in all_situations():
        for table in TABLES.values():
            reached[id(row_of(table, now))] += 1
    unreached = [row.word for table in TABLES.values() for row in table if not reached[id(row)]]
    assert unreached == []


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("page", TABLES)
def test_every_word_has_a_sentence_and_every_key_is_one_of_the_keymap(page: str, language: str) -> None:
    text, actions = load(language), {action.id for action in ACTIONS}
    for row in TABLES[page]:
        assert row.word.startswith(f"{page}.")
        said = text(row.sentence, **FACTS)
        assert said != row.sentence and "{" not in said and not said.startswith(f"{page}_page")
        assert row.key is None or row.key in actions
    assert set(AGAINST) <= actions


class Novice:
    """Presses the key of the row, as far as it says; at the mark and at the part the eyes decide."""

    def __init__(self, floor: Floor, work: Work, data: Path) -> None:
        self.floor, self.work, self.data = floor, work, data
        self.open: Work | None = None

    def now(self) -> Situation:
        machine = self.work.machine.machine
        at_s = self.floor.state.at_s
        return Situation(state=self.floor.idle(), work=self.open, machine=machine, now_s=at_s)

    def follow(self, row: Row) -> None:
        self.floor.station.post(NoteJog(enabled=row.key == "align.enable"))
        if row.key == "page.jobs":
            self.open = self.work
        elif row.word == "align.jaw":
            for _ in range(2):
                seen = known(self.floor.idle().seen)
                self.floor.do(Jog(axis=AxisName.SPINDLE, distance=-seen.jaw_1_past_mark_deg))
            self.floor.do(self._command(row))
        elif row.word == "align.touch_off_over":
            self.floor.touch(-0.0005)
        elif row.key == "inspect.accept":
            measured = known(self.floor.state.measured)
            assert measured.learning is not None
            self.open = using(self.work, accept(measured.learning, self.data))
        elif row.key not in ("align.enable", "inspect.next"):
            self.floor.do(self._command(row))

    def _command(self, row: Row) -> Command:
        work, job = self.work, self.work.job
        made: dict[type[Command], Callable[[], Command]] = {
            ConfirmClamping: lambda: ConfirmClamping(job=job),
            Approach: lambda: Approach(job=job),
            TakeTouchOff: lambda: TakeTouchOff(radius_mm=job.radius_mm),
            Arm: lambda: Arm(
                job=job, job_sha256=work.loaded.sha256, strategy=Strategy(work.strategy), loaded=work.loaded
            ),
        }
        assert row.command is not None, row.word
        return made.get(row.command, row.command)()


def test_the_guide_leads_to_a_learned_part(
    tmp_path: Path, job_file: Callable[..., Path], data_folder: Path
) -> None:
    lathe = tmp_path / "lathe.toml"
    lathe.write_text(compact_text("pmac"), encoding="utf-8")
    job = load_job(str(job_file(cut_length_mm="0.5", feed_mm_per_rev="0.1")))
    data, machine = data_folder / "trilobe", load_machine(str(lathe))
    novice = Novice(open_floor(data, 11, "steady", machine), open_work(job, machine), data)
    said: list[str] = []
    while len(said) < 40 and (not said or said[-1] != "inspect.kept"):
        row = next_step(now := novice.now())
        assert find_refusals(row.key or "", now) == (), row.word
        said.append(row.word)
        novice.follow(row)
    align = ["clamp", "drives", "home", "jaw_enable", "jaw", "touch_off", "touch_off_over_enable"]
    align += ["touch_off_over", "touch_off_touching"]
    after = ["run.arm", "run.armed", "inspect.measure", "inspect.failed_scatter", "inspect.kept"]
    assert said == ["run.no_job", *(f"align.{name}" for name in align), *after]


def test_a_part_is_turned_where_the_spindle_of_its_gauge_is_unknown_and_not_again() -> None:
    part = turned_next()
    done = replace(part, trace=replace(part.trace, meta={**part.trace.meta, "gauge_error": "a gauge: 2 UPR"}))
    rows = [
        next_step(situation(run_stage.state(UNCLAMPED, measured=each, cut_done=False), None))
        for each in (part, done)
    ]
    assert [row.key for row in rows] == ["inspect.turned", "inspect.import"]
