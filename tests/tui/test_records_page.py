"""The page Records: what is listed, a run as it was, two side by side, and what is said without a record."""

from __future__ import annotations

import asyncio
import re
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.cells import cell_len

from console.session.data import run_reader
from console.session.data.measured_part import RecordedPart
from console.session.data.record_file import FILE_NAME
from console.session.learning.job_chart import ChartedQuantity, JobChart, job_chart
from console.session.station.state import Activity
from console.text.catalogue import load
from console.tui.gate import FieldKind
from console.tui.records import background_reader, reading
from profiles.store import load_job
from tests.tui import records_stage
from tests.tui.page_stage import NEXT_STEP_CELLS, READY, on_page
from tests.tui.records_stage import RecordsScene, run, telemetry
from tests.tui.stage import LANGUAGES, experiment

RING = "고리-60"
MANY = 230


@pytest.fixture(autouse=True)
def in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is read is there when it is asked for, however busy this computer is."""
    monkeypatch.setattr(background_reader, "SHORT_S", 60.0)


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Four simulated runs of this lathe, a real one, and one of another lathe; the newest last."""
    folder = tmp_path_factory.mktemp("shop")
    ring = replace(experiment().job, name=RING)
    run(folder, 0.5, machine="other-lathe")
    run(folder, 0.7, simulated=0, operator="lee")
    run(folder, 27.0, strategy="none")
    run(folder, 0.9)
    run(folder, None, job=ring, end=("stopped", {"reason": "space", "turn": 31.2, "by": "kim"}))
    run(folder, 1.3, strategy="cam", compensation=2)
    yield folder


def rows_of(scene: RecordsScene) -> list[str]:
    """The rows of the list, without its frame."""
    rows = [row.strip("│") for row in scene.text.splitlines()]
    return [row for row in rows if "20" in row[:9]]


on_records = partial(on_page, RecordsScene, work=experiment())


def keys(*names: str) -> tuple[str, ...]:
    return tuple(f"records.{name}" for name in names)


async def test_runs_of_this_machine_and_kind_are_listed_newest_first_and_m_lists_all(shop: Path) -> None:
    async with on_records(shop) as page:
        await page.show()
        newest, stopped, good, bad = rows_of(page)
        assert newest.startswith("▸") and "✓ complete" in newest and newest.rstrip().endswith("SIM")
        assert RING in stopped and "stopped" in stopped and "–" in stopped
        assert "✓" in good and "✗ complete" in bad
        await page.act(*keys("machines"))
        assert len(rows_of(page)) == 6
        assert sum(row.rstrip().count("SIM") for row in rows_of(page)) == 5
        page.control.state = replace(READY, simulated=False)
        await page.act(*keys("machines"))
        (real,) = rows_of(page)
        assert "SIM" not in real


async def test_the_list_is_filtered_by_failure_by_the_open_job_and_by_words(shop: Path) -> None:
    async with on_records(shop) as page:
        await page.act(*keys("failed"))
        assert ["✗" in row or "stopped" in row for row in rows_of(page)] == [True, True]
        await page.act(*keys("failed", "job"))
        assert len(rows_of(page)) == 3 and not any(RING in row for row in rows_of(page))
        await page.act(*keys("job", "search"))
        assert page.page.field is FieldKind.TEXT
        await page.pilot.press(*"고리")
        await page.act(*keys("open"))
        (found,) = rows_of(page)
        assert RING in found and str(page.page.field) == str(FieldKind.NONE)
        await page.act(*keys("job"))
        assert rows_of(page) == [] and "No recorded run matches" in page.text


async def test_what_works_elsewhere_or_with_a_job_says_so_and_nothing_is_commanded_or_stops(shop: Path) -> None:
    async with on_records(shop) as page:
        for action in ("search", "failed", "job", "machines"):
            await page.act(*keys("open", action))
            assert page.codes == ["screen.records_list_first"]
            page.ui.key_answer = ()
        await page.act(*keys("back", "back"))
        page.ui.work = None
        await page.act(*keys("job"))
        assert page.codes == ["screen.nothing_to_cut"] and len(rows_of(page)) == 4
        page.control.state = replace(READY, activity=Activity.CUTTING)
        monitored = keys("down", "open", "program", "cut", "back", "chart", "figure", "back", "mark", "machines")
        await page.act(*monitored)
        assert (page.control.orders, page.control.stops, page.control.kills) == ([], [], [])


async def test_a_run_is_shown_as_it_was(shop: Path) -> None:
    """The figures are those of the part that was cut: three lobes of 1.3 um are 2.6 um p-p."""
    async with on_records(shop) as page:
        await page.act(*keys("open"))
        full = " ".join("".join(piece for piece, _ in row) for row in page.page.in_full(page.view, 78))
        assert "PASS: 2.68 um of 5.00 um" in full and "Cut complete · turn 160.0" in full
        (lobe,) = re.findall(r"3 / rev +([0-9.]+) um p-p", full)
        assert float(lobe) == pytest.approx(2.6, abs=0.011)
        assert "cam, learned 2, full" in " ".join(full.split())
        assert "1314.0 N" in full and "12.63° (2 Jan 08:45)" in full and "R 76.013 mm" in full
        assert "The job's file is the same today." in full and "1000.0 rpm" in full
        assert full.index("arm kim") < full.index("start kim") < full.index("measure kim")
        assert "Simulated, not machined." in page.text and "jaw 1 at 12.6°" in page.text
        await page.act(*keys("program"))
        assert "OPEN PROG 10 CLEAR" in page.text
        await page.act(*keys("cut"))
        assert "Tool error (cam)" in page.text and "Spindle speed (cam)" in page.text
        await page.act(*keys("back", "back"))
        assert len(rows_of(page)) == 4


async def test_the_tool_error_is_drawn_on_the_scale_of_the_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On its way to the part and back the tool is 2 mm from its path: as seen beside that, a cut is a line."""
    in_part = telemetry()

    def whole_way(_: object = None) -> Any:
        far = in_part[:3].copy()
        far[:, 2], far[:, 3], far[:, 4] = -0.5, 0.0, -2000.0
        back = in_part[-3:].copy()
        back[:, 2], back[:, 4] = in_part[-1, 2], -2000.0
        rows = np.vstack([far, in_part, back])
        rows[:, 0] = np.arange(len(rows)) / 10.0
        return rows

    monkeypatch.setattr(records_stage, "telemetry", whole_way)
    run(tmp_path, 1.3)
    async with on_records(tmp_path) as page:
        await page.act(*keys("open", "cut"))
        scales = re.findall(r"-?[0-9.]+(?=┤| um)", page.text)
        assert scales[:3] == ["1", "0", "-1"], scales


async def test_a_job_whose_file_has_changed_since_is_told(shop: Path, tmp_path: Path) -> None:
    job = load_job("lee-2001-experiment-1").job
    other = replace(job, name="since-changed", chucking_force_n=job.chucking_force_n)
    run(tmp_path, 1.0, job=other)
    run(tmp_path, 1.0, job=other, job_sha256="0" * 64, machine_sha256="0" * 64)
    (tmp_path / "jobs").mkdir()
    async with on_records(tmp_path) as page:
        await page.act(*keys("open"))
        words = [piece for row in page.page.in_full(page.view, 78) for piece, _ in row]
        assert "There is no file of this job now." in words
        assert "The machine profile has been changed since." in words
        from profiles.store import save_job

        save_job(other, tmp_path / "jobs" / "another-name.toml")
        page.page.leave()
        await page.show()
        words = [piece for row in page.page.in_full(page.view, 78) for piece, _ in row]
        assert "The job's file has been changed since." in words


async def test_two_runs_are_shown_side_by_side(shop: Path) -> None:
    async with on_records(shop) as page:
        await page.act(*keys("down", "down", "down", "mark", "up", "open"))
        rows = {row[:12].strip(): row[12:].split() for row in (r[42:-1] for r in page.text.splitlines())}
        assert rows["RONt"][1::2] == ["✗", "✓"]
        assert [float(value) for value in rows["3 / rev"]] == pytest.approx([54.0, 1.8], rel=0.003)
        assert "20 um/div" in page.text, "the scale is that of the larger one"
        await page.act(*keys("mark", "open"))
        assert "Side by side" not in page.text


@pytest.mark.parametrize("language", LANGUAGES)
async def test_without_a_record_the_page_says_what_makes_one(language: str, tmp_path: Path) -> None:
    async with on_records(tmp_path, language=language) as page:
        await page.show()
        words = "".join(page.text.replace("│", "").split())
        assert "".join(load(language)("records_page.how").split()) in words
        for action in ("open", "chart", "mark", "program", "cut", "figure", "down", "last"):
            await page.act(*keys(action))
            assert page.codes == [], "nothing to open is no fault"


async def test_a_damaged_record_is_told_in_words_and_a_mended_one_is_read_again(
    shop: Path, tmp_path: Path
) -> None:
    (tmp_path / FILE_NAME).write_bytes(b"SQLite format 3\0" + bytes(range(256)) * 40)
    async with on_records(tmp_path) as page:
        await page.show()
        assert "Traceback" not in page.text and "The record cannot be read" in page.next_step
        words = "".join(piece.strip() for row in page.page.in_full(page.view, 78) for piece, _ in row)
        assert "the run record is damaged" in words and FILE_NAME in words
        await page.act(*keys("open", "chart", "down", "program"))
        (tmp_path / FILE_NAME).write_bytes((shop / FILE_NAME).read_bytes())
        page.page.leave()
        await page.show()
        assert len(rows_of(page)) == 4


async def test_a_run_whose_trace_is_damaged_is_shown_without_its_plot(tmp_path: Path) -> None:
    run(tmp_path, 1.0)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        database.execute("DROP TRIGGER traces_stay")
        database.execute("UPDATE traces SET content = x'00112233'")
        database.commit()
    async with on_records(tmp_path) as page:
        await page.act(*keys("open"))
        assert "PASS" in page.text and "Cannot be read: trace 1" in page.text


async def test_more_is_read_as_the_list_is_scrolled_and_end_shows_the_oldest(tmp_path: Path) -> None:
    run(tmp_path, 1.0)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        (columns,) = [[row[1] for row in database.execute("PRAGMA table_info(runs)")]]
        others = ", ".join(name for name in columns if name not in ("run_id", "job"))
        for number in range(MANY):
            database.execute(
                f"INSERT INTO runs (run_id, job, {others}) SELECT ?, ?, {others} FROM runs LIMIT 1",
                (f"{number:032x}", f"job-{number:03d}"),
            )
        database.commit()
    async with on_records(tmp_path) as page:
        await page.show()
        assert "Runs (50+)" in page.text and f"job-{MANY - 1:03d}" in rows_of(page)[0]
        for _ in range(4):
            await page.act(*keys("page_down"))
        assert "Runs (1" in page.text and "▸  2026-11-23" not in rows_of(page)[0]
        chosen = next(row for row in rows_of(page) if row.startswith("▸"))
        assert f"job-{MANY - 1 - 4 * 14:03d}" in chosen
        await page.act(*keys("last"))
        assert f"Runs ({MANY + 1})" in page.text and rows_of(page)[-1].startswith("▸")
        assert experiment().job.name in rows_of(page)[-1]
        await page.act(*keys("first"))
        assert rows_of(page)[0].startswith("▸")


async def test_a_slow_disk_never_holds_the_screen(shop: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk answers only after the screen has painted and taken keys."""
    answers, asked = threading.Event(), threading.Event()

    def slow(*given: Any, **options: Any) -> Any:
        asked.set()
        assert answers.wait(60.0)
        return runs(*given, **options)

    runs = run_reader.runs
    monkeypatch.setattr(reading, "runs", slow)
    monkeypatch.setattr(background_reader, "SHORT_S", 0.0)
    async with on_records(shop) as page:
        await page.show()
        assert asked.wait(60.0) and "Reading." in page.text
        await page.act(*keys("down", "open", "failed", "failed"))
        answers.set()
        while not rows_of(page):
            await asyncio.sleep(0.01)
            await page.show()
        assert len(rows_of(page)) == 4


@pytest.mark.parametrize("language", LANGUAGES)
async def test_everything_fits_80_columns_in_both_languages(language: str, shop: Path) -> None:
    ways: tuple[list[str], ...] = (
        [],
        ["open"],
        ["down", "open"],
        ["open", "cut"],
        ["open", "program"],
        ["chart"],
        ["chart", "figure"],
    )
    pair = ["mark", "down", "down", "open"]
    async with on_records(shop, language=language) as page:
        for way in (*ways, pair):
            page.page.leave()
            await page.act(*keys(*way))
            rows = page.text.splitlines()
            assert len(rows) <= 18 and all(cell_len(row) <= 80 for row in rows)
            assert cell_len(page.next_step) <= NEXT_STEP_CELLS, way
            assert "records_page." not in page.text + page.next_step, way
            await page.act(*keys("back", "back"))


async def test_while_something_moves_no_statistics_are_loaded(shop: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loading them holds up the thread that keeps the watchdog of the controller alive."""
    judged: list[bool] = []
    monkeypatch.setattr(reading, "STATISTICS", "scipy.not_loaded_yet")

    def charted(parts: tuple[RecordedPart, ...], figure: ChartedQuantity, *, judge: bool) -> JobChart:
        judged.append(judge)
        return job_chart(parts, figure, judge=judge)

    monkeypatch.setattr(reading, "job_chart", charted)
    async with on_records(shop) as page:
        page.control.state = replace(READY, activity=Activity.CUTTING)
        await page.act(*keys("chart"))
        page.control.state = READY
        await page.show()
        assert judged == [False, True]
