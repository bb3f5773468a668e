"""A console that starts after one was left in mid cut by a table: keys alone get tool out and table off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.station.commands import Command, ConfirmClamping, EnableDrives, Home, Jog, Recover, Start
from console.session.station.progress import CutStage
from console.session.station.state import StationState
from console.tui.page import Page
from console.tui.pages.align import AlignPage
from console.tui.pages.run import RunPage
from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import AxisName
from profiles.words.sentences import LANGUAGES
from tests.console.floor import Floor, experiment_1, floor_at, set_up_once
from tests.console.test_stopped_cam_cut import commissioned
from tests.tui.stage import experiment, ui_for

JOB = experiment_1()
WORK = replace(experiment(), job=JOB)


class Keys:
    """The pages Align and Run at a station whose commands are carried out at once."""

    side = None

    def __init__(self, floor: Floor, language: str = "en") -> None:
        self.floor = floor
        self.ui = ui_for(self, Path("/nowhere"), language, WORK)  # type: ignore[arg-type]
        self.align, self.run = AlignPage(self.ui), RunPage(self.ui)

    @property
    def state(self) -> StationState:
        return self.floor.state

    def now_s(self) -> float:
        return self.floor.sim.now_s()

    def post(self, intent: Command) -> bool:
        self.floor.do(intent)
        return True

    def press(self, page: Page, action: str) -> str:
        """Press a key, and return what it was answered."""
        self.ui.said = ()
        page.act(action)
        return " ".join(self.ui.text.problem(each) for each in (*self.ui.said, *self.state.refusals))

    def next_step(self, page: Page) -> str:
        return "".join(words for words, _ in page.next_step(self.ui.view))


def left_in_mid_cut(records: Path) -> Floor:
    """The lathe as a closed terminal leaves it in mid cut, and a new console at it."""
    floor = set_up_once(records)
    assert floor.arm(JOB, Strategy.CAM).armed is not None
    floor.when(
        lambda _: floor.state.cut is not None and floor.state.cut.stage is CutStage.CUT,
        lambda: floor.stop.stop("SIGHUP"),
    )
    floor.do(Start())
    floor.station.close("SIGHUP")
    new = floor_at(floor.sim, records, floor.context.loaded_machine)
    assert new.station.connect()
    new.idle()
    return new


def is_clamped(floor: Floor) -> bool:
    return floor.state.alignment.clamping is not None


def drives_are_on(floor: Floor) -> bool:
    return floor.state.alignment.drives_on


def tool_mm(floor: Floor) -> float:
    tool = floor.lathe.snapshot().tool.position
    return tool / floor.context.machine.tool.counts_per_mm


@pytest.mark.parametrize("language", LANGUAGES)
def test_by_keys_alone_the_tool_comes_out_and_the_table_is_switched_off(
    tmp_path: Path, in_copies: None, language: str
) -> None:
    keys = Keys(left_in_mid_cut(tmp_path), language)
    commissioned(keys.floor, tmp_path)
    floor, text = keys.floor, keys.ui.text
    assert keys.next_step(keys.run) == text("run_page.next.switch_on")
    assert "F4" in keys.press(keys.run, "run.retract")
    assert keys.next_step(keys.align) == text("align_page.next.switch_on_to_table_off")
    confirmed = keys.press(keys.align, "align.take")
    assert "F4" in confirmed and "F8" in confirmed and not is_clamped(floor)

    before_mm = tool_mm(floor)
    assert keys.press(keys.align, "align.step") == ""
    assert drives_are_on(floor)
    floor.idle()
    assert tool_mm(floor) == pytest.approx(before_mm, abs=0.002), "the loop closes where the tool stands"
    assert keys.next_step(keys.align) == text("align_page.next.table_off")
    assert "F8" in keys.press(keys.align, "align.step")
    assert "F8" in keys.press(keys.align, "align.take")

    assert keys.next_step(keys.run) == text("run_page.next.table_off")
    assert keys.press(keys.run, "run.retract") == ""
    assert tool_mm(floor) < before_mm - 1.9
    assert floor.sim.controller.variables.i(51) == 0.0
    assert floor.lathe.program.tables_left() == ()
    assert keys.press(keys.align, "align.step") == "" and not drives_are_on(floor)
    assert keys.press(keys.align, "align.take") == "" and is_clamped(floor)
    checks = floor.context.commissioned
    assert checks is not None and checks.problems(floor.lathe.snapshot()) == (), "no other host is blamed for it"


def test_until_the_table_is_off_nothing_else_moves_and_nothing_is_clamped(tmp_path: Path, in_copies: None) -> None:
    floor = left_in_mid_cut(tmp_path)
    before = floor.do(ConfirmClamping(job=JOB))
    floor.do(EnableDrives())
    orders = Home(), Jog(axis=AxisName.CARRIAGE, distance=-1.0)
    refused = [before.refusals, *(floor.do(order).refusals for order in orders), floor.arm(JOB).refusals]
    assert {problems[0].code for problems in refused} == {"cut.table_on"}


def test_a_table_that_is_on_with_the_tool_out_is_switched_off_by_f8_too(tmp_path: Path, in_copies: None) -> None:
    """The cut was stopped after its table was switched on, and before the tool was at the part."""
    floor = set_up_once(tmp_path)
    assert floor.arm(JOB, Strategy.CAM).armed is not None
    floor.when(
        lambda seen: floor.sim.controller.variables.i(51) == 1.0 and seen.program_running,
        lambda: floor.stop.stop("space"),
    )
    floor.do(Start())
    floor.do(Recover())
    keys = Keys(floor)
    assert keys.state.alignment.tables != ()
    assert keys.press(keys.run, "run.retract") == ""
    assert floor.sim.controller.variables.i(51) == 0.0 and keys.state.alignment.tables == ()
