"""A replay shows the pages as they were, forward and back; it commands nothing, saves nothing, and says so."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from textual import events

from console.flight.playback import SPEEDS, Playback
from console.flight.replay.replay_app import PAGES, ReplayApp
from console.session.guide.situation import Situation
from console.session.station.alarms import Priority, raise_alarm
from console.session.station.commands import TakeControl
from console.session.station.state import Activity, ArmedCut, StationState
from console.text.catalogue import load
from console.tui.align.align_lines import why_lines
from console.tui.frame import Frame, next_row, state_row
from console.tui.gate import FieldKind
from console.tui.keymap import ACTIONS, KILL_KEYS, STOP_KEYS, PageName
from console.tui.lines import line, plain_text, width_of
from console.tui.theme import COLOUR, MONO
from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.console_role import ConsoleRole
from profiles.problem import Problem
from profiles.store import load_machine
from tests.console.flight.bench import BEGAN_S, FlightBench
from tests.golden_text import compare, writing
from tests.tui import align_stage, run_stage
from tests.tui.run_stage import MADE
from tests.tui.scenes import (
    ALIGNED,
    Scene,
    application,
    console_on,
    cut,
    fixed_world,
    machine,
    played,
    pressed,
    rows_of,
    scene_of,
    settle,
    signed,
)
from tests.tui.stage import LANGUAGES, MACHINE, ON

SIZE = (80, 24)
LIVE = [page for page in PAGES if page not in (PageName.PREVIEW, PageName.ALARMS, PageName.LOG)]
"""Not Preview, whose numbers come from a thread of their own, nor what has the times of the recording."""


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@asynccontextmanager
async def replayed(
    bench: FlightBench, *, language: str = "en", size: tuple[int, int] = SIZE, palette: Any = COLOUR
) -> AsyncIterator[tuple[ReplayApp, Any]]:
    """A replay of what a bench has recorded, paused at its beginning."""
    bench.recorder.close("SIGTERM")
    bench.recorder._finish()
    playback = Playback(bench.frozen[-1], playing=False)
    nothing = bench.data / "nothing"
    nothing.mkdir()
    app = ReplayApp(playback, text=load(language), palette=palette, data=nothing, now_s=Clock(), ticking=False)
    async with app.run_test(size=size) as pilot:
        await settle(app, pilot)
        yield app, pilot
    assert list(nothing.iterdir()) == []


def page_of(app: ReplayApp) -> str:
    return app.page.value


def a_cut(data: Path) -> FlightBench:
    """Some seconds of a cut, with keys, a stop, an alarm, and rest; on two pages."""
    bench = FlightBench(data, state=replace(machine(Activity.READY), alignment=ALIGNED), work=signed())
    bench.page = "align"
    bench.runs(3.0)
    bench.page = "run"
    bench.inbox.put("key", "5")
    bench.state = replace(bench.state, activity=Activity.CUTTING, cut=cut())
    turn = iter(range(1000))

    def turns() -> None:
        bench.state = replace(bench.state, cut=replace(cut(), turn=60.0 + next(turn)))

    bench.runs(4.0, turns)
    bench.stops("space")
    bench.alarms()
    bench.state = replace(bench.state, activity=Activity.STOPPED)
    bench.runs(3.0)
    return bench


@pytest.mark.first(2)
@pytest.mark.parametrize("page", LIVE)
async def test_a_page_is_as_it_was(page: PageName, tmp_path: Path) -> None:
    scene = replace(scene_of(page), keys=())
    measured = scene.state.measured
    if measured is not None:  # a learning step is not recorded
        scene = replace(scene, state=replace(scene.state, measured=replace(measured, learning=None)))
    with fixed_world():
        (tmp_path / "live").mkdir()
        live, _ = application(scene, tmp_path / "live")
        async with played(live, scene, SIZE):
            expected = rows_of(live)
        bench = FlightBench(tmp_path / "data", state=scene.state, work=scene.work)
        bench.page, bench.now_s = page, 100.0
        bench.recorder.turn()
        async with replayed(bench) as (app, _):
            assert rows_of(app)[1:22] == expected[1:22]
            assert rows_of(app)[0].startswith(" REPLAY ")


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.long
async def test_backward_shows_what_forward_showed(language: str, tmp_path: Path) -> None:
    bench = a_cut(tmp_path)
    async with replayed(bench, language=language) as (app, pilot):
        shown: dict[float, list[str]] = {}
        for key in ["full_stop", "n", "full_stop", "full_stop", "n", "full_stop", "end"]:
            await pilot.press(key)
            await settle(app, pilot)
            shown[app.playback.at_s] = rows_of(app)
        assert [*shown] == sorted(shown)
        assert len({tuple(rows) for rows in shown.values()}) == 7
        for at_s in reversed(shown):
            app.playback.seek(at_s - app.playback.at_s)
            await settle(app, pilot)
            assert rows_of(app) == shown[at_s]


@pytest.mark.long
async def test_it_plays_at_any_speed_and_follows_the_page(tmp_path: Path) -> None:
    bench = a_cut(tmp_path)
    async with replayed(bench) as (app, pilot):
        clock = app._real_s
        assert isinstance(clock, Clock)
        assert page_of(app) == "align"
        await pilot.press("space")
        clock.now_s += 2.0
        await settle(app, pilot)
        assert app.playback.past_s == pytest.approx(2.0)
        await pilot.press("plus", "plus")  # x5
        clock.now_s += 0.5
        await settle(app, pilot)
        assert page_of(app) == "run"
        assert app.playback.past_s == pytest.approx(4.5)
        for _ in SPEEDS:
            app.perform_key(events.Key("-", "-"))
        assert app.playback.speed == SPEEDS[0]
        await pilot.press("2")
        await settle(app, pilot)
        assert page_of(app) == "setup"
        await pilot.press("f")
        for _ in SPEEDS:
            app.perform_key(events.Key("+", "+"))
        await settle(app, pilot)
        assert (page_of(app), app.playback.speed) == ("run", SPEEDS[-1])
        clock.now_s += 60.0
        await settle(app, pilot)
        assert (app.playback.playing, app.playback.place) == (False, len(app.playback.recording.moments) - 1)
        await pilot.press("pageup")
        await settle(app, pilot)
        assert app.playback.past_s == 0.0
        await pilot.press("n")
        assert app.playback.at_s == pytest.approx(BEGAN_S + 3.0)  # the key
        await pilot.press("n")
        assert app.playback.at_s == pytest.approx(BEGAN_S + 7.1)  # the stop
        await pilot.press("b")
        assert app.playback.at_s == pytest.approx(BEGAN_S + 3.0)


@pytest.mark.first(1)
@pytest.mark.parametrize("language", LANGUAGES)
async def test_no_key_of_the_machine_does_anything_and_each_says_why(language: str, tmp_path: Path) -> None:
    bench, text = a_cut(tmp_path), load(language)
    ours = {
        "space",
        "left",
        "right",
        "pageup",
        "pagedown",
        "+",
        "-",
        ",",
        ".",
        "b",
        "n",
        "f",
        "home",
        "end",
        "ctrl+q",
    }
    looks = {"1", "2", "3", "4", "5", "6", "8", "?", "w", "backspace", "escape"}
    keys = {action.keys[0] for action in ACTIONS if action.keys} | {*STOP_KEYS, *KILL_KEYS}
    async with replayed(bench, language=language) as (app, pilot):
        for key in sorted(keys - ours - looks):
            assert app.perform_key(events.Key(key, key if len(key) == 1 else None))
            assert (app._refused, app.playback.place, app.page) == (True, 0, PageName.ALIGN), key
            app._refused = False
        await pilot.press("f5")
        await settle(app, pilot)
        assert text.problem(Problem(code="flight.is_recording"))[:40] in rows_of(app)[1]
        await pilot.press("full_stop")
        await settle(app, pilot)
        assert text.problem(Problem(code="flight.is_recording"))[:40] not in rows_of(app)[1]


@pytest.mark.first(1)
@pytest.mark.parametrize(("language", "palette"), [("en", MONO), ("ko", COLOUR)], ids=LANGUAGES)
async def test_the_badge_the_time_and_the_keys_are_always_there(
    language: str, palette: Any, tmp_path: Path
) -> None:
    text = load(language)
    async with replayed(a_cut(tmp_path), language=language, palette=palette) as (app, pilot):
        for key in ("1", "4", "question_mark", "w", "end", "f"):
            await pilot.press(key)
            await settle(app, pilot)
            rows = rows_of(app)
            assert rows[0].startswith(f" {text('replay.badge')}  {text('sim')} ")
            assert "0:0" in rows[-2] and "●" in rows[-2]
            assert text("replay.key.help") in rows[-1]
            assert text("frame.stop") not in "".join(rows)
        assert "!" in rows[-2]
        await pilot.resize_terminal(50, 12)
        await settle(app, pilot)
        assert text("replay.small") in " ".join(" ".join(rows_of(app)).split())


async def test_the_page_of_alarms_has_what_was_raised_and_commanded_up_to_the_moment(tmp_path: Path) -> None:
    bench = FlightBench(tmp_path)
    bench.runs(2.0)
    bench.inbox.put("command", "Home")
    bench.inbox.put("command", "Jog axis=tool distance=0.01 refused")
    bench.inbox.put("command", "__import__ os")
    bench.runs(2.0)
    bench.alarms()
    bench.runs(2.0)
    async with replayed(bench) as (app, pilot):
        await pilot.press("8", "home")
        await settle(app, pilot)
        assert "Alarms (0)" in "\n".join(rows_of(app))
        await pilot.press("end")
        await settle(app, pilot)
        assert "Alarms (1)" in "\n".join(rows_of(app))
        assert "the spindle has stopped with the tool in the part" in " ".join(rows_of(app)[-12:])
        await pilot.press("l")
        await settle(app, pilot)
        logged = [row[10:40] for row in rows_of(app) if re.match(r"│\d\d:\d\d:\d\d ", row)]
        assert [row.rstrip()[:17] for row in logged] == [
            "command      home",
            "not taken    jog",
            "alarm        no. ",
        ]
        await pilot.press("7")
        await settle(app, pilot)
        assert (app.page, app._refused) == (PageName.LOG, True)


async def test_an_armed_cut_is_shown_without_its_program(tmp_path: Path) -> None:
    work = signed()
    plan = plan_cut(work.job, work.machine.machine, Strategy.PVT)
    armed = ArmedCut(job=work.job, strategy=Strategy.PVT, plan=plan, alignment=ALIGNED, until_s=1e4, made=MADE)
    state = replace(machine(Activity.READY), alignment=ALIGNED, armed=armed)
    bench = FlightBench(tmp_path, state=state, work=signed())
    bench.page = "run"
    bench.runs(0.1)
    async with replayed(bench) as (app, _):
        assert "1000 rpm" in "\n".join(rows_of(app))


# The screens of a console that looks on: what stands there, what its keys do, how it takes over.


GOLDENS = Path(__file__).with_name("observer_goldens")
HOLDER = 1_683_503_496
"""Numbers are drawn up to ten digits."""

LOOKING_ON: dict[str, Any] = {"standing": ConsoleRole.OBSERVER, "holder": HOLDER}
ALARMS = raise_alarm((), Problem(code="owner.held", value=str(HOLDER)), Priority.MEDIUM, 1.0)
MOVING = align_stage.look(ON - {"desired_velocity_zero"})


def frame(state: StationState, language: str = "en", **changes: Any) -> Frame:
    made = Frame(
        text=load(language),
        state=state,
        machine=load_machine(MACHINE).machine,
        page=PageName.RUN,
        field=FieldKind.NONE,
        next_step=line("what to do"),
        said=(),
        clock=datetime(2026, 1, 2, 8, 41),
        now_s=100.1,
    )
    return replace(made, **changes)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("standing", [ConsoleRole.OBSERVER, ConsoleRole.OUSTED])
def test_the_state_row_says_who_controls_and_the_next_row_what_helps(standing: ConsoleRole, language: str) -> None:
    text, now = load(language), frame(run_stage.state(standing=standing, holder=HOLDER), language)
    first, following = plain_text(state_row(now, 80)), plain_text(next_row(now, 80))
    assert text("frame.looks_on", holder=HOLDER) in first and str(HOLDER) in first
    assert text("frame.observer") in following and " t " in following
    assert "what to do" not in following
    for width in (60, 80, 160):
        assert all(width_of(row) <= width for row in (*state_row(now, width), *next_row(now, width)))


def test_a_stop_comes_before_who_controls() -> None:
    stopped = replace(run_stage.stopped(), **LOOKING_ON)
    assert "F2" in plain_text(next_row(frame(stopped), 80))


@pytest.mark.parametrize("activity", [Activity.CONNECTING, Activity.LOST])
def test_nothing_is_said_of_who_controls_where_that_is_not_known(activity: Activity) -> None:
    now = frame(run_stage.state(activity=activity, **LOOKING_ON))
    assert str(HOLDER) not in plain_text(state_row(now, 80))


FREE: dict[str, Any] = {"standing": ConsoleRole.OBSERVER, "holder": 0}
RUN, ALIGN = run_stage.state(**LOOKING_ON), align_stage.state(**LOOKING_ON)
MOVED = align_stage.state(snapshot=MOVING, **LOOKING_ON)
AGAIN, TAKES = "screen.take_over_again", [TakeControl()]


@pytest.mark.parametrize(
    ("now", "page", "presses", "orders", "answers"),
    [
        (RUN, PageName.RUN, ((0.0, "t"), (2.0, "t")), TAKES, [AGAIN, ""]),
        (RUN, PageName.RUN, ((0.0, "ㅅ"), (2.0, "ㅅ")), TAKES, [AGAIN, ""]),
        (RUN, PageName.RUN, ((0.0, "t"), (6.0, "t"), (12.0, "t")), [], [AGAIN] * 3),
        (
            run_stage.state(**FREE),
            PageName.RUN,
            ((0.0, "t"), (2.0, "t")),
            TAKES,
            ["screen.take_control_again", ""],
        ),
        (run_stage.state(), PageName.RUN, ((0.0, "t"), (1.0, "t")), [], ["screen.controls_already"] * 2),
        *((ALIGN, PageName.ALIGN, ((0.0, key),), [], ["screen.observes"]) for key in ("f4", "enter")),
        *((RUN, PageName.RUN, ((0.0, key),), [], ["screen.observes"]) for key in ("f5", "f8")),
        # It may leave while the owner moves.
        (MOVED, PageName.ALIGN, ((0.0, "ctrl+q"),), [], [""]),
    ],
)
def test_t_twice_within_five_seconds_takes_the_machine_over_and_no_other_key_moves_it(
    now: StationState,
    page: PageName,
    presses: tuple[tuple[float, str], ...],
    orders: list[object],
    answers: list[str],
    tmp_path: Path,
) -> None:
    found = pressed(tmp_path, now, page, *presses)
    assert (found.orders, found.control.stops, found.answers) == (orders, [], answers)


@pytest.mark.parametrize(
    ("keys", "stops", "kills"), [(("z", "f3"), [], []), (("space",), ["space"], []), (("f9",), [], ["f9"])]
)
def test_space_and_f9_stop_whoever_controls_and_a_key_without_a_meaning_does_not(
    keys: tuple[str, ...], stops: list[str], kills: list[str], tmp_path: Path
) -> None:
    control = pressed(tmp_path, MOVED, PageName.ALIGN, *enumerate(keys)).control
    assert (control.stops, control.kills) == (stops, kills)


def test_a_machine_that_nobody_controls_is_called_so() -> None:
    for lost, words in ((FREE, ("No console has control", "t twice")), (LOOKING_ON, ("Another console",))):
        now = Situation(state=align_stage.state(**lost), work=None, machine=load_machine(MACHINE).machine)
        assert all(each in plain_text(why_lines(load("en"), now, 60, 4)) for each in words)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("page", [PageName.RUN, PageName.ALIGN])
async def test_the_screen_of_an_observer_looks_as_it_did(page: PageName, language: str, tmp_path: Path) -> None:
    state = replace(machine(Activity.READY), simulated=False, alignment=ALIGNED, alarms=ALARMS, **LOOKING_ON)
    scene = Scene(page=page, state=state, work=signed())
    with fixed_world():
        async with console_on(scene, tmp_path, language=language) as (app, _, _):
            rows = rows_of(app)
    compare(rows, GOLDENS / f"{page}-{language}.txt", write=writing())
