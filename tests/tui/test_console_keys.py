"""Keys on the whole console: what is done once, answers that are not true any more, a machine that was lost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from textual import events
from textual.widgets import Input

from console.rings import SCHOOL, is_installed
from console.session.cut.alignment import Alignment
from console.session.data.kept_files import jobs_folder
from console.session.station.commands import Adjust, Home, Jog
from console.session.station.state import Activity, StationState, StopState
from console.tui.align.hold_run import SURE_S
from console.tui.app import ConsoleApp
from console.tui.driver import Written
from console.tui.gate import FieldKind, HeldKeys
from console.tui.keymap import ACTIONS, DIGITS, PageName
from drivers.cutting.bounds import Bounds, CutAdjustment
from drivers.lathe.console_role import ConsoleRole
from tests.tui import align_stage, run_stage
from tests.tui.page_stage import run_apart
from tests.tui.scenes import Pressed, console_at, fill, rows_of
from tests.tui.scenes import pressed as pressed_at
from tests.tui.stage import CLAMPED, ON, FixedControl, experiment

HOMING = align_stage.state(Alignment(settings=(), clamping=CLAMPED, drives_on=True))
LEFT = run_stage.state(snapshot=run_stage.look(tool=run_stage.SURFACE_COUNTS), cut=run_stage.cut())


pressed = partial(pressed_at, settles_s=SURE_S)  # a press that may be a terminal's repeat is decided then


def test_what_is_done_once_is_what_orders_or_takes_something() -> None:
    once = {action.id for action in ACTIONS if action.once}
    once_of_page = {
        "align": ("step", "take", "go", "flank", "skim"),
        "calibrate": ("drop", "keep"),
        "controller": ("verify", "backup", "diff"),
        "inspect": ("accept", "revert", "offset"),
        "jobs": ("delete",),
        "scope": ("gather", "keep"),
        "run": ("arm", "start", "feed_hold", "one_turn", "hold", "retract"),
        "tune": ("arm", "start", "apply", "revert"),
    } | ({"train": ("end",)} if is_installed(SCHOOL) else {})
    assert once == {"take_over"} | {f"{page}.{key}" for page, keys in once_of_page.items() for key in keys}


def test_presses_within_eight_tenths_of_a_second_are_one() -> None:
    arm, up = (next(a for a in ACTIONS if a.id == name) for name in ("run.arm", "jobs.up"))
    held = HeldKeys()
    assert [held.repeats(arm, t) for t in (0.0, 0.7, 1.4, 2.3)] == [False, True, True, False]
    assert [held.repeats(up, t) for t in (0.0, 0.1, 0.2)] == [False, False, False]


async def test_readings_may_be_typed_as_fast_as_a_number_pad_allows(tmp_path: Path) -> None:
    """Each Enter takes what was typed before it: else a reading would go on with the digits of the next."""
    async with console_at(tmp_path, PageName.ALIGN, align_stage.state()) as (app, pilot, control):
        for after_s, key in enumerate(["n", "6", "enter", "5", "enter", "minus", "3", "enter"]):
            control.at(100.0 + 0.2 * after_s)
            await pilot.press(key)
            await pilot.pause()
        app.tick()
        shown = "\n".join(rows_of(app))
    assert "place 3 of 6" in shown and "held down" not in shown


@pytest.mark.parametrize(
    ("key", "page"), [("f4", PageName.ALIGN), *((key, PageName.RUN) for key in ("f5", "f6", "f7", "f8"))]
)
@pytest.mark.first(2)
def test_a_key_that_is_held_down_orders_once(key: str, page: PageName, tmp_path: Path) -> None:
    now = {
        "f4": HOMING,
        "f5": run_stage.state(),
        "f6": run_stage.state(armed=run_stage.armed()),
        "f7": run_stage.cutting(),
        "f8": LEFT,
    }[key]
    console = pressed(tmp_path, now, page, (0.0, key), (0.5, key), (1.0, key))
    assert (len(console.orders), console.said) == (1, ["screen.key_repeats"])


def test_every_press_of_plus_changes_the_cut_by_a_step_and_a_held_one_by_one(tmp_path: Path) -> None:
    cutting = run_stage.cutting(adjusted=CutAdjustment(bounds=Bounds(low_percent=95, high_percent=105)))

    def steps(*presses: tuple[float, str]) -> list[int]:
        console = pressed(tmp_path, cutting, PageName.RUN, *presses)
        return [order.steps for order in console.orders if isinstance(order, Adjust)]

    assert steps((0.0, "+"), (0.3, "+"), (0.6, "+")) == [1, 1, 1]
    assert steps((0.0, "+"), (0.3, "-"), (0.6, "+")) == [1, -1, 1]
    # The first repeat of a held key comes late; as soon as the next is there, neither was a press.
    assert steps((0.0, "-"), (0.5, "-"), *((0.53 + 0.03 * n, "-") for n in range(20))) == [-1]
    # A press whose meaning is not decided yet is dropped by a stop, and by any other key.
    assert steps((0.0, "+"), (0.3, "+"), (0.35, "space")) == [1]
    assert steps((0.0, "+"), (0.3, "+"), (0.35, "c")) == [1]


def test_a_held_f4_and_a_held_enter_do_not_go_from_step_to_step_and_a_jog_key_is_none_of_them(
    tmp_path: Path,
) -> None:
    again = pressed(tmp_path, HOMING, PageName.ALIGN, (0.0, "f4"), (0.7, "f4"), (1.55, "f4"))
    assert again.orders == [Home(), Home()]
    far = align_stage.state(seen=align_stage.FAR)
    held = pressed(tmp_path, far, PageName.ALIGN, *((0.1 * n, "enter") for n in range(20)))
    assert (held.orders, held.said) == ([], ["screen.key_repeats"])
    jogs = pressed(tmp_path, align_stage.state(), PageName.ALIGN, (0.0, "j"), (0.1, "right"), (0.9, "right"))
    assert len(jogs.orders) == 2


def test_escape_closes_the_list_of_keys_at_rest_and_without_one_is_a_stop(tmp_path: Path) -> None:
    console = pressed(tmp_path, align_stage.state(), PageName.ALIGN, (0.0, "?"), (0.5, "escape"))
    assert console.control.stops == [] and not console.app._list.is_open
    assert pressed(tmp_path, align_stage.state(), PageName.ALIGN, (0.0, "escape")).control.stops == ["escape"]


STOP = StopState(reason="space", killed=False, sent_s=100.0)


@pytest.mark.parametrize(
    ("page", "key", "code", "later"),
    [
        (PageName.RUN, "f6", "screen.not_armed", {"armed": True}),
        (PageName.RUN, "f6", "screen.not_armed", {"activity": Activity.ARMING}),
        (PageName.ALIGN, "right", "screen.jog_not_enabled", {"stop": STOP}),
    ],
)
def test_an_answer_goes_with_the_state_that_it_speaks_of(
    page: PageName, key: str, code: str, later: dict[str, object], tmp_path: Path
) -> None:
    console = pressed(tmp_path, run_stage.state(), page, (0.0, key))
    assert console.said == [code]
    ui = console.app.ui
    ui.forget_stale_answer(replace(console.control.state, at_s=101.0))
    assert console.said == [code]
    changes = {"armed": run_stage.armed()} if "armed" in later else later
    ui.forget_stale_answer(replace(console.control.state, **changes))
    assert console.said == []


async def test_nothing_is_armed_does_not_stay_beside_armed(tmp_path: Path) -> None:
    async with console_at(tmp_path, PageName.RUN, run_stage.state()) as (app, pilot, control):
        await pilot.press("f6")
        for now, is_said in ((run_stage.state(), True), (run_stage.state(armed=run_stage.armed()), False)):
            control.state = now
            app.tick()
            await pilot.pause()
            row = "".join(text for text, _ in app._rows["alarm"].lines[0])
            assert ("nothing is armed" in row) is is_said


def test_why_a_key_stopped_the_machine_stays_said(tmp_path: Path) -> None:
    """The stop changes what the machine does, and that is what the answer speaks of."""
    jogging = align_stage.state(activity=Activity.JOGGING)
    console = pressed(tmp_path, jogging, PageName.ALIGN, (0.0, "f3"))
    assert (console.control.stops, console.said) == (["change F3"], ["screen.key_in_motion"])
    stopped = replace(jogging, activity=Activity.STOPPED, stop=replace(STOP, rest_s=100.4))
    console.app.ui.forget_stale_answer(stopped)
    assert console.said == ["screen.key_in_motion"]


@pytest.mark.parametrize("keys", [(), ("down", "enter")])
async def test_a_character_for_a_field_is_written_into_it_and_shows_no_page_once_it_is_closed(
    keys: tuple[str, ...], tmp_path: Path
) -> None:
    """It was not held back, as it was for a field; so it does nothing else."""
    async with console_at(tmp_path, PageName.SETUP, align_stage.state(), *keys) as (app, pilot, _):
        app.post_message(Written("4", "4"))
        await pilot.pause()
        said = [problem.code for problem in app.ui.key_answer]
        assert (app._page, said) == (PageName.SETUP, [] if keys else ["screen.entry_over"])
        assert not keys or app.query_one("SetupPage Input", Input).value == "4"


ANOTHERS: dict[str, Any] = {"standing": ConsoleRole.OUSTED, "holder": 7}
MOVES = align_stage.look(ON - {"desired_velocity_zero"})


@pytest.mark.parametrize(
    ("now", "presses"),
    [
        (align_stage.state(activity=Activity.HOMING), ((0.0, "?"), (0.5, "escape"))),
        (align_stage.state(snapshot=MOVES, **ANOTHERS), ((0.0, "?"), (0.5, "escape"))),
        (align_stage.state(activity=Activity.LOST), ((0.0, "?"), (0.5, "escape"))),
        # An order that the machine has not begun yet, and a machine that was not looked at for long.
        (HOMING, ((0.0, "f4"), (0.2, "?"), (0.4, "escape"))),
        (align_stage.state(), ((0.0, "?"), (5.0, "escape"))),
    ],
    ids=["moving", "moved by another console", "lost", "ordered", "not seen for long"],
)
@pytest.mark.first(2)
def test_escape_stops_with_a_list_open_where_something_may_move(
    now: StationState, presses: tuple[tuple[float, str], ...], tmp_path: Path
) -> None:
    assert pressed(tmp_path, now, PageName.ALIGN, *presses).control.stops == ["escape"]


@pytest.mark.first(3)
@pytest.mark.parametrize("key", DIGITS.values())
def test_while_a_part_is_cut_every_page_may_be_looked_at(key: str, tmp_path: Path) -> None:
    console = pressed(tmp_path, run_stage.cutting(), PageName.RUN, (0.0, key))
    assert console.control.stops == []
    assert DIGITS[console.app._page] == key


def test_a_machine_that_was_lost_in_motion_is_still_stopped_by_any_key_and_can_be_left(tmp_path: Path) -> None:
    moving = align_stage.look(ON - {"desired_velocity_zero"})
    lost = align_stage.state(activity=Activity.LOST, snapshot=moving)
    console = pressed(tmp_path, lost, PageName.ALIGN, (0.0, "z"), (1.0, "ctrl+q"))
    assert (console.control.stops, console.said) == (["unbound z"], [])


def typed(data: Path, *keys: str) -> Pressed:
    return pressed(data, align_stage.state(), PageName.SETUP, *((float(n), key) for n, key in enumerate(keys)))


@pytest.mark.parametrize("number", ["1e3", "1e3x7", "1 5", "1k3", "1t3", "ㅁ13", "1ㅏ3"])
@pytest.mark.first(3)
def test_no_character_is_left_out_of_a_number_and_no_key_acts_in_the_middle_of_it(
    number: str, tmp_path: Path
) -> None:
    """1e3 without its e would be 13 mm: what does not belong stays in the entry, and Enter refuses it."""
    console = typed(tmp_path, "down", "enter", *("space" if each == " " else each for each in number), "enter")
    (refused,) = console.app.ui.key_answer
    assert (refused.code, refused.value) == ("value.not_number", f'"{number}"')
    assert console.app.ui.work == experiment()
    assert console.app._field is FieldKind.NUMBER and console.orders == []


@pytest.mark.parametrize("opening", ["?", "w"])
@pytest.mark.first(1)
def test_nothing_is_typed_or_taken_behind_a_list_that_hides_the_entry(opening: str, tmp_path: Path) -> None:
    """13 would be taken by somebody who has not seen the list come up in the middle of it."""
    keys = ["down", "enter", "1", opening, "3", "enter"]
    hidden = typed(tmp_path, *keys)
    assert hidden.app.ui.work == experiment() and hidden.app._field is FieldKind.NUMBER
    again = typed(tmp_path / "again", *keys, "backspace", "5", "enter")
    assert again.app.ui.work is not None and again.app.ui.work.job.diameter_mm == 15.0


def test_a_character_that_does_not_belong_is_told_at_once_and_can_be_deleted(tmp_path: Path) -> None:
    assert typed(tmp_path, "down", "enter", "5", "e").said == ["screen.not_of_a_number"]
    mended = typed(tmp_path / "again", "down", "enter", "5", "e", "backspace", "3", "enter")
    assert mended.app.ui.work is not None and mended.app.ui.work.job.diameter_mm == 53.0


@pytest.mark.long
async def test_any_of_many_jobs_is_opened_in_five_keys(tmp_path: Path) -> None:
    """A search, three characters that only one job has, Enter; the digits in it are no pages."""
    fill(tmp_path)
    source = (jobs_folder(tmp_path) / "ring-52.toml").read_text(encoding="utf-8")
    for number in range(100, 160):
        (jobs_folder(tmp_path) / f"flange-{number}.toml").write_text(
            source.replace("ring-52", f"flange-{number}"), encoding="utf-8"
        )
    async with console_at(tmp_path, PageName.JOBS, align_stage.state()) as (app, pilot, control):
        await pilot.press("slash", "1", "3", "7", "enter")
        await pilot.pause()
    assert app.fault is None and control.stops == []
    assert app._page is PageName.SETUP
    assert app.ui.work is not None and app.ui.work.job.name == "flange-137"


async def test_a_held_d_deletes_nothing(tmp_path: Path) -> None:
    fill(tmp_path)
    path = jobs_folder(tmp_path) / "ring-52.toml"
    there: list[bool] = []
    async with console_at(tmp_path, PageName.JOBS, align_stage.state()) as (_app, pilot, control):
        await pilot.press("down", "down")
        for after_s in (0.0, 0.1, 0.2, 0.9, 2.0):
            control.at(100.0 + after_s)
            await pilot.press("d")
            await pilot.pause()
            there.append(path.exists())
    assert there == [True, True, True, True, False]


# Steps of a jog key that wait, on the whole console: made one after the other, dropped by anything else.


@dataclass(frozen=True)
class Jogged:
    """The console after some presses, and how many commands there were after each."""

    app: ConsoleApp
    control: FixedControl
    orders: list[int]


def jogged(tmp_path: Path, *presses: tuple[float, str, StationState]) -> Jogged:
    """Press keys at these times, each in a state of the machine; look after each, and once without a key."""

    async def run() -> Jogged:
        orders: list[int] = []
        async with console_at(tmp_path, PageName.ALIGN, align_stage.state()) as (app, pilot, control):
            control.arrives = False
            for at_s, key, now in presses:
                control.at(at_s)
                control.state = now
                if key:  # at this moment, whatever tick is pending
                    written = {"space": " "}.get(key, key if len(key) == 1 else None)
                    await app.on_event(events.Key(key, written))
                app.tick()
                await pilot.pause()
                orders.append(len(control.orders))
        return Jogged(app=app, control=control, orders=orders)

    return run_apart(run)


AT_REST, UNDER_WAY = align_stage.state(), align_stage.state(activity=Activity.JOGGING)
ONE_MADE, TWO_MADE = (replace(AT_REST, jogs=n) for n in (1, 2))
THREE_PRESSES = (
    (100.0, "j", AT_REST),
    (100.1, "right", AT_REST),
    (100.3, "right", UNDER_WAY),
    (100.45, "right", UNDER_WAY),
)
"""The first one starts a step; the others come while it is under way."""


def test_presses_in_motion_wait_and_are_made_one_after_the_other(tmp_path: Path) -> None:
    console = jogged(
        tmp_path,
        *THREE_PRESSES,
        (100.7, "", UNDER_WAY),
        (100.8, "", ONE_MADE),
        (100.9, "", replace(UNDER_WAY, jogs=1)),
        (101.2, "", TWO_MADE),
    )
    assert console.orders == [0, 1, 1, 1, 1, 2, 2, 3]
    assert console.app.ui.key_answer == ()


@pytest.mark.parametrize(
    ("key", "state", "reason"),
    [
        ("left", UNDER_WAY, ["change ←"]),
        ("left", ONE_MADE, ["change ←"]),  # between two steps, at rest
        ("up", ONE_MADE, ["change ↑"]),
        ("z", ONE_MADE, ["unbound z"]),
        ("space", ONE_MADE, ["space"]),
        ("+", ONE_MADE, ["change +"]),
        ("5", ONE_MADE, ["page"]),
        # No stop, but a key that asks for something else.
        ("w", UNDER_WAY, []),
        ("k", UNDER_WAY, []),
        ("j", UNDER_WAY, []),
    ],
)
@pytest.mark.first(3)
def test_any_other_key_drops_the_steps_that_wait(
    key: str, state: StationState, reason: list[str], tmp_path: Path
) -> None:
    console = jogged(tmp_path, *THREE_PRESSES, (100.7, key, state), (100.8, "", TWO_MADE), (101.3, "", TWO_MADE))
    assert console.control.stops == reason
    assert len([order for order in console.control.orders if isinstance(order, Jog)]) == 1


@pytest.mark.parametrize(
    "after",
    [
        replace(ONE_MADE, stops=1),
        replace(ONE_MADE, activity=Activity.LOST),
        replace(ONE_MADE, standing=ConsoleRole.OUSTED),
        replace(ONE_MADE, activity=Activity.VERIFYING),
    ],
    ids=["a stop, and F2 at once", "lost link", "lost ownership", "busy with something else"],
)
@pytest.mark.first(2)
def test_nothing_continues_on_a_machine_that_is_not_as_before(after: StationState, tmp_path: Path) -> None:
    console = jogged(tmp_path, *THREE_PRESSES, (100.8, "", after), (101.0, "", TWO_MADE))
    assert len(console.control.orders) == 1


async def test_a_terminal_that_loses_the_focus_stops_the_jog(tmp_path: Path) -> None:
    async with console_at(tmp_path, PageName.ALIGN, UNDER_WAY) as (app, pilot, control):
        app.post_message(events.AppBlur())
        await pilot.pause()
    assert control.stops == ["blur"]
