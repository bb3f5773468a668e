"""Page Controller through the whole console, on a simulated controller of either family that answers at once."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from textual.pilot import Pilot

from console.session.data.controller_backups import backups_of
from console.session.station.commands import EnableDrives
from console.session.station.state import Activity, StationState
from console.tui.app import ConsoleApp
from console.tui.application.far_terminal import WITHIN_S, FarTerminal
from console.tui.controller.watching import read_watch, watch_path
from console.tui.further.scope import read_record, record_text, records_of
from console.tui.further.scope_pictures import over_turns
from console.tui.further.scope_setup import ROWS, change_setup
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from drivers.lathe.console_role import ConsoleRole
from drivers.requests.scope_gather import ANGLE, CHANNELS, ScopeSetup
from drivers.requests.side_line import RequestConditions
from profiles.problem import ProfileError
from tests.drivers.families import of_family
from tests.tui import align_stage, records_stage
from tests.tui.page_stage import run_apart
from tests.tui.scenes import (
    Scene,
    console_at,
    console_on,
    fill,
    fixed_world,
    machine,
    rows_of,
    settle,
    signed,
)
from tests.tui.side_stage import DirectSide
from tests.tui.stage import CLAMPED, LANGUAGES, FixedControl, lathe
from tests.tui.test_replay_pages import MOVING

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
        return [problem.code for problem in self.app.ui.key_answer]

    @property
    def sent(self) -> list[str]:
        return [each.text.rstrip("\r") for each in self.side.heard.list_traffic(polls=True) if each.mark == ">"]


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


OBSERVES = replace(machine(Activity.READY), standing=ConsoleRole.OBSERVER, holder=7)
MOVES = replace(machine(Activity.READY), snapshot=replace(MOVING, asked_s=100.0, at_s=100.0))


@pytest.mark.parametrize(("state", "code"), [(OBSERVES, "screen.observes"), (MOVES, "screen.in_motion")])
async def test_the_whole_controller_is_read_at_rest_by_who_controls_it(
    state: StationState, code: str, tmp_path: Path
) -> None:
    async with play(tmp_path, state=state) as stage:
        for key in ("v", "b", "f"):
            stage.app.ui.key_answer = ()
            await stage.press(key)
            assert stage.codes == [code]
        await stage.press(*TERMINAL)
        if state is OBSERVES:
            stage.side.moment = RequestConditions(at_rest=True, controls=False)
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


# Page Scope through the whole console: set-up, gathering on a simulated controller, cursors, angle, files.


READY = machine(Activity.READY)


class Moving(DirectSide):
    """Simulated time passes with every look at the clock: nobody polls in these tests."""

    def now_s(self) -> float:
        self.sim.wait(0.05)
        return self.sim.now_s()


@asynccontextmanager
async def on_scope(data: Path, *, family: str = "pmac", state: StationState = READY) -> AsyncIterator[Stage]:
    side = Moving(of_family(lathe().machine, family))
    begun = Scene(page=PageName.SCOPE, state=state, work=signed(), side=side)
    with fixed_world():
        async with console_on(begun, data, filled=False) as (app, pilot, control):
            stage, clock = Stage(app, pilot, control, side), control.now_s
            control.now_s = lambda: side.now_s() if gathers(stage) else clock()  # type: ignore[method-assign]
            yield stage


def gathers(stage: Stage) -> bool:
    page = stage.app._pages[PageName.SCOPE]
    return bool(page._errand.running)  # type: ignore[attr-defined]


@pytest.mark.first(1)
@pytest.mark.parametrize("family", ["pmac", "turbo"])
async def test_g_gathers_and_x_keeps_what_is_opened_again_in_si_units(family: str, tmp_path: Path) -> None:
    async with on_scope(tmp_path, family=family) as stage:
        stage.side.client.request("#1J/ #2J/")
        shown = await stage.press("g")
        assert "Tool cmd mm" in shown and stage.codes == []
        await stage.press("x")
        assert stage.codes == ["screen.scope_kept"]
        await stage.press("o", "enter")
        assert stage.codes == []
    (path,) = records_of(tmp_path)
    head = path.read_text(encoding="utf-8").splitlines()[4]
    assert head == "time [s],tool.commanded [m],tool.actual [m],tool.following_error [m],spindle.actual [rad]"
    found = read_record(path)
    assert found.times_s[-1] == pytest.approx(0.5, abs=0.002) and np.ptp(found.values[ANGLE]) < 1e-6


async def test_cursors_read_what_the_file_says_and_the_angle_averages_the_turns(tmp_path: Path) -> None:
    fill(tmp_path)
    async with on_scope(tmp_path) as stage:
        shown = await stage.press("o", "enter", "n", "n")
        times = re.search(r"time s +([\d.-]+) +([\d.-]+) +([\d.-]+)", shown)
        assert times is not None
        first, second = float(times[1]), float(times[2])
        assert float(times[3]) == pytest.approx(second - first, abs=1e-5)
        error = re.search(r"Tool FE um +([\d.-]+)", shown)
        assert error is not None
        turn = int(first * 10.0)
        expected = 3.0 * np.sin(3.0 * 2.0 * np.pi * 10.0 * first) * (1.0 if turn % 2 == 0 else 1.0 / 3.0)
        assert float(error[1]) == pytest.approx(expected, abs=0.001)
        shown = await stage.press("v", "n", "n")
        assert "mean" in shown and "of 5.0 turns" in shown
        await stage.press("tab", "right", "pagedown")
        assert "▶B" in await stage.press()


def test_the_mean_over_the_angle_and_its_spread_are_those_of_the_turns() -> None:
    record = records_stage.scope_record(1.0, step_s=0.0001)
    degrees = np.degrees(record.values[ANGLE])
    found = over_turns(degrees, record.values[records_stage.ERROR] * 1e6)
    assert found is not None and found.turns == pytest.approx(10.0, abs=0.02)
    wave = np.sin(3.0 * np.radians(found.angle_deg))
    seen = ~np.isnan(found.mean)
    # Five turns of 3 um and five of 1 um: mean 2 um, standard deviation 1.054 um.
    assert np.abs(found.mean - 2.0 * wave)[seen].max() < 0.35
    crest = seen & (np.abs(wave) > 0.95)
    assert found.spread[crest] == pytest.approx(np.full(crest.sum(), 1.054), rel=0.25)
    assert over_turns(degrees[:1500], record.values[ANGLE][:1500]) is None


@pytest.mark.parametrize(
    ("state", "key", "code"),
    [
        (replace(READY, standing=ConsoleRole.OBSERVER, holder=7), "g", "screen.observes"),
        (replace(READY, activity=Activity.ARMING), "g", "screen.scope_arming"),
        (replace(READY, activity=Activity.LOST), "g", "screen.no_controller"),
        (READY, "c", "screen.nothing_gathers"),
        (READY, "x", "screen.no_record_yet"),
        (READY, "v", "screen.no_record_yet"),
    ],
)
async def test_what_cannot_be_done_says_why(state: StationState, key: str, code: str, tmp_path: Path) -> None:
    async with on_scope(tmp_path, state=state) as stage:
        await stage.pilot.press(key)
        assert stage.codes == [code]


async def test_a_damaged_record_is_refused_with_its_name(tmp_path: Path) -> None:
    folder = tmp_path / "scope"
    folder.mkdir()
    text = record_text(records_stage.scope_record())
    for number, damaged in enumerate(
        (text.replace("scope 1", "scope 9"), text.replace("[m]", "[um]"), text[:200], "", text[: len(text) // 2])
    ):
        path = folder / f"lathe-2026010{number}.csv"
        path.write_text(damaged, encoding="utf-8")
        with pytest.raises(ProfileError) as refused:
            read_record(path)
        assert refused.value.problems[0].code == "scope.unreadable" and path.name in str(refused.value)
    last = text[: len(text) // 2].count("\n") + 1
    assert refused.value.problems[0].value == f"damaged or cut short at line: {last}"
    async with on_scope(tmp_path) as stage:
        await stage.press("o", "enter")
        assert stage.codes == ["scope.unreadable"]


async def test_the_list_of_kept_records_has_its_keys_and_is_walked_by_the_page(tmp_path: Path) -> None:
    folder = tmp_path / "scope"
    folder.mkdir()
    for number in range(30):
        (folder / f"lathe-202601{number:02d}.csv").write_text(
            record_text(records_stage.scope_record()), encoding="utf-8"
        )
    async with on_scope(tmp_path) as stage:
        assert "Nothing gathered" in await stage.press() and "mm, um, ° over s" in await stage.press()
        assert "g gather" in await stage.press()
        shown = await stage.press("o")
        assert "o close" in shown and "g gather" not in shown
        for key, number in (("end", 0), ("pageup", 15), ("home", 29), ("pagedown", 14)):
            assert f"▶ lathe-202601{number:02d}.csv" in await stage.press(key), key
        shown = await stage.press("o")
        assert "g gather" in shown and "▶ lathe" not in shown


def test_one_to_six_channels_are_gathered() -> None:
    setup = ScopeSetup()
    for row in range(len(CHANNELS)):
        setup = change_setup(setup, row, 1) or setup
        assert 1 <= len(setup.channels) <= 6
    full = replace(setup, channels=CHANNELS[:6])
    assert change_setup(full, 8, 1) is None and change_setup(replace(setup, channels=CHANNELS[:1]), 0, 1) is None
    for row in range(len(ROWS)):
        for by in (-1, 1):
            again = change_setup(full, row, by)
            assert again is None or again.level_of in again.channels


# A console whose terminal is not at the machine says so, and asks once before it enables drives (rule R4).


CLIENT = "192.168.1.7"
OFF = align_stage.state(replace(align_stage.NO_JAW, drives_on=False, homed=False, clamping=CLAMPED))


def test_it_is_asked_once_and_a_late_answer_is_none() -> None:
    far = FarTerminal(CLIENT)
    assert far.asks(0.0, simulated=False)
    assert far.asks(WITHIN_S + 0.1, simulated=False), "too late: asked again"
    assert not far.asks(WITHIN_S + 5.0, simulated=False)
    assert not far.asks(1000.0, simulated=False), "once for a console"
    assert not FarTerminal("").asks(0.0, simulated=False)
    assert not FarTerminal(CLIENT).asks(0.0, simulated=True)


def enabled(data: Path, client: str, *, simulated: bool, language: str = "en") -> tuple[list[int], list[str], str]:
    """How often drives were enabled after each of two F4, what was said, and the first row."""
    counts, said, now = list[int](), list[str](), replace(OFF, simulated=simulated)

    async def run() -> str:
        given = {"language": language, "client": client}
        async with console_at(data, PageName.ALIGN, now, **given) as (app, pilot, control):
            row = rows_of(app)[0]
            for at_s in (101.0, 103.0):
                control.at(at_s)
                await pilot.press("f4")
                counts.append(sum(isinstance(order, EnableDrives) for order in control.orders))
                said.extend(problem.code for problem in app.ui.key_answer)
            return row

    row = run_apart(run)
    return counts, said, row


def test_by_ssh_the_drives_are_enabled_by_who_says_that_he_sees_the_machine(tmp_path: Path) -> None:
    counts, said, row = enabled(tmp_path, CLIENT, simulated=False)
    assert (counts, said) == ([0, 1], ["screen.see_machine"])
    assert f"by SSH from {CLIENT}" in row


@pytest.mark.parametrize(("client", "simulated"), [("", False), (CLIENT, True)])
def test_at_the_machine_and_at_a_simulated_one_nothing_is_asked(
    tmp_path: Path, client: str, simulated: bool
) -> None:
    counts, said, row = enabled(tmp_path, client, simulated=simulated)
    assert counts[0] == 1 and "screen.see_machine" not in said
    assert "SSH" not in row


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_first_row_says_it_in_every_language_and_keeps_the_state(tmp_path: Path, language: str) -> None:
    _, _, row = enabled(tmp_path, "192.168.100.107", simulated=False, language=language)
    assert "192.168.100.107" in row
    assert {"en": "ready", "ko": "대기 중"}[language] in row
