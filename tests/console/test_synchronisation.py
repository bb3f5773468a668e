"""Whether tool and spindle keep together, told from the start of a program to the end of its cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.station.commands import Start
from console.session.station.progress import CutProgress, CutStage, CutWatch, Synchronisation, before_part, in_part
from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.snapshot import driven_axes
from profiles.store import load_machine
from tests.console.floor import experiment_1, set_up_once
from tests.drivers.cut_floor import with_inverter
from tests.tui.machine_states import ON, look_at

QUEUED, WAITING, IN_SYNC, LOST = Synchronisation
FOLLOWING = [strategy for strategy in Strategy if strategy is not Strategy.NONE]


@pytest.mark.parametrize("strategy", FOLLOWING)
@pytest.mark.parametrize("rpm", [None, 0.0, 970.0])
def test_without_its_speed_a_spindle_is_waited_for(strategy: Strategy, rpm: float | None) -> None:
    for begun in (False, True):
        assert before_part(strategy, spindle_rpm=rpm, target_rpm=1000.0, begun=begun) is QUEUED


@pytest.mark.parametrize("rpm", [985.0, 1000.0, -1000.0, 1015.0])
def test_only_a_program_on_the_spindles_time_waits_for_its_index(rpm: float) -> None:
    for strategy in FOLLOWING:
        now = before_part(strategy, spindle_rpm=rpm, target_rpm=1000.0, begun=False)
        assert now is (WAITING if strategy is Strategy.TIMEBASE else QUEUED)
        assert before_part(strategy, spindle_rpm=rpm, target_rpm=1000.0, begun=True) is QUEUED


@pytest.mark.parametrize(("in_phase", "told"), [(True, IN_SYNC), (False, LOST), (None, None)])
@pytest.mark.parametrize("rpm", [None, 400.0, 1000.0])
def test_in_the_part_the_phase_decides(
    in_phase: bool | None, told: Synchronisation | None, rpm: float | None
) -> None:
    for strategy in FOLLOWING:
        assert in_part(strategy, spindle_rpm=rpm, target_rpm=1000.0, in_phase=in_phase) is told


@given(st.floats(-49.0, 49.0), st.sampled_from([True, False, None]), st.sampled_from(FOLLOWING))
def test_a_spindle_that_stands_in_the_part_is_lost_in_any_phase(
    rpm: float, in_phase: bool | None, strategy: Strategy
) -> None:
    assert in_part(strategy, spindle_rpm=rpm, target_rpm=1000.0, in_phase=in_phase) is LOST


@pytest.mark.parametrize("rpm", [None, 0.0, 1000.0])
def test_a_tool_that_follows_no_lobe_keeps_nothing(rpm: float | None) -> None:
    assert before_part(Strategy.NONE, spindle_rpm=rpm, target_rpm=1000.0, begun=False) is None
    assert in_part(Strategy.NONE, spindle_rpm=rpm, target_rpm=1000.0, in_phase=None) is None


# In a cut -------------------------------------------------------------------------------------------------------


def test_a_followed_spindle_that_comes_to_stand_is_lost_and_has_no_ripple() -> None:
    """A program on its time stands with it: tool and carriage where they were, in phase."""
    job, machine = experiment_1(), with_inverter(load_machine("lee-2001-lathe").machine)
    plan = plan_cut(job, machine, Strategy.TIMEBASE)
    watch = CutWatch(plan, job, machine)
    turn, per_mm = machine.spindle.counts_per_rev, machine.carriage.counts_per_mm
    told = []
    for number in range(200):
        turns = 0.4056 * min(number, 150)
        infeed_um = plan.target.at_um(360.0 * turns)
        look = look_at(
            ON,
            tool=plan.setup.surface + float(infeed_um) / machine.tool.count_um,
            spindle=turns * turn,
            carriage=plan.carriage_start + 1.5 * per_mm,
            running=True,
        )
        rpm = 1000.0 if number < 150 else 0.0
        told.append(watch.see(replace(look, driven=driven_axes(machine)), CutStage.RUN_UP, False, rpm))
    assert [each.synchronisation for each in (told[149], told[150], told[199])] == [IN_SYNC, LOST, LOST]
    assert told[199].in_phase
    assert {each.ripple for each in told} == {None}


# On the simulated lathe -----------------------------------------------------------------------------------------


def told_in(seen: Sequence[CutProgress], *stages: CutStage) -> list[Synchronisation | None]:
    """What was told in these stages, each once in its order."""
    return [told for told, _ in groupby(each.synchronisation for each in seen if each.stage in stages)]


@pytest.mark.parametrize(
    ("strategy", "before", "inside"),
    [
        (Strategy.NONE, [None], [None]),
        (Strategy.PVT, [QUEUED], [None, IN_SYNC]),
        pytest.param(Strategy.CAM, [QUEUED], [None, IN_SYNC], marks=pytest.mark.long),
        (Strategy.TIMEBASE, [QUEUED, WAITING, QUEUED], [None, IN_SYNC]),
        # Printed times are not those of the lobe: 28 um of 55 are left.
        (Strategy.PAPER, [QUEUED], [None, LOST]),
    ],
)
@pytest.mark.first(1)
def test_an_undisturbed_cut_is_queued_then_in_sync_or_lost_and_done(
    tmp_path: Path,
    in_copies: None,
    strategy: Strategy,
    before: list[Synchronisation | None],
    inside: list[Synchronisation | None],
) -> None:
    floor, job = set_up_once(tmp_path), experiment_1()
    floor.arm(job, strategy)
    seen: list[CutProgress] = []
    floor.looks.append(lambda _: seen.append(floor.state.cut) if floor.state.cut else None)
    floor.do(Start())
    running = [each for each in told_in(seen, CutStage.RUN_UP) if each is not None or strategy is Strategy.NONE]
    assert running == before
    assert told_in(seen, CutStage.CUT) == inside
    assert told_in(seen, CutStage.POSITION, CutStage.RETRACT) == [None]
    assert floor.state.cut is not None and floor.state.cut.synchronisation is None
    alarms = [alarm.problem.code for alarm in floor.state.alarms]
    assert floor.state.cut_done and alarms == (["cut.out_of_phase"] if LOST in inside else [])
