"""A console whose terminal is not at the machine says so, and asks once before it enables drives (rule R4)."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.station.commands import EnableDrives
from console.tui.application.far_terminal import WITHIN_S, FarTerminal
from console.tui.keymap import PageName
from tests.tui import align_stage
from tests.tui.machine_states import CLAMPED
from tests.tui.scenes import Scene, application, fill, played, rows_of
from tests.tui.stage import LANGUAGES, experiment

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
    fill(data)
    scene = Scene(page=PageName.ALIGN, state=replace(OFF, simulated=simulated), work=experiment())
    app, control = application(scene, data, language=language, client=client)
    counts, said, rows = list[int](), list[str](), list[str]()

    async def run() -> None:
        async with played(app, scene, (80, 24)) as pilot:
            rows.extend(rows_of(app))
            for at_s in (101.0, 103.0):
                control.at(at_s)
                await pilot.press("f4")
                counts.append(sum(isinstance(order, EnableDrives) for order in control.orders))
                said.extend(problem.code for problem in app.ui.said)

    asyncio.run(run())
    return counts, said, rows[0]


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
