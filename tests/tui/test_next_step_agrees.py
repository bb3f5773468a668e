"""The row of the next step says what the page above it says, and asks for nothing that is done already."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from rich.cells import cell_len

from console.session.cut.alignment import Alignment, JawAngle
from console.session.data.learned_store import store
from console.session.data.stop_records import simulated_record
from console.session.data.stop_records import store as store_stops
from console.session.learning.row_faults import RowFaults
from console.session.station.commands import Verify
from console.session.station.machine_connection import CommissioningGate
from console.session.station.progress import CutStage
from console.session.station.state import Activity, MeasuredPart, StationState
from console.session.work import Work, with_strategy
from console.text.catalogue import load
from console.tui.lines import plain_text
from console.tui.pages import run as run_page
from console.tui.pages.align import AlignPage
from console.tui.pages.inspect import InspectPage
from console.tui.pages.jobs import JobsPage
from console.tui.pages.learn_lines import learn_lines
from console.tui.pages.learning_keys import step_compensation
from console.tui.pages.preview import PreviewPage
from console.tui.pages.run import RunPage
from console.tui.pages.setup import SetupPage
from console.tui.previewing import ChosenPath, Previewer
from drivers.cutting.planning import Strategy
from drivers.lathe.heartbeat import Heartbeat
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.compensations.hypotheses import LatheFault
from profiles.compensations.learned_compensation import (
    ExpectedPart,
    LearnedCompensation,
    as_table,
    expected_part,
    from_table,
    path_settings,
)
from profiles.findings import Finding, Severity
from profiles.forecast import LEAST_FORECAST_UM
from profiles.problem import Problem
from tests.console.floor import open_floor
from tests.tui import align_stage, run_stage
from tests.tui.page_stage import READY, PageScene, Shown, on_page, shown_on
from tests.tui.scenes import fixed_world, previewed, signed, taught_part
from tests.tui.stage import EXPERIMENT, FRAME_ROWS, LANGUAGES, experiment, look_at
from tests.tui.test_faults_on_inspect import diagnosis

EN = load("en")
PART = taught_part()
"""A part with 1.8 um of lobe left, of which two clampings may differ by 9.24 um."""


def cam() -> Work:
    return with_strategy(signed(), "cam")


def fails(measured: MeasuredPart) -> MeasuredPart:
    return replace(measured, job=replace(measured.job, roundness_tolerance_um=2.0))


def inspected(measured: MeasuredPart, language: str = "en") -> Shown:
    state = StationState(activity=Activity.READY, measured=measured)
    return shown_on(InspectPage, state, work=cam(), language=language)


def panel(measured: MeasuredPart) -> str:
    """What the panel Learn says, as w shows it."""
    assert measured.learning is not None
    failed = measured.result.ront_um > measured.job.roundness_tolerance_um
    return " ".join(plain_text(learn_lines(measured.learning, cam(), EN, 76, failed=failed)).split())


def test_what_may_not_help_is_not_offered_and_what_is_offered_is_not_called_so() -> None:
    passed, failed = inspected(PART), inspected(fails(PART))
    assert "leave it" in panel(PART) and "a accepts" not in passed.next_step
    assert "leave it" not in panel(fails(PART)) and "a accepts" in failed.next_step
    assert "the next part shows whether it repeats" in panel(fails(PART))
    assert "repeats" in failed.next_step


def test_of_a_lobe_that_is_elsewhere_the_set_up_is_asked_for_first() -> None:
    assert PART.learning is not None and PART.learning.taught is not None
    warned = replace(PART.learning.taught, warnings=(Problem(code="learned.lobe_elsewhere", value="+15 deg"),))
    for measured in (PART, fails(PART)):
        page = inspected(replace(measured, learning=replace(PART.learning, taught=warned)))
        assert page.next_step == EN("inspect_page.next.check_jaw")
        assert "check jaw 1 before a" in " ".join(page.text.split())


@pytest.mark.parametrize("language", LANGUAGES)
def test_where_jaw_1_explains_the_most_it_is_one_remedy_or_the_other(language: str) -> None:
    """A correction learned with jaw 1 taken wrongly would be made twice once jaw 1 is found again."""
    assert PART.learning is not None and PART.learning.taught is not None
    text = load(language)
    turned = RowFaults(diagnosis=diagnosis(LatheFault.ANGLE, LatheFault.DRIFT, 1.0))
    step = replace(PART.learning.taught.step, expected_half_width_um_pp=0.0)  # no two clampings differ
    taught = replace(PART.learning.taught, step=step)
    measured = replace(PART, learning=replace(PART.learning, taught=taught, faults=turned))
    failed = inspected(fails(measured), language)
    assert failed.next_step == text("inspect_page.next.failed_jaw") and cell_len(failed.next_step) <= 77
    assert "not both" in panel(fails(measured))
    assert inspected(measured, language).next_step == text("inspect_page.next.part_learn"), "it passes as it is"


def test_nothing_is_promised_of_what_may_not_be_kept() -> None:
    assert PART.learning is not None and PART.learning.taught is not None
    worse = Problem(code="learned.worse", key="+25 deg", value="67.0 um", limit="55.0 um")
    step = replace(PART.learning.taught.step, reasons=(worse,))
    part_ = replace(PART, learning=replace(PART.learning, taught=replace(PART.learning.taught, step=step)))
    assert "3/rev 1.82 · 6/rev" in panel(part_)
    assert not any(words in panel(part_) for words in ("→", "gain 1 ", "may not help"))


@pytest.mark.parametrize("language", LANGUAGES)
def test_after_the_gauge_run_says_one_thing(language: str) -> None:
    text = load(language)
    done = run_stage.cut(CutStage.DONE, figures=run_stage.FIGURES)
    # Measuring opens the chuck: nothing is clamped and the drives are off.
    now = run_stage.state(
        replace(run_stage.VALID, clamping=None), snapshot=run_stage.look(run_stage.OFF), cut=done, measured=PART
    )
    page = shown_on(RunPage, now, work=cam(), language=language)
    assert page.next_step == text("run_page.next.measured") and cell_len(page.next_step) <= 77
    assert text("run_page.after_measured")[:20] in page.words
    assert not any(words in page.words + page.next_step for words in ("not measured yet", "see the list"))


def test_while_the_tool_is_taken_out_the_row_says_so_and_a_list_that_is_spoken_of_is_there() -> None:
    """After a hold the blank may be cut again; the drives were switched off meanwhile."""
    for language in LANGUAGES:
        for activity, word in ((Activity.RETRACTING, "taken_out"), (Activity.HOMING, "moves")):
            page = shown_on(RunPage, run_stage.state(activity=activity), language=language)
            assert page.next_step == load(language)(f"run_page.next.{word}")
    held = run_stage.state(Alignment(), snapshot=run_stage.look(run_stage.OFF), cut=run_stage.cut(CutStage.HELD))
    page = shown_on(RunPage, held, work=cam())
    assert "see the list" in page.next_step
    assert "✗ drives enabled" in page.text or "✗ alignment valid" in page.text


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    ("carriage_mm", "gap_mm", "said"),
    [
        (41.2, None, "touch_off"),
        (171.0, 0.25, "touch_off_over_enable"),
        (171.0, 0.0, "touch_off_touching"),
        (171.0, -0.003, "touch_off_touching"),
    ],
)
def test_the_touch_off_asks_for_what_is_left_of_it(
    carriage_mm: float, gap_mm: float | None, said: str, language: str
) -> None:
    text = load(language)
    seen = WorkshopView(jaw_1_past_mark_deg=0.0, tool_gap_mm=gap_mm)
    snapshot = align_stage.look(carriage_mm=carriage_mm)
    now = align_stage.state(replace(align_stage.VALID, touch_off=None), seen=seen, snapshot=snapshot)
    page = shown_on(AlignPage, now, language=language)
    assert page.next_step == text(f"align_page.next.{said}", radius="26.000")
    assert cell_len(page.next_step) <= 77
    # F4 takes the tool away from the part, to come in again: it is not proposed to one that is there.
    assert ("F4" in align_stage.words_of(page.text) + page.next_step) is (carriage_mm < 100.0)
    jogging = shown_on(AlignPage, now, "align.enable", language=language)
    assert jogging.next_step in (page.next_step, text("align_page.next.touch_off_over", radius="26.000"))


@pytest.mark.parametrize("language", LANGUAGES)
def test_nobody_is_sent_on_to_align_past_what_was_found(language: str) -> None:
    text, made = load(language), previewed(signed().job)
    warning = Finding(
        severity=Severity.WARNING,
        problem=Problem(code="rule.lobe_unstated", key="lobe_error_source", value="measured", limit="lobe_tool"),
    )
    taught_by = ExpectedPart(ront_um=2.4, lobe=made.target.harmonics[0])
    for found in (False, True):
        seen = replace(made, findings=(warning,) if found else ())
        plainly = replace(signed(), outlook=seen, preview=seen)
        by_part = replace(plainly, preview=replace(seen, taught=taught_by))
        works = (plainly, replace(plainly, stage="air"), replace(plainly, stage="partial"), by_part)
        for work in works:
            page = shown_on(PreviewPage, StationState(activity=Activity.READY), work=work, language=language)
            assert cell_len(page.next_step) <= 77
            opens = text("preview_page.opens_align")
            read = text("preview_page.then_findings", digit="4")
            if work is plainly:
                read = text("preview_page.next_findings", opens=opens)
            assert page.next_step.endswith(read) is found


@pytest.mark.parametrize("language", LANGUAGES)
def test_preview_opens_the_run_where_the_alignment_is_valid(language: str) -> None:
    """It sent to Align after the alignment, too."""
    text, work = load(language), replace(signed(), outlook=(made := previewed(signed().job)), preview=made)
    for alignment, page in ((run_stage.VALID, "run"), (Alignment(), "align")):
        state = StationState(activity=Activity.READY, alignment=alignment)
        shown = shown_on(PreviewPage, state, work=work, language=language)
        assert text(f"preview_page.opens_{page}") in shown.next_step


# What was accepted is what the next part is cut with, in whatever session; where not, the screen says so.


class OnJobs(PageScene):
    page_class = JobsPage

    async def open(self, name: str) -> Work:
        """Select a job and open it."""
        while name not in next(row for row in self.text.splitlines() if "▸" in row):
            before = self.text
            await self.act("jobs.down")
            assert self.text != before, name
        await self.act("jobs.open")
        assert self.ui.work is not None and self.ui.work.loaded.job.name == name
        return self.ui.work


class OnPreview(PageScene):
    page_class = PreviewPage


def learned() -> LearnedCompensation:
    assert PART.learning is not None and PART.learning.taught is not None
    return PART.learning.taught.step.next


def cut_with(version: LearnedCompensation | None) -> Work:
    """Experiment 1 with its preview, which is asked for beside the screen."""
    made = previewed(signed().job)
    return replace(with_strategy(signed(), "cam"), compensation=version, outlook=made, preview=made)


def keep(data: Path, **holds_for: object) -> None:
    """Accept what the part teaches, in a session of its own."""
    version = learned()
    store(data, replace(version, holds_for=replace(version.holds_for, **holds_for)))  # type: ignore[arg-type]


@asynccontextmanager
async def on_jobs(data: Path) -> AsyncIterator[OnJobs]:
    """The console was started anew: no job is in hand."""
    with fixed_world():
        async with on_page(OnJobs, data) as stage:
            yield stage


async def test_what_was_accepted_is_used_after_a_restart_and_after_another_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_page, "changed_since_opened", lambda _: ())  # the revision of this job is made up
    keep(tmp_path)
    opened: list[Work] = []
    async with on_jobs(tmp_path) as stage:
        for name in (EXPERIMENT, "lee-2001-experiment-2"):
            opened.append(await stage.open(name))
            assert stage.codes == []
        await stage.act("jobs.up")
        opened.append(await stage.open(EXPERIMENT))
    first, other, again = opened
    assert (first.compensation, first.strategy) == (learned(), "cam")
    assert (other.compensation, other.strategy, other.set_aside) == (None, "pvt", ())
    assert again.compensation == first.compensation
    page = shown_on(RunPage, run_stage.state(), "run.arm", work=first)
    assert "learned 1, full" in page.text
    (order,) = page.orders
    assert getattr(order, "compensation", None) == learned()


@pytest.mark.parametrize(
    ("settings", "spoil", "code", "told"),
    [
        ({"I130": "999"}, False, "learned.settings_changed", "(I130 999 → 528)"),
        ({}, True, "learned.file", "not a learned compensation"),
    ],
)
async def test_what_does_not_hold_any_more_is_not_used_and_that_is_said(
    settings: dict[str, str], spoil: bool, code: str, told: str, tmp_path: Path
) -> None:
    present = path_settings(signed().job, signed().machine.machine) if settings else {}
    keep(tmp_path, job_sha256="e" * 64, settings=present | settings)
    (file,) = tmp_path.rglob("version-*.json")
    if spoil:
        file.write_text("{", encoding="utf-8")
    opened: list[Work] = []
    async with on_jobs(tmp_path) as stage:
        opened.append(await stage.open(EXPERIMENT))
        assert stage.codes == [code]
    (work,) = opened
    ready = shown_on(RunPage, run_stage.state(), work=work)
    assert work.compensation is None
    assert "! compensation and stage fit" in ready.text and told in ready.words
    assert "F5 arms" in ready.next_step


@pytest.mark.parametrize("language", LANGUAGES)
async def test_a_version_that_is_set_aside_is_told_with_the_key_that_uses_it(
    language: str, tmp_path: Path
) -> None:
    keep(tmp_path)
    text, aside = load(language), []
    async with on_page(OnPreview, tmp_path, work=cut_with(learned()), state=READY, language=language) as stage:
        await stage.act("preview.learned")
        assert stage.ui.work is not None
        aside.append(stage.ui.work)
        (problem,) = stage.ui.work.set_aside
        assert (problem.code, problem.key) == ("learned.set_aside", "1")
        assert "· w" in stage.text and stage.next_step.startswith(text("preview_page.next_aside"))
        assert cell_len(stage.next_step) <= 77
        assert text.problem(problem)[:20] in plain_text(stage.page.in_full(stage.view, 200))
        await stage.act("preview.learned")
        assert (stage.ui.work.compensation, stage.ui.work.set_aside) == (learned(), ())
    run = shown_on(RunPage, run_stage.state(), work=aside[0], language=language)
    assert f"! {text('run_page.check.learned')}" in run.text


async def test_a_version_that_was_learned_elsewhere_meanwhile_is_told_on_run(tmp_path: Path) -> None:
    class OnRun(PageScene):
        page_class = RunPage

    keep(tmp_path)
    async with on_page(OnRun, tmp_path, work=cut_with(learned()), state=run_stage.state()) as stage:
        await stage.show()
        assert stage.ui.work is not None
        assert [problem.code for problem in stage.ui.work.set_aside] == []
        store(tmp_path, replace(learned(), version=2))
        stage.page.leave()
        await stage.show()
        await stage.show()
        assert [(problem.code, problem.key) for problem in stage.ui.work.set_aside] == [("learned.newer", "2")]
        assert "version 2" in stage.text and stage.ui.work.compensation == learned()
        step_compensation(stage.ui)
        assert stage.ui.work.compensation == replace(learned(), version=2)


def test_what_is_expected_of_a_learned_part_is_what_the_part_before_says() -> None:
    """Not the model, which would have the learned path leave the very lobe that it was learned against."""
    version = learned()
    told, half = expected_part(version), expected_part(version, 0.5)
    assert told is not None and half is not None and told.ront_um is not None
    assert version.part is not None and told.ront_um == version.expected_ront_um
    left_um = (1.0 - version.gain) * version.part.lobe.amplitude_um
    assert told.lobe.amplitude_um == pytest.approx(left_um, abs=1e-6)
    assert half.ront_um == pytest.approx(27.5, abs=1.5)
    work = cut_with(version)
    assert work.preview is not None
    work = replace(work, preview=replace(work.preview, strategy=Strategy.CAM, taught=told))
    page = shown_on(PreviewPage, READY, work=work)
    (row,) = [row for row in page.text.splitlines() if "▸ cam" in row]
    assert told.ront_um < LEAST_FORECAST_UM and f" {LEAST_FORECAST_UM:.1f} um" in row
    assert "from the measured part" in page.text
    assert "from the measured part" in page.next_step
    # Two clampings at 5 % of the force, of which the lobe keeps (1314 - 230) / 1314: 1.96 sd of 55 um p-p.
    assert version.part is not None
    clamping_um_pp = 55.0 * 0.05 * 1314.0 / (1314.0 - 230.3)
    trace_um_pp = 2.45 * 2.0 * version.part.lobe_sd_um
    half_um = math.hypot(trace_um_pp, 1.96 * clamping_um_pp, 1.96 * clamping_um_pp)
    assert f"({LEAST_FORECAST_UM:.1f}–{told.ront_um + half_um:.1f})" in page.text


def test_the_preview_is_asked_for_with_what_the_part_says_turned_to_where_jaw_1_is() -> None:
    part_of = learned().part
    assert part_of is not None
    off = replace(learned(), part=replace(part_of, lobe=replace(part_of.lobe, amplitude_um=5.0)))
    work, jaw = cut_with(off), Alignment(jaw=JawAngle(angle_deg=12.63, jaws=3, at="2 Jan 08:45"))
    path, told = ChosenPath().path_for(work, jaw, simulated=True), expected_part(off)
    seen = Previewer().refresh_work(work, jaw, path=path).outlook
    assert path is not None and seen is not None and seen.taught is not None and told is not None
    assert seen.taught.ront_um == told.ront_um
    turned_deg = seen.taught.lobe.phase_deg - told.lobe.phase_deg
    assert turned_deg % 120.0 == pytest.approx((12.63 - work.job.jaw_1_deg) % 120.0)
    in_air = Previewer().refresh_work(replace(work, stage="air"), jaw, path=path).outlook
    by_model = Previewer().refresh_work(replace(work, compensation=None), jaw).outlook
    assert in_air is not None and by_model is not None and (in_air.taught, by_model.taught) == (None, None)


def test_a_version_of_before_says_nothing_of_the_next_part() -> None:
    """Its file has no such key: then nothing is said, and the model is not asked instead."""
    table = as_table(learned())
    del table["expected_ront_um"]
    old = from_table(table)
    told = expected_part(old)
    assert told is not None and told.ront_um is None
    work = cut_with(old)
    assert work.preview is not None
    preview = replace(work.preview, strategy=Strategy.CAM, taught=told)
    page = shown_on(PreviewPage, READY, work=replace(work, preview=preview))
    (row,) = [row for row in page.text.splitlines() if "▸ cam" in row]
    assert " – um" in row


# A machine that nobody has commissioned: said where the job is set up, not after the whole of the alignment.


UNPROVEN = replace(READY, simulated=False, uncommissioned=(Problem(code="stops.no_record", key="shop-3"),))
ROOM = (80, 24 - FRAME_ROWS)


class Setup(PageScene):
    page_class = SetupPage


class Run(PageScene):
    page_class = RunPage


@pytest.mark.parametrize("language", LANGUAGES)
async def test_set_up_says_that_the_machine_may_not_cut_and_what_helps(language: str, tmp_path: Path) -> None:
    async with on_page(Setup, tmp_path, state=UNPROVEN, work=experiment(), language=language, size=ROOM) as stage:
        assert stage.next_step == stage.ui.text("setup.next.uncommissioned")
        assert "✗" in stage.text
        words = " ".join("".join(piece for piece, _ in row) for row in stage.page.in_full(stage.view, 200))
        assert "console doctor" in words and "--prove" in words


async def test_run_names_it_before_everything_else(tmp_path: Path) -> None:
    state = replace(UNPROVEN, snapshot=look_at(frozenset(), tool=0.0, spindle=0.0, carriage=0.0))
    async with on_page(Run, tmp_path, state=state, work=experiment(), size=ROOM) as stage:
        assert stage.ui.text("run_page.check.commissioned") in stage.text


def test_the_machine_is_asked_when_it_is_verified(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    machine = floor.context.loaded_machine.machine
    client = PmacClient(MemoryLink(floor.sim.connect(), floor.sim), floor.sim)
    client.connect()
    heartbeat = Heartbeat(client, floor.sim, machine)
    floor.context.commissioned = CommissioningGate(
        client, heartbeat, machine, tmp_path, lambda: machine.controller.axis_definitions, simulated=False
    )
    assert [each.code for each in floor.do(Verify()).uncommissioned] == ["stops.no_record"]
    record = simulated_record(machine, DIALECTS["pmac"], date.today())
    store_stops(tmp_path, machine, replace(record, address=client.link.address))
    assert floor.do(Verify()).uncommissioned == ()
