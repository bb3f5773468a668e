"""A part of one's own, from a blank form or from another job; and where its lobe comes from."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from console.session.data.kept_files import jobs_folder
from console.session.work import Work, blank_form, edited, lobe_choices, opened, saved, with_lobe_from
from console.tui.gate import FieldKind
from console.tui.lines import width_of
from console.tui.pages.fields import FORM
from console.tui.pages.jobs import JobsPage
from console.tui.pages.setup import SetupPage
from profiles.problem import ProfileError
from profiles.store import load_job, save_job
from tests.tui.page_stage import PageScene, on_page
from tests.tui.stage import FRAME_ROWS, LANGUAGES, experiment, lathe

ROOM = (80, 24 - FRAME_ROWS)
TYPED = {
    "material": "steel",
    "diameter_mm": "60",
    "wall_thickness_mm": "2",
    "overhang_mm": "25",
    "jaws": "4",
    "chucking_force_n": "2500",
    "depth_of_cut_mm": "0,1",
    "feed_mm_per_rev": "0.05",
    "spindle_speed_rpm": "600",
    "cut_length_mm": "8",
    "roundness_tolerance_um": "5",
}
LOBE = len(FORM) - 1


class Held(PageScene):
    """A page, and what is in its hands."""

    @property
    def draft(self) -> Work:
        assert self.ui.draft is not None
        return self.ui.draft

    @property
    def held(self) -> tuple[bool, bool]:
        """Whether there is a new job, and an open one."""
        return self.ui.draft is not None, self.ui.work is not None


class Form(Held):
    """The page Set-up, with a blank form or with a job."""

    page_class = SetupPage

    async def type(self, text: str) -> None:
        await self.pilot.press(*("space" if each == " " else each for each in text))
        await self.pilot.pause()

    def kind(self) -> FieldKind:
        return self.page.field

    async def begin(self) -> None:
        """What the page Jobs does for a new job."""
        self.ui.draft = blank_form(lathe())
        await self.act("setup.previous")


class Jobs(Held):
    page_class = JobsPage


play = partial(on_page, Form)


def filled(**changed: str) -> Work:
    """A new job with every value."""
    work = blank_form(lathe())
    for key, value in (TYPED | changed).items():
        work = edited(work, key, value)
    return work


def test_a_new_job_has_no_value_that_nobody_gave() -> None:
    work = blank_form(lathe())
    assert work.missing == TYPED.keys()
    assert {field.key for field in FORM} - {"lobe_error_source", "diameter_tolerance_um"} == work.missing
    assert filled().missing == frozenset()
    assert edited(work, "jaws", "2").missing == work.missing - {"jaws"}  # whatever stood in its place


@pytest.mark.parametrize("language", LANGUAGES)
async def test_a_blank_form_is_filled_in_with_tab_and_saved_under_a_name(language: str, tmp_path: Path) -> None:
    async with play(tmp_path, language=language, size=ROOM) as stage:
        await stage.begin()
        assert stage.ui.text("setup.new_title") in stage.text
        assert "2500" not in stage.text and stage.text.count("–") >= len(TYPED)
        await stage.act("setup.save_as")
        assert stage.codes == ["screen.values_missing"]
        await stage.act("setup.edit")
        for typed in (*TYPED.values(), "20"):
            assert width_of(stage.page.next_step(stage.view)) <= 78
            await stage.type(typed)
            await stage.act("setup.next")
        assert stage.kind() is FieldKind.NONE, "behind the last value stands the lobe, which is not typed"
        assert (stage.draft.missing, stage.draft.job.diameter_tolerance_um) == (frozenset(), 20.0)
        await stage.act("setup.previous", "setup.edit")
        await stage.type("-")
        await stage.act("setup.edit")
        assert stage.draft.job.diameter_tolerance_um is None, "a dash takes the tolerance away"
        assert "D 60.000  mm" in stage.text and stage.ui.text("setup.lobe_from.none") in stage.text
        await stage.act("setup.save_as")
        assert "[steel-60 " in stage.text
        await stage.act("setup.edit")
        assert stage.held == (False, True)
        assert stage.ui.work is not None
        assert stage.ui.work.job == load_job("steel-60", jobs_folder(tmp_path)).job
        assert (stage.ui.work.strategy, stage.ui.work.job.copied_from) == ("none", None)
        assert stage.next_step == stage.ui.text("setup.next.plain")


async def test_an_undone_value_is_missing_again(tmp_path: Path) -> None:
    async with play(tmp_path, size=ROOM) as stage:
        await stage.begin()
        await stage.act("setup.edit")
        await stage.type("steel")
        await stage.act("setup.edit")
        assert "material" not in stage.draft.missing
        await stage.act("setup.undo")
        assert "material" in stage.draft.missing


async def test_the_lobe_steps_through_none_and_the_model_and_back_to_the_file(tmp_path: Path) -> None:
    async with play(tmp_path, work=experiment(), size=ROOM) as stage:
        await stage.act(*["setup.next"] * LOBE)
        assert "55.0 um, measured" in stage.text and "as in the file → none yet → by the model" in stage.text
        await stage.act("setup.edit")
        assert stage.next_step == stage.ui.text("setup.next.plain")
        assert stage.ui.work is not None and stage.ui.work.strategy == "none"
        await stage.act("setup.edit")
        assert "by the model" in stage.text and stage.ui.work.strategy != "none"
        await stage.act("setup.edit")
        assert stage.ui.work.job == experiment().job and not stage.ui.work.edited


async def test_what_the_lobe_depends_on_unsets_a_measured_one_and_says_so(tmp_path: Path) -> None:
    for key, typed in (("material", "steel"), ("overhang_mm", "40"), ("spindle_speed_rpm", "600"), ("jaws", "4")):
        async with play(tmp_path, work=edited(experiment(), key, typed), size=ROOM) as stage:
            assert stage.next_step == stage.ui.text("setup.next.lobe")
            await stage.act(*["setup.next"] * LOBE)
            assert "of another cut" in stage.text and "measured with" in stage.text


def test_a_lobe_by_the_model_follows_the_part() -> None:
    work = with_lobe_from(filled(), "model")
    before_um = work.job.lobe_error_um_pp
    doubled = edited(work, "chucking_force_n", "5000").job
    assert doubled.lobe_error_um_pp > 1.8 * before_um > 0.0  # the spring-back, less what the speed takes
    assert edited(work, "roundness_tolerance_um", "3").job.lobe_error_um_pp == before_um
    lost = edited(work, "material", "kryptonite")
    assert (lost.job.lobe_error_source, lost.strategy) == ("none", "none")
    chosen_first = with_lobe_from(blank_form(lathe()), "model")
    for key, value in TYPED.items():
        chosen_first = edited(chosen_first, key, value)
    assert chosen_first.job == work.job


def test_a_bundled_lobe_by_the_model_is_that_of_its_file_again() -> None:
    work = opened(load_job("thin-ring-3-jaws"), lathe())
    there = edited(work, "chucking_force_n", "800")
    assert there.job.lobe_error_um_pp < work.job.lobe_error_um_pp
    assert edited(there, "chucking_force_n", "900").job.lobe_error_um_pp == work.job.lobe_error_um_pp
    assert lobe_choices(work) == ("model", "none")


async def test_an_own_job_is_saved_over_its_file_unless_that_has_changed(tmp_path: Path) -> None:
    folder = jobs_folder(tmp_path)
    path = folder / "ring.toml"
    folder.mkdir()
    save_job(experiment().job, path)
    work = edited(opened(load_job(str(path)), lathe()), "feed_mm_per_rev", "0.04")
    async with play(tmp_path, work=work, size=ROOM) as stage:
        await stage.act("setup.save_as")
        assert "[ring " in stage.text and stage.next_step == stage.ui.text("setup.next.naming_over")
        await stage.act("setup.edit")
        assert stage.ui.work is not None and not stage.ui.work.edited
        assert load_job(str(path)).job.feed_mm_per_rev == 0.04
    with pytest.raises(ProfileError) as raised:
        saved(work)
    assert raised.value.problems[0].code == "job.changed_elsewhere"
    assert load_job(str(path)).job.feed_mm_per_rev == 0.04


async def test_the_list_begins_a_new_job_and_copies_one_and_loses_nothing_silently(tmp_path: Path) -> None:
    async with on_page(Jobs, tmp_path, work=edited(experiment(), "jaws", "4"), size=ROOM) as stage:
        await stage.act("jobs.new")
        assert stage.codes == ["screen.edits_unsaved"] and stage.held == (False, True)
        await stage.act("jobs.new")
        assert stage.held == (True, False)
        stage.ui.draft = edited(stage.draft, "jaws", "4")
        await stage.act("jobs.new")
        assert stage.draft.job.jaws == 4, "the new job that was begun is continued"
        await stage.act("jobs.copy")
        assert stage.codes == ["screen.edits_unsaved"]
        await stage.act("jobs.copy")
        assert stage.held == (False, True) and stage.ui.copying


async def test_a_copy_asks_for_its_name_at_once(tmp_path: Path) -> None:
    async with play(tmp_path, work=experiment(), size=ROOM) as stage:
        stage.ui.copying = True
        stage.page.show(stage.view)
        await stage.pilot.pause()
        assert stage.kind() is FieldKind.TEXT and "[lee-2001-experiment-1-2 " in stage.text
        await stage.act("setup.edit")
        assert stage.ui.work is not None and stage.ui.work.job.copied_from == "lee-2001-experiment-1"
