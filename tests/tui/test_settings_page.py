"""Page Settings: a change counts at once on every page, is kept, and nothing in it can reach the machine."""

from __future__ import annotations

import unicodedata
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.cells import cell_len
from rich.segment import Segment
from textual.pilot import Pilot

from console.session.appearance import GLYPHS, THEMES, Appearance
from console.session.configuration import Configuration, Setting, SettingOrigin, read_configuration
from console.session.station.history.session_log import SessionLog
from console.session.station.state import Activity, StationState
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.application.glyphs import in_ascii
from console.tui.application.own_keys import REMAPPABLE
from console.tui.frame import keys_row
from console.tui.key_help import help_lines
from console.tui.keymap import PageName
from console.tui.lines import plain_text, width_of
from console.tui.theme import MONO
from tests.tui import run_stage
from tests.tui.scenes import Scene, console_on, fill, fixed_world, keys_to, rows_of, scene_of, settle
from tests.tui.stage import LANGUAGES, FixedControl, experiment
from tests.tui.test_frame_rows import frame
from tests.tui.test_nothing_is_cut import filled, problems

SETTINGS = scene_of(PageName.SETTINGS)
EVERYWHERE = replace(SETTINGS, state=run_stage.state(), work=experiment())
"""One state of the machine in which every page has something to show."""


def play(
    data: Path,
    *,
    state: StationState | None = None,
    appearance: Appearance | None = None,
    scene: Scene = SETTINGS,
    **given: Any,
) -> AbstractAsyncContextManager[tuple[ConsoleApp, Pilot[None], FixedControl]]:
    begun = scene if state is None else replace(scene, state=state)
    language = "en" if appearance is None else appearance.language
    return console_on(begun, data, language=language, appearance=appearance, **given)


def own_configuration(folder: Path, monkeypatch: pytest.MonkeyPatch, **variables: str) -> Configuration:
    environment = {"XDG_CONFIG_HOME": str(folder), **variables}
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    return read_configuration(environment, folder / "no-site.toml")


def codes(app: ConsoleApp) -> list[str]:
    return [problem.code for problem in app.ui.key_answer]


def segments_of(app: ConsoleApp) -> list[list[Segment]]:
    return [list(strip) for strip in app.screen._compositor.render_strips()]


async def every_page(app: ConsoleApp, pilot: Pilot[None]) -> dict[PageName, tuple[list[str], list[list[Segment]]]]:
    seen = {}
    for page in PageName:
        await pilot.press(*keys_to(page))
        await settle(app, pilot)
        seen[page] = rows_of(app), [list(Segment.simplify(row)) for row in segments_of(app)]
    return seen


# A change counts at once, everywhere ---------------------------------------------------------------------------

CHANGED = [Appearance(language="ko", theme="light", glyphs="ascii"), Appearance(theme="16-colour")]


@pytest.mark.rings
@pytest.mark.long
@pytest.mark.parametrize("target", CHANGED, ids=["ko-light-ascii", "16-colour"])
async def test_after_a_change_every_page_looks_as_if_the_console_had_been_started_so(
    target: Appearance, tmp_path: Path
) -> None:
    """Characters and colours; the pages were all shown before the change."""
    fill(tmp_path)
    seen: list[dict[PageName, tuple[list[str], list[list[Segment]]]]] = []
    with fixed_world():
        async with play(tmp_path, scene=EVERYWHERE) as (app, pilot, _):
            await every_page(app, pilot)
            await pilot.press(*keys_to(PageName.SETTINGS))
            app.ui.appear(target)
            app.logs.log = SessionLog()  # what the first walk was answered is not in the log of the second one
            seen.append(await every_page(app, pilot))
        async with play(tmp_path, scene=EVERYWHERE, appearance=target) as (app, pilot, _):
            seen.append(await every_page(app, pilot))
    for page in PageName:
        assert seen[0][page][0] == seen[1][page][0], page
        assert seen[0][page][1] == seen[1][page][1], f"the colours of {page}"


async def test_the_keys_step_through_the_values_and_each_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    configuration = own_configuration(tmp_path, monkeypatch)
    path = tmp_path / "trilobe" / "config.toml"
    async with play(tmp_path, configuration=configuration) as (app, pilot, _):
        await pilot.press("down", "right")
        assert app.ui.appearance.theme == "light" and path.read_text() == 'theme = "light"\n'
        await settle(app, pilot)
        assert str(path)[-20:] in "\n".join(rows_of(app)), "the row says where the value comes from"
        await pilot.press("left", "left")
        assert app.ui.appearance.theme == THEMES[-1] and f'theme = "{THEMES[-1]}"' in path.read_text()
        await pilot.press("down", "enter", "down", "enter", "down", "enter", "up", "up", "up", "up", "enter")
        assert app.ui.appearance == Appearance(
            theme=THEMES[-1], glyphs=GLYPHS[1], calm="on", mouse="on", language="ko"
        )
        assert read_configuration({"XDG_CONFIG_HOME": str(tmp_path)}, tmp_path / "no").value("language") == "ko"
        assert codes(app) == []


REFUSED = {
    "moving": (run_stage.state(activity=Activity.CUTTING, cut=run_stage.cut()), "screen.settings_moving"),
    "armed": (run_stage.state(armed=run_stage.armed()), "screen.settings_armed"),
}


@pytest.mark.parametrize("name", REFUSED)
async def test_nothing_is_changed_while_something_moves_or_a_cut_is_armed(name: str, tmp_path: Path) -> None:
    state, code = REFUSED[name]
    async with play(tmp_path, state=state) as (app, pilot, control):
        for key in ("right", "enter", "left"):
            await pilot.press(key)
            assert codes(app) == [code]
        assert app.ui.appearance == Appearance() and control.orders == []


async def test_what_a_later_place_fixes_is_said_and_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    configuration = own_configuration(tmp_path, monkeypatch, TRILOBE_CALM="on")
    option = Setting(value="en", origin=SettingOrigin.OPTION, place="--lang")
    configuration = configuration.with_layer({"language": option})
    appearance = Appearance(calm="on")
    async with play(tmp_path, configuration=configuration, appearance=appearance, palette=MONO) as (app, pilot, _):
        shown = "\n".join(rows_of(app))
        assert "fixed by --lang" in shown and "fixed by TRILOBE_CALM" in shown and "fixed by NO_COLOR" in shown
        for steps, place in ((0, "--lang"), (1, "NO_COLOR"), (2, "TRILOBE_CALM")):
            await pilot.press(*["down"] * steps, "right")
            assert (codes(app), app.ui.key_answer[0].value) == (["screen.setting_fixed"], place)
        assert not (tmp_path / "trilobe").exists()


async def test_what_cannot_be_kept_counts_and_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    configuration = own_configuration(tmp_path, monkeypatch)
    (tmp_path / "trilobe").write_text("a file where the folder should be")
    async with play(tmp_path, configuration=configuration) as (app, pilot, _):
        await pilot.press("down", "right")
        assert app.ui.appearance.theme == "light"
        assert codes(app)[-1] == "screen.setting_not_kept" and len(codes(app)) == 2


# Own keys ------------------------------------------------------------------------------------------------------


async def give(pilot: Pilot[None], app: ConsoleApp, action: str, typed: str) -> None:
    """Give the action a key by the keys of the page, from wherever its list stands."""
    place = [each.id for each in REMAPPABLE].index(action)
    back = len(REMAPPABLE) - 1 - place
    way = ["home", *["down"] * place] if place < back else ["end", *["up"] * back]
    await pilot.press(*way, "enter", *["backspace"] * 4, *typed, "enter")


async def test_an_own_key_does_what_our_key_does_and_both_are_shown(tmp_path: Path) -> None:
    async with play(tmp_path) as (app, pilot, control):
        await pilot.press("end", "enter")
        await give(pilot, app, "page.records", "F11")
        await give(pilot, app, "alarms.all", "q")
        assert app.ui.appearance.keys == {"page.records": "f11", "alarms.all": "q"} and codes(app) == []
        await pilot.press("f11")
        assert app.page is PageName.RECORDS
        for key in ("q", "ㅂ", "a"):
            await pilot.press("8", key)
            assert codes(app) == ["screen.nothing_to_acknowledge"], key
        await settle(app, pilot)
        assert "q acknowledge all" in rows_of(app)[-1]
        await pilot.press("?")
        await settle(app, pilot)
        assert any(row.strip(" │").startswith("q a ") for row in rows_of(app))
        await pilot.press("7", "q")
        assert control.stops == [], "on another page it means nothing"
        await pilot.press("0", "s", "d")
        assert app.ui.appearance.keys == {"page.records": "f11"}


CANNOT_BE_HAD = (
    ("alarms.all", "f9", "screen.own_key_stops"),
    ("alarms.all", "F12", "screen.own_key_stops"),
    ("alarms.all", "space", "screen.own_key_stops"),
    ("alarms.all", "k", "screen.own_key_taken"),
    ("alarms.all", "l", "screen.own_key_taken"),
    ("recover", "f5", "screen.own_key_taken"),
    ("run.start", "q", "screen.own_key_moves"),
    ("alarms.all", "f13", "screen.own_key_unknown"),
    ("alarms.all", "7", "screen.own_key_unknown"),
)


@pytest.mark.long
async def test_a_key_that_cannot_be_had_is_refused_with_both_names(tmp_path: Path) -> None:
    """One after the other: what was refused is typed over, for the same action or for another."""
    names = {"k": "k everywhere", "l": "l Alarms", "f5": "F5 Run"}
    async with play(tmp_path) as (app, pilot, control):
        await pilot.press("end", "enter")
        given = ""
        for action, typed, code in CANNOT_BE_HAD:
            if action != given:
                await pilot.press(*(["backspace"] * 5 + ["enter"] if given else []))  # no key: the entry ends
                await give(pilot, app, action, typed)
            else:
                await pilot.press(*["backspace"] * 5, *typed, "enter")
            given = action
            assert codes(app) == [code] and app.ui.appearance.keys == {}, typed
            if code == "screen.own_key_taken":
                assert app.ui.key_answer[0].limit == names[typed] and app.ui.key_answer[0].key
        assert (control.stops, control.kills) == ([], []), "typing the name of a key is not pressing it"


# Signs and cells -----------------------------------------------------------------------------------------------


def test_in_ascii_every_sign_of_every_page_is_ascii_or_a_letter_in_as_many_cells(tmp_path: Path) -> None:
    """The kept screens, in both languages and three sizes: whatever is drawn there."""
    strange = set()
    for path in sorted(Path(__file__).with_name("goldens").iterdir()):
        for row in path.read_text(encoding="utf-8").splitlines():
            shown = in_ascii(row)
            assert cell_len(shown) == cell_len(row), row
            strange |= {sign for sign in shown if not sign.isascii() and unicodedata.category(sign) != "Lo"}
    assert strange == set()
    assert in_ascii("± 0.5 mm, ≤ 3") == "+-0.5 mm, <=3"
    assert in_ascii("⠉⠁⣿⣀") == "\"'#_"


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_message_keeps_its_cells_in_ascii(language: str) -> None:
    """Every sentence of the catalogues, with long values: signs are replaced after lines were broken."""
    for sentence in (*filled(language), *(load(language).problem(each) for each in problems(language))):
        shown = in_ascii(sentence)
        assert cell_len(shown) == cell_len(sentence)
        assert all(sign.isascii() or unicodedata.category(sign) == "Lo" for sign in shown), sentence


@pytest.mark.parametrize("language", LANGUAGES)
def test_with_an_own_key_on_every_action_the_rows_and_lists_of_keys_still_fit(language: str) -> None:
    own = {action.id: "f11" for action in REMAPPABLE}
    for page in PageName:
        now = replace(frame(language=language), page=page, own=own)
        (row,) = keys_row(now, 80)
        assert width_of(row) <= 80 and plain_text([row]).endswith(load(language)("key.help"))
        for number in (1, 2):
            listed = help_lines(load(language), page, number, 78, own)
            assert all(width_of(each) <= 78 for each in listed)
            assert "…" not in "".join(plain_text([each])[:9] for each in listed), "a key is cut"
