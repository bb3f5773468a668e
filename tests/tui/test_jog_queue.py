"""Steps of a jog key that wait, on the whole console: made one after the other, dropped by anything else."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from textual import events

from console.session.station.commands import Jog
from console.session.station.state import Activity, StationState
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName
from drivers.lathe.standing import Standing
from tests.tui import align_stage
from tests.tui.scenes import Scene, application, fill, played
from tests.tui.stage import FixedControl, experiment


@dataclass(frozen=True)
class Jogged:
    """The console after some presses, and how many commands there were after each."""

    app: ConsoleApp
    control: FixedControl
    orders: list[int]


def jogged(tmp_path: Path, *presses: tuple[float, str, StationState]) -> Jogged:
    """Press keys at these times, each in a state of the machine; look after each, and once without a key."""
    fill(tmp_path)
    scene = Scene(page=PageName.ALIGN, state=align_stage.state(), work=experiment())
    app, control = application(scene, tmp_path)
    control.arrives = False
    orders: list[int] = []

    async def run() -> None:
        async with played(app, scene, (80, 24)) as pilot:
            for at_s, key, now in presses:
                control.at(at_s)
                control.state = now
                if key:  # at this moment, whatever tick is pending
                    written = {"space": " "}.get(key, key if len(key) == 1 else None)
                    await app.on_event(events.Key(key, written))
                app.tick()
                await pilot.pause()
                orders.append(len(control.orders))

    asyncio.run(run())
    return Jogged(app=app, control=control, orders=orders)


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
    assert console.app.ui.said == ()


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
    console = jogged(
        tmp_path,
        *THREE_PRESSES,
        (100.7, key, state),
        (100.8, "", TWO_MADE),
        (101.3, "", TWO_MADE),
    )
    assert console.control.stops == reason
    assert len([order for order in console.control.orders if isinstance(order, Jog)]) == 1


@pytest.mark.parametrize(
    "after",
    [
        replace(ONE_MADE, stops=1),
        replace(ONE_MADE, activity=Activity.LOST),
        replace(ONE_MADE, standing=Standing.OUSTED),
        replace(ONE_MADE, activity=Activity.VERIFYING),
    ],
    ids=["a stop, and F2 at once", "lost link", "lost ownership", "busy with something else"],
)
@pytest.mark.first(2)
def test_nothing_continues_on_a_machine_that_is_not_as_before(after: StationState, tmp_path: Path) -> None:
    console = jogged(
        tmp_path,
        *THREE_PRESSES,
        (100.8, "", after),
        (101.0, "", TWO_MADE),
    )
    assert len(console.control.orders) == 1


async def test_a_terminal_that_loses_the_focus_stops_the_jog(tmp_path: Path) -> None:
    fill(tmp_path)
    scene = Scene(page=PageName.ALIGN, state=UNDER_WAY, work=experiment())
    app, control = application(scene, tmp_path)
    async with played(app, scene, (80, 24)) as pilot:
        app.post_message(events.AppBlur())
        await pilot.pause()
    assert control.stops == ["blur"]
