"""Deeds of another host that are undone before the cut ends are in the part, and it is not called good.

They were drawn by `benchmarks.hostile_host` with seed 2001, and called good once.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.hostile_host import JOB, Attack, Sent, WitnessedLathe, lathe_at, make, plan_of, said
from console.session.cut.cut_verdict import CutJudgement
from console.session.cut.engine import CutContext, Step
from console.session.cut.run import cut_part
from drivers.cutting.strategy import Strategy
from drivers.lathe.polling import Poller
from profiles.axis.servo import sampled_response
from tests.system.lathe_sites import compact


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("family", "strategy", "first", "later", "after_s", "for_s", "outcome"),
    [
        ("turbo", Strategy.PVT, "P25=P25+40", "", 3.78, 0.0, "cut.disturbed"),
        ("pmac", Strategy.CAM, "I{tool}30={gain}/4", "I{tool}30={gain}", 3.15, 0.39, "cut.constant_differs"),
        ("turbo", Strategy.TIMEBASE, "&1H", "&1R", 3.08, 0.2, "cut.lobe_off_path"),
        ("pmac", Strategy.PVT, "M169=M169+30000", "M169=M169-30000", 0.4, 6.5, "cut.constant_differs"),
    ],
)
def test_what_was_undone_is_found(
    family: str, strategy: Strategy, first: str, later: str, after_s: float, for_s: float, outcome: str
) -> None:
    sent = [
        Sent(step=Step.CUT, after_s=after_s, line=first),
        Sent(step=Step.CUT, after_s=after_s + for_s, line=later),
    ]
    made, _ = make(family, strategy, Attack(name=first, length="", sent=tuple(sent)), 1)
    assert made.outcome == outcome


def test_a_gain_that_was_another_for_the_whole_feed_is_told_in_um(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each turn is like the others, and the gain is back before the end: the command kept to the plan.

    Neither are the settings read beside the polls here nor is there a witness: each would tell.
    """
    monkeypatch.setattr(Poller, "read_beside", lambda _: None)
    family, strategy, gain = "pmac", Strategy.PVT, "I{tool}30={gain}"
    machine, plan = compact(family), plan_of(family, strategy)
    sim = WitnessedLathe(machine)
    lathe = lathe_at(sim, machine)

    def tell(step: Step, _: str) -> None:
        if step is Step.CUT:
            begun_s = sim.now_s()
            lines = (said(f"{gain}/2", machine, plan), said(gain, machine, plan))
            sim.due = [(begun_s + 0.05 * plan.duration_s, lines[0]), (begun_s + 0.9 * plan.duration_s, lines[1])]

    lathe.witness = None
    lathe.connect()
    verdict = cut_part(CutContext(lathe=lathe, workshop=sim), JOB, plan, tell).figures.verdict
    assert sim.done == 2
    assert (verdict.judgement, [each.code for each in verdict.problems]) == (
        CutJudgement.TOOL_ERROR,
        ["cut.tool_not_round"],
    )
    assert verdict.tool is not None
    settings = machine.controller.variables
    weak = replace(
        machine, controller=replace(machine.controller, variables={**settings, "I130": settings["I130"] / 2})
    )
    responses = (complex(sampled_response(each, JOB.lobe_frequency_hz)) for each in (weak, machine))
    expected_um = JOB.lobe_amplitude_um * abs(next(responses) / next(responses) - 1.0)
    assert abs(verdict.tool.orders[3]) == pytest.approx(expected_um, abs=0.3)
