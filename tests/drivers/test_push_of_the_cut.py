"""A program that makes up for the push of the cut: by how much its tool is further in, and where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.cutting.planning import CutPlan, Strategy, nominal_command, plan_cut
from profiles.compensations.path import CutPath, target_path
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

PUSH_UM = 30.0
RELAXES_S = 147.6 / 32.3  # Kp over Ki of the published loop
MACHINES = ["lee-2001-lathe", "turbo-ethernet-lathe"]


def planned(job: Job, machine: MachineProfile, strategy: Strategy, push_um: float, air_mm: float = 0.0) -> CutPlan:
    command = replace(nominal_command(job, machine, strategy), push_um=push_um)
    path = CutPath(target=target_path(job), command=command)
    return plan_cut(job, machine, strategy, path=path, air_mm=air_mm, trimmed=strategy is Strategy.CAM)


def offsets_um(pushed: CutPlan, plain: CutPlan, machine: MachineProfile) -> tuple[np.ndarray, np.ndarray]:
    """Where the carriage is, mm past the face of the part, and how much further in the tool is than without."""
    motors = pushed.checked.motors
    tool, carriage = motors.index(machine.tool.motor), motors.index(machine.carriage.motor)
    rows = [
        (one.record.target[carriage], one.record.target[tool] - other.record.target[tool])
        for one, other in zip(pushed.checked.moves, plain.checked.moves, strict=True)
    ]
    at, off = np.array(rows).T
    return (at - pushed.setup.carriage_face) / machine.carriage.counts_per_mm, off * machine.tool.count_um


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE])
def test_the_tool_makes_up_for_the_push_until_the_integrator_has(name: str, strategy: Strategy) -> None:
    job, machine = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=2.0), load_machine(name).machine
    pushed, plain = (planned(job, machine, strategy, each) for each in (PUSH_UM, 0.0))
    at_mm, off_um = offsets_um(pushed, plain, machine)
    begins = int(np.argmax(off_um > 0.01))
    # The land of 0.4 mm meets the part 0.2 mm before its middle does; the chip begins late, never early.
    assert -0.2 <= at_mm[begins] < -0.18
    assert np.abs(off_um[:begins]).max() < 0.01
    feed_mm_per_s = job.feed_mm_per_rev * job.spindle_speed_rpm / 60.0
    in_cut = (at_mm > -0.2 + 2.0 * job.feed_mm_per_rev) & (at_mm < 1.9) & (np.arange(len(at_mm)) > begins)
    passed_s = (at_mm[in_cut] + 0.2) / feed_mm_per_s
    left = PUSH_UM * np.exp(-(passed_s - 0.06) / RELAXES_S)  # on average it begins a turn of 0.06 s later
    inside = off_um[in_cut][: int(0.8 * in_cut.sum())]
    assert inside == pytest.approx(left[: len(inside)], abs=0.2)
    assert abs(off_um[-1]) < 0.01  # it ends where any cut ends


def test_in_air_nothing_pushes() -> None:
    job, machine = load_job("lee-2001-experiment-1").job, load_machine(MACHINES[0]).machine
    assert planned(job, machine, Strategy.PVT, PUSH_UM, air_mm=1.1).command.push_um == 0.0
