"""A stop in a cut on a compensation table: the tool goes out, the carriage back, and the table off."""

from __future__ import annotations

from pathlib import Path

from console.session.station.commands import Recover, Retract, Start
from console.session.station.progress import CutStage
from console.session.station.state import Activity
from drivers.cutting.planning import Strategy
from tests.console.floor import experiment_1, set_up_once


def test_after_a_stop_on_a_table_f8_leaves_nothing_of_it(tmp_path: Path, in_copies: None) -> None:
    floor, job = set_up_once(tmp_path), experiment_1()
    assert floor.arm(job, Strategy.CAM).armed is not None
    floor.when(
        lambda _: floor.state.cut is not None and floor.state.cut.stage is CutStage.CUT,
        lambda: floor.stop.stop("space"),
    )
    floor.do(Start())
    floor.idle()
    assert floor.state.stop is not None and floor.state.stop.rest_s is not None
    floor.do(Recover())
    assert [problem.code for problem in floor.lathe.program.tables_left()] != []
    state = floor.do(Retract())
    assert state.activity is Activity.READY and state.refusals == () and state.stop is None, state.alarms
    assert floor.lathe.program.tables_left() == ()
    assert floor.sim.controller.variables.i(51) == 0.0
    assert floor.arm(job, Strategy.CAM).armed is not None, floor.state.refusals
