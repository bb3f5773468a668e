"""A cut that another host changes, holds or ends, also for a while: it is said so, and not measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from benchmarks.hostile_host import GOOD, JOB, Attack, Sent, WitnessedLathe, lathe_at, make, plan_of, said
from console.session.cut.cut_verdict import CutJudgement
from console.session.cut.engine import CutContext, PartStep
from console.session.cut.in_process import simulated_context
from console.session.cut.run import cut_part, plan_run
from console.session.data.record_file import FILE_NAME
from console.session.learning.learning import learn
from console.session.station.commands import EnableDrives, Home, Jog, Measure, Recover, Retract, Start
from console.session.station.state import Activity, StationState
from drivers.cutting.strategy import Strategy
from drivers.lathe.heartbeat import cut_condition
from drivers.lathe.polling import Poller
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.true_parameters import ideal
from profiles.axis.servo import sampled_response
from profiles.problem import Problem, ProblemError
from profiles.store import load_job
from tests.compact import compact_machine
from tests.console.floor import Floor, experiment_1, in_turn, known, open_floor, set_up_once
from tests.drivers.test_identification_refused import disturb
from tests.system.lathe_sites import compact

LONG_MM = 1.0
"""Sixteen mm of feed a second: a cut of 30 turns, two seconds."""


@pytest.fixture
def floor(tmp_path: Path, in_copies: None) -> Floor:
    return set_up_once(tmp_path)


def told(state: StationState) -> list[str]:
    return [alarm.problem.code for alarm in state.alarms]


def another_host(floor: Floor, line: str) -> None:
    """A second host sends one line, or a control character."""
    port = floor.sim.connect()
    port.receive(line.encode("latin-1") if line < " " else f"{line}\r".encode("latin-1"))
    floor.sim.attend(port)


def cut_with(floor: Floor, line: str, strategy: Strategy = Strategy.PVT) -> tuple[StationState, float]:
    """Cut while another host sends a line at turn 10; return how it ended, and how long after."""
    floor.arm(experiment_1(LONG_MM), strategy)
    assert floor.state.armed is not None, floor.state.refusals
    sent: list[float] = []

    def send() -> None:
        sent.append(floor.sim.now_s())
        another_host(floor, line)

    floor.when(lambda _: floor.state.cut is not None and floor.state.cut.turn > 10.0, send)
    state = floor.do(Start())
    assert sent, "the cut was over before"
    stopped_s = state.stop.sent_s if state.stop is not None else floor.sim.now_s()
    return state, stopped_s - sent[0]


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("&1A#1K", "machine.loop_open"),
        pytest.param("\x0b", "machine.loop_open", marks=pytest.mark.long),
        ("&1H", "cut.override"),
        pytest.param("&1%0", "cut.override", marks=pytest.mark.long),
        pytest.param("&1%50", "cut.override", marks=pytest.mark.long),
        ("$$$", "controller.was_reset"),
        ("P11=P11+500", "cut.outside_plan"),
        # A segment that ends in full motion runs on, beyond the plan or not, as its phase has it.
        ("&1Q", "cut.outside_plan cut.ended_early"),
    ],
)
@pytest.mark.first(2)
def test_what_another_host_does_to_a_cut_stops_it_at_that_poll(floor: Floor, line: str, code: str) -> None:
    state, after_s = cut_with(floor, line)
    assert set(code.split()) & set(told(state)) and state.activity is Activity.STOPPED
    assert after_s < (1.0 if "ended_early" in code else 0.2)
    floor.do(Recover())
    assert not state.cut_done and floor.do(Measure()).measured is None


@pytest.mark.parametrize(
    ("line", "code", "key"),
    [("I130=4", "controller.setting", "I130"), ("P55=60", "cut.trim_differs", "")],
)
@pytest.mark.first(1)
def test_a_trip_after_another_wrote(
    floor: Floor, line: str, code: str, key: str, monkeypatch: MonkeyPatch
) -> None:
    """A factor of 60 on the path, or next to no gain, trips a tool without friction within a turn.

    Here that comes before it is read beside the polls.
    """
    monkeypatch.setattr(Poller, "read_beside", lambda _: None)
    state, _ = cut_with(floor, line)
    found = {alarm.problem.code: alarm.problem for alarm in state.alarms}
    assert state.stop is not None and state.stop.rest_s is not None
    assert "machine.behind_after_change" in found and "machine.tool_left_behind" not in found, sorted(found)
    assert found[code].key == key


@pytest.mark.parametrize(
    "line",
    [
        "P12=P12*1.05",
        *(pytest.param(other, marks=pytest.mark.long) for other in ("P14=P14+3", "P18=P18*0.99", "P32=P32+1")),
    ],
)
def test_a_constant_that_is_changed_in_the_cut_is_found_while_it_cuts(floor: Floor, line: str) -> None:
    state, after_s = cut_with(floor, line)
    assert "cut.constant_differs" in told(state) and after_s < 1.0
    assert not state.cut_done


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("\x01", "cut.stopped_by_another"),
        pytest.param("&1A", "cut.stopped_by_another", marks=pytest.mark.long),
        ("M26=1", "cut.held_by_another"),
    ],
)
@pytest.mark.first(1)
def test_a_cut_that_another_host_ends_is_not_measured(floor: Floor, line: str, reason: str) -> None:
    state, _ = cut_with(floor, line)
    assert {"cut.ended_early", reason} <= set(told(state))
    early = next(alarm.problem for alarm in state.alarms if alarm.problem.code == "cut.ended_early")
    assert float(early.value) < float(early.limit)
    assert state.activity is Activity.STOPPED and not state.cut_done
    refused = floor.do(Recover(), Measure())
    assert [problem.code for problem in refused.refusals] == ["session.nothing_cut"]
    assert (floor.context.records / FILE_NAME).exists()


@pytest.mark.parametrize(("strategy", "line"), [(Strategy.CAM, "P25=P25+2"), (Strategy.PVT, "P25=P25-2")])
@pytest.mark.first(1)
def test_a_program_that_goes_on_elsewhere_is_not_called_done(floor: Floor, strategy: Strategy, line: str) -> None:
    """Two segments are little enough that no axis trips and no poll need see it."""
    state, _ = cut_with(floor, line, strategy)
    assert not state.cut_done and told(state) != []
    assert state.activity is Activity.STOPPED


def test_a_cut_with_fewer_turns_than_planned_is_ended_early(floor: Floor) -> None:
    """Found at the end, should the few turns be over before the constant is read."""
    state, _ = cut_with(floor, "P23=11")
    assert {"cut.ended_early", "cut.constant_differs"} & set(told(state))
    assert not state.cut_done


@pytest.mark.parametrize(
    ("strategy", "line", "code"),
    [
        (Strategy.PVT, "P11=P11+500", "controller.constant_differs"),
        (Strategy.PVT, "OPEN PROG 2 CLEAR X0 CLOSE", "controller.program_differs"),
        (Strategy.CAM, "#1DELETE COMP", "controller.err003"),
        (Strategy.CAM, "P35=P35+1", "controller.constant_differs"),
    ],
)
@pytest.mark.first(2)
def test_what_changes_before_the_start_is_refused(floor: Floor, strategy: Strategy, line: str, code: str) -> None:
    """Between the first look of the start and the start itself the axes go to their places."""
    floor.arm(experiment_1(LONG_MM), strategy)
    floor.when(lambda seen: seen.moving, lambda: another_host(floor, line))
    state = floor.do(Start())
    codes = [problem.code for problem in state.refusals] + told(state)
    assert code in codes and not floor.sim.controller.systems[1].running
    assert state.cut is not None and state.cut.turn == 0.0


@pytest.mark.parametrize("meanwhile", ["at rest", "jog", "stopping"])
def test_a_reset_is_an_alarm_whenever_it_comes_and_stops_a_jog(floor: Floor, meanwhile: str) -> None:
    """While the machine comes to rest nobody waits for the jog any more, and nothing can be compared behind it."""
    if meanwhile == "at rest":
        another_host(floor, "$$$")
        state = floor.idle()
    elif meanwhile == "jog":
        floor.when(lambda seen: seen.moving, lambda: another_host(floor, "$$$"))
        state = floor.do(Jog(axis=AxisName.CARRIAGE, distance=-3.0))
        assert state.activity is Activity.STOPPED
    else:
        floor.when(lambda seen: seen.moving, lambda: floor.stop.stop("space"))
        floor.when(lambda _: floor.state.activity is Activity.STOPPING, lambda: another_host(floor, "$$$"))
        state = floor.do(Jog(axis=AxisName.CARRIAGE, distance=-3.0))
        assert state.activity is Activity.STOPPED and told(state) == ["controller.was_reset"]
    assert "controller.was_reset" in told(state)[:1] and not state.alignment.homed
    if meanwhile == "jog":
        floor.do(Recover(), EnableDrives())
        assert floor.do(Home()).alignment.homed


@pytest.mark.parametrize(
    ("line", "code"),
    [("#3J+", "machine.jog_astray"), ("#3J-", "machine.jog_astray"), ("#1J:-3000", "machine.unexpected_motion")],
)
def test_a_jog_that_goes_elsewhere_is_stopped_on_its_way(floor: Floor, line: str, code: str) -> None:
    before = known(floor.idle().snapshot)
    floor.when(lambda seen: seen.moving, lambda: another_host(floor, line))
    state = floor.do(Jog(axis=AxisName.CARRIAGE, distance=1.0))
    assert code in told(state) and state.snapshot is not None
    gone = state.snapshot.carriage.position - before.carriage.position
    assert -1500.0 < gone < 2500.0, "1 mm is 1000 counts; the rest is what a stop takes"


def test_a_home_search_that_is_stopped_has_lost_no_position_to_another_host(floor: Floor) -> None:
    """The stop comes behind the line that begins the search, before anything was seen of it."""
    sent = floor.link.send

    def send(data: bytes) -> None:
        sent(data)
        if b"HM" in data:
            floor.stop.stop("space")

    floor.link.send = send  # type: ignore[method-assign]
    state = floor.do(Home())
    assert state.activity is Activity.STOPPED and told(state) == []
    assert state.snapshot is not None and "home_complete" not in state.snapshot.tool.flags


@pytest.mark.long
def test_a_blank_that_is_cut_again_after_a_stop_is_no_disturbed_cut(tmp_path: Path) -> None:
    """Up to where the first cut ended the tool meets a turned surface, behind it the blank: its force changes."""
    floor = open_floor(tmp_path, plant="steady", seed=11)
    job = experiment_1(3.0)
    floor.set_up(job)
    floor.arm(job)
    floor.when(lambda _: in_turn(floor, 5.0), lambda: floor.stop.stop("space"))
    stopped = floor.do(Start())
    assert stopped.touched is not None and 0.0 < stopped.touched.to_mm < 1.5
    floor.do(Recover(), Retract())
    floor.arm(job)
    assert floor.do(Start()).cut_done, told(floor.state)


DEEDS = {
    "gain": ("I130=I130/2", "I130=I130*2", "I130"),
    "scale": ("I108=I108+1", "I108=I108-1", "I108"),
    "servo period": ("I10=I10+37137", "I10=I10-37137", "I10"),
    "friction": ("I168=400", "I168=0", "I168"),
    "carriage limit": ("I316=I316+1", "I316=I316-1", "I316"),
}
OF_A_FAMILY = {
    "pmac": {
        "conversion": ("WY:$720,$C008", "WY:$720,$C000", "Y:$720"),
        "bias": ("M500->D:$813 M500=M500+30000", "M500=M500-30000", "Y:$813"),
        "correction of the spindle": ("M500->D:$82 M500=M500+30000", "M500=M500-30000", "Y:$82"),
    },
    "turbo": {
        "conversion": ("I8000=I8001", "I8000=$78200", "I8000"),
        "bias": ("M500->D:$CC M500=M500+30000", "M500=M500-30000", "Y:$CC"),
        "correction of the spindle": ("M500->D:$110 M500=M500+30000", "M500=M500-30000", "Y:$110"),
    },
}


def cut_held_with(
    family: str, strategy: Strategy, lines: tuple[str, str] | None, begin: float, last_s: float
) -> tuple[Problem | str, WitnessedLathe]:
    """Cut while a second host sends the first line so far into the program, and the other so long after it."""
    machine, plan = compact(family), plan_of(family, strategy)
    sim = WitnessedLathe(machine)
    lathe = lathe_at(sim, machine)

    def tell(step: PartStep, _: str) -> None:
        if step is PartStep.CUT and lines is not None:
            at_s = sim.now_s() + begin * plan.duration_s
            first, later = (said(line, machine, plan) for line in lines)
            sim.due = [(at_s, first), (at_s + last_s, later)]

    lathe.connect()
    try:
        cut_part(CutContext(lathe=lathe, workshop=sim), JOB, plan, tell)
    except ProblemError as error:
        return error.problems[0], sim
    return GOOD, sim


CASES = [
    pytest.param(family, name, id=f"{family} {name}")
    for family in ("pmac", "turbo")
    for name in (*DEEDS, *OF_A_FAMILY[family])
]


@pytest.mark.first(8)
@pytest.mark.parametrize(("family", "name"), CASES)
def test_what_is_held_for_as_long_as_the_whole_table_takes_is_seen(family: str, name: str) -> None:
    first, later, key = {**DEEDS, **OF_A_FAMILY[family]}[name]
    found, _ = cut_held_with(family, Strategy.PVT, (first, later), 0.5, 1.2)
    assert isinstance(found, Problem), found
    assert (found.code, found.key) == ("cut.constant_differs", key)


@pytest.mark.parametrize("strategy", list(Strategy))
@pytest.mark.parametrize("family", ["pmac", "turbo"])
@pytest.mark.first(5)
def test_what_is_held_for_the_whole_feed_is_seen_with_every_strategy(family: str, strategy: Strategy) -> None:
    last_s = 0.6 * plan_of(family, strategy).duration_s
    found, _ = cut_held_with(family, strategy, ("I130=I130/2", "I130=I130*2"), 0.2, last_s)
    assert isinstance(found, Problem), found
    assert (found.code, found.key) == ("cut.constant_differs", "I130")


def test_what_is_changed_at_the_end_of_the_feed_is_read_once_more() -> None:
    """The tool is on its way out, and the carriage limit comes late in the table."""
    duration_s = plan_of("turbo", Strategy.PVT).duration_s
    begin = (duration_s - 0.9) / duration_s
    found, _ = cut_held_with("turbo", Strategy.PVT, ("I323=I323-1", "I323=I323+1"), begin, 3.0)
    assert isinstance(found, Problem), found
    assert (found.code, found.key) == ("cut.constant_differs", "I323")


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("family", "strategy", "first", "later", "after_s", "for_s", "outcome"),
    [
        ("turbo", Strategy.PVT, "P25=P25+40", "", 3.78, 0.0, "cut.disturbed"),
        (
            "pmac",
            Strategy.CAM,
            "I{tool}30={gain}/4",
            "I{tool}30={gain}",
            3.15,
            0.39,
            "cut.constant_differs",
        ),
        ("turbo", Strategy.TIMEBASE, "&1H", "&1R", 3.08, 0.2, "cut.lobe_off_path"),
        ("pmac", Strategy.PVT, "M169=M169+30000", "M169=M169-30000", 0.4, 6.5, "cut.constant_differs"),
    ],
)
def test_what_was_undone_is_found(
    family: str, strategy: Strategy, first: str, later: str, after_s: float, for_s: float, outcome: str
) -> None:
    sent = [
        Sent(step=PartStep.CUT, after_s=after_s, line=first),
        Sent(step=PartStep.CUT, after_s=after_s + for_s, line=later),
    ]
    made, _ = make(family, strategy, Attack(name=first, length="", sent=tuple(sent)), 1)
    assert made.outcome == outcome


def test_a_gain_that_was_another_for_the_whole_feed_is_told_in_um(monkeypatch: MonkeyPatch) -> None:
    """Each turn is like the others, and the gain is back before the end: the command kept to the plan.

    Neither are the settings read beside the polls here nor is there a witness: each would tell.
    """
    monkeypatch.setattr(Poller, "read_beside", lambda _: None)
    family, strategy, gain = "pmac", Strategy.PVT, "I{tool}30={gain}"
    machine, plan = compact(family), plan_of(family, strategy)
    sim = WitnessedLathe(machine)
    lathe = lathe_at(sim, machine)

    def tell(step: PartStep, _: str) -> None:
        if step is PartStep.CUT:
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


MACHINE = compact_machine().machine
AIR_JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=2.0)


@pytest.mark.first(1)
@pytest.mark.parametrize("lines", [("I168=60",), ("I168=60", "I168=0")], ids=["left", "put back"])
def test_no_version_is_learned_in_air_while_a_setting_changes(lines: tuple[str, ...]) -> None:
    """Friction feedforward, which no profile states: the loop follows otherwise, and the path learns it."""
    context, sim = simulated_context(MACHINE, ideal(MACHINE))
    told: list[str] = []

    def tell(part: str, step: PartStep, _: str) -> None:
        told.append(f"{part} {step}")
        if told.count("air cut") == 1 and step is PartStep.CUT:
            disturb(sim, *((1.5 + k, line) for k, line in enumerate(lines)))

    plan = plan_run(AIR_JOB, MACHINE, Strategy.CAM, watchdog=cut_condition(MACHINE))
    with pytest.raises(ProblemError) as refused:
        learn(plan, lambda: context, tell, 1)
    problem = refused.value.problems[0]
    assert (problem.code, problem.key, problem.value) == ("cut.constant_differs", "I168", "60")
    assert told[-1] == "air cut"
