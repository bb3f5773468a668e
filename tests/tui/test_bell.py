"""The bell: once for a new alarm of high priority, rarely in a flood, never for an answer; off, it says so."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.appearance import Appearance
from console.session.station.alarms import Alarms, Priority, acknowledged, cleared, raised
from console.tui.application.bell import APART_S, Bell
from console.tui.keymap import PageName
from profiles.problem import Problem
from tests.tui import align_stage
from tests.tui.scenes import Scene, application, fill, played, rows_of
from tests.tui.stage import LANGUAGES, experiment

RESET, HEARTBEAT = Problem(code="controller.was_reset"), Problem(code="heartbeat.lost")


def high(alarms: Alarms, *problems: Problem) -> Alarms:
    for problem in problems:
        alarms = raised(alarms, problem, Priority.HIGH, 0.0)
    return alarms


def test_each_new_alarm_of_high_priority_rings_once_and_a_flood_rarely() -> None:
    bell, first, both = Bell(), high((), RESET), high((), RESET, HEARTBEAT)
    assert not bell.rings((), 0.0)
    assert not bell.rings(raised((), RESET, Priority.MEDIUM, 0.0), 0.0)
    assert [bell.rings(first, 0.1 * n) for n in range(100)] == [True] + [False] * 99
    assert not bell.rings(acknowledged(first), 10.0)
    assert bell.rings(high(acknowledged(first), RESET), 20.0), "it came again"
    assert not bell.rings(both, 20.0 + 0.9 * APART_S)
    assert bell.rings(high(cleared(both, RESET.code), RESET), 20.0 + 1.1 * APART_S)
    flood = Bell()
    many = [high((), *(Problem(code=f"a.{n}") for n in range(m))) for m in range(1, 101)]
    assert sum(flood.rings(each, 0.1 * n) for n, each in enumerate(many)) == 2


def rung(data: Path, appearance: Appearance) -> tuple[list[str], str]:
    """What rang while an answer, an alarm, and nothing came; and the row of alarms before it."""
    fill(data)
    scene = Scene(page=PageName.ALIGN, state=align_stage.state(), work=experiment())
    app, control = application(scene, data, appearance=appearance, language=appearance.language)
    heard, rows = list[str](), list[str]()
    now = ["start"]
    app.bell = lambda: heard.append(now[0])  # type: ignore[method-assign]

    async def run() -> None:
        async with played(app, scene, (80, 24)) as pilot:
            rows.append(rows_of(app)[1])
            now[0] = "answer"
            await pilot.press("pageup")
            app.tick()
            assert app.ui.said
            now[0] = "alarm"
            control.state = replace(control.state, alarms=high((), RESET))
            app.tick()
            now[0] = "later"
            for n in range(20):
                control.at(101.0 + n)
                app.tick()

    asyncio.run(run())
    return heard, rows[0]


def test_the_terminal_rings_for_an_alarm_and_not_for_an_answer(tmp_path: Path) -> None:
    heard, row = rung(tmp_path, Appearance())
    assert heard == ["alarm"]
    assert row.split() == ["·", "no", "alarms"]


@pytest.mark.parametrize("language", LANGUAGES)
def test_switched_off_it_is_silent_and_says_so(tmp_path: Path, language: str) -> None:
    heard, row = rung(tmp_path, Appearance(bell="off", language=language))
    assert heard == []
    assert {"en": "bell off", "ko": "벨 꺼짐"}[language] in row
