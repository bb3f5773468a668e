"""The trace chooser of the page Inspect: the newest file first, what it says, and what has to be answered."""

from __future__ import annotations

import asyncio
import hashlib
import os
import threading
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
from rich.cells import cell_len
from textual.pilot import Pilot
from textual.widgets import Input

from console.session.station.commands import TakeTrace
from console.session.station.state import Activity, StationState
from console.tui.lines import plain
from console.tui.pages.inspect import InspectPage
from console.tui.ui_context import View
from profiles.traces import Trace, write_trace
from tests.tui.stage import FRAME_ROWS, LANGUAGES, SIZES, FixedControl, PageStage, experiment, grid, ui_for

CUT = StationState(activity=Activity.READY, cut_done=True, simulated=False)
Result = TypeVar("Result")


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

    def __init__(self, data: Path, state: StationState = CUT, language: str = "en") -> None:
        self.control = FixedControl(state)
        self.page = InspectPage(ui_for(self.control, data, language, experiment()))
        self.view = View(state=state, work=experiment(), now_s=0.0)
        self.app = PageStage(self.page, self.view)

    def play(
        self, scene: Callable[[Pilot[None]], Awaitable[Result]], size: tuple[int, int] = (80, 24 - FRAME_ROWS)
    ) -> Result:
        async def played() -> Result:
            async with self.app.run_test(size=size) as pilot:
                await pilot.pause()
                return await scene(pilot)

        return asyncio.run(played())

    async def do(self, pilot: Pilot[None], *actions: str) -> str:
        """Do what keys do, and return the screen when the file has been read."""
        for action in actions:
            self.page.act(action)
            await self._settled(pilot)
        return grid(self.app)

    async def _settled(self, pilot: Pilot[None]) -> None:
        """Until the file is read, and what it says is painted in its place."""
        for _ in range(1000):
            self.page.show(self.view)
            await pilot.pause()
            choice = self.page._chooser._choice
            if choice is None or (choice.listed and (choice.file is None or choice.found is not None)):
                break
        for _ in range(2):
            self.page.show(self.view)
            await pilot.pause()

    @property
    def next_step(self) -> str:
        return plain([self.page.next_step(self.view)])


def test_the_newest_file_is_offered_and_enter_takes_it_for_the_part(tmp_path: Path) -> None:
    gauge(tmp_path, "older.csv", age_s=60, state="free")
    newest = gauge(tmp_path, "newest.csv", state="free", direction="ccw", start_mark="jaw 1")
    staged = Staged(tmp_path)

    async def scene(pilot: Pilot[None]) -> str:
        text = await staged.do(pilot, "inspect.import")
        assert staged.next_step.startswith("Enter takes")
        await staged.do(pilot, "inspect.next")
        return text

    text = staged.play(scene)
    assert "▸ newest.csv" in text
    assert text.index("newest.csv") < text.index("older.csv")
    for words in ("For the part that was just cut", "counter-clockwise", "released (free)", "5.99 um"):
        assert words in text
    work = staged.view.work
    assert work is not None
    sha256 = hashlib.sha256(newest.read_bytes()).hexdigest()
    taken = TakeTrace(path=newest, sha256=sha256, job=work.job, loaded=work.loaded, answers={})
    assert staged.control.orders == [taken]


def test_what_the_file_does_not_state_is_answered_before_it_is_taken(tmp_path: Path) -> None:
    gauge(tmp_path, "part.csv", direction="cw")
    staged = Staged(tmp_path)

    async def scene(pilot: Pilot[None]) -> None:
        await staged.do(pilot, "inspect.import", "inspect.next")
        assert staged.control.orders == []
        assert [problem.code for problem in staged.page.ui.said] == ["trace.not_ready"]
        assert staged.next_step.endswith("answer with s, j.")
        await staged.do(pilot, "inspect.direction")
        assert [problem.code for problem in staged.page.ui.said] == ["trace.stated"]
        text = await staged.do(pilot, "inspect.state", "inspect.state")
        assert "clamped" in text
        await staged.do(pilot, "inspect.state", "inspect.mark", "inspect.next")

    staged.play(scene)
    (order,) = staged.control.orders
    assert isinstance(order, TakeTrace)
    assert order.answers == {"state": "free", "start_mark": "jaw 1"}


def test_answers_are_for_one_file(tmp_path: Path) -> None:
    gauge(tmp_path, "one.csv")
    gauge(tmp_path, "two.csv", age_s=60)
    staged = Staged(tmp_path)

    async def scene(pilot: Pilot[None]) -> str:
        return await staged.do(pilot, "inspect.import", "inspect.state", "inspect.down")

    text = staged.play(scene)
    assert "▸ two.csv" in text
    assert "not stated: press s" in text


def test_a_typed_path_is_offered_first(tmp_path: Path) -> None:
    gauge(tmp_path, "one.csv")
    elsewhere = gauge(tmp_path / "usb", "stick.csv", state="free", start_mark="unknown")
    staged = Staged(tmp_path)

    async def scene(pilot: Pilot[None]) -> str:
        await staged.do(pilot, "inspect.import", "inspect.path")
        staged.page.query_one("#trace-path", Input).value = str(elsewhere)
        return await staged.do(pilot, "inspect.next")

    text = staged.play(scene)
    assert "▸ stick.csv" in text
    assert "unknown: no learning" in text


@pytest.mark.parametrize("state", [replace(CUT, activity=Activity.RETRACTING), replace(CUT, cut_done=False)])
def test_in_motion_and_without_a_part_nothing_is_taken(state: StationState, tmp_path: Path) -> None:
    gauge(tmp_path, "part.csv", state="free", start_mark="unknown")
    staged = Staged(tmp_path, state)

    async def scene(pilot: Pilot[None]) -> None:
        await staged.do(pilot, "inspect.import", "inspect.next")

    staged.play(scene)
    assert staged.control.orders == []


def test_the_page_is_as_before_when_the_list_is_closed(tmp_path: Path) -> None:
    staged = Staged(tmp_path)

    async def scene(pilot: Pilot[None]) -> tuple[str, str, str]:
        before = grid(staged.app)
        during = await staged.do(pilot, "inspect.import")
        return before, during, await staged.do(pilot, "inspect.import")

    before, during, after = staged.play(scene)
    assert "No trace file yet" in during
    assert "No measurement yet" not in during
    assert after == before


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", SIZES)
def test_no_row_is_wider_than_the_terminal(language: str, size: tuple[int, int], tmp_path: Path) -> None:
    long = "측정-" * 12
    gauge(tmp_path, f"{long}.csv", state="clamped", direction="cw", start_mark="jaw 1")
    staged = Staged(tmp_path, CUT, language)

    async def scene(pilot: Pilot[None]) -> str:
        return await staged.do(pilot, "inspect.import")

    text = staged.play(scene, (size[0], size[1] - FRAME_ROWS))
    assert all(cell_len(row) <= size[0] for row in text.splitlines())
    assert cell_len(staged.next_step) <= size[0] - 3
    shown = plain(staged.page.in_full(staged.view, 200))
    assert "clamped" in shown or "척킹 상태" in shown


def test_a_file_that_comes_while_the_list_is_open_is_listed_and_the_selection_stays(
    tmp_path: Path,
) -> None:
    staged = Staged(tmp_path)

    async def scene(pilot: Pilot[None]) -> tuple[str, str]:
        await staged.do(pilot, "inspect.import")
        gauge(tmp_path, "first.csv", age_s=60, state="free", start_mark="unknown")
        first = await staged.do(pilot, "inspect.up")
        gauge(tmp_path, "second.csv", state="free", start_mark="unknown")
        return first, await staged.do(pilot, "inspect.state")

    first, second = staged.play(scene)
    assert "▸ first.csv" in first
    assert "▸ first.csv" in second and "  second.csv" in second


def test_a_folder_that_hangs_holds_no_key_and_the_list_comes_when_it_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a network folder whose server is gone: every look at it waits."""
    gauge(tmp_path, "part.csv", state="free", direction="ccw", start_mark="jaw 1")
    answers = threading.Event()
    there = os.stat

    def waits(path: Any, **options: Any) -> os.stat_result:
        if str(path).endswith("traces"):
            answers.wait(20.0)
        return there(path, **options)

    staged = Staged(tmp_path)

    async def scene(pilot: Pilot[None]) -> tuple[str, str, float, str]:
        monkeypatch.setattr(os, "stat", waits)
        began = time.monotonic()
        staged.page.act("inspect.import")
        staged.page.show(staged.view)
        staged.page.act("inspect.down")
        staged.page.show(staged.view)
        await pilot.pause()
        waited, during, step = time.monotonic() - began, grid(staged.app), staged.next_step
        answers.set()
        return during, step, waited, await staged.do(pilot, "inspect.up")

    during, step, waited, after = staged.play(scene)
    assert "Reading the folder" in during and "No trace file yet" not in during
    assert "i: close" in step
    assert waited < 5.0
    assert "▸ part.csv" in after


def test_the_key_row_has_the_keys_of_the_open_list(tmp_path: Path) -> None:
    gauge(tmp_path, "part.csv", direction="cw")
    staged = Staged(tmp_path)

    async def scene(pilot: Pilot[None]) -> list[set[str]]:
        rows = [{each.shown for each in staged.page.keys}]
        for action in ("inspect.import", "inspect.state", "inspect.mark", "inspect.path", "inspect.next"):
            await staged.do(pilot, action)
            rows.append({each.shown for each in staged.page.keys})
        await staged.do(pilot, "inspect.import")
        return [*rows, {each.shown for each in staged.page.keys}]

    before, opened, _, answered, typing, listed, closed = staged.play(scene)
    assert before == closed
    assert "i" in before
    assert "m" not in before  # there is no gauge
    assert opened == {"↑↓", "s", "j", "p", "i"}  # the direction is stated, and nothing can be taken yet
    assert answered == opened | {"Enter"}
    assert typing == {"Enter"}
    assert listed == answered
