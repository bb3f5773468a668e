"""What was accepted is what the next part is cut with, in whatever session; where not, the screen says so."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from rich.cells import cell_len

from console.session.cut.alignment import Alignment, JawAngle
from console.session.data.learned_store import store
from console.session.station.state import Activity, StationState
from console.session.work import Work, with_strategy
from console.text.catalogue import load
from console.tui.lines import plain
from console.tui.pages import run as run_page
from console.tui.pages.jobs import JobsPage
from console.tui.pages.learning_keys import step_compensation
from console.tui.pages.preview import PreviewPage
from console.tui.pages.run import RunPage
from console.tui.previewing import ChosenPath, Previewer
from drivers.cutting.planning import Strategy
from profiles.compensations.learned import (
    LearnedCompensation,
    as_table,
    expected_part,
    from_table,
    path_settings,
)
from profiles.forecast import LEAST_FORECAST_UM
from tests.tui import run_stage
from tests.tui.page_stage import PageScene, on_page, shown_on
from tests.tui.scenes import fixed_world, previewed, signed, taught_part
from tests.tui.stage import EXPERIMENT, LANGUAGES

PART = taught_part()
READY = StationState(activity=Activity.READY)


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
        ({}, False, "learned.job_changed", "revision eeeeee"),
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
        assert text.problem(problem)[:20] in plain(stage.page.in_full(stage.view, 200))
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
    path, told = ChosenPath().of(work, jaw, simulated=True), expected_part(off)
    seen = Previewer().refreshed(work, jaw, path=path).outlook
    assert path is not None and seen is not None and seen.taught is not None and told is not None
    assert seen.taught.ront_um == told.ront_um
    turned_deg = seen.taught.lobe.phase_deg - told.lobe.phase_deg
    assert turned_deg % 120.0 == pytest.approx((12.63 - work.job.jaw_1_deg) % 120.0)
    in_air = Previewer().refreshed(replace(work, stage="air"), jaw, path=path).outlook
    by_model = Previewer().refreshed(replace(work, compensation=None), jaw).outlook
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
