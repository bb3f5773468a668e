"""Jobs: every saved job can be seen and opened, and no edit is given up without a word."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from rich.cells import cell_len

from console.session.data.kept_files import jobs_folder
from console.session.data.records import RunRecord
from console.session.station.state import Activity, StationState
from console.session.work import Work, blank_form, edit_field, lobe_choices, open_work, save_work, with_lobe_from
from console.text.catalogue import load
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import plain_text, width_of
from console.tui.pages.fields import FORM
from console.tui.pages.jobs import JobsPage
from console.tui.pages.jobs_lines import job_lines
from console.tui.pages.setup import SetupPage
from profiles.problem import ProfileError
from profiles.store import BUNDLED_JOBS, load_job, save_job
from tests.tui.page_stage import READY, PageScene, on_page
from tests.tui.stage import EXPERIMENT, FRAME_ROWS, LANGUAGES, SIZES, experiment, lathe

ROOMS = [(width, height - FRAME_ROWS) for width, height in (*SIZES, (60, 18))]
SOURCE = BUNDLED_JOBS / f"{EXPERIMENT}.toml"


class Stage(PageScene):
    """The page, with the job that is selected on it."""

    page_class = JobsPage

    @property
    def selected(self) -> str:
        (row,) = [row for row in self.text.splitlines() if "▸" in row]
        return row.partition("▸")[2].lstrip(" ●").split()[0]


play = partial(on_page, Stage)


@pytest.fixture
def own(tmp_path: Path) -> Path:
    folder = jobs_folder(tmp_path)
    folder.mkdir(parents=True)
    return folder


def measured(folder: Path, ront_um: float, *, simulated: int, strategy: str = "pvt") -> None:
    names = ("software", "job", "job_sha256", "machine", "machine_sha256", "strategy", "program")
    record = RunRecord(folder, {**dict.fromkeys(names, ""), "simulated": simulated})
    record.add("measured", {"job": EXPERIMENT, "strategy": strategy, "ront_um": ront_um})
    record.close()


@pytest.mark.parametrize("size", ROOMS)
@pytest.mark.parametrize("language", LANGUAGES)
async def test_the_saved_jobs_and_the_selected_one_are_seen(
    size: tuple[int, int], language: str, tmp_path: Path
) -> None:
    async with play(tmp_path, language=language, size=size) as stage:
        await stage.show()
        rows = stage.text.splitlines()
        assert len(rows) <= size[1]
        assert all(cell_len(row) <= size[0] for row in rows)
        assert stage.selected == EXPERIMENT
        assert "lee-2001-experiment-2" in stage.text
        assert "1000.0 rpm" in stage.text
        assert 0 < width_of(stage.page.next_step(stage.view)) <= 78


async def test_the_summary_says_what_is_known_and_where_it_comes_from(tmp_path: Path) -> None:
    async with play(tmp_path) as stage:
        for words in (
            "D 52.0 x 2.5 mm",
            "assumed 1314.0 N",
            "0.100 mm",
            "3 jaws, 50.0 Hz",
            "measured 55.0 um",
            "never measured",
            load_job(EXPERIMENT).sha256[:6] + ", bundled",
            "Lee & Lee 2001",
        ):
            assert words in stage.text


@pytest.mark.parametrize(
    ("ront_um", "strategy", "real", "words"),
    [
        (2.634, "pvt", False, ("2.63 um", "LSC, 1-50 UPR, free state", "simulated, not machined")),
        (55.02, "none", False, ("cut without compensation",)),
        (2.634, "pvt", True, ("never measured",)),
    ],
)
async def test_a_measured_part_is_shown_with_what_was_measured_on_this_machine(
    ront_um: float, strategy: str, real: bool, words: tuple[str, ...], tmp_path: Path
) -> None:
    measured(tmp_path, ront_um, simulated=1, strategy=strategy)
    async with play(tmp_path, state=replace(READY, simulated=not real)) as stage:
        assert all(each in stage.text for each in words)
        assert ("2.63" in stage.text) is (ront_um < 10.0 and not real)


async def test_a_wide_and_tall_terminal_shows_tags_force_and_the_latest_parts(own: Path, tmp_path: Path) -> None:
    tagged = SOURCE.read_text("utf-8").replace("schema = 1\n", 'schema = 1\ntags = ["trial", "thin"]\n', 1)
    (own / "tagged.toml").write_text(tagged.replace(EXPERIMENT, "tagged"), "utf-8")
    for ront_um in (3.51, 2.63):
        measured(tmp_path, ront_um, simulated=1)
    async with play(tmp_path, size=ROOMS[2]) as stage:
        await stage.show()
        (row,) = [row for row in stage.text.splitlines() if row.partition("tagged")[2].startswith("  ")]
        assert "1314" in row and "trial thin" in row
        assert "Latest parts (2)" in stage.text
        newest, oldest = stage.text.index("2.63 um", stage.text.index("Latest")), stage.text.index("3.51 um")
        assert newest < oldest


async def test_a_lobe_that_is_not_known_yet_or_tiny_is_not_shown_as_zero(own: Path, tmp_path: Path) -> None:
    text = SOURCE.read_text("utf-8").replace("lobe_error_um_pp = 55.0", "lobe_error_um_pp = 0.0")
    text = text.replace('lobe_error_source = "measured"', 'lobe_error_source = "none"')
    (own / "unknown.toml").write_text(text.replace(EXPERIMENT, "unknown"), "utf-8")
    async with play(tmp_path, size=ROOMS[2]) as stage:
        await stage.show()
        (unknown,) = [row for row in stage.text.splitlines() if "unknown" in row]
        assert unknown.split()[:6] == ["│", "unknown", "Al", "52.0", "1000", "–"]
        (tiny,) = [row for row in stage.text.splitlines() if "steel-bar-65" in row]
        assert "< 0.1" in tiny and " 0.0 " not in tiny


async def test_a_job_that_cannot_be_read_is_listed_with_the_reason(own: Path, tmp_path: Path) -> None:
    (own / "a [bold].toml").write_text("name = 3")
    (own / os.fsdecode(b"b\xff.toml")).write_bytes(SOURCE.read_bytes())
    async with play(tmp_path) as stage:
        assert "a [bold]" in stage.text
        assert "cannot be read" in stage.text
        assert "name = 3 is not text" in stage.text
        assert r"b\udcff" in stage.text
        await stage.act("jobs.open")
        assert "value.not_text" in stage.codes
        assert stage.gone == []


async def test_enter_opens_the_selected_job_at_set_up(own: Path, tmp_path: Path) -> None:
    save_job(replace(load_job(str(SOURCE)).job, name="my ring"), own / "my ring.toml")
    async with play(tmp_path) as stage:
        await stage.act("jobs.down", "jobs.down", "jobs.open")
        assert stage.gone == [PageName.SETUP]
        assert stage.ui.work is not None
        assert stage.ui.work.loaded.path == own / "my ring.toml"


async def test_the_job_in_hand_keeps_its_edits(tmp_path: Path) -> None:
    work = edit_field(experiment(), "jaws", "4")
    async with play(tmp_path, work=work) as stage:
        assert "edits not saved" in stage.text
        await stage.act("jobs.open")
        assert stage.ui.work is work
        assert stage.gone == [PageName.SETUP]


async def test_edits_are_given_up_on_the_second_enter_only(tmp_path: Path) -> None:
    work = edit_field(experiment(), "jaws", "4")
    async with play(tmp_path, work=work) as stage:
        await stage.act("jobs.down", "jobs.open")
        assert stage.codes == ["screen.edits_unsaved"]
        assert (stage.ui.work, stage.gone) == (work, [])
        await stage.act("jobs.up", "jobs.down", "jobs.open")
        assert (stage.ui.work, stage.gone) == (work, [])
        await stage.act("jobs.open")
        assert stage.ui.work is not None
        assert stage.ui.work.job.name == "lee-2001-experiment-2"


def armed() -> Any:
    return object()


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    ("state", "code"),
    [
        (replace(READY, activity=Activity.CUTTING), "screen.open_moving"),
        (replace(READY, activity=Activity.ARMING), "screen.open_armed"),
        (replace(READY, armed=armed()), "screen.open_armed"),
    ],
)
async def test_no_job_is_opened_while_it_matters(
    state: StationState, code: str, language: str, tmp_path: Path
) -> None:
    async with play(tmp_path, work=experiment(), state=state, language=language) as stage:
        await stage.act("jobs.down", "jobs.open")
        assert stage.codes == [code]
        assert stage.gone == []
        assert width_of(stage.page.next_step(stage.view)) <= 78
        stage.ui.key_answer = ()
        stage.page.open_named("lee-2001-experiment-2")  # by a scanned code
        assert (stage.codes, stage.gone) == ([code], [])


async def test_a_scanned_code_opens_its_job_and_gives_up_edits_at_the_second_time(tmp_path: Path) -> None:
    async with play(tmp_path, work=edit_field(experiment(), "feed_mm_per_rev", "0.04")) as stage:
        stage.page.open_named("lee-2001-experiment-2")
        assert (stage.codes, stage.gone) == (["screen.edits_unsaved"], [])
        stage.page.open_named("LEE-2001-EXPERIMENT-2")
        assert stage.gone == [PageName.SETUP]
        assert stage.ui.work is not None and stage.ui.work.loaded.path.stem == "lee-2001-experiment-2"


async def test_files_are_listed_again_when_the_page_comes_back(own: Path, tmp_path: Path) -> None:
    async with play(tmp_path) as stage:
        await stage.act("jobs.down")
        shutil.copy(SOURCE, own / "a-ring.toml")
        await stage.show()
        assert "a-ring" not in stage.text
        stage.page.leave()
        await stage.show()
        assert "a-ring" in stage.text
        assert stage.selected == "lee-2001-experiment-2"


async def test_a_page_without_room_does_not_break(tmp_path: Path) -> None:
    async with play(tmp_path) as stage:
        for size in ((1, 1), (10, 3), (30, 5)):
            await stage.pilot.resize_terminal(*size)
            await stage.act("jobs.down", "jobs.up")


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_lobe_of_a_model_and_that_of_another_cut_are_whole_at_80_columns(language: str) -> None:
    """So is one below what is shown: < 0.1 um. Another force in a file makes the lobe that of another cut."""
    text, names = load(language), ("steel-bar-65", "thin-ring-3-jaws", "thin-ring-6-jaws")
    shown = {name: plain_text(job_lines(load_job(name).job, text, 32)) for name in names}
    for rows in shown.values():
        assert text("jobs_page.model") in rows and "um" in rows and "…" not in rows
    assert "< 0.1 um" in shown["steel-bar-65"]
    other = replace(load_job("lee-2001-experiment-1").job, chucking_force_n=9314.0)
    rows = plain_text(job_lines(other, text, 32))
    assert text("source.other_cut") in rows and "55.0 um" in rows and "…" not in rows


# A part of one's own, from a blank form or from another job; and where its lobe comes from.


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


on_form = partial(on_page, Form)


def filled(**changed: str) -> Work:
    """A new job with every value."""
    work = blank_form(lathe())
    for key, value in (TYPED | changed).items():
        work = edit_field(work, key, value)
    return work


def test_a_new_job_has_no_value_that_nobody_gave() -> None:
    work = blank_form(lathe())
    assert work.missing == TYPED.keys()
    optional = {"lobe_error_source", "cylindricity_tolerance_um", "diameter_tolerance_um"}
    assert {field.key for field in FORM} - optional == work.missing
    assert filled().missing == frozenset()
    assert edit_field(work, "jaws", "2").missing == work.missing - {"jaws"}  # whatever stood in its place


@pytest.mark.parametrize("language", LANGUAGES)
async def test_a_blank_form_is_filled_in_with_tab_and_saved_under_a_name(language: str, tmp_path: Path) -> None:
    async with on_form(tmp_path, language=language, size=ROOM) as stage:
        await stage.begin()
        assert stage.ui.text("setup.new_title") in stage.text
        assert "2500" not in stage.text and stage.text.count("–") >= len(TYPED)
        await stage.act("setup.save_as")
        assert stage.codes == ["screen.values_missing"]
        await stage.act("setup.edit")
        await stage.type("steel")
        await stage.act("setup.edit")
        assert "material" not in stage.draft.missing
        await stage.act("setup.undo")
        assert "material" in stage.draft.missing
        await stage.act("setup.edit")
        for typed in (*TYPED.values(), "8", "20"):
            assert width_of(stage.page.next_step(stage.view)) <= 78
            await stage.type(typed)
            await stage.act("setup.next")
        assert stage.kind() is FieldKind.NONE, "behind the last value stands the lobe, which is not typed"
        assert (stage.draft.missing, stage.draft.job.diameter_tolerance_um) == (frozenset(), 20.0)
        assert stage.draft.job.cylindricity_tolerance_um == 8.0
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


async def test_the_lobe_steps_through_none_and_the_model_and_back_to_the_file(tmp_path: Path) -> None:
    async with on_form(tmp_path, work=experiment(), size=ROOM) as stage:
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
        async with on_form(tmp_path, work=edit_field(experiment(), key, typed), size=ROOM) as stage:
            assert stage.next_step == stage.ui.text("setup.next.lobe")
            await stage.act(*["setup.next"] * LOBE)
            assert "of another cut" in stage.text and "measured with" in stage.text


def test_a_lobe_by_the_model_follows_the_part() -> None:
    work = with_lobe_from(filled(), "model")
    before_um = work.job.lobe_error_um_pp
    doubled = edit_field(work, "chucking_force_n", "5000").job
    assert doubled.lobe_error_um_pp > 1.8 * before_um > 0.0  # the spring-back, less what the speed takes
    assert edit_field(work, "roundness_tolerance_um", "3").job.lobe_error_um_pp == before_um
    lost = edit_field(work, "material", "kryptonite")
    assert (lost.job.lobe_error_source, lost.strategy) == ("none", "none")
    chosen_first = with_lobe_from(blank_form(lathe()), "model")
    for key, value in TYPED.items():
        chosen_first = edit_field(chosen_first, key, value)
    assert chosen_first.job == work.job


def test_a_bundled_lobe_by_the_model_is_that_of_its_file_again() -> None:
    work = open_work(load_job("thin-ring-3-jaws"), lathe())
    there = edit_field(work, "chucking_force_n", "800")
    assert there.job.lobe_error_um_pp < work.job.lobe_error_um_pp
    assert edit_field(there, "chucking_force_n", "900").job.lobe_error_um_pp == work.job.lobe_error_um_pp
    assert lobe_choices(work) == ("model", "none")


async def test_an_own_job_is_saved_over_its_file_unless_that_has_changed(tmp_path: Path) -> None:
    folder = jobs_folder(tmp_path)
    path = folder / "ring.toml"
    folder.mkdir()
    save_job(experiment().job, path)
    work = edit_field(open_work(load_job(str(path)), lathe()), "feed_mm_per_rev", "0.04")
    async with on_form(tmp_path, work=work, size=ROOM) as stage:
        await stage.act("setup.save_as")
        assert "[ring " in stage.text and stage.next_step == stage.ui.text("setup.next.naming_over")
        await stage.act("setup.edit")
        assert stage.ui.work is not None and not stage.ui.work.edited
        assert load_job(str(path)).job.feed_mm_per_rev == 0.04
    with pytest.raises(ProfileError) as raised:
        save_work(work)
    assert raised.value.problems[0].code == "job.changed_elsewhere"
    assert load_job(str(path)).job.feed_mm_per_rev == 0.04


async def test_the_list_begins_a_new_job_and_copies_one_and_loses_nothing_silently(tmp_path: Path) -> None:
    async with on_page(Jobs, tmp_path, work=edit_field(experiment(), "jaws", "4"), size=ROOM) as stage:
        await stage.act("jobs.new")
        assert stage.codes == ["screen.edits_unsaved"] and stage.held == (False, True)
        await stage.act("jobs.new")
        assert stage.held == (True, False)
        stage.ui.draft = edit_field(stage.draft, "jaws", "4")
        await stage.act("jobs.new")
        assert stage.draft.job.jaws == 4, "the new job that was begun is continued"
        await stage.act("jobs.copy")
        assert stage.codes == ["screen.edits_unsaved"]
        await stage.act("jobs.copy")
        assert stage.held == (False, True) and stage.ui.copying


async def test_a_copy_asks_for_its_name_at_once(tmp_path: Path) -> None:
    async with on_form(tmp_path, work=experiment(), size=ROOM) as stage:
        stage.ui.copying = True
        stage.page.show(stage.view)
        await stage.pilot.pause()
        assert stage.kind() is FieldKind.TEXT and "[lee-2001-experiment-1-2 " in stage.text
        await stage.act("setup.edit")
        assert stage.ui.work is not None and stage.ui.work.job.copied_from == "lee-2001-experiment-1"
