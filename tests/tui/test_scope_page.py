"""Page Scope through the whole console: set-up, gathering on a simulated controller, cursors, angle, files."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.session.station.state import Activity, StationState
from console.tui.further.scope import read_record, record_text, records_of
from console.tui.further.scope_pictures import over_turns
from console.tui.further.scope_setup import ROWS, changed
from console.tui.keymap import PageName
from drivers.lathe.standing import Standing
from drivers.requests.scope_setup import ANGLE, CHANNELS, ScopeSetup
from profiles.problem import ProfileError
from tests.drivers.families import of_family
from tests.tui import scope_stage
from tests.tui.scenes import Scene, console_on, fill, fixed_world, machine, signed
from tests.tui.side_stage import DirectSide
from tests.tui.stage import lathe
from tests.tui.test_controller_page import Stage

READY = machine(Activity.READY)


class Moving(DirectSide):
    """Simulated time passes with every look at the clock: nobody polls in these tests."""

    def now_s(self) -> float:
        self.sim.wait(0.05)
        return self.sim.now_s()


@asynccontextmanager
async def play(data: Path, *, family: str = "pmac", state: StationState = READY) -> AsyncIterator[Stage]:
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
    async with play(tmp_path, family=family) as stage:
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
    async with play(tmp_path) as stage:
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
    record = scope_stage.record(1.0, step_s=0.0001)
    degrees = np.degrees(record.values[ANGLE])
    found = over_turns(degrees, record.values[scope_stage.ERROR] * 1e6)
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
        (replace(READY, standing=Standing.OBSERVER, holder=7), "g", "screen.observes"),
        (replace(READY, activity=Activity.ARMING), "g", "screen.scope_arming"),
        (replace(READY, activity=Activity.LOST), "g", "screen.no_controller"),
        (READY, "c", "screen.nothing_gathers"),
        (READY, "x", "screen.no_record_yet"),
        (READY, "v", "screen.no_record_yet"),
    ],
)
async def test_what_cannot_be_done_says_why(state: StationState, key: str, code: str, tmp_path: Path) -> None:
    async with play(tmp_path, state=state) as stage:
        await stage.pilot.press(key)
        assert stage.codes == [code]


async def test_a_damaged_record_is_refused_with_its_name(tmp_path: Path) -> None:
    folder = tmp_path / "scope"
    folder.mkdir()
    text = record_text(scope_stage.record())
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
    async with play(tmp_path) as stage:
        await stage.press("o", "enter")
        assert stage.codes == ["scope.unreadable"]


async def test_the_list_of_kept_records_has_its_keys_and_is_walked_by_the_page(tmp_path: Path) -> None:
    folder = tmp_path / "scope"
    folder.mkdir()
    for number in range(30):
        (folder / f"lathe-202601{number:02d}.csv").write_text(record_text(scope_stage.record()), encoding="utf-8")
    async with play(tmp_path) as stage:
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
        setup = changed(setup, row, 1) or setup
        assert 1 <= len(setup.channels) <= 6
    full = replace(setup, channels=CHANNELS[:6])
    assert changed(full, 8, 1) is None and changed(replace(setup, channels=CHANNELS[:1]), 0, 1) is None
    for row in range(len(ROWS)):
        for by in (-1, 1):
            again = changed(full, row, by)
            assert again is None or again.level_of in again.channels
