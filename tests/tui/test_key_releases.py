"""Releases of keys, where the terminal reports them: asked for, confirmed, and the end of a run at once."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from textual import events

from console.session.station.commands import Jog
from console.tui.align.hold_run import UNMEASURED, HoldRun
from console.tui.align.jog_presses import ReportedStrokes
from console.tui.application.key_releases import OFF, ON, QUERY, SLOWEST_S, KeyReleases, ReportedKey, Stroke
from console.tui.driver import Reader
from console.tui.gate import UNREADABLE
from console.tui.keymap import PageName
from tests.tui import align_stage
from tests.tui.scenes import Scene, application, fill, played
from tests.tui.stage import experiment, grid

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


def held(*, releases: int = 0) -> HoldRun:
    run = HoldRun()
    run.begin(0.0)
    for at_s in (0.4, 0.433, 0.466):
        run.repeat(at_s, UNMEASURED, releases)
    return run


def test_any_release_ends_the_run_at_once_and_silence_ends_it_too() -> None:
    assert held().runs(0.47, UNMEASURED, 0)
    ended = held()
    assert not ended.runs(0.47, UNMEASURED, 1)
    assert not ended.lost
    silent = held()
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
    return steps, shown[0], [problem.code for problem in app.ui.said]


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


def test_what_a_stalled_line_brings_later_moves_nothing(tmp_path: Path) -> None:
    late = [(2.5, REPEATED)] * 40 + [(2.5, RELEASED), (2.8, PAGE_UP), (2.85, RELEASED)]
    steps, text, _ = play(tmp_path, [*HELD, *late], 3.0)
    assert max(steps) <= LAST_S + UNMEASURED.timeout_s + 0.02
    assert "stood still: this press may be an old one" in text


def test_taps_are_steps_at_once(tmp_path: Path) -> None:
    taps = [event for n in range(5) for event in ((0.2 * n + 0.2, PAGE_UP), (0.2 * n + 0.25, RELEASED))]
    assert len(play(tmp_path, taps, 2.0)[0]) == 5
