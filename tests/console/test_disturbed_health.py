"""A test of the tool while another host writes a setting: the screens keep nothing, and name the setting."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.station.commands import CheckHealth, EnableDrives, Home, IdentifyTool
from drivers.cutting.strategy import Strategy
from profiles.store import load_machine
from tests.console.floor import open_floor
from tests.drivers.test_identification_refused import disturb


@pytest.mark.first(1)
@pytest.mark.parametrize("command", [CheckHealth(step_um=25.0), IdentifyTool(path=Strategy.PVT)])
def test_nothing_is_kept_of_a_tool_whose_gain_changed_meanwhile(
    tmp_path: Path, command: CheckHealth | IdentifyTool
) -> None:
    floor = open_floor(tmp_path, 1, "ideal", load_machine("lee-2001-lathe"), owned=True)
    floor.do(EnableDrives())
    floor.do(Home())
    disturb(floor.sim, (1.0, "I132=2452"))
    state = floor.do(command)
    (alarm,) = state.alarms
    assert (alarm.problem.code, alarm.problem.key) == ("measurement.changed", "I132")
    assert (alarm.problem.value, alarm.problem.limit) == ("2452", "4905")
    assert state.tested == "" and not [*tmp_path.glob("health/**/*.json"), *tmp_path.glob("identified/**/*.json")]
    assert state.snapshot is not None and state.snapshot.loops_open
