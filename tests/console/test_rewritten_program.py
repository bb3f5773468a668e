"""A controller that rewrites the program between its loading and its start never runs it, whoever cuts."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.cut.engine import Step
from console.session.cut.in_process import simulated_context
from console.session.cut.run import cut_part
from console.session.errors import SessionError
from console.session.station.commands import Start
from drivers.cutting.planning import plan_cut
from drivers.cutting.strategy import Strategy
from drivers.simulator.machine import SimulatedLathe
from tests.compact import compact_machine
from tests.console.floor import experiment_1, set_up_once

CUT_MM = 0.5
REWRITES = [
    pytest.param("OPEN PROG 2 CLEAR X0 Z0 CLOSE", "controller.program_differs", id="another program"),
    pytest.param("OPEN PROG 2 X0 CLOSE", "controller.program_differs", id="a line more"),
    pytest.param("P11=P11+500", "controller.constant_differs", id="a deeper cut"),
]


def rewrite(sim: SimulatedLathe, line: str) -> None:
    port = sim.connect()
    port.receive(f"{line}\r".encode("ascii"))
    sim.attend(port)


def started(sim: SimulatedLathe) -> bool:
    return any(system.running for system in sim.controller.systems.values())


@pytest.mark.parametrize(("line", "code"), REWRITES)
@pytest.mark.first(1)
def test_the_screens_refuse_it_before_anything_moves(
    tmp_path: Path, in_copies: None, line: str, code: str
) -> None:
    floor, job = set_up_once(tmp_path), experiment_1(CUT_MM)
    assert floor.arm(job).armed is not None
    before = floor.lathe.snapshot()
    rewrite(floor.sim, line)
    state = floor.do(Start())
    assert [problem.code for problem in state.refusals] == [code] and not started(floor.sim)
    assert [axis.commanded for axis in floor.lathe.snapshot().axes] == [axis.commanded for axis in before.axes]


@pytest.mark.first(3)
@pytest.mark.parametrize("step", [Step.ALIGN, Step.ARM])
@pytest.mark.parametrize(("line", "code"), REWRITES)
def test_console_run_refuses_it_and_leaves_the_machine_at_rest(line: str, code: str, step: Step) -> None:
    machine, job = compact_machine().machine, experiment_1(CUT_MM)
    context, sim = simulated_context(machine)
    ran: list[bool] = []

    def tell(now: Step, _: str) -> None:
        ran.append(started(sim))
        if now is step:
            rewrite(sim, line)

    plan = plan_cut(job, machine, Strategy.PVT, watchdog=context.lathe.program.watchdog)
    with pytest.raises(SessionError) as refused:
        cut_part(context, job, plan, tell)
    assert refused.value.problems[0].code == code
    assert not any(ran) and not started(sim) and context.lathe.snapshot().at_rest
