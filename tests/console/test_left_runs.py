"""A cut that was left in the part is told to whoever has the machine next, also if that is after its start."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from console.session.cut.alignment import problems
from console.session.data.records import LEFT_IN_PART, RunRecord
from console.session.data.run_reader import ended_early
from console.session.station.commands import ConfirmClamping, EnableDrives, Home, Retract, TakeControl
from drivers.cutting.planning import CutPlan
from drivers.lathe.snapshot import AxisName
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_job, load_machine
from tests.console.consoles import MACHINE, WithStation, station_of

RUN = {
    **dict.fromkeys(("software", "job_sha256", "machine_sha256", "strategy", "program"), ""),
    "job": "ring",
    "machine": MACHINE,
    "simulated": 0,
}


def beside_another(data: Path) -> tuple[SimulatedLathe, WithStation]:
    """A console that looks on, because another one of this computer has the machine."""
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    station_of(sim, data)
    new = station_of(sim, data)
    assert not new.state.controls
    return sim, new


def cut_left(data: Path) -> RunRecord:
    record = RunRecord(data, RUN)
    record.add("started", {})
    record.add("stopped", {"reason": "SIGHUP"})
    return record


def leave(record: RunRecord) -> None:
    record.add(LEFT_IN_PART, {})
    record.close(marked=True)


def test_whoever_takes_control_is_told_of_a_tool_that_was_left_in_the_part(tmp_path: Path) -> None:
    _, new = beside_another(tmp_path)
    leave(cut_left(tmp_path))
    assert "record.left_in_part" not in new.alarms
    new.do(TakeControl())
    assert new.state.controls
    (told,) = [alarm.problem for alarm in new.state.alarms if alarm.problem.code == "record.left_in_part"]
    assert told.key == "ring"


def test_a_console_that_is_still_ending_is_waited_for(tmp_path: Path) -> None:
    sim, new = beside_another(tmp_path)
    ending = cut_left(tmp_path)
    new.do(TakeControl())
    sim.wait(2.0)
    new.look()
    assert "record.left_in_part" not in new.alarms
    leave(ending)
    sim.wait(2.0)
    new.look()
    assert new.alarms.count("record.left_in_part") == 1
    sim.wait(2.0)
    new.look()
    assert new.alarms.count("record.left_in_part") == 1, "told once"


def test_a_console_that_starts_while_the_one_before_is_ending_is_told_too(tmp_path: Path) -> None:
    ending = cut_left(tmp_path)
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    new = station_of(sim, tmp_path)
    assert new.state.controls and "record.left_in_part" not in new.alarms
    leave(ending)
    sim.wait(2.0)
    new.look()
    assert new.alarms.count("record.left_in_part") == 1


def test_a_restart_remembers_that_the_last_cut_ended_early_until_a_clamping_is_confirmed(tmp_path: Path) -> None:
    cut_left(tmp_path).close()
    job = load_job("lee-2001-experiment-1").job
    new = station_of(SimulatedLathe(load_machine(MACHINE).machine), tmp_path)
    assert "alignment.ended_early" in [problem.code for problem in problems(new.state.alignment, job)]
    new.do(ConfirmClamping(job=job))
    assert new.state.alignment.clamping is not None
    assert "alignment.ended_early" not in [problem.code for problem in problems(new.state.alignment, job)]


@pytest.mark.parametrize(
    ("run", "kinds", "early"),
    [
        ({}, ("armed", "started", "stopped"), True),
        ({}, ("armed", "started", "held"), True),
        ({}, ("armed", "started", "ended"), True),
        ({}, ("armed", "started", "cut"), False),
        ({"stage": "air"}, ("armed", "started", "stopped"), False),
        ({}, ("armed",), False),
        ({"machine": "another"}, ("armed", "started", "stopped"), False),
        ({"simulated": 1}, ("armed", "started", "stopped"), False),
    ],
)
def test_a_cut_that_reached_its_end_or_no_part_leaves_nothing(
    tmp_path: Path, run: dict[str, object], kinds: tuple[str, ...], early: bool
) -> None:
    record = RunRecord(tmp_path, {**RUN, **run})
    for kind in kinds:
        record.add(kind, {})
    record.close()
    assert ended_early(tmp_path, MACHINE) is early


def test_of_several_cuts_the_last_one_that_was_started_counts(tmp_path: Path) -> None:
    assert not ended_early(tmp_path, MACHINE)
    cuts: tuple[tuple[dict[str, object], tuple[str, ...], bool], ...] = (
        ({}, ("started", "stopped"), True),
        ({}, ("armed",), True),
        ({"stage": "air"}, ("started", "cut"), True),  # to look at what was wrong
        ({}, ("started", "cut"), False),
    )
    for run, kinds, early in cuts:
        record = RunRecord(tmp_path, {**RUN, **run})
        for kind in kinds:
            record.add(kind, {})
        record.close()
        assert ended_early(tmp_path, MACHINE) is early, kinds


def test_who_looks_on_at_a_cut_is_not_told_that_it_ended_early(tmp_path: Path) -> None:
    """It has no end yet, because it runs."""
    lathe = SimulatedLathe(load_machine(MACHINE).machine)
    first = station_of(lathe, tmp_path)
    assert first.state.controls
    record = RunRecord(tmp_path, RUN)
    record.add("started", {})
    second = station_of(lathe, tmp_path)
    assert not second.state.controls
    job = load_job("lee-2001-experiment-1").job
    assert "alignment.ended_early" not in [problem.code for problem in problems(second.state.alignment, job)]
    record.close()


def test_after_a_restart_of_the_controller_homing_takes_the_tool_out_first_and_f8_never_moves_it_in(
    tmp_path: Path,
) -> None:
    """Nobody knows where the tool stands; no blank has to be confirmed that is not there."""
    cut_left(tmp_path).close()
    new = station_of(SimulatedLathe(load_machine(MACHINE).machine), tmp_path)
    new.do(EnableDrives())
    before = new.state.snapshot
    assert before is not None and not before.homed
    plan = SimpleNamespace(setup=SimpleNamespace(retracted=before.tool.position + 1.0e5), zero_row_z=None)
    new.context.plan = cast(CutPlan, plan)  # of the cut that was left, in the zero that is lost
    new.do(Retract())
    after = new.state.snapshot
    assert new.refusals == [] and after is not None
    assert after.tool.position < before.tool.position, "positive is toward the work"
    assert after.carriage.commanded == before.carriage.commanded
    moved: list[str] = []
    new.looks.append(
        lambda seen: moved.extend(a for a in AxisName if "desired_velocity_zero" not in seen.axis(a).flags)
    )
    new.do(Home())
    assert list(dict.fromkeys(moved)) == [AxisName.TOOL, AxisName.CARRIAGE, AxisName.SPINDLE]
    assert new.state.snapshot is not None and new.state.snapshot.homed
    assert "alignment.ended_early" in [problem.code for problem in new.state.alignment.lost], "as it was recorded"
    new.do(Retract())
    assert new.refusals == ["screen.tool_is_out"]
