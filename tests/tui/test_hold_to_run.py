"""Hold-to-run by the repeat of a terminal: measured before it is used, and ended by all but its next repeat."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest
from textual import events
from textual.pilot import Pilot

from console.session.station.commands import Jog
from console.session.station.state import Activity, StationState
from console.tui.align.align_jog import HELD_UP_S, MOST_WAITING, StepQueue
from console.tui.align.hold_run import (
    UNMEASURED,
    HoldRun,
    JogPresses,
    KeyRepeatCalibration,
    Repeat,
    ReportedStrokes,
)
from console.tui.application.key_releases import OFF, ON, QUERY, SLOWEST_S, KeyReleases, ReportedKey, Stroke
from console.tui.driver import Reader
from console.tui.gate import UNREADABLE
from console.tui.keymap import PageName
from profiles.problem import Problem
from tests.tui import align_stage
from tests.tui.scenes import Scene, application, fill, played
from tests.tui.stage import experiment, grid

REPEAT = Repeat(first_s=0.5, gap_s=0.035)
READY = align_stage.state()


def calibrated(first_s: float, period_s: float, late_s: float = 0.0) -> Repeat | None:
    """Hold a key for four seconds on a terminal with this repeat, of which one comes late."""
    calibration, now_s = KeyRepeatCalibration(), 0.0
    calibration.press(now_s)
    now_s += first_s
    for n in range(int(4.0 / period_s)):
        now_s += late_s if n == 10 else 0.0
        if calibration.press(now_s):
            return calibration.measured
        now_s += period_s
    return None


def test_the_timeout_follows_from_the_largest_gap() -> None:
    quick, slow = calibrated(0.5, 0.033), calibrated(0.25, 0.092)
    assert quick is not None and (quick.first_s, quick.timeout_s) == (0.5, 0.1)
    assert slow is not None and slow.timeout_s == pytest.approx(0.138)


@pytest.mark.parametrize(
    ("first_s", "period_s", "late_s"), [(0.5, 0.2, 0.0), (0.5, 0.033, 0.15), (0.75, 0.033, 0.0)]
)
def test_a_slow_terminal_or_an_uneven_line_stays_with_single_steps(
    first_s: float, period_s: float, late_s: float
) -> None:
    assert calibrated(first_s, period_s, late_s) is None


def test_taps_of_the_key_measure_nothing() -> None:
    calibration = KeyRepeatCalibration()
    assert not any(calibration.press(n * 0.9) for n in range(10))


def held(*repeats_s: float) -> HoldRun:
    run = HoldRun()
    run.begin(0.0)
    for at_s in repeats_s:
        run.repeat(at_s, REPEAT)
    return run


def test_it_runs_while_repeats_come_and_not_before() -> None:
    assert not held().runs(0.3, REPEAT)
    assert held(0.5, 0.533, 0.566).runs(0.6, REPEAT)
    assert not held(0.5, 0.533, 0.566).runs(0.7, REPEAT)
    assert not held(0.5).runs(0.52, None)


def test_what_a_stalled_line_brings_later_moves_nothing() -> None:
    run = held(0.5, 0.533, 0.566)
    # Half a second nothing, then everything at once, and then the rhythm again: the key has to be pressed anew.
    for at_s in (1.1, 1.1, 1.1, 1.133, 1.166):
        run.repeat(at_s, REPEAT)
        assert not run.runs(at_s, REPEAT)
    run.begin(3.0)
    run.repeat(3.5, REPEAT)
    assert run.runs(3.51, REPEAT)


def test_the_overrun_counts_the_step_under_way_and_those_begun_until_the_timeout() -> None:
    # 0.1 s of timeout and 0.25 s till then; a step takes 0.3 s: under way, begun, begun before the end.
    assert REPEAT.overrun_steps(0.3) == 3
    assert REPEAT.overrun_steps(0.6) == 2


def hold(
    tmp_path: Path, key: str, *, calibrate: bool = True, stall_at_s: float = 99.0
) -> tuple[int, str, list[str]]:
    """Hold h for 3.2 s, then a jog key for 2 s, on a machine that makes each step at once; then let 1 s pass."""
    fill(tmp_path)
    scene = Scene(page=PageName.ALIGN, state=READY, work=experiment())
    app, control = application(scene, tmp_path)
    shown: list[str] = []
    counts: list[int] = []

    async def press(pilot: Pilot[None], key: str, begin_s: float, for_s: float) -> None:
        now_s = begin_s
        while now_s < begin_s + for_s:
            control.at(now_s)
            await pilot.press(key)
            app.tick()
            gap_s = 0.5 if now_s == begin_s else 0.05
            stalls = key != "h" and abs(now_s - begin_s - stall_at_s) < 0.03
            now_s += gap_s + (0.4 if stalls else 0.0)
            counts.append(len(control.orders))

    async def run() -> None:
        async with played(app, scene, (80, 24)) as pilot:
            if calibrate:
                await press(pilot, "h", 100.0, 3.2)
            control.at(104.0)
            await pilot.press("j")
            await press(pilot, key, 105.0, 2.0)
            for n in range(10):
                control.at(107.1 + 0.1 * n)
                app.tick()
                await pilot.pause()
            shown.append(grid(app))

    asyncio.run(run())
    orders = [order for order in control.orders if isinstance(order, Jog)]
    assert len(orders) == counts[-1]  # none after the last repeat
    return len(orders), shown[0], [problem.code for problem in app.ui.key_answer]


def test_a_held_key_is_one_step_until_the_repeat_is_measured_then_runs_and_ends_with_its_repeats(
    tmp_path: Path,
) -> None:
    steps, text, said = hold(tmp_path, "right", calibrate=False)
    assert (steps, said) == (1, ["screen.jog_key_held"])
    assert "Jog, step only" in text
    even, text, _ = hold(tmp_path / "even", "pageup")
    assert even > 20  # 30 repeats, on a machine that needs no time for a step
    # Step 0.10 degrees, 4 of them.
    assert "Jog, hold: ≤ 0.4° over" in text
    stalled, _, _ = hold(tmp_path / "stalls", "pageup", stall_at_s=0.8)
    assert 1 < stalled < even / 2, "a stall ends it although the key is still held"


@pytest.mark.long
def test_toward_the_work_every_step_is_a_press(tmp_path: Path) -> None:
    steps, _, said = hold(tmp_path, "down")
    assert (steps, said) == (1, ["screen.no_hold_to_work"])


async def test_one_step_is_under_way_at_most(tmp_path: Path) -> None:
    fill(tmp_path)
    scene = Scene(page=PageName.ALIGN, state=READY, work=experiment())
    app, control = application(scene, tmp_path)
    control.arrives = False
    async with played(app, scene, (80, 24)) as pilot:
        for n in range(70):
            control.at(100.0 + (0.0 if n == 0 else 0.5 + 0.05 * n))
            await pilot.press("h")
        control.at(106.0)
        await pilot.press("j")
        for n in range(30):
            control.at(107.0 + (0.0 if n == 0 else 0.5 + 0.05 * n))
            control.state = replace(READY, activity=Activity.JOGGING if n else Activity.READY)
            await pilot.press("pageup")
            app.tick()
    assert len(control.orders) == 1


# Releases of keys, where the terminal reports them: asked for, confirmed, and the end of a run at once.


PLAIN_FLAGS, FLAGS = "\x1b[?25u", "\x1b[?27u"
PAGE_UP, REPEATED, RELEASED = "\x1b[5~", "\x1b[5;1:2~", "\x1b[5;1:3~"


def asked(round_trip_s: float = 0.01, answer: str = FLAGS) -> tuple[KeyReleases, Reader]:
    """A terminal that was asked, told, and asked again."""
    releases = KeyReleases()
    reader = Reader(releases)
    assert releases.ask(True, 0.0) == QUERY
    feed(reader, PLAIN_FLAGS, 0.01)
    assert releases.ask(True, 1.0) == ON + QUERY
    feed(reader, answer, 1.0 + round_trip_s)
    return releases, reader


def feed(reader: Reader, typed: str, now_s: float = 0.0) -> list[object]:
    """What is made of characters: the stroke of a reported key, the name of another one."""
    said = [message for character in typed for message in reader.read(character, now_s)]
    return [
        (each.key, each.stroke) if isinstance(each, ReportedKey) else each.key
        for each in said
        if isinstance(each, events.Key)
    ]


def test_they_are_in_force_only_once_the_terminal_says_so() -> None:
    silent = KeyReleases()
    assert silent.ask(True, 0.0) == QUERY
    # Never told to report, because it has not answered; and asked once.
    assert [silent.ask(True, 0.1 * n) for n in range(100)] == [""] * 100
    assert not silent.in_force
    assert asked()[0].in_force
    assert not asked(answer="\x1b[?1u")[0].confirmed, "a terminal without event types"
    assert not asked(answer="\x1b[?3u")[0].confirmed, "text keys have no release there"


def test_they_are_given_back_and_asked_for_anew() -> None:
    releases, reader = asked()
    assert (releases.ask(False, 2.0), releases.ask(False, 2.1)) == (OFF, "")
    assert not releases.confirmed
    assert feed(reader, RELEASED) == [], "it was on its way, and stops nothing"
    assert releases.ask(True, 3.0) == ON + QUERY
    assert not releases.confirmed, "the answer is still to come"


def test_a_terminal_that_answers_late_has_none_in_force() -> None:
    assert asked(round_trip_s=SLOWEST_S * 1.1)[0].is_slow
    releases, reader = asked()
    assert releases.ask(True, 3.1) == QUERY, "asked again while the page is shown"
    assert releases.ask(True, 3.1 + 1.1 * SLOWEST_S) == ""
    assert releases.is_slow
    feed(reader, FLAGS, 4.0)
    assert releases.is_slow
    assert releases.ask(True, 6.0) == QUERY
    feed(reader, FLAGS, 6.01)
    releases.ask(True, 6.1)
    assert releases.in_force


def test_strokes_are_told_apart_and_a_release_is_no_key() -> None:
    releases, reader = asked()
    assert feed(reader, PAGE_UP) == [("pageup", Stroke(repeated=False, releases=0))]
    assert feed(reader, REPEATED) == [("pageup", Stroke(repeated=True, releases=0))]
    assert feed(reader, RELEASED + "\x1b[104;1:3u" + "\x1b[57441;2:3u") == []
    assert releases.count == 3
    assert feed(reader, "\x1b[104;1:2;104u") == [("h", Stroke(repeated=True, releases=3))]
    assert feed(reader, "\x1b[32;1;32u") == [("space", Stroke(repeated=False, releases=3))]


def test_what_nobody_asked_for_changes_nothing_and_a_release_is_invalid_input() -> None:
    releases = KeyReleases()
    assert feed(Reader(releases), FLAGS) == []
    assert not releases.understood
    assert feed(Reader(releases), RELEASED) == [UNREADABLE]


def held_key(*, releases: int = 0) -> HoldRun:
    run = HoldRun()
    run.begin(0.0)
    for at_s in (0.4, 0.433, 0.466):
        run.repeat(at_s, UNMEASURED, releases)
    return run


def test_any_release_ends_the_run_at_once_and_silence_ends_it_too() -> None:
    assert held_key().runs(0.47, UNMEASURED, 0)
    ended = held_key()
    assert not ended.runs(0.47, UNMEASURED, 1)
    assert not ended.lost
    silent = held_key()
    assert not silent.runs(0.467 + UNMEASURED.timeout_s, UNMEASURED, 0)
    assert silent.lost
    # What the line brings later, is no run either.
    for at_s in (1.5, 1.5, 1.5, 1.533):
        silent.repeat(at_s, UNMEASURED, 0)
    assert not silent.runs(1.54, UNMEASURED, 0)


@pytest.mark.parametrize("behind_s", [0.0, 0.05])
def test_a_press_and_its_repeats_that_come_at_once_waited_somewhere(behind_s: float) -> None:
    run = HoldRun()
    run.begin(0.0)
    for n in range(3):
        run.repeat(behind_s + 0.001 * n, UNMEASURED, 0)
    assert not run.runs(behind_s + 0.01, UNMEASURED, 0)
    strokes = ReportedStrokes()
    assert not strokes.is_finger(Stroke(repeated=True, releases=0), 0.0)
    assert not strokes.is_finger(Stroke(repeated=False, releases=1), 0.001)
    assert strokes.is_finger(Stroke(repeated=False, releases=1), 0.5)


def play(data: Path, said: list[tuple[float, str]], ends_s: float) -> tuple[list[float], str, list[str]]:
    """When steps were commanded while a terminal says this; the screen, and the answers."""
    fill(data)
    scene = Scene(page=PageName.ALIGN, state=align_stage.state(), work=experiment())
    app, control = application(scene, data)
    releases, reader = asked()
    steps: list[float] = []
    shown: list[str] = []
    app.offer_releases = lambda on: releases  # type: ignore[method-assign]

    async def run() -> None:
        async with played(app, scene, (80, 24)) as pilot:
            await pilot.press("j")
            waiting, now_s = list(said), 100.0
            while now_s < 100.0 + ends_s:
                control.at(now_s)
                while waiting and 100.0 + waiting[0][0] <= now_s:
                    for character in waiting.pop(0)[1]:
                        for message in reader.read(character, now_s):
                            app.post_message(message)
                    await pilot.pause()
                app.tick()
                orders = sum(isinstance(order, Jog) for order in control.orders)
                steps.extend([now_s - 100.0] * (orders - len(steps)))
                now_s += 0.02
            await pilot.pause()
            shown.append(grid(app))

    asyncio.run(run())
    return steps, shown[0], [problem.code for problem in app.ui.key_answer]


HELD = [(0.1, PAGE_UP), *((0.5 + 0.033 * n, REPEATED) for n in range(30))]
LAST_S = HELD[-1][0]


def test_a_held_key_runs_without_a_calibration_and_ends_with_its_release(tmp_path: Path) -> None:
    steps, text, _ = play(tmp_path, [*HELD, (LAST_S + 0.03, RELEASED)], 2.5)
    assert len(steps) > 10
    assert max(steps) <= LAST_S + 0.03
    # The step of 0.10 degrees takes longer than the line: that under way, and one that was just commanded.
    assert "Jog: release ≤ 0.2, lost ≤ 0.5°" in text


@pytest.mark.long
def test_a_release_that_is_lost_ends_with_the_repeats(tmp_path: Path) -> None:
    steps, _, _ = play(tmp_path, HELD, 3.0)
    assert LAST_S + 0.05 < max(steps) <= LAST_S + UNMEASURED.timeout_s + 0.02


def test_what_a_stalled_line_brings_later_moves_nothing_where_releases_are_reported(tmp_path: Path) -> None:
    late = [(2.5, REPEATED)] * 40 + [(2.5, RELEASED), (2.8, PAGE_UP), (2.85, RELEASED)]
    steps, text, _ = play(tmp_path, [*HELD, *late], 3.0)
    assert max(steps) <= LAST_S + UNMEASURED.timeout_s + 0.02
    assert "stood still: this press may be an old one" in text


def test_taps_are_steps_at_once(tmp_path: Path) -> None:
    taps = [event for n in range(5) for event in ((0.2 * n + 0.2, PAGE_UP), (0.2 * n + 0.25, RELEASED))]
    assert len(play(tmp_path, taps, 2.0)[0]) == 5


# Every press of a jog key is one step, in motion too, and a key that is held down is one press.


REST = StationState(activity=Activity.READY)
BUSY = StationState(activity=Activity.JOGGING)


def fingers(*pressed_s: float) -> tuple[int, bool]:
    """Presses that a finger made, of a key that comes at these times; and whether it is held at the end."""
    presses, now_s, left, counted = JogPresses(), 0.0, list(pressed_s), 0
    while now_s < pressed_s[-1] + 1.0:
        counted += presses.take_due_key(now_s) is not None
        while left and left[0] <= now_s:
            left.pop(0)
            counted += presses.take_due_key(now_s) is not None
            counted += presses.press("align.in", now_s)
        now_s += 0.005
    return counted, presses.held


@pytest.mark.parametrize("gap_s", [0.15, 0.2, 0.35, 0.45, 0.8, 1.5])
def test_ten_presses_are_ten_steps_at_any_pace_of_a_person(gap_s: float) -> None:
    assert fingers(*(gap_s * n for n in range(10))) == (10, False)


@pytest.mark.parametrize("delay_s", [0.25, 0.5, 0.66])
@pytest.mark.parametrize("period_s", [0.03, 0.04, 0.092])
def test_a_key_that_is_held_down_is_one_step(delay_s: float, period_s: float) -> None:
    assert fingers(0.0, *(delay_s + period_s * n for n in range(60))) == (1, True)


def test_presses_faster_than_a_hand_are_a_key_that_is_held_down() -> None:
    assert fingers(*(0.1 * n for n in range(10))) == (1, True)


def test_another_key_is_taken_at_once() -> None:
    presses = JogPresses()
    assert presses.press("align.in", 0.0)
    assert presses.press("align.out", 0.3)


def test_the_next_step_is_due_only_when_the_one_before_is_proven_in_position() -> None:
    queue = StepQueue()
    for n in range(3):
        queue.add("align.in", 0.1 * n)
    assert queue.is_due
    queue.note_posted_step(REST)
    # At rest again, but nobody has said that it arrived.
    for state in (REST, BUSY, REST):
        assert queue.follow(state, 0.3)
        assert not queue.is_due
    assert queue.follow(replace(REST, jogs=1), 0.4)
    assert (queue.is_due, queue.made, queue.asked) == (True, 1, 3)


def test_a_step_that_the_machine_refuses_ends_those_behind_it() -> None:
    queue = StepQueue()
    for _ in range(3):
        queue.add("align.in", 0.0)
    # What was refused before the step is no answer to it.
    before = replace(REST, refusals=(Problem(code="session.busy"),))
    queue.note_posted_step(before)
    assert queue.follow(before, 0.1)
    assert not queue.follow(replace(REST, refusals=(Problem(code="machine.beyond_travel"),)), 0.2)
    assert queue.steps_left == 0


def test_a_screen_that_was_held_up_does_not_continue() -> None:
    queue = StepQueue()
    for _ in range(3):
        queue.add("align.in", 0.0)
    queue.note_posted_step(REST)
    assert not queue.follow(replace(REST, jogs=1), HELD_UP_S + 0.1)
    assert (queue.is_due, queue.steps_left) == (False, 0)


def test_no_more_than_ten_steps_wait() -> None:
    """A terminal that repeats a held key five times a second would else drive long after it is let go."""
    queue = StepQueue()
    taken = [queue.add("align.in", 0.2 * n) for n in range(20)]
    assert (sum(taken), queue.waiting) == (MOST_WAITING, MOST_WAITING)


def test_what_is_pressed_later_or_is_another_key_is_counted_anew() -> None:
    queue = StepQueue()
    queue.add("align.in", 0.0)
    queue.note_posted_step(REST)
    queue.follow(replace(REST, jogs=1), 0.5)
    queue.add("align.in", 1.0)
    assert (queue.made, queue.asked) == (1, 2)
    queue.note_posted_step(replace(REST, jogs=1))
    queue.follow(replace(REST, jogs=2), 1.5)
    queue.add("align.in", 9.0)
    assert (queue.made, queue.asked) == (0, 1)
    queue.drop()
    queue.add("align.out", 9.1)
    assert (queue.made, queue.asked) == (0, 1)
