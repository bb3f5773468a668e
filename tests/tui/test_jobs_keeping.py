"""Jobs: found among thousands, renamed, labelled, deleted and brought back, imported and exported."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from rich.cells import cell_len

from console.session.data.kept_files import jobs_folder
from console.session.station.state import Activity
from console.session.work import edit_field, open_work
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.pages import job_shelf as shelf
from profiles.files import read_toml
from profiles.store import BUNDLED_JOBS, LoadedJob, list_jobs, load_job
from tests.tui.page_stage import NEXT_STEP_CELLS, READY, PageScene, on_page
from tests.tui.stage import EXPERIMENT, LANGUAGES, lathe
from tests.tui.test_jobs_page import Stage, measured

SOURCE = BUNDLED_JOBS / f"{EXPERIMENT}.toml"
play = partial(on_page, Stage)


@pytest.fixture
def own(tmp_path: Path) -> Path:
    folder = jobs_folder(tmp_path)
    folder.mkdir(parents=True)
    return folder


def put(folder: Path, name: str, material: str = "Al", first: str = "") -> Path:
    text = SOURCE.read_text(encoding="utf-8").replace(EXPERIMENT, name, 1)
    path = folder / f"{name}.toml"
    path.write_text(first + text.replace('material = "Al"', f'material = "{material}"', 1), encoding="utf-8")
    return path


async def typed(stage: PageScene, words: str, *, enter: bool = True) -> None:
    for letter in words:
        await stage.pilot.press({" ": "space", "/": "slash", ".": "full_stop", "-": "minus"}.get(letter, letter))
    if enter:
        await stage.act("jobs.open")


async def indexed(stage: Stage) -> None:
    while stage.page._jobs_shelf.is_reading:  # type: ignore[attr-defined]
        await stage.show()


def names(stage: Stage) -> Sequence[str]:
    return [entry.name for entry in stage.page._shelf.entries]  # type: ignore[attr-defined]


async def test_a_search_goes_over_name_material_and_tags_as_it_is_typed(own: Path, tmp_path: Path) -> None:
    put(own, "flange", "S45C", 'tags = ["urgent", "Kim"]\n')
    put(own, "sleeve", "C3604")
    async with play(tmp_path) as stage:
        for words, found in (
            ("kim", ["flange"]),
            ("c36", ["sleeve"]),
            ("sle", ["sleeve"]),
            ("s45 urg", ["flange"]),
        ):
            await stage.act("jobs.search")
            assert stage.page.field is FieldKind.TEXT
            await typed(stage, words, enter=False)
            await indexed(stage)
            assert names(stage) == found
            heading, typed_row = stage.text.splitlines()[:2]
            assert f"(1 of {len(list_jobs()) + 2}) · /{words} · by name" in heading
            assert words in typed_row and typed_row.count("│") == 4, "the entry covers no border"
            stage.page._entry.close()  # type: ignore[attr-defined]
            await stage.act("jobs.back")
        assert len(names(stage)) == len(list_jobs()) + 2


async def test_enter_ends_a_search_and_opens_a_single_match(own: Path, tmp_path: Path) -> None:
    put(own, "flange-1")
    put(own, "flange-2")
    async with play(tmp_path) as stage:
        await stage.act("jobs.search")
        await typed(stage, "flange")
        assert (stage.gone, stage.page.field, names(stage)) == ([], FieldKind.NONE, ["flange-1", "flange-2"])
        await stage.act("jobs.search")
        await typed(stage, "lee")  # other words, in the place of those before
        assert not [name for name in names(stage) if "flange" in name]
        await stage.act("jobs.search")
        await typed(stage, "flange")
        await stage.act("jobs.search")
        await stage.pilot.press("end")
        await typed(stage, "-2")  # behind the words before
        assert stage.gone == [PageName.SETUP]
        assert stage.ui.work is not None and stage.ui.work.job.name == "flange-2"


async def test_of_two_thousand_jobs_a_key_reads_what_is_seen_and_each_file_is_indexed_once(
    own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counted in a list of 400: the counts do not depend on how many there are, the time of the test does."""
    for number in range(400):
        put(own, f"part-{number:04d}")
    loads: list[str] = []
    reads: list[Path] = []

    def counted_load(reference: str) -> LoadedJob:
        loads.append(reference)
        return load_job(reference)

    def counted_read(path: Path) -> tuple[bytes, dict[str, object]]:
        reads.append(path)
        return read_toml(path)

    monkeypatch.setattr(shelf, "load_job", counted_load)
    monkeypatch.setattr(shelf, "read_toml", counted_read)
    async with play(tmp_path) as stage:
        assert len(loads) <= 18 and reads == []  # the first frame: a screenful, and no index
        await stage.act("jobs.search")
        await typed(stage, "part-0399", enter=False)
        await indexed(stage)
        await stage.show()
        everything = len(list_jobs()) + 400
        assert len(reads) == everything
        await typed(stage, "")
        assert stage.gone == [PageName.SETUP]
        stage.page.leave()
        os.utime(own / "part-0007.toml", ns=(1, 1))
        await stage.show()
        await indexed(stage)
        assert reads[everything:] == [own / "part-0007.toml"]  # again only what has changed
        before = len(loads)
        await stage.act("jobs.back", "jobs.last")
        assert names(stage)[-1] == "two-jaw-tube" and len(loads) - before <= 36


async def test_the_index_is_not_read_while_something_moves(
    own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(own, "flange", "S45C")
    monkeypatch.setattr(shelf, "read_toml", lambda path: pytest.fail("read in motion"))
    async with play(tmp_path, state=replace(READY, activity=Activity.CUTTING)) as stage:
        await stage.act("jobs.search")
        await typed(stage, "flan")
        await stage.show()
        assert names(stage) == ["flange"] and "reading" in stage.text


async def test_the_list_is_sorted_and_says_by_what(own: Path, tmp_path: Path) -> None:
    put(own, "zinc", "AA")
    measured(tmp_path, 2.6, simulated=1)
    os.utime(put(own, "zebra", "ZZ"), ns=(2**62, 2**62))
    async with play(tmp_path) as stage:
        assert "by name" in stage.text
        for words, first in (("by last change", "zebra"), ("by last result", EXPERIMENT), ("by material", "zinc")):
            await stage.act("jobs.sort")
            await indexed(stage)
            await stage.act("jobs.first")
            assert words in stage.text and names(stage)[0] == stage.selected == first


async def test_a_long_list_goes_along_with_the_selection_by_rows_pages_and_ends(own: Path, tmp_path: Path) -> None:
    for number in range(60):
        put(own, f"a-{number:02d}")
    async with play(tmp_path) as stage:
        assert "more below" in stage.text
        for _ in range(20):
            await stage.act("jobs.down")
            assert stage.selected
        assert "more above" in stage.text
        await stage.act("jobs.first")
        for action, selected in (("page_down", "a-14"), ("page_up", "a-00"), ("last", "two-jaw-tube")):
            await stage.act(f"jobs.{action}")
            assert stage.selected == selected
        assert "more below" not in stage.text
        await stage.act("jobs.down")
        assert stage.selected == "two-jaw-tube"
        await stage.act("jobs.first")
        assert stage.selected == "a-00"


async def test_the_open_job_is_marked(tmp_path: Path) -> None:
    work = open_work(load_job("two-jaw-tube"), lathe())
    async with play(tmp_path, work=work) as stage:
        assert "▸●two-jaw-tube" in stage.text and "open job" in stage.text
        await stage.act("jobs.up")
        assert " ●two-jaw-tube" in stage.text and "open job" not in stage.text


async def test_a_job_is_renamed_and_stays_open(own: Path, tmp_path: Path) -> None:
    path = put(own, "a-ring")
    work = open_work(load_job(str(path)), lathe())
    async with play(tmp_path, work=work) as stage:
        await stage.act("jobs.rename")
        await typed(stage, "-2")
        assert stage.codes == ["screen.job_renamed"]
        assert not path.exists() and stage.selected == "a-ring-2"
        assert stage.ui.work is not None and stage.ui.work.job.name == "a-ring-2" and not stage.ui.work.edited


async def test_a_name_that_cannot_be_is_refused_stays_in_the_entry_and_is_discarded_with_a_word(
    own: Path, tmp_path: Path
) -> None:
    put(own, "a-ring")
    async with play(tmp_path) as stage:
        await stage.act("jobs.rename")
        for name, code in (
            ("two-jaw-tube", "screen.name_taken"),
            ("../x", "file.name_unfit"),
            ("x" * 61, "file.name_long"),
        ):
            stage.ui.key_answer = ()
            stage.page._entry.value = name  # type: ignore[attr-defined]
            await stage.act("jobs.open")
            assert stage.codes == [code] and stage.page.field is FieldKind.TEXT
            assert (own / "a-ring.toml").exists()
        stage.ui.key_answer = ()
        stage.page.leave()
        assert stage.codes == ["screen.job_entry_dropped"] and (own / "a-ring.toml").exists()


async def test_note_and_tags_are_shown_and_the_open_job_keeps_its_edits_and_its_hash(
    own: Path, tmp_path: Path
) -> None:
    path = put(own, "a-ring")
    work = edit_field(open_work(load_job(str(path)), lathe()), "jaws", "4")
    async with play(tmp_path, work=work) as stage:
        await stage.act("jobs.note")
        await typed(stage, "soft jaws only")
        await stage.act("jobs.tags")
        await typed(stage, "urgent kim urgent")
        assert "soft jaws only" in stage.text and "urgent kim" in stage.text
        now = stage.ui.work
        assert now is not None and now.edited and now.job.jaws == 4
        assert (now.job.note, now.job.tags) == ("soft jaws only", ("urgent", "kim"))
        assert now.loaded.sha256 == work.loaded.sha256 and now.undo[0][0].note == "soft jaws only"
        assert read_toml(path)[1]["tags"] == ["urgent", "kim"]


async def test_a_job_is_deleted_by_the_second_press_and_comes_back(own: Path, tmp_path: Path) -> None:
    path = put(own, "a-ring")
    before = load_job(str(path)).job
    async with play(tmp_path) as stage:
        await stage.act("jobs.delete")
        assert stage.codes == ["screen.job_delete_again"] and path.exists()
        await stage.act("jobs.down", "jobs.up", "jobs.delete")
        assert path.exists(), "another key in between: the question is asked anew"
        await stage.act("jobs.delete")
        assert not path.exists() and "a-ring" not in stage.text
        put(own, "a-ring", "S45C")  # somebody makes another one of this name meanwhile
        await stage.act("jobs.undo")
        assert stage.codes == ["screen.job_back"] and stage.selected == "a-ring-2"
        back = load_job("a-ring-2", own).job
        assert back == replace(before, name="a-ring-2")
        await stage.act("jobs.undo")
        assert stage.codes == ["screen.nothing_deleted"]


async def test_the_open_job_is_closed_when_it_is_deleted_and_kept_with_unsaved_edits(
    own: Path, tmp_path: Path
) -> None:
    path = put(own, "a-ring")
    work = open_work(load_job(str(path)), lathe())
    async with play(tmp_path, work=work) as stage:
        stage.ui.work = edit_field(work, "jaws", "4")
        await stage.act("jobs.delete", "jobs.delete")
        assert stage.codes == ["screen.job_edited"] and path.exists()
        stage.ui.work = work
        await stage.act("jobs.delete", "jobs.delete")
        assert not path.exists()
        assert stage.ui.work is None


async def test_a_supplied_job_stays_as_it_is_and_nothing_is_changed_in_motion_or_armed(
    own: Path, tmp_path: Path
) -> None:
    async with play(tmp_path) as stage:
        for action in ("rename", "note", "tags", "delete"):
            await stage.act(f"jobs.{action}", f"jobs.{action}")
            assert stage.codes == ["screen.job_bundled"] and stage.page.field is FieldKind.NONE
        put(own, "a-ring")
        stage.page.leave()
        await stage.show()
        await stage.act("jobs.first")
        for action in ("rename", "note", "tags", "delete", "undo", "import"):
            for activity, code in (
                (Activity.CUTTING, "screen.jobs_moving"),
                (Activity.ARMING, "screen.jobs_armed"),
            ):
                stage.control.state = replace(READY, activity=activity)
                await stage.act(f"jobs.{action}")
                assert stage.codes == [code], action


async def test_a_sound_file_is_imported_byte_for_byte_and_another_one_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "import"
    folder.mkdir()
    good = put(folder, "from-usb", first="# theirs\n")
    bad = put(folder, "flipped")
    bad.write_bytes(good.read_bytes().replace(b"jaws = 3", b"jaws = 33", 1))
    shutil.copy(good, folder / f"{EXPERIMENT}.toml")
    async with play(tmp_path) as stage:
        await stage.act("jobs.import")
        assert "Files to import (3)" in stage.text
        codes: set[str] = set()
        while len(names(stage)) == 3 and len(codes) < 2:
            if stage.selected != "from-usb":
                await stage.act("jobs.open")
                codes |= set(stage.codes)
            await stage.act("jobs.down")
        assert codes == {"value.out_of_range", "screen.name_taken"}
        stage.page._imports.select(good)  # type: ignore[attr-defined]
        await stage.act("jobs.open")
        assert stage.codes == ["screen.job_imported"] and stage.selected == "from-usb"
        assert (jobs_folder(tmp_path) / "from-usb.toml").read_bytes() == good.read_bytes()
        await stage.act("jobs.open")
        assert stage.gone == [PageName.SETUP]


async def test_a_path_is_typed_for_a_file_elsewhere(tmp_path: Path) -> None:
    elsewhere = put(tmp_path, "stick")
    async with play(tmp_path) as stage:
        await stage.act("jobs.path")
        assert stage.codes == ["screen.jobs_import_only"]
        for path, code in ((tmp_path / "no.toml", "file.unreadable"), (elsewhere, "screen.job_imported")):
            await stage.act("jobs.import" if "Files" not in stage.text else "jobs.first", "jobs.path")
            stage.page._entry.value = str(path)  # type: ignore[attr-defined]
            await stage.act("jobs.open")
            assert stage.codes == [code]
        assert stage.selected == "stick"


async def test_an_export_overwrites_nothing(own: Path, tmp_path: Path) -> None:
    content = put(own, "a-ring").read_bytes()
    async with play(tmp_path) as stage:
        await stage.act("jobs.export", "jobs.export")
        assert stage.codes == ["screen.job_exported"]
        folder = tmp_path / "exported-jobs"
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == {
            "a-ring.toml": content,
            "a-ring-2.toml": content,
        }


@pytest.mark.parametrize("language", LANGUAGES)
async def test_each_entry_says_what_enter_does_within_the_row(language: str, own: Path, tmp_path: Path) -> None:
    put(own, "a-ring")
    async with play(tmp_path, language=language) as stage:
        said = set()
        for actions in (("search",), ("rename",), ("note",), ("tags",), ("import",), ("path",)):
            await stage.act(*(f"jobs.{action}" for action in actions))
            said.add(stage.next_step)
            if actions != ("import",):
                stage.page._entry.close()  # type: ignore[attr-defined]
        assert len(said) == 6 and not [each for each in said if cell_len(each) > NEXT_STEP_CELLS]
