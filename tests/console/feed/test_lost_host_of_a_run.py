"""A `console run` that says nothing for a while in its cut: the controller ends it; feed and record tell."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from console.session.cut.engine import CutContext
from console.session.cut.recording import CutRecorder
from console.session.cut.run import plan_run, run_once
from console.session.feed.followed_run import FollowedRun, Run, RunAlarms
from console.session.feed.report import report
from console.site.exchange.mtconnect import conditions
from drivers.cutting.strategy import Strategy
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from profiles.problem import ProblemError
from tests.compact import compact_machine
from tests.console.floor import experiment_1

SILENT_S = 1.0
"""More than the 0.3 s of the watchdog: the controller ends the cut."""


class Hangs(CutRecorder):
    """Says nothing for a second, in the middle of the cut; then looks at the feed at each poll."""

    def __init__(self, simulated: SimulatedLathe) -> None:
        self.polls, self.simulated = 0, simulated

    def see(self, snapshot: Snapshot) -> None:
        self.polls += 1
        if self.polls == 60:
            self.simulated.wait(SILENT_S)


@pytest.mark.parametrize("policy", ["retract", "finish"])
def test_a_lapse_is_an_alarm_with_its_code_and_is_recorded(policy: str) -> None:
    machine, job = compact_machine().machine, experiment_1()
    machine = replace(machine, heartbeat=replace(machine.heartbeat, policy=policy))
    simulated = SimulatedLathe(machine)
    link = MemoryLink(simulated.connect(), simulated)
    client = PmacClient(link, simulated)
    heartbeat, events = Heartbeat(client, simulated, machine), list[tuple[str, Any]]()
    alarms = RunAlarms(lambda kind, data: events.append((kind, data)))
    run = Run(job=job.name, machine=machine, run_id="r1", simulated=False)
    followed = FollowedRun(run, Hangs(simulated), alarms)
    followed.alarms.heartbeat = heartbeat
    lathe = Lathe(client, machine, simulated, StopPath(link), seen=followed.seen, heartbeat=heartbeat)
    context = CutContext(lathe=lathe, workshop=simulated, recorder=followed)
    plan = plan_run(job, machine, Strategy.PVT, simulated=True)
    with pytest.raises(ProblemError) as ended:
        run_once(plan, context, lambda part, step, detail: followed.told(step))
    assert ended.value.problems[0].code == "heartbeat.lapsed"
    line = report(followed.observed(), process=1, operator="kim", at_utc="")
    (alarm,) = line.alarms
    assert (alarm.code, alarm.priority, alarm.state) == ("heartbeat.lapsed", "high", "new")
    assert [each.code for each in conditions(line.alarms)["communications"]] == ["heartbeat.lapsed"]
    ((kind, data),) = events
    assert (kind, data["code"], data["priority"]) == ("alarm_raised", "heartbeat.lapsed", "high")


def test_a_loss_before_this_run_is_told_as_such() -> None:
    """P1004 is 2: the controller has ended a cut of a console before this one."""
    machine = compact_machine().machine
    simulated = SimulatedLathe(machine)
    link = MemoryLink(simulated.connect(), simulated)
    heartbeat = Heartbeat(PmacClient(link, simulated), simulated, machine)
    loss = heartbeat.loss(2)
    assert loss is not None and (loss.code, loss.value) == ("heartbeat.lost", "program")
    assert heartbeat.loss(0) is None
