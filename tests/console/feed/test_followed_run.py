"""What `console run` publishes while it cuts, also when it falls silent and the controller ends the cut."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from console.session.cut.engine import CutContext
from console.session.cut.in_process import simulated_context
from console.session.cut.recording import CutRecorder
from console.session.cut.run import plan_run, run_once
from console.session.feed.followed_run import FollowedRun, Run, RunAlarms
from console.session.feed.observed_state import ObservedState
from console.session.feed.report import report
from console.session.station.state import Activity
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
from tests.console.floor import experiment_1, known


class Watched(CutRecorder):
    """Looks at the feed at some polls of the program, as its thread would."""

    def __init__(self) -> None:
        self.followed: FollowedRun | None = None
        self.moments: list[ObservedState] = []
        self.polls = 0

    def see(self, snapshot: Snapshot) -> None:
        self.polls += 1
        if self.followed is not None and self.polls % 5 == 0:
            self.moments.append(self.followed.observe_state())


def test_a_cut_is_followed_to_its_part() -> None:
    machine, job = compact_machine().machine, experiment_1()
    watched = Watched()
    followed = FollowedRun(Run(job=job.name, machine=machine, run_id="r1", simulated=True), watched)
    watched.followed = followed
    assert followed.observe_state().state.activity is Activity.CONNECTING
    context, _ = simulated_context(machine)
    plan = plan_run(job, machine, Strategy.PVT, simulated=True)
    run_once(plan, replace(context, recorder=followed), lambda part, step, detail: followed.take_step(step))
    cuts = [moment.cut for moment in watched.moments if moment.cut is not None]
    # 1.5 mm at 0.05 mm a turn, by the job: 30 turns, 1.8 s at 1000 rpm.
    assert {cut.turns for cut in cuts} == {30.0}
    turns = [cut.turn for cut in cuts]
    assert turns == sorted(turns) and turns[0] == 0.0 and turns[-1] > 29.0
    inside = [cut for cut in cuts if 2.0 < cut.turn < 28.0]
    assert inside and all(abs(cut.left_s - (30.0 - cut.turn) * 0.06) < 0.1 for cut in inside)
    assert all(abs(cut.tool_error_um) < 5.0 for cut in inside)
    speeds = [moment.state.spindle_rpm for moment in watched.moments if moment.cut in inside]
    assert all(rpm is not None and abs(rpm - 1000.0) < 20.0 for rpm in speeds)
    assert {moment.state.activity for moment in watched.moments} == {Activity.CUTTING}
    assert {(moment.run_id, moment.job, moment.parts) for moment in watched.moments} == {("r1", job.name, 0)}
    newest = known(watched.moments[-1].state.snapshot)
    followed.take_poll(replace(newest, tool=replace(newest.tool, flags=newest.tool.flags | {"amplifier_fault"})))
    line = report(followed.observe_state(), process=1, operator="kim", at_utc="")
    (alarm,) = line.alarms
    assert (alarm.code, alarm.priority, alarm.state) == ("machine.fault", "high", "new")
    assert "amplifier fault" in alarm.text
    assert conditions(line.alarms)["system"][0].level == "FAULT"
    followed.take_poll(newest)
    after = followed.observe_state()
    assert not after.state.alarms
    assert (after.parts, after.cut, after.state.activity) == (1, None, Activity.MEASURING)


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
    lathe = Lathe(client, machine, simulated, StopPath(link), seen=followed.take_poll, heartbeat=heartbeat)
    context = CutContext(lathe=lathe, workshop=simulated, recorder=followed)
    plan = plan_run(job, machine, Strategy.PVT, simulated=True)
    with pytest.raises(ProblemError) as ended:
        run_once(plan, context, lambda part, step, detail: followed.take_step(step))
    assert ended.value.problems[0].code == "heartbeat.lapsed"
    line = report(followed.observe_state(), process=1, operator="kim", at_utc="")
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
    loss = known(heartbeat.loss(2))
    assert (loss.code, loss.value) == ("heartbeat.lost", "program")
    assert heartbeat.loss(0) is None
