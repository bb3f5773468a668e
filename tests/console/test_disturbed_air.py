"""A setting that another host changes while a path is learned in air: nothing is learned, the setting is named."""

from __future__ import annotations

from dataclasses import replace

import pytest

from console.session.cut.engine import Step
from console.session.cut.in_process import simulated_context
from console.session.cut.run import plan_run
from console.session.learning.learning import learn
from drivers.cutting.strategy import Strategy
from drivers.lathe.heartbeat import cut_condition
from drivers.simulator.plant.true_parameters import ideal
from profiles.problem import ProblemError
from profiles.store import load_job
from tests.compact import compact_machine
from tests.drivers.test_identification_refused import disturb

MACHINE = compact_machine().machine
JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=2.0)


@pytest.mark.parametrize("lines", [("I168=60",), ("I168=60", "I168=0")], ids=["left", "put back"])
def test_no_version_is_learned_in_air_while_a_setting_changes(lines: tuple[str, ...]) -> None:
    """Friction feedforward, which no profile states: the loop follows otherwise, and the path learns it."""
    context, sim = simulated_context(MACHINE, ideal(MACHINE))
    told: list[str] = []

    def tell(part: str, step: Step, _: str) -> None:
        told.append(f"{part} {step}")
        if told.count("air cut") == 1 and step is Step.CUT:
            disturb(sim, *((1.5 + k, line) for k, line in enumerate(lines)))

    plan = plan_run(JOB, MACHINE, Strategy.CAM, watchdog=cut_condition(MACHINE))
    with pytest.raises(ProblemError) as refused:
        learn(plan, lambda: context, tell, 1)
    problem = refused.value.problems[0]
    assert (problem.code, problem.key, problem.value) == ("cut.constant_differs", "I168", "60")
    assert told[-1] == "air cut"
