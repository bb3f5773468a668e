"""Page Controller through the whole console, on a simulated controller of either family that answers at once."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot

from console.session.data.controller_backups import backups_of
from console.session.station.state import Activity, StationState
from console.tui.app import ConsoleApp
from console.tui.controller.watching import read_watch, watch_path
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from drivers.lathe.standing import Standing
from drivers.requests.side_line import Moment
from tests.drivers.families import of_family
from tests.tui.scenes import Scene, console_on, fixed_world, machine, rows_of, settle, signed
from tests.tui.side_stage import DirectSide
from tests.tui.stage import FixedControl, lathe
from tests.tui.test_observer import MOVING

Play = Callable[["Stage"], Awaitable[None]]
FAMILIES = pytest.mark.parametrize("family", ["pmac", "turbo"])


class Stage:
    """The console on its page, with a controller behind it."""

    def __init__(self, app: ConsoleApp, pilot: Pilot[None], control: FixedControl, side: DirectSide) -> None:
        self.app, self.pilot, self.control, self.side = app, pilot, control, side

    async def press(self, *keys: str) -> str:
        """Press keys, with time between them, and return what is shown."""
        for key in keys:
            self.control.at(self.control.now_s() + 1.0)
            self.control.state = replace(self.control.state, at_s=self.control.now_s())
            snapshot = self.control.state.snapshot
            if snapshot is not None:
                now = replace(snapshot, asked_s=self.control.now_s(), at_s=self.control.now_s())
                self.control.state = replace(self.control.state, snapshot=now)
            await self.pilot.press(key)
        await settle(self.app, self.pilot)
        return "\n".join(rows_of(self.app))

    @property
    def codes(self) -> list[str]:
        return [problem.code for problem in self.app.ui.said]

    @property
    def sent(self) -> list[str]:
        return [each.text.rstrip("\r") for each in self.side.heard.spoken(polls=True) if each.mark == ">"]


@asynccontextmanager
async def play(data: Path, *, family: str = "pmac", state: StationState | None = None) -> AsyncIterator[Stage]:
    side = DirectSide(of_family(lathe().machine, family))
    begun = Scene(page=PageName.CONTROLLER, state=state or machine(Activity.READY), work=signed(), side=side)
    with fixed_world():
        async with console_on(begun, data, filled=False) as (app, pilot, control):
            yield Stage(app, pilot, control, side)


WATCH, TERMINAL, CONFIGURATION = ("right",) * 2, ("right",) * 3, ("right",) * 4


@FAMILIES
async def test_it_says_who_answers_and_what_its_bits_mean(family: str, tmp_path: Path) -> None:
    async with play(tmp_path, family=family) as stage:
        shown = await stage.press()
        assert {"pmac": "602191", "turbo": "603382"}[family] in shown
        assert "0.4427 ms" in shown  # I10 of the factory, 3713707 / 8388608
        await stage.press("right")
        stage.side.client.request("#1J/")
        stage.side.sim.wait(0.1)
        shown = await stage.press("down")
        assert "amplifier enabled" in shown and "Spindle  #2?" in shown


@pytest.mark.first(1)
@FAMILIES
async def test_watched_items_are_kept_and_followed(family: str, tmp_path: Path) -> None:
    async with play(tmp_path, family=family) as stage:
        await stage.press(*WATCH, "enter", *"p40", "enter", "enter", *"i130", "enter")
        stage.side.client.request("P40=7")
        shown = await stage.press("up")
        assert "P40                          7" in shown and "528" in shown
        await stage.press("enter", *"i130=2", "enter")
        assert stage.codes == ["terminal.writes"]
        await stage.press("enter", *"i9999", "enter")
        assert "does not have it" in await stage.press("down")
        await stage.press("x")
        await stage.press("enter", *"p40", "enter")
        assert stage.codes == ["watch.twice"]
    assert read_watch(watch_path(tmp_path, lathe().machine.name)) == ("P40", "I130")


async def test_a_damaged_table_is_reported_and_left_alone(tmp_path: Path) -> None:
    path = watch_path(tmp_path, lathe().machine.name)
    path.parent.mkdir(parents=True)
    path.write_text('{"schema": "something else"}', encoding="utf-8")
    async with play(tmp_path) as stage:
        assert "cannot be read" in await stage.press(*WATCH)
    assert "something else" in path.read_text(encoding="utf-8")


@pytest.mark.first(1)
@FAMILIES
async def test_the_terminal_shows_queries_and_refuses_motion_with_the_page_that_does_it(
    family: str, tmp_path: Path
) -> None:
    async with play(tmp_path, family=family) as stage:
        shown = await stage.press(*TERMINAL, "enter", *"i130", "enter")
        assert "> I130" in shown and "< 528 ACK" in shown
        shown = await stage.press("r")
        assert shown.count("> I130") == 2
        before = len(stage.sent)
        for typed, code in (
            ("#1j+", "terminal.moves"),
            ("&1b1r", "terminal.moves"),
            ("i130=5", "terminal.writes"),
        ):
            await stage.press("enter", *typed, "enter")
            assert stage.codes == [code]
        assert stage.sent[before:] == []
        shown = await stage.press("enter", *"list prog 9", "enter")
        assert "BEL ERR" in shown
        assert stage.codes[0].startswith("controller.err")


async def test_the_terminal_is_paused_and_scrolled(tmp_path: Path) -> None:
    async with play(tmp_path) as stage:
        await stage.press(*TERMINAL)
        stage.side.client.query(*(f"P{number}" for number in range(40, 48)))
        shown = await stage.press("p")
        assert "paused" in shown and "P47" in shown
        stage.side.client.query("P99")
        assert "P99" not in await stage.press("up")
        assert "P99" in await stage.press("end")


@pytest.mark.first(1)
@FAMILIES
async def test_a_backup_is_written_compared_and_verified(family: str, tmp_path: Path) -> None:
    async with play(tmp_path, family=family) as stage:
        shown = await stage.press("b")
        (path,) = backups_of(tmp_path, lathe().machine.name)
        assert path.name in shown and "Backup written" in shown
        stage.side.client.request("I130=2222")
        shown = await stage.press("f")
        assert "1 difference" in shown and "I130" in shown and "2222" in shown
        shown = await stage.press("v")
        assert "failed" in shown and "I130" in "".join(
            "".join(words for words, _ in row)
            for row in stage.app._pages[PageName.CONTROLLER].in_full(view(stage), 78)
        )


def view(stage: Stage) -> Any:
    return stage.app.ui.view


OBSERVES = replace(machine(Activity.READY), standing=Standing.OBSERVER, holder=7)
MOVES = replace(machine(Activity.READY), snapshot=replace(MOVING, asked_s=100.0, at_s=100.0))


@pytest.mark.parametrize(("state", "code"), [(OBSERVES, "screen.observes"), (MOVES, "screen.in_motion")])
async def test_the_whole_controller_is_read_at_rest_by_who_controls_it(
    state: StationState, code: str, tmp_path: Path
) -> None:
    async with play(tmp_path, state=state) as stage:
        for key in ("v", "b", "f"):
            stage.app.ui.said = ()
            await stage.press(key)
            assert stage.codes == [code]
        await stage.press(*TERMINAL)
        if state is OBSERVES:
            stage.side.moment = Moment(at_rest=True, controls=False)
            shown = await stage.press("enter", *"i130", "enter")
            assert "< 528 ACK" in shown
            await stage.press("enter", *"list plc 1", "enter")
            assert stage.codes == ["beside.observer"]
        else:
            await stage.press("enter")
            assert stage.codes == ["screen.entry_moving"]


async def test_an_entry_ends_when_something_moves_and_space_stops(tmp_path: Path) -> None:
    async with play(tmp_path) as stage:
        await stage.press(*TERMINAL, "enter", "i")
        kinds = [stage.app._pages[PageName.CONTROLLER].field]
        stage.control.state = replace(stage.control.state, activity=Activity.JOGGING)
        kinds.append(stage.app._pages[PageName.CONTROLLER].field)
        assert kinds == [FieldKind.TEXT, FieldKind.NONE]
        await stage.pilot.press("space")
        assert stage.control.stops == ["space"]
        stage.app.tick()
        assert stage.codes == ["screen.entry_moving"]
