"""A table adds something to a tool without a home: it is cleared on killed drives, and nothing moves by that."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.station.commands import ClearTables, DisableDrives, EnableDrives, Home, Jog, Verify
from drivers.errors import DriverError
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.words.sentences import LANGUAGES
from tests.console.floor import Floor
from tests.console.test_left_table import Keys, left_in_mid_cut, tool_mm

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
    client = floor.context.client
    assert client is not None
    for line in ("#1HM", "#1K"):
        client.request(line)
    floor.idle()


def codes(floor: Floor) -> set[str]:
    return {problem.code for problem in floor.lathe.program.tables_left()}


@pytest.mark.parametrize("language", LANGUAGES)
def test_by_keys_alone_the_table_is_cleared_and_the_axes_are_homed(
    tmp_path: Path, in_copies: None, language: str
) -> None:
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
    before = floor.lathe.program.tables_left()
    assert [problem.code for problem in floor.do(ClearTables()).refusals] == ["tables.homed"]
    lose_home(floor)
    floor.do(EnableDrives())
    before = floor.lathe.program.tables_left()
    assert [problem.code for problem in floor.do(ClearTables()).refusals] == ["tables.drives_enabled"]
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
