"""Every strategy cuts under the checks of a commissioned machine: what it writes itself is not another host's."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.station.commands import Start
from console.session.station.state import Activity
from drivers.cutting.planning import Strategy
from tests.console.floor import experiment_1, open_floor
from tests.console.test_stopped_cam_cut import commissioned

JOB = experiment_1(0.3)


@pytest.mark.parametrize("strategy", Strategy)
def test_a_cut_is_not_stopped_for_what_its_own_program_has_written(tmp_path: Path, strategy: Strategy) -> None:
    floor = open_floor(tmp_path)
    commissioned(floor, tmp_path)
    floor.set_up(JOB)
    assert floor.arm(JOB, strategy).armed is not None, floor.state.refusals
    state = floor.do(Start())
    assert (state.refusals, state.stop) == ((), None)
    assert state.activity is Activity.READY and state.armed is None


@pytest.mark.parametrize("line", ["&1#2->-Y", "&1#2->2Y"])
def test_another_definition_of_a_spindle_that_a_program_has_released_is_told(tmp_path: Path, line: str) -> None:
    floor = open_floor(tmp_path)
    commissioned(floor, tmp_path)
    floor.set_up(JOB)
    assert floor.arm(JOB, Strategy.TIMEBASE).armed is not None
    floor.sim.connect().receive(f"{line}\r".encode("ascii"))
    floor.sim.wait(0.1)
    refused = floor.do(Start()).refusals
    assert "fingerprint.appeared" in [problem.code for problem in refused], refused
