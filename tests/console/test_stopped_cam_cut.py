"""A cut by a table that was stopped leaves the table on: the console says so, and does not blame another host."""

from __future__ import annotations

from datetime import date
from pathlib import Path

from console.session.data.stop_records import simulated_record, store
from console.session.station.commands import Arm, Recover, Retract, Start, Verify
from console.session.station.reaching import Commissioned
from console.session.station.state import Activity
from drivers.cutting.strategy import Strategy
from drivers.lathe.heartbeat import Heartbeat
from drivers.pmac.dialect import DIALECTS
from tests.console.floor import Floor, experiment_1, open_floor

JOB = experiment_1()


def commissioned(floor: Floor, data: Path) -> None:
    client, machine = floor.context.client, floor.context.loaded_machine.machine
    assert client is not None
    program, heartbeat = floor.context.lathe.program, Heartbeat(client, floor.sim, machine)
    floor.context.commissioned = Commissioned(
        client, heartbeat, machine, data, lambda: program.definitions, simulated=True
    )
    store(data, machine, simulated_record(machine, DIALECTS["pmac"], date.today()))
    floor.do(Verify())


def in_the_cut(floor: Floor) -> bool:
    """Whether the program of the cut was seen running and has switched its table on."""
    client = floor.context.client
    return client is not None and floor.state.activity is Activity.CUTTING and client.numbers("I51") == (1.0,)


def test_after_a_stop_in_a_cut_by_a_table_arming_names_the_table_and_f8_switches_it_off(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    commissioned(floor, tmp_path)
    floor.set_up(JOB)
    assert floor.arm(JOB, Strategy.CAM).armed is not None
    floor.when(lambda _: in_the_cut(floor), lambda: floor.stop.stop("space"))
    floor.do(Start())
    floor.do(Recover())
    refused = floor.do(Arm(job=JOB, job_sha256="0" * 64, strategy=Strategy.CAM)).refusals
    assert [problem.code for problem in refused] == ["cut.table_on"]
    floor.do(Retract())
    assert floor.arm(JOB, Strategy.CAM).refusals == ()
