"""A machine that nobody has commissioned: said where the job is set up, not after the whole of the alignment."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from console.session.data.stop_records import simulated_record, store
from console.session.station.commands import Verify
from console.session.station.reaching import Commissioned
from console.tui.pages.run import RunPage
from console.tui.pages.setup import SetupPage
from drivers.lathe.heartbeat import Heartbeat
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS
from profiles.problem import Problem
from tests.console.floor import open_floor
from tests.tui.machine_states import look_at
from tests.tui.page_stage import READY, PageScene, on_page
from tests.tui.stage import FRAME_ROWS, LANGUAGES, experiment

UNPROVEN = replace(READY, simulated=False, uncommissioned=(Problem(code="stops.no_record", key="shop-3"),))
ROOM = (80, 24 - FRAME_ROWS)


class Setup(PageScene):
    page_class = SetupPage


class Run(PageScene):
    page_class = RunPage


@pytest.mark.parametrize("language", LANGUAGES)
async def test_set_up_says_that_the_machine_may_not_cut_and_what_helps(language: str, tmp_path: Path) -> None:
    async with on_page(Setup, tmp_path, state=UNPROVEN, work=experiment(), language=language, size=ROOM) as stage:
        assert stage.next_step == stage.ui.text("setup.next.uncommissioned")
        assert "✗" in stage.text
        words = " ".join("".join(piece for piece, _ in row) for row in stage.page.in_full(stage.view, 200))
        assert "console doctor" in words and "--prove" in words


async def test_run_names_it_before_everything_else(tmp_path: Path) -> None:
    state = replace(UNPROVEN, snapshot=look_at(frozenset(), tool=0.0, spindle=0.0, carriage=0.0))
    async with on_page(Run, tmp_path, state=state, work=experiment(), size=ROOM) as stage:
        assert stage.ui.text("run_page.check.commissioned") in stage.text


def test_the_machine_is_asked_when_it_is_verified(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    machine = floor.context.loaded_machine.machine
    client = PmacClient(MemoryLink(floor.sim.connect(), floor.sim), floor.sim)
    client.connect()
    heartbeat = Heartbeat(client, floor.sim, machine)
    floor.context.commissioned = Commissioned(
        client, heartbeat, machine, tmp_path, lambda: machine.controller.axis_definitions, simulated=False
    )
    assert [each.code for each in floor.do(Verify()).uncommissioned] == ["stops.no_record"]
    record = simulated_record(machine, DIALECTS["pmac"], date.today())
    store(tmp_path, machine, replace(record, address=client.link.address))
    assert floor.do(Verify()).uncommissioned == ()
