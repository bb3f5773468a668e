"""A table that was left on: keys alone get tool out and table off, also without a home."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from console.session.data.stop_records import simulated_record, store
from console.session.station.commands import (
    Arm,
    ClearTables,
    Command,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Home,
    Jog,
    Recover,
    Retract,
    Start,
    Verify,
)
from console.session.station.machine_connection import CommissioningGate
from console.session.station.progress import CutStage
from console.session.station.state import Activity, StationState
from console.tui.page import Page
from console.tui.pages.align import AlignPage
from console.tui.pages.run import RunPage
from drivers.cutting.strategy import Strategy
from drivers.errors import DriverError
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.dialect import DIALECTS
from profiles.words.sentences import LANGUAGES
from tests.console.floor import Floor, experiment_1, floor_at, known, open_floor, refused_codes, set_up_once
from tests.tui.stage import experiment, ui_for

JOB = experiment_1()


def commissioned(floor: Floor, data: Path) -> None:
    client, machine = floor.context.client, floor.context.loaded_machine.machine
    assert client is not None
    program, heartbeat = floor.context.lathe.program, Heartbeat(client, floor.sim, machine)
    floor.context.commissioned = CommissioningGate(
        client, heartbeat, machine, data, lambda: program.definitions, simulated=True
    )
    store(data, machine, simulated_record(machine, DIALECTS["pmac"], date.today()))
    floor.do(Verify())


def cutting(floor: Floor) -> bool:
    return floor.state.cut is not None and floor.state.cut.stage is CutStage.CUT


def test_after_a_stop_on_a_table_arming_names_it_and_f8_leaves_nothing_of_it(
    tmp_path: Path, in_copies: None
) -> None:
    floor = set_up_once(tmp_path)
    commissioned(floor, tmp_path)
    assert floor.arm(JOB, Strategy.CAM).armed is not None
    floor.when(lambda _: cutting(floor), lambda: floor.stop.stop("space"))
    floor.do(Start())
    floor.idle()
    assert floor.state.stop is not None and floor.state.stop.rest_s is not None
    floor.do(Recover())
    named = refused_codes(floor.do(Arm(job=JOB, job_sha256="0" * 64, strategy=Strategy.CAM)))
    assert set(named) == codes(floor) == {"cut.table_on", "cut.table_holds"}
    state = floor.do(Retract())
    assert state.activity is Activity.READY and state.refusals == () and state.stop is None, state.alarms
    assert codes(floor) == set() and floor.sim.controller.variables.i(51) == 0.0
    state = floor.arm(JOB, Strategy.CAM)
    assert state.armed is not None and state.refusals == (), state.refusals


SHORT = experiment_1(0.3)


@pytest.mark.first(3)
@pytest.mark.parametrize("strategy", Strategy)
def test_a_cut_is_not_stopped_for_what_its_own_program_has_written(tmp_path: Path, strategy: Strategy) -> None:
    floor = open_floor(tmp_path)
    commissioned(floor, tmp_path)
    floor.set_up(SHORT)
    assert floor.arm(SHORT, strategy).armed is not None, floor.state.refusals
    state = floor.do(Start())
    assert (state.refusals, state.stop) == ((), None)
    assert state.activity is Activity.READY and state.armed is None


@pytest.mark.parametrize("line", ["&1#2->-Y", "&1#2->2Y"])
def test_another_definition_of_a_spindle_that_a_program_has_released_is_told(tmp_path: Path, line: str) -> None:
    floor = open_floor(tmp_path)
    commissioned(floor, tmp_path)
    floor.set_up(SHORT)
    assert floor.arm(SHORT, Strategy.TIMEBASE).armed is not None
    floor.sim.connect().receive(f"{line}\r".encode("ascii"))
    floor.sim.wait(0.1)
    refused = floor.do(Start()).refusals
    assert "fingerprint.appeared" in [problem.code for problem in refused], refused


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
        self.ui.key_answer = ()
        page.act(action)
        return " ".join(self.ui.text.problem(each) for each in (*self.ui.key_answer, *self.state.refusals))

    def next_step(self, page: Page) -> str:
        return "".join(words for words, _ in page.next_step(self.ui.view))


def left_in_mid_cut(records: Path) -> Floor:
    """The lathe as a closed terminal leaves it in mid cut, and a new console at it."""
    floor = set_up_once(records)
    assert floor.arm(JOB, Strategy.CAM).armed is not None
    floor.when(lambda _: cutting(floor), lambda: floor.stop.stop("SIGHUP"))
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


@pytest.mark.first(1)
@pytest.mark.parametrize("language", LANGUAGES)
def test_by_keys_the_tool_comes_out_and_the_table_off(tmp_path: Path, in_copies: None, language: str) -> None:
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
    checks = known(floor.context.commissioned)
    assert checks.problems(floor.lathe.snapshot()) == (), "no other host is blamed for it"


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
    floor.do(Start(), Recover())
    keys = Keys(floor)
    assert keys.state.alignment.tables != ()
    assert keys.press(keys.run, "run.retract") == ""
    assert floor.sim.controller.variables.i(51) == 0.0 and keys.state.alignment.tables == ()


AT_ONCE_MM = 0.001
"""No command has moved the tool by more: half of its lobe is ten times as much."""


def without_home(records: Path) -> Floor:
    """The lathe that a closed terminal has left in mid cut; then somebody has aborted the homing of its tool."""
    floor = left_in_mid_cut(records)
    lose_home(floor)
    floor.do(Verify())
    snapshot = floor.lathe.snapshot()
    assert not snapshot.homed and snapshot.loops_open
    return floor


def lose_home(floor: Floor) -> None:
    """Begin and abort the homing of the tool from another host, with the drives killed before and after."""
    client = known(floor.context.client)
    for line in ("#1HM", "#1K"):
        client.request(line)
    floor.idle()


def codes(floor: Floor) -> set[str]:
    return {problem.code for problem in floor.lathe.program.tables_left()}


@pytest.mark.first(1)
@pytest.mark.parametrize("language", LANGUAGES)
def test_by_keys_the_table_is_cleared_and_all_homed(tmp_path: Path, in_copies: None, language: str) -> None:
    keys = Keys(without_home(tmp_path), language)
    floor, text = keys.floor, keys.ui.text
    assert codes(floor) == {"cut.table_on", "cut.table_holds"}
    # With the drives enabled home and jogs are refused, and name the keys.
    floor.do(EnableDrives())
    for order in (Home(), Jog(axis=AxisName.CARRIAGE, distance=-1.0)):
        (told,) = floor.do(order).refusals
        said = text.problem(told)
        assert told.code == "cut.table_no_home"
        assert all(word in said for word in ("F3", "F8", "console retract --clear-tables", "F4"))
    assert keys.next_step(keys.run) == text("run_page.next.table_kill")
    assert keys.next_step(keys.align) == text("align_page.next.table_kill")
    assert "F3" in keys.press(keys.run, "run.retract"), "the tool is out, and the table still adds to it"

    assert keys.press(keys.align, "align.off") == ""
    assert keys.next_step(keys.run) == text("run_page.next.table_clear")
    assert keys.next_step(keys.align) == text("align_page.next.table_clear")
    before_mm = tool_mm(floor)
    assert keys.press(keys.run, "run.retract") == ""
    assert codes(floor) == set() and floor.sim.controller.variables.i(51) == 0.0
    assert floor.lathe.snapshot().loops_open
    assert tool_mm(floor) == pytest.approx(before_mm, abs=AT_ONCE_MM)

    floor.do(EnableDrives())
    floor.idle()
    assert tool_mm(floor) == pytest.approx(before_mm, abs=AT_ONCE_MM), "the loop closes where the tool stands"
    alignment = floor.state.alignment
    assert (alignment.homed, alignment.jaw, alignment.touch_off) == (False, None, None)
    assert floor.do(Home()).refusals == () and floor.state.alignment.homed


def test_nothing_is_sent_while_a_drive_is_enabled_or_a_home_is_known(tmp_path: Path, in_copies: None) -> None:
    floor = left_in_mid_cut(tmp_path)
    assert refused_codes(floor.do(ClearTables())) == ["tables.homed"]
    lose_home(floor)
    floor.do(EnableDrives())
    before = floor.lathe.program.tables_left()
    assert refused_codes(floor.do(ClearTables())) == ["tables.drives_enabled"]
    assert floor.lathe.program.tables_left() == before != ()


def test_nothing_is_sent_while_the_spindle_coasts(tmp_path: Path, in_copies: None) -> None:
    floor = without_home(tmp_path)
    before = floor.lathe.program.tables_left()
    places = iter(range(0, 1000, 50))
    look = floor.lathe.program._poller.look

    def coasting() -> Snapshot:
        seen = look()
        spindle = replace(seen.spindle, position=seen.spindle.position + next(places))
        return replace(seen, spindle=spindle)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(floor.lathe.program._poller, "look", coasting)
        with pytest.raises(DriverError) as refused:
            floor.lathe.program.clear_tables()
    assert [problem.code for problem in refused.value.problems] == ["machine.moving"]
    assert floor.lathe.program.tables_left() == before


def test_doing_nothing_leaves_it_as_it_is(tmp_path: Path, in_copies: None) -> None:
    floor = without_home(tmp_path)
    before, tool_before_mm = floor.lathe.program.tables_left(), tool_mm(floor)
    floor.do(DisableDrives())
    floor.idle()
    assert floor.lathe.program.tables_left() == before
    assert tool_mm(floor) == pytest.approx(tool_before_mm, abs=AT_ONCE_MM) and floor.lathe.snapshot().loops_open
