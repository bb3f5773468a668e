"""Limits between a plan and its machine: margins of the guard, ends of a home search, rate of reports."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from drivers.cutting.bounds import Trim
from drivers.cutting.corrected_motion import with_spindle
from drivers.cutting.feed_hold import FeedHold, HoldLedger, HoldReport, HoldState
from drivers.cutting.guarding import cut_guard
from drivers.cutting.planning import Strategy, plan_cut
from drivers.cutting.program_reports import POLLS_A_REPORT, ProgramReports
from drivers.cutting.sampling import Batch, BatchGather
from drivers.errors import DriverError, LinkError, LinkTimeoutError
from drivers.lathe.lathe import Lathe
from drivers.lathe.polling import SLOW_LINE_S
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot
from drivers.lathe.standstill import HomeSearch, Settling, prove_rest, rest_limits
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.axes import read_definitions
from drivers.pmac.check import run_through
from drivers.pmac.client import PmacClient
from drivers.pmac.program_text import read_program
from drivers.pmac.trajectory.linear import timing_of
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import Problem
from tests.drivers.conftest import JobMaker

IN_CUT = frozenset({"activated", "amplifier_enabled", "home_complete"})
RESTING = frozenset({"activated", "amplifier_enabled", "desired_velocity_zero"})


def polled(at_s: float = 0.0, **axes: AxisState) -> Snapshot:
    still = AxisState(position=0.0, following_error=0.0, flags=IN_CUT)
    return Snapshot(
        asked_s=at_s,
        at_s=at_s,
        program_running=True,
        runtime_error=False,
        override_percent=100.0,
        tool=axes.get("tool", still),
        spindle=axes.get("spindle", still),
        carriage=axes.get("carriage", still),
    )


def commanded(counts: float) -> AxisState:
    return AxisState(position=counts, following_error=0.0, flags=IN_CUT)


@pytest.mark.parametrize(
    ("axis", "margin_counts"),
    [
        (AxisName.TOOL, 30.0 / 0.2),  # 30 um at 5000 counts a mm
        (AxisName.SPINDLE, 5.0 / 360.0 * 12_000.0),  # 5 deg
        (AxisName.CARRIAGE, 0.1 * 1000.0),  # 0.1 mm
    ],
)
def test_a_running_cut_may_leave_its_plan_by_its_margins(
    machine: MachineProfile, experiment: JobMaker, axis: AxisName, margin_counts: float
) -> None:
    plan = plan_cut(experiment(1), machine, Strategy.NONE)
    motors = {AxisName.TOOL: 1, AxisName.SPINDLE: 2, AxisName.CARRIAGE: 3}
    assert (machine.tool.counts_per_mm, machine.carriage.counts_per_mm) == (5000.0, 1000.0)
    margin_counts *= machine.spindle.counts_per_rev / 12_000.0 if axis is AxisName.SPINDLE else 1.0
    inside = {name: plan.checked.highest[motor] for name, motor in motors.items()}
    for planned, way in ((plan.checked.highest, 1.0), (plan.checked.lowest, -1.0)):
        for beyond, codes in ((0.9, []), (1.1, ["cut.outside_plan"])):
            at = {**inside, axis: planned[motors[axis]] + way * beyond * margin_counts}
            states = {name.value: commanded(counts) for name, counts in at.items()}
            found = cut_guard(plan, machine)(polled(0.0, **states))
            assert [problem.code for problem in found] == codes, (axis, way, beyond)


@pytest.mark.parametrize("axis", AxisName)
def test_a_machine_stands_still_when_no_axis_has_moved_by_more_than_two_counts(axis: AxisName) -> None:
    first = polled(0.0, **{axis.value: commanded(5000.0)})
    for counts, still in ((4998.0, True), (5002.0, True), (5002.5, False), (-5000.0, False)):
        assert polled(0.2, **{axis.value: commanded(counts)}).still(first, 2.0) is still


def test_a_tool_near_its_end_does_not_end_the_move_of_another_axis() -> None:
    """The tool alone may lag, by its band and for its time: 50 counts, 1 s."""
    rest, lag = RESTING | {"in_position"}, RESTING

    def over(tool_lag: float, carriage: frozenset[str]) -> list[bool]:
        settling = Settling((AxisName.TOOL, AxisName.CARRIAGE), 50.0, 1.0)
        tool = AxisState(position=0.0, following_error=tool_lag, flags=lag)
        other = AxisState(position=0.0, following_error=0.0, flags=carriage)
        return [settling.is_over(polled(at_s, tool=tool, carriage=other)) for at_s in (0.0, 0.9, 1.0, 2.0)]

    assert over(50.0, rest) == [False, False, True, True]
    assert over(50.1, rest) == [False] * 4
    assert over(50.0, lag) == [False] * 4


def searched(*flags: frozenset[str]) -> list[bool]:
    search = HomeSearch(AxisName.CARRIAGE, 50.0)
    states = (AxisState(position=0.0, following_error=0.0, flags=each) for each in flags)
    return [search.is_over(polled(0.1 * k, carriage=state)) for k, state in enumerate(states)]


def test_a_home_search_is_over_in_position_or_after_three_rests_without_a_zero() -> None:
    """Once or twice in a row it may turn round; a poll of the search between them begins the count anew."""
    searching = frozenset({"activated", "home_search"})
    assert searched(RESTING, RESTING, RESTING) == [False, False, True]
    assert searched(RESTING, RESTING, searching, RESTING, RESTING, RESTING) == [False] * 5 + [True]
    assert searched(*[searching | RESTING] * 5) == [False] * 5
    assert searched(*[IN_CUT - {"home_complete"}] * 5) == [False] * 5
    zero = RESTING | {"home_complete"}
    assert searched(*[zero] * 5) == [False] * 5
    assert searched(zero | {"in_position"}) == [True]
    assert searched(zero | {"in_position", "home_search"}) == [False]


def test_every_poll_of_a_stopped_machine_ends_its_watchdog_or_stops_again(machine: MachineProfile) -> None:
    """The second poll fails: the stop is sent again, and three polls behind a first one have to report rest."""
    resting = AxisState(position=0.0, following_error=0.0, flags=RESTING | {"in_position"})
    polls = iter([True, False, True, True, True, True])
    clock: Any = SimpleNamespace(at_s=0.0)
    clock.now_s = lambda: clock.at_s
    stop: Any = SimpleNamespace(mark=1, leave_by_s=100.0, killed=False, given_up=False, proven=False, repeats=0)
    clock.wait = lambda seconds: setattr(clock, "at_s", clock.at_s + seconds)
    stop.repeat = lambda: setattr(stop, "repeats", stop.repeats + 1)
    stop.rest_proven = lambda mark: setattr(stop, "proven", mark == 1)
    stop.only_repeated = lambda mark, latest: mark == latest

    def poll_once(_: float) -> Snapshot:
        clock.at_s += 0.1
        if not next(polls):
            raise DriverError(Problem(code="link.timeout"))
        return replace(polled(clock.at_s, tool=resting, spindle=resting, carriage=resting), program_running=False)

    poller = SimpleNamespace(poll_once=poll_once, quick_timeout_s=0.1)
    ended: list[float] = []
    prove_rest(
        cast(Any, poller),
        cast(Any, stop),
        cast(Any, clock),
        rest_limits(machine),
        lambda: ended.append(clock.at_s),
    )
    assert (len(ended), stop.repeats, stop.proven, list(polls)) == (5, 1, True, [])


class Queried:
    """A controller that counts its queries."""

    def __init__(self, problem: str = "") -> None:
        self.queries, self.problem = 0, problem

    def request(self, _: str, __: float) -> list[str]:
        self.queries += 1
        if self.problem:
            raise LinkError(Problem(code=self.problem))
        return [""]


def reports(queried: Queried, round_trip_s: float = 0.01) -> ProgramReports:
    poller = SimpleNamespace(round_trip_s=round_trip_s)
    return ProgramReports(cast(Any, queried), cast(Any, poller), cast(Any, None))


def test_a_program_is_asked_for_its_line_once_in_twelve_polls() -> None:
    queried = Queried()
    read, asked = reports(queried).read, []
    for _ in range(36):
        read()
        asked.append(queried.queries)
    assert POLLS_A_REPORT == 12
    assert asked == [0] * 11 + [1] * 12 + [2] * 12 + [3]
    for round_trip_s, queries in ((SLOW_LINE_S, 0), (0.9 * SLOW_LINE_S, 2)):
        queried = Queried()
        read = reports(queried, round_trip_s).read
        for _ in range(24):
            read()
        assert queried.queries == queries


@pytest.mark.parametrize(("code", "gone"), [("link.timeout", False), ("link.lost", True)])
def test_a_missing_reply_is_left_to_the_next_round_and_a_lost_link_is_not(code: str, gone: bool) -> None:
    queried = Queried(code)
    read = reports(queried).read
    for _ in range(11):
        read()
    if gone:
        with pytest.raises(LinkError):
            read()
        return
    for _ in range(13):
        read()
    assert queried.queries == 2


@pytest.mark.parametrize(
    "ask",
    [
        lambda program: program.override.command(90),
        lambda program: program.hold.ask(),
        lambda program: program.live_trim.ask(Trim(gain_percent=5.0)),
        lambda program: program.end_after_turn(),
        lambda program: program.trim(1.0 + 0.0j),
    ],
)
@pytest.mark.parametrize("lost", [1, 2])
def test_what_only_sets_a_value_is_sent_twice_at_most(machine: MachineProfile, ask: Any, lost: int) -> None:
    """A key that the line has lost still acts; a line that answers nothing is told and not asked for ever."""
    sim = SimulatedLathe(machine)
    link = MemoryLink(sim.connect(), sim)
    client, sent = PmacClient(link, sim), list[str]()
    lathe = Lathe(client, machine, sim, StopPath(link))
    lathe.connect()

    def request(line: str, _: float) -> list[str]:
        sent.append(line)
        if len(sent) <= lost:
            raise LinkTimeoutError(Problem(code="link.timeout"))
        return []

    client.request = request  # type: ignore[method-assign, assignment]
    with pytest.raises(LinkTimeoutError) if lost == 2 else nullcontext():
        ask(lathe.program)
    assert len(sent) == 2 and sent[0] == sent[1]


@pytest.mark.parametrize(
    ("p47", "state"),
    [(0.0, HoldState.CUTS), (1.0, HoldState.GOES_OUT), (2.0, HoldState.HELD), (3.0, HoldState.COMES_IN)],
)
def test_a_hold_is_what_the_program_reports_of_it(p47: float, state: HoldState) -> None:
    """340 segments of 34 a turn were held, after 12 turns that were cut."""
    answers = {"P46": 1.0, "P47": p47, "P49": 340.0, "P32": 34.0}
    client = SimpleNamespace(
        request=lambda *_: [], numbers=lambda *items, **_: [answers.get(each, 12.0) for each in items]
    )
    hold = FeedHold(cast(Any, client), cast(Any, SimpleNamespace(refuse_unless_owner=lambda: None)))
    hold.ask()
    hold.read()
    assert hold.report == HoldReport(asked=True, state=state, turns=10, cut_turns=12.0)


def test_on_a_slower_clock_every_time_of_a_move_is_longer() -> None:
    """The clock of a program that the spindle drives is stretched whole: acceleration, S-curve and move."""
    text = read_program("OPEN PROG 1\nCLEAR\nINC TA100 TS40 TM500\nX300\nCLOSE")
    checked = run_through(text, {190: 1000.0}, read_definitions(("#1->X",)), {1: 0.0})
    slower = with_spindle(checked, 2, 5.0, stretch=1.5)
    (record,) = (move.record for move in slower.moves)
    assert record.asked == record.timing == timing_of(150.0, 60.0, 750.0)
    assert slower.duration_ms == pytest.approx(1.5 * checked.duration_ms)


def test_a_gathering_is_given_back_once_where_it_was_set_up(machine: MachineProfile, experiment: JobMaker) -> None:
    """Other work may need the room, and a buffer that is not ours is left alone."""
    sim = SimulatedLathe(machine)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    gather, sent = BatchGather(client, machine, sim, lambda: 0.0), list[str]()
    request = client.request
    client.request = lambda line, *rest, **more: sent.append(line) or request(line, *rest, **more)  # type: ignore
    gather.give_back()
    assert sent == []
    gather.prepare(plan_cut(experiment(1), machine, Strategy.PVT), 100, 1.0, lambda _: None)
    sent.clear()
    gather.give_back()
    gather.give_back()
    assert sent == ["ENDGATHER", "DELETE GATHER"]


def test_a_lost_batch_ends_gathering_and_three_are_told(machine: MachineProfile, experiment: JobMaker) -> None:
    """Whether the lost one still fills its buffer is unknown; the next one defines that buffer anew."""
    sim = SimulatedLathe(machine)
    client, sent = PmacClient(MemoryLink(sim.connect(), sim), sim), list[str]()
    client.connect()
    request = client.request

    def lose_listings(line: str, *rest: Any, **more: Any) -> tuple[str, ...]:
        sent.append(" ".join(line.split()[:2]))
        if line.startswith("LIST"):
            raise LinkTimeoutError(Problem(code="link.timeout"))
        return request(line, *rest, **more)

    client.request = lose_listings  # type: ignore[method-assign]
    plan, gather = plan_cut(experiment(1), machine, Strategy.PVT), BatchGather(client, machine, sim, lambda: 0.0)
    gather.prepare(plan, 100, 0.1, lambda _: None)
    setup = plan.setup
    in_part = polled(tool=commanded(setup.surface + setup.depth), carriage=commanded(setup.carriage_middle))

    def see_batch() -> list[str]:
        sent.clear()
        gather.see(in_part)
        sim.wait(0.2)
        gather.see(in_part)
        gather.see(in_part)
        return list(sent)

    batch = ["DEFINE GATHER", "GATHER", "ENDGATHER", "LIST GATHER"]
    assert see_batch() == batch
    assert see_batch() == ["ENDGATHER", *batch]
    with pytest.raises(DriverError) as failed:
        see_batch()
    assert failed.value.problems[0].code == "gather.failed"


def test_a_batch_is_where_the_carriage_was_halfway(machine: MachineProfile, experiment: JobMaker) -> None:
    """Polled 0.1 mm before the middle of the cut and 0.5 mm behind it: 0.2 mm behind it."""
    sim = SimulatedLathe(machine)
    client, batches = PmacClient(MemoryLink(sim.connect(), sim), sim), list[Batch]()
    client.connect()
    plan, gather = plan_cut(experiment(1), machine, Strategy.PVT), BatchGather(client, machine, sim, lambda: 0.0)
    gather.prepare(plan, 100, 0.1, batches.append)
    setup, per_mm = plan.setup, machine.carriage.counts_per_mm
    for past_mm in (-0.1, 0.5):
        carriage = commanded(setup.carriage_middle + past_mm * per_mm)
        gather.see(polled(tool=commanded(setup.surface + setup.depth), carriage=carriage))
        sim.wait(0.2)
    gather.finish()
    (batch,) = batches
    assert batch.past_middle_mm == pytest.approx(0.2)
    assert batch.thrust_n.size == 0 and batch.angle_deg.size == batch.infeed_um.size > 100
    assert batch.infeed_um == pytest.approx(-setup.surface * machine.tool.count_um), "it stands at its zero"


def test_a_poll_after_a_hold_is_as_much_earlier_as_its_turns_took() -> None:
    """60 ms a turn, held for five: turn 18 is turn 13, 0.3 s earlier, and its poll took its 5 ms as before."""
    ledger = HoldLedger(12_000.0, 2.0)

    def see(turn: float, report: HoldReport) -> Snapshot | None:
        poll = polled(0.06 * turn, spindle=commanded(12_000.0 * turn))
        return ledger.see(replace(poll, asked_s=poll.at_s - 0.005), report)

    held = HoldReport(asked=True, state=HoldState.HELD, turns=5)
    assert see(10.0, HoldReport()) is not None
    assert [see(turn, held) for turn in (11.0, 13.0, 15.0)] == [None] * 3
    assert see(16.9, replace(held, asked=False, state=HoldState(0))) is None, "on its way back into the path"
    found = see(18.0, replace(held, asked=False, state=HoldState(0)))
    assert found is not None and found.spindle.position == pytest.approx(12_000.0 * 13.0)
    assert (found.at_s, found.at_s - found.asked_s) == pytest.approx((0.78, 0.005))
    assert ledger.turns == 5
    assert ledger.held_s == pytest.approx(0.3)
    assert see(20.0, replace(held, turns=8)) is None
    found = see(28.0, replace(held, asked=False, state=HoldState(0), turns=8))
    assert found is not None and found.spindle.position == pytest.approx(12_000.0 * 20.0)
    assert (found.at_s, ledger.turns, ledger.held_s) == pytest.approx((1.2, 8, 0.48)), "three more"
