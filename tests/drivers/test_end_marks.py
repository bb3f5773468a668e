"""What a program says of its end: finished only where it came there segment by segment, on its own time base."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_job
from tests.system.lathe_sites import compact

LOOK_S = 0.05
LONGEST_S = 40.0


def ended(strategy: Strategy, family: str, line: str, at_turn: float = 4.0) -> tuple[float, float]:
    """Run the program of a short cut, with another host's line in the midst of it; return P43 and P44."""
    machine = compact(family)
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.3)
    plan = plan_cut(job, machine, strategy)
    sim = SimulatedLathe(machine)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    for motor in sim.controller.motors.values():
        motor.home_zero()
    client.request("#1J/#2J/#3J/")
    client.request(f"#3J={plan.carriage_start:.3f} #2J={plan.spindle_start:.3f} #1J={plan.tool_start:.3f}")
    sim.wait(5.0)
    client.download(plan.program.lines)
    client.request(f"&1B{plan.program.number}R")
    sent = not line
    for _ in range(round(LONGEST_S / LOOK_S)):
        sim.wait(LOOK_S)
        if not sent and turn_of(sim, plan) > at_turn:
            client.request(line)
            sent = True
        if not sim.controller.systems[1].running:
            break
    assert sent
    turns, finished = client.numbers("P43", "P44")
    return turns, finished


def turn_of(sim: SimulatedLathe, plan: CutPlan) -> float:
    """Turns of feed that the carriage has gone."""
    return (sim.controller.motors[3].position - plan.carriage_start) / plan.setup.carriage_per_turn


@pytest.mark.parametrize(
    ("strategy", "family"),
    [*((each, "pmac") for each in Strategy), (Strategy.CAM, "turbo"), (Strategy.TIMEBASE, "turbo")],
)
@pytest.mark.first(2)
def test_a_program_that_nobody_disturbs_says_its_turns_and_that_it_is_finished(
    strategy: Strategy, family: str
) -> None:
    turns, finished = ended(strategy, family, "")
    assert (turns, finished) == (20.0, 1.0)


@pytest.mark.parametrize(
    ("strategy", "line"),
    [
        (Strategy.PVT, "P25=P25+1"),
        (Strategy.PVT, "P25=P25-1"),
        (Strategy.CAM, "P25=P25-1"),
        (Strategy.TIMEBASE, "P25=P25+1"),
        (Strategy.PAPER, "P630=P630+2"),
        (Strategy.TIMEBASE, "I193=0"),
    ],
)
@pytest.mark.first(2)
def test_a_program_in_which_somebody_goes_on_elsewhere_is_not_finished(strategy: Strategy, line: str) -> None:
    assert ended(strategy, "pmac", line)[1] == 0.0
