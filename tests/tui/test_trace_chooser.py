"""The trace chooser of the page Inspect: the newest file first, what it says, and what has to be answered."""

from __future__ import annotations

import hashlib
import os
import re
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest
from rich.cells import cell_len
from textual.widgets import Input

from console.session.station.commands import MeasureTurned, TakeTrace
from console.session.station.state import Activity, StationState
from console.tui.lines import plain_text
from console.tui.pages.inspect import InspectPage
from console.tui.ui_context import View
from drivers.cutting.strategy import Strategy
from profiles.traces import Trace, write_trace
from tests.tui.scenes import AFTER, part
from tests.tui.stage import FRAME_ROWS, LANGUAGES, SIZES, FixedControl, PageStage, experiment, grid, ui_for

CUT = StationState(activity=Activity.READY, cut_done=True, simulated=False)


def gauge(data: Path, name: str, age_s: int = 0, **stated: str) -> Path:
    """A file of the gauge: three lobes of 6 um p-p, and what it states."""
    folder = data / "traces"
    folder.mkdir(parents=True, exist_ok=True)
    angle_deg = np.arange(720) / 2.0
    path = folder / name
    write_trace(
        path, Trace(angle_deg=angle_deg, deviation_um=3.0 * np.cos(np.radians(3.0 * angle_deg)), meta=stated)
    )
    os.utime(path, ns=((1_790_000_000 - age_s) * 10**9,) * 2)
    return path


class Staged:
    """The page on its stage, in front of the files of a gauge."""

    def __init__(
        self, data: Path, state: StationState = CUT, language: str = "en", size: tuple[int, int] = (80, 18)
    ) -> None:
        self.control = FixedControl(state)
        self.page = InspectPage(ui_for(self.control, data, language, experiment()))
        self.view = View(state=state, work=experiment(), now_s=0.0)
        self.app = PageStage(self.page, self.view)
        self._shown = self.app.run_test(size=size)

    async def __aenter__(self) -> Self:
        self.pilot = await self._shown.__aenter__()
        await self.pilot.pause()
        return self

    async def __aexit__(self, *raised: Any) -> None:
        await self._shown.__aexit__(*raised)

    async def do(self, *actions: str) -> str:
        """Do what keys do, and return the screen when the file has been read."""
        for action in actions:
            self.page.act(action)
            await self._settled()
        return grid(self.app)

    async def _settled(self) -> None:
        """Until the file is read, and what it says is painted in its place."""
        for _ in range(1000):
            self.page.show(self.view)
            await self.pilot.pause()
            choice = self.page._chooser._choice
            if choice is None or (choice.listed and (choice.file is None or choice.found is not None)):
                break
        for _ in range(2):
            self.page.show(self.view)
            await self.pilot.pause()

    @property
    def next_step(self) -> str:
        return plain_text([self.page.next_step(self.view)])


async def test_the_newest_file_is_offered_and_enter_takes_it_for_the_part(tmp_path: Path) -> None:
    gauge(tmp_path, "older.csv", age_s=60, state="free")
    newest = gauge(tmp_path, "newest.csv", state="free", direction="ccw", start_mark="jaw 1")
    async with Staged(tmp_path) as staged:
        text = await staged.do("inspect.import")
        assert staged.next_step.startswith("Enter takes")
        await staged.do("inspect.next")
    assert "▸ newest.csv" in text
    assert text.index("newest.csv") < text.index("older.csv")
    for words in ("For the part that was just cut", "counter-clockwise", "released (free)", "5.99 um"):
        assert words in text
    work = staged.view.work
    assert work is not None
    sha256 = hashlib.sha256(newest.read_bytes()).hexdigest()
    taken = TakeTrace(path=newest, sha256=sha256, job=work.job, loaded=work.loaded, answers={})
    assert staged.control.orders == [taken]


async def test_key_r_takes_the_file_of_the_part_turned_on_its_gauge(tmp_path: Path) -> None:
    newest = gauge(tmp_path, "turned.csv", state="free", direction="ccw", start_mark="jaw 1")
    async with Staged(tmp_path) as staged:
        await staged.do("inspect.turned")
        assert [problem.code for problem in staged.page.ui.key_answer] == ["gauge.no_first"]
    async with Staged(tmp_path, replace(CUT, measured=part(Strategy.CAM, AFTER))) as staged:
        await staged.do("inspect.turned")
        assert "turned by 90 deg" in staged.next_step
        await staged.do("inspect.next")
    (order,) = staged.control.orders
    assert isinstance(order, MeasureTurned) and order.second is not None and order.second.path == newest


async def test_what_the_file_does_not_state_is_answered_before_it_is_taken(tmp_path: Path) -> None:
    gauge(tmp_path, "part.csv", direction="cw")
    async with Staged(tmp_path) as staged:
        await staged.do("inspect.import", "inspect.next")
        assert staged.control.orders == []
        assert [problem.code for problem in staged.page.ui.key_answer] == ["trace.not_ready"]
        assert staged.next_step.endswith("answer with s, j.")
        await staged.do("inspect.direction")
        assert [problem.code for problem in staged.page.ui.key_answer] == ["trace.stated"]
        assert "clamped" in await staged.do("inspect.state", "inspect.state")
        await staged.do("inspect.state", "inspect.mark", "inspect.next")
    (order,) = staged.control.orders
    assert isinstance(order, TakeTrace)
    assert order.answers == {"state": "free", "start_mark": "jaw 1"}


async def test_answers_are_for_one_file_and_a_typed_path_is_offered_first(tmp_path: Path) -> None:
    gauge(tmp_path, "one.csv")
    gauge(tmp_path, "two.csv", age_s=60)
    elsewhere = gauge(tmp_path / "usb", "stick.csv", state="free", start_mark="unknown")
    async with Staged(tmp_path) as staged:
        text = await staged.do("inspect.import", "inspect.state", "inspect.down")
        assert "▸ two.csv" in text and "not stated: press s" in text
        await staged.do("inspect.path")
        staged.page.query_one("#trace-path", Input).value = str(elsewhere)
        text = await staged.do("inspect.next")
        assert "▸ stick.csv" in text and "unknown: no learning" in text


@pytest.mark.parametrize("state", [replace(CUT, activity=Activity.RETRACTING), replace(CUT, cut_done=False)])
async def test_in_motion_and_without_a_part_nothing_is_taken(state: StationState, tmp_path: Path) -> None:
    gauge(tmp_path, "part.csv", state="free", start_mark="unknown")
    async with Staged(tmp_path, state) as staged:
        await staged.do("inspect.import", "inspect.next")
    assert staged.control.orders == []


async def test_the_page_is_as_before_when_the_list_is_closed(tmp_path: Path) -> None:
    async with Staged(tmp_path) as staged:
        before = grid(staged.app)
        during = await staged.do("inspect.import")
        assert "No trace file yet" in during and "No measurement yet" not in during
        assert await staged.do("inspect.import") == before


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", SIZES)
async def test_no_row_is_wider_than_the_terminal(language: str, size: tuple[int, int], tmp_path: Path) -> None:
    long = "측정-" * 12
    gauge(tmp_path, f"{long}.csv", state="clamped", direction="cw", start_mark="jaw 1")
    async with Staged(tmp_path, CUT, language, (size[0], size[1] - FRAME_ROWS)) as staged:
        text = await staged.do("inspect.import")
        assert all(cell_len(row) <= size[0] for row in text.splitlines())
        assert cell_len(staged.next_step) <= size[0] - 3
        shown = plain_text(staged.page.in_full(staged.view, 200))
        assert "clamped" in shown or "척킹 상태" in shown


async def test_a_file_that_comes_while_the_list_is_open_is_listed_and_the_selection_stays(tmp_path: Path) -> None:
    async with Staged(tmp_path) as staged:
        await staged.do("inspect.import")
        gauge(tmp_path, "first.csv", age_s=60, state="free", start_mark="unknown")
        assert "▸ first.csv" in await staged.do("inspect.up")
        gauge(tmp_path, "second.csv", state="free", start_mark="unknown")
        second = await staged.do("inspect.state")
        assert "▸ first.csv" in second and "  second.csv" in second


async def test_a_folder_that_hangs_holds_no_key_and_the_list_comes_when_it_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a network folder whose server is gone: every look at it waits."""
    gauge(tmp_path, "part.csv", state="free", direction="ccw", start_mark="jaw 1")
    answers, there = threading.Event(), os.stat

    def waits(path: Any, **options: Any) -> os.stat_result:
        if str(path).endswith("traces"):
            answers.wait(20.0)
        return there(path, **options)

    async with Staged(tmp_path) as staged:
        monkeypatch.setattr(os, "stat", waits)
        began = time.monotonic()
        for action in ("inspect.import", "inspect.down"):
            staged.page.act(action)
            staged.page.show(staged.view)
        await staged.pilot.pause()
        assert time.monotonic() - began < 5.0
        assert "Reading the folder" in grid(staged.app) and "No trace file yet" not in grid(staged.app)
        assert "i: close" in staged.next_step
        answers.set()
        assert "▸ part.csv" in await staged.do("inspect.up")


async def test_the_key_row_has_the_keys_of_the_open_list(tmp_path: Path) -> None:
    gauge(tmp_path, "part.csv", direction="cw")
    async with Staged(tmp_path) as staged:
        rows = [{each.shown for each in staged.page.keys}]
        for action in ("import", "state", "mark", "path", "next", "import"):
            await staged.do(f"inspect.{action}")
            rows.append({each.shown for each in staged.page.keys})
    before, opened, _, answered, typing, listed, closed = rows
    assert before == closed
    assert "i" in before
    assert "m" not in before  # there is no gauge
    assert opened == {"↑↓", "s", "j", "p", "i"}  # the direction is stated, and nothing can be taken yet
    assert answered == opened | {"Enter"}
    assert typing == {"Enter"}
    assert listed == answered


async def test_marked_files_are_read_together_as_sections_of_one_part(tmp_path: Path) -> None:
    stated = {"state": "free", "direction": "ccw", "start_mark": "jaw 1", "z_from": "free end"}
    low = gauge(tmp_path, "low.csv", 0, z_mm="7", **stated)
    middle = gauge(tmp_path, "middle.csv", 60, z_mm="4", **stated)
    gauge(tmp_path, "other.csv", 120, z_mm="2", **stated)
    top = gauge(tmp_path, "top.csv", 180, z_mm="1", **stated)
    async with Staged(tmp_path) as staged:
        await staged.do("inspect.import", "inspect.together", "inspect.down", "inspect.together")
        await staged.do("inspect.down")
        text = await staged.do("inspect.down", "inspect.together")
        for words in ("3 files together", " +low.csv", " +middle.csv", "  other.csv", "▸+top.csv"):
            assert words in text
        assert "section at Z 26.00 mm" in text and "3 sections (roundness profiles)" in text
        assert re.search(r"CYLt MZCY +5.99 um", text)
        await staged.do("inspect.next")
    (order,) = staged.control.orders
    assert isinstance(order, TakeTrace)
    assert (order.path, order.others) == (low, (middle, top))


async def test_a_mark_is_taken_back_and_one_file_alone_has_no_key_for_it(tmp_path: Path) -> None:
    gauge(tmp_path, "one.csv", state="free", start_mark="unknown")
    async with Staged(tmp_path) as staged:
        await staged.do("inspect.import", "inspect.together")
        assert [problem.code for problem in staged.page.ui.key_answer] == ["trace.one_file"]
        gauge(tmp_path, "two.csv", 60, state="free", start_mark="unknown")
        assert "▸+one.csv" in await staged.do("inspect.up", "inspect.together")
        assert "▸ one.csv" in await staged.do("inspect.together")


async def test_a_helix_is_named_with_its_form_and_taken_once_its_state_and_z_are_known(tmp_path: Path) -> None:
    path = gauge(tmp_path, "helix.csv")
    angle = np.arange(0.0, 7200.0, 2.0)
    rows = [f"{22 + a / 900:.5f},{a:g},{2 * np.cos(np.radians(3 * a)):.4f}" for a in angle]
    path.write_text("z_mm,angle_deg,deviation_um\n" + "\n".join(rows), encoding="utf-8")
    async with Staged(tmp_path) as staged:
        text = await staged.do("inspect.import")
        assert re.search(r"CYLt MZCY +4.00 um", text) and "a helix (3600 points)" in text
        await staged.do("inspect.next")
        assert staged.control.orders == [] and "s, e" in staged.next_step
        await staged.do("inspect.state", "inspect.height")
        await staged.do("inspect.next")
    (order,) = staged.control.orders
    assert isinstance(order, TakeTrace)
    assert (order.path, order.answers) == (path, {"state": "free", "z_from": "jaw faces"})


@pytest.mark.parametrize(
    ("language", "words"), [("en", r"sections +3: Z 1.0 … 7.0 mm"), ("ko", "3개: Z 1.0 … 7.0 mm")]
)
async def test_the_number_of_sections_is_shown_before_anything_is_answered(
    language: str, words: str, tmp_path: Path
) -> None:
    path = gauge(tmp_path, "stack.csv")
    rows = [f"{z},{a:g},{np.cos(np.radians(3 * a)):.4f}" for z in (4, 1, 7) for a in np.arange(0.0, 360.0, 2.0)]
    path.write_text("z_mm,angle_deg,deviation_um\n" + "\n".join(rows), encoding="utf-8")
    async with Staged(tmp_path, language=language) as staged:
        text = await staged.do("inspect.import")
        assert re.search(words, text) and "s, d, j, e" in staged.next_step.replace("'", "")
