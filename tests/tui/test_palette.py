"""The palette: every action is found by its words and key, and is refused for the reason that its key gives."""

from __future__ import annotations

import math
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.cells import cell_len
from textual import events
from textual.drivers.linux_driver import LinuxDriver
from textual.message import Message
from textual.pilot import Pilot

from console.session.cut.alignment import Alignment
from console.session.station.state import Activity, StationState, StopState
from console.session.work import Work, edit_field
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.driver import StopDriver, Written
from console.tui.gate import FieldKind, HeldKeys, KeySituation
from console.tui.key_help import words_of
from console.tui.keymap import ACTIONS, CLOSE, PALETTE, PageName, actions_of
from console.tui.list_panel import STOPPING, Entry, entries, find_palette_entries
from console.tui.pace import KeyPace, ScanCollector
from console.tui.pages import run as run_page
from drivers.lathe.console_role import ConsoleRole
from tests.tui import align_stage, run_stage
from tests.tui.scenes import Scene, console_on, rows_of, scene_of, settle
from tests.tui.stage import CLAMPED, LANGUAGES, ON, REST, FixedControl, answered_age, experiment

STOP = StopState(reason="space", killed=False, sent_s=99.0, rest_s=99.4)
CLAMP = Alignment(settings=())


def play(
    data: Path,
    *,
    state: StationState | None = None,
    page: PageName = PageName.ALIGN,
    work: Work | None = None,
    **given: Any,
) -> AbstractAsyncContextManager[tuple[ConsoleApp, Pilot[None], FixedControl]]:
    return console_on(Scene(page=page, state=state or align_stage.state(), work=work), data, **given)


def codes(app: ConsoleApp) -> list[str]:
    return [problem.code for problem in app.ui.key_answer]


# The palette and the keys agree --------------------------------------------------------------------------------

STATES: dict[str, tuple[StationState, Work | None]] = {
    "no job": (align_stage.state(), None),
    "not verified": (align_stage.state(Alignment()), experiment()),
    "to be clamped": (align_stage.state(CLAMP, snapshot=align_stage.look(REST)), experiment()),
    "drives on": (align_stage.state(replace(CLAMP, drives_on=True)), experiment()),
    "to be homed": (align_stage.state(Alignment(settings=(), clamping=CLAMPED, drives_on=True)), experiment()),
    "jaw 1": (align_stage.state(), experiment()),
    "aligned": (run_stage.state(), experiment()),
    "edited": (run_stage.state(), edit_field(experiment(), "chucking_force_n", "1400")),
    "armed": (run_stage.state(armed=run_stage.armed()), experiment()),
    "arming": (run_stage.state(activity=Activity.ARMING), experiment()),
    "stopped": (run_stage.state(activity=Activity.STOPPED, stop=STOP), experiment()),
    "observing": (align_stage.state(standing=ConsoleRole.OUSTED, holder=7), experiment()),
    "connecting": (StationState(), experiment()),
    "lost": (align_stage.state(activity=Activity.LOST), experiment()),
    "in the part": (
        run_stage.state(snapshot=run_stage.look(tool=run_stage.SURFACE_COUNTS), cut=run_stage.cut()),
        experiment(),
    ),
    "cut": (run_stage.state(cut_done=True, simulated=True), experiment()),
    "measured": (scene_of(PageName.INSPECT).state, scene_of(PageName.INSPECT).work),
}
ASKS_AGAIN = {"screen.jaw_far", "screen.take_over_again", "screen.take_control_again", "screen.edits_unsaved"}
ASKS_AGAIN |= {"screen.quit_unsaved", "screen.job_delete_again", "training.end_again"}
TELLS = {"trace.exported", "trace.not_stated", "screen.job_exported", "screen.nothing_deleted"}
TELLS |= {"screen.job_entry_dropped", "screen.log_exported"}
"""Answers to keys that did something."""


@pytest.mark.rings
@pytest.mark.long
async def test_the_palette_refuses_what_its_key_refuses_for_the_same_reasons(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_page, "changed_since_opened", lambda _: ())  # a reason from a file
    differ: list[tuple[str, str, list[str], list[str]]] = []
    ways: dict[str, set[bool]] = {}

    def compare(app: ConsoleApp, control: FixedControl, name: str, page: PageName) -> None:
        state, work = STATES[name]
        for action in actions_of(page):
            control.state, app.ui.work, app.ui.draft, app.ui.copying = state, work, None, False
            # Fresh presses: none of them is a repeat of the one before.
            app._held, app.ui.key_answer, control.orders = HeldKeys(), (), []
            expected = [problem.code for problem in app._why_not(action)]
            ways.setdefault(action.id, set()).add(not expected)
            app._do(action, app._pages[page])
            said = [code for code in codes(app) if code not in ASKS_AGAIN | TELLS]
            if said != expected or (expected and control.orders):
                differ.append((name, action.id, expected, codes(app)))
            app._pages[page].leave()
            if app.page is not page:
                app.go(page)

    async with play(tmp_path, work=experiment()) as (app, pilot, control):
        for page in PageName:
            control.state, app.ui.work = STATES["aligned"]
            app.go(page)
            app.tick()
            await pilot.pause()
            for name in STATES:
                compare(app, control, name, page)
    assert differ == []
    # Otherwise nothing would have been compared.
    both = {action for action, seen in ways.items() if seen == {True, False}}
    assert both >= {"jobs.open", "setup.edit", "preview.strategy", "align.step", "align.take", "align.off"}
    assert both >= {"run.arm", "run.start", "run.retract", "inspect.measure", "inspect.accept", "records.job"}


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("aligned", {"recover", "acknowledge", "take_over"}),
        ("stopped", {"acknowledge", "take_over"}),
        ("observing", {"recover", "acknowledge"}),
    ],
)
async def test_the_keys_of_every_page_are_refused_likewise(name: str, refused: set[str], tmp_path: Path) -> None:
    async with play(tmp_path, state=STATES[name][0], work=experiment()) as (app, _, _):
        for action in (each for each in ACTIONS if each.id in ("recover", "acknowledge", "take_over")):
            app.ui.key_answer = ()
            reasons = [problem.code for problem in app._why_not(action)]
            app._do(action, app._pages[app.page])
            assert [code for code in codes(app) if code not in ASKS_AGAIN] == reasons
            assert bool(reasons) is (action.id in refused), action.id


# What is found -------------------------------------------------------------------------------------------------


def listed(language: str, page: PageName = PageName.RUN) -> tuple[Entry, ...]:
    return entries(load(language), page, lambda action: ())


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_action_is_there_once_in_words_the_present_page_first_then_everywhere(language: str) -> None:
    for page in PageName:
        shown = listed(language, page)
        actions = [entry.action for entry in shown]
        assert set(actions) == {*ACTIONS, *STOPPING} - {CLOSE, PALETTE} and len(actions) == len(set(actions))
        ranks = [0 if each.page is page else 1 if each.page is None else 2 for each in actions]
        assert ranks == sorted(ranks)
        bare = [entry.words for entry in shown if "key_help." in entry.words or "help." in entry.words]
        assert bare == []


@pytest.mark.parametrize(
    ("language", "query", "first"),
    [
        ("en", "f5", "run.arm"),
        ("en", "F5", "run.arm"),
        ("en", "save name", "setup.save_as"),
        ("en", "touch-off redo", "align.back"),
        ("en", "b", "align.back"),
        ("ko", "ㅠ", "align.back"),
        ("ko", "다른 이름으로 저장", "setup.save_as"),
        ("en", "space", "stop"),
        ("en", "disable the drives at once", "kill"),
        ("en", "pagedown program", "preview.down"),
        ("en", "no such action", None),
    ],
)
def test_an_action_is_found_by_words_and_by_key(language: str, query: str, first: str | None) -> None:
    hits = find_palette_entries(listed(language), query)
    assert (hits[0].action.id if hits else None) == first


# What its keys do ----------------------------------------------------------------------------------------------


async def test_enter_shows_the_page_of_an_action_and_does_nothing_there(tmp_path: Path) -> None:
    async with play(tmp_path, state=run_stage.state(), work=experiment()) as (app, pilot, control):
        await pilot.press(":", *"f5", "enter")
        # Enter is still held down: it is not for the page either.
        await pilot.press("enter")
        assert (app.page, codes(app), app._list.is_open) == (PageName.RUN, ["screen.palette_page"], False)
        assert control.orders == []


async def test_a_held_enter_confirms_nothing_on_the_page_that_it_shows(tmp_path: Path) -> None:
    state = align_stage.state(CLAMP, snapshot=align_stage.look(REST))
    async with play(tmp_path, state=state, page=PageName.JOBS, work=experiment()) as (app, pilot, control):
        await pilot.press("ctrl+p", *"f4")
        for tenth in range(20):
            control.at(100.0 + 0.1 * tenth)
            await pilot.press("enter")
        assert app.page is PageName.ALIGN and control.orders == []
        control.at(104.0)
        app.tick()
        await pilot.press("enter")
        assert len(control.orders) == 1, "a press of its own confirms"


async def test_enter_performs_on_this_page_only_what_moves_nothing(tmp_path: Path) -> None:
    homing = align_stage.state(Alignment(settings=(), clamping=CLAMPED, drives_on=True))
    async with play(tmp_path, state=homing, work=experiment()) as (app, pilot, control):
        await pilot.press(":", *"f4", "enter")
        assert (control.orders, codes(app), app._list.is_palette) == ([], ["screen.palette_moves"], True)
        await pilot.press("escape", ":", *"f3", "enter")
        assert (len(control.orders), app._list.is_open) == (1, False)
        control.at(101.5)
        await pilot.press(":", *"redo", "enter")
        assert (codes(app), app._list.is_palette) == (["screen.nothing_to_take_back"], True)


def test_no_moving_action_is_started_from_it_on_any_page() -> None:
    moving = [*STOPPING, *(action for action in ACTIONS if action.moves)]
    assert not any(Entry(action=action, words="", page_name="").is_started for action in moving)


async def test_backspace_takes_back_what_was_typed_and_then_closes(tmp_path: Path) -> None:
    async with play(tmp_path) as (app, pilot, control):
        await pilot.press(":", *"ab", "backspace", "backspace")
        seen = [app._list.is_palette]
        await pilot.press("backspace")
        seen.append(app._list.is_open)
        await pilot.press(":", "escape")
        assert [*seen, app._list.is_open] == [True, False, False]
        await pilot.press(":", "ctrl+p", "?")
        assert app._list.selected_entry is not None, "a question mark is one of its characters"
        await pilot.press("f1")
        assert [app._list.is_open, app._list.is_palette] == [True, False]
        assert control.stops == []


# Safety --------------------------------------------------------------------------------------------------------


async def test_space_is_written_at_rest_and_stops_where_nobody_knows_that_nothing_moves(tmp_path: Path) -> None:
    """What was read as text for it, and comes when it has closed, does nothing."""
    async with play(tmp_path) as (app, pilot, control):
        app.post_message(Written("j", "j"))
        await pilot.pause()
        assert codes(app) == ["screen.entry_over"] and control.orders == []
        await pilot.press(":", *"save", "space", "n")
        await settle(app, pilot)
        assert control.stops == [] and any("find an action: save n" in row for row in rows_of(app))
        assert any("[F12] STOP" in row for row in rows_of(app))
        control.at(110.0)  # the last poll is old
        await settle(app, pilot)
        assert any("[SPACE] STOP" in row for row in rows_of(app))
        await pilot.press("space", "f12")
        assert control.stops == ["space", "f12"]


MOVES = align_stage.look(ON - {"desired_velocity_zero"})


@pytest.mark.parametrize(
    "moving",
    [
        align_stage.state(activity=Activity.JOGGING),
        align_stage.state(snapshot=MOVES, standing=ConsoleRole.OUSTED, holder=7),
    ],
    ids=["by this console", "by another"],
)
async def test_it_neither_opens_nor_stays_open_while_something_moves(moving: StationState, tmp_path: Path) -> None:
    async with play(tmp_path) as (app, pilot, control):
        rest = control.state
        control.state = moving
        await pilot.press(":")
        assert (app._list.is_open, codes(app), control.stops) == (False, ["screen.palette_moving"], [])
        control.state = rest
        await pilot.press(":", "a")
        assert app._list.is_palette
        control.state = moving
        await pilot.press("space")
        assert control.stops == ["space"]
        app.tick()
        assert (app._list.is_open, codes(app)) == (False, ["screen.palette_moving"])


class Terminal:
    """The thread that reads keys, with a clock that is given; `heard` is what it passes to the application."""

    def __init__(self, now: KeySituation, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.heard = now, list[str]()
        self.driver = StopDriver.__new__(StopDriver)
        self.driver._pace, self.driver._stopped_s, self.driver._app = KeyPace(), -math.inf, self  # type: ignore[assignment]
        self.driver._codes, self.driver.age, self.driver._drops = ScanCollector(), answered_age(), False
        monkeypatch.setattr(LinuxDriver, "process_message", lambda driver, message: self._hear(message))

    def _hear(self, message: Message) -> None:
        self.heard.append(message.key if isinstance(message, events.Key) else type(message).__name__)

    def situation(self) -> KeySituation:
        return self.now

    def press(self, at_s: float, key: str) -> None:
        self.heard += [each.key for each in self.driver._pace.take_due_keys(at_s - 1e-6)]
        self.driver._hear(events.Key(key, key if len(key) == 1 else None), at_s)

    def later(self, at_s: float) -> list[str]:
        return [*self.heard, *(each.key for each in self.driver._pace.take_due_keys(at_s))]


SCANNED = (":", *"f4", "enter")


@pytest.mark.parametrize("gap_s", [0.0, 0.01, 0.03])
def test_a_scanner_neither_opens_the_palette_nor_takes_anything_in_it(
    gap_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed = Terminal(KeySituation(page=PageName.ALIGN, at_rest=True), monkeypatch)
    for number, key in enumerate(SCANNED):
        closed.press(10.0 + gap_s * number, key)
    assert ":" not in closed.later(12.0) and "enter" not in closed.later(12.0)
    opened = KeySituation(page=PageName.ALIGN, field=FieldKind.TEXT, at_rest=True, reading=True, seeking=True)
    typed = Terminal(opened, monkeypatch)
    for number, key in enumerate((*"redo", "enter")):
        typed.press(10.0 + gap_s * number, key)
    typed.press(10.3, "enter")  # a slow line brings it late
    assert [key for key in typed.later(12.0) if key not in ("TooFast", "Scanned")] == list("redo")
    typed.press(13.0, "enter")
    assert typed.later(14.0)[-1] == "enter", "somebody has read it"


# How it looks --------------------------------------------------------------------------------------------------


@pytest.mark.first(1)
@pytest.mark.parametrize(("language", "size"), [("en", (80, 24)), ("ko", (80, 24)), ("en", (160, 48))])
async def test_it_fits_with_the_reason_of_the_selected_action_in_full(
    language: str, size: tuple[int, int], tmp_path: Path
) -> None:
    text = load(language)
    async with play(tmp_path, work=experiment(), language=language, size=size) as (app, pilot, _):
        await pilot.press(":")
        await settle(app, pilot)
        rows = rows_of(app)
        assert all(cell_len(row) == size[0] for row in rows)
        assert (
            text("palette.title") in rows[3]
            and text("palette.foot", place=1, all=len(listed(language))) in rows[-4]
        )
        for key in ("pagedown", "end", "up"):
            await pilot.press(key)
            await settle(app, pilot)
            entry = app._list.selected_entry
            assert entry is not None and sum("▶" in row for row in rows_of(app)) >= 1
            words = "".join("".join(rows_of(app)).split())
            assert "".join(entry.words.split()) in words, key
            for problem in entry.reasons:
                assert "".join(text.problem(problem).split()) in words, key


@pytest.mark.rings
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_key_of_each_page_says_what_that_page_is(language: str) -> None:
    """Alone, as in Settings and in the palette; in the lists of `?` one key shares the words of another."""
    text = load(language)
    for page in PageName:
        (action,) = (each for each in ACTIONS if each.id == f"page.{page}")
        assert words_of(text, action).startswith(text(f"page.{page}")), page
