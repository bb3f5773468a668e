"""The lathe does the same over memory, a serial line, TCP and Ethernet, with a card of either family."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.errors import DriverError, RefusedError
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StoppedError
from drivers.pmac.gathering.gather_client import DataGathering
from profiles.store import load_job
from tests.system.lathe_sites import LINKS, MACHINES, Site, build, compact, opened

pytestmark = [pytest.mark.system, pytest.mark.long]

JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.25)
STEP_COUNTS = 250.0
CLOSE_COUNTS = 5.0
"""1 um of tool, 0.2 deg of spindle, 5 um of carriage."""

TYPES = {"pmac": "PMAC1, X1", "turbo": "TURBO2, X4"}


@pytest.fixture(params=MACHINES)
def family(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=LINKS)
def site(request: pytest.FixtureRequest, family: str) -> Iterator[Site]:
    with opened(request.param, family) as site:
        yield site


def air_cut(site: Site) -> CutPlan:
    """Experiment 1 with 10 turns of feed, from where the spindle stands; nothing is clamped."""
    lathe, counts = site.lathe, site.machine.spindle.counts_per_rev
    turns = math.ceil(lathe.snapshot().spindle.position / counts)
    plan = plan_cut(JOB, site.machine, Strategy.PVT, from_turn=turns, watchdog=lathe.program.watchdog)
    lathe.program.load(plan.program, plan.axis_definitions)
    lathe.jog_to(AxisName.CARRIAGE, plan.carriage_start)
    lathe.jog_to(AxisName.SPINDLE, plan.spindle_start)
    lathe.jog_to(AxisName.TOOL, plan.tool_start)
    return plan


def refused(action: Callable[[], object]) -> str:
    with pytest.raises(DriverError) as error:
        action()
    return error.value.problems[0].code


def stopped_when(site: Site, condition: Callable[[Snapshot], bool]) -> Callable[[Snapshot], None]:
    """Stop, once, with the first look that is as told."""

    def see(snapshot: Snapshot) -> None:
        if condition(snapshot) and site.stop.reason is None:
            site.stop.stop("operator")

    return see


def comes_to_rest(site: Site) -> Snapshot:
    """The stop is obeyed and proven, nothing moves before it was acknowledged, and the drives are held."""
    rest = site.lathe.wait_for_rest()
    assert site.stop.proven
    assert rest.at_rest and not rest.program_running and rest.loops_closed
    with pytest.raises(StoppedError, match="operator"):
        site.lathe.jog_by(AxisName.TOOL, -STEP_COUNTS)
    site.stop.release()
    return rest


def gets_ready(site: Site, family: str) -> None:
    """The card is the one of the profile, set as it says; its drives are switched on and it is homed."""
    lathe = site.lathe
    _, kind = lathe.connect()
    assert kind == TYPES[family]
    assert refused(lathe.enable) == "owner.observer"
    lathe.claim()
    assert lathe.verify() == ()
    lathe.enable()
    assert not lathe.snapshot().homed
    lathe.home()
    assert lathe.snapshot().homed


def jogs_a_step_and_gathers_it(site: Site) -> None:
    """What the card has gathered of a step is the step: out by 250 counts, and nothing but that."""
    gathering = DataGathering(client=site.client, dialect=site.client.dialect)
    before = site.lathe.snapshot().tool.position
    plan = gathering.prepare(gathering.motor_channels("#1 actual"), 100, 15)
    gathering.start(plan)
    site.lathe.jog_by(AxisName.TOOL, STEP_COUNTS)
    assert site.lathe.snapshot().tool.position == pytest.approx(before + STEP_COUNTS, abs=CLOSE_COUNTS)
    gathering.stop()
    track = gathering.fetch(plan).values["#1 actual"]
    assert track[-1] - track[0] == pytest.approx(STEP_COUNTS, abs=CLOSE_COUNTS)
    assert np.diff(track).min() >= -CLOSE_COUNTS


def stops_in_a_jog(site: Site) -> None:
    start = site.lathe.snapshot().carriage.position
    site.seen.append(stopped_when(site, lambda look: look.carriage.position > start + 1000.0))
    with pytest.raises(StoppedError, match="operator"):
        site.lathe.jog_to(AxisName.CARRIAGE, start + 9000.0)
    site.seen.clear()
    assert start + 1000.0 < comes_to_rest(site).carriage.position < start + 4000.0


def is_out(site: Site, plan: CutPlan) -> bool:
    return abs(site.lathe.snapshot().tool.position - plan.setup.retracted) < CLOSE_COUNTS


def cuts(site: Site) -> float:
    """The program is on the card, does the whole cut and takes the tool out; return where the carriage ends."""
    lathe, plan = site.lathe, air_cut(site)
    number = plan.program.number
    assert len(site.client.question(f"LIST PROG{number}")) > 20
    deepest: list[float] = []
    lathe.program.start(number, plan.setup.retracted)
    last = lathe.program.follow(lambda look: deepest.append(look.tool.position), 2 * plan.duration_s)
    assert max(deepest) > plan.setup.surface
    assert last.at_rest and is_out(site, plan)
    assert last.carriage.position >= plan.carriage_start + plan.setup.carriage_counts - CLOSE_COUNTS
    return last.carriage.position


def holds_and_retracts(site: Site, full_way: float) -> None:
    """A cut that is held ends early, at the end of a turn, with the tool out."""
    lathe, plan = site.lathe, air_cut(site)
    held: list[Snapshot] = []

    def hold(look: Snapshot) -> None:
        if look.carriage.position > plan.carriage_start + 3 * plan.setup.carriage_per_turn and not held:
            held.append(look)
            lathe.program.end_after_turn()

    lathe.program.start(plan.program.number, plan.setup.retracted)
    last = lathe.program.follow(hold, 2 * plan.duration_s)
    assert last.at_rest and is_out(site, plan) and held
    assert last.carriage.position < full_way - 3 * plan.setup.carriage_per_turn


def stops_in_a_cut(site: Site) -> None:
    """The tool stays where the stop left it, in the part; it is taken out when somebody asks for that."""
    lathe, plan = site.lathe, air_cut(site)
    lathe.program.start(plan.program.number, plan.setup.retracted)
    watch = stopped_when(site, lambda look: look.carriage.position > plan.carriage_start + 100.0)
    with pytest.raises(StoppedError, match="operator"):
        lathe.program.follow(watch, 2 * plan.duration_s)
    assert comes_to_rest(site).tool.position > plan.setup.surface - 500.0
    lathe.retract(plan.setup.retracted)
    assert is_out(site, plan)


def is_killed_and_switched_off(site: Site) -> None:
    lathe = site.lathe
    site.stop.kill("operator")
    assert lathe.wait_for_rest().loops_open
    site.stop.release()
    assert refused(lambda: lathe.jog_by(AxisName.TOOL, -STEP_COUNTS)) == "machine.not_enabled"
    lathe.enable()
    lathe.switch_off()
    assert lathe.snapshot().loops_open
    assert refused(lathe.enable) == "machine.hands_in"
    lathe.confirm_nobody_inside()
    lathe.release()
    assert lathe.snapshot().owner == 0


def test_the_lathe_does_the_same_over_every_link(site: Site, family: str) -> None:
    gets_ready(site, family)
    jogs_a_step_and_gathers_it(site)
    stops_in_a_jog(site)
    holds_and_retracts(site, cuts(site))
    stops_in_a_cut(site)
    is_killed_and_switched_off(site)
    assert site.client.faults.total == 0


def test_a_card_of_the_other_family_is_refused(site: Site, family: str) -> None:
    other = compact(next(each for each in MACHINES if each != family))
    lathe = build(site.client.link, site.clock, other).lathe
    with pytest.raises(RefusedError) as error:
        lathe.connect()
    problem = error.value.problems[0]
    assert (problem.code, problem.value) == ("controller.family_differs", TYPES[family])
    assert not lathe.has_moved
