"""Where the iron of the tool and of the carriage ends, whatever the card commands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.pmac.settings import settings_with
from drivers.simulator.hosts.control_socket import answer
from drivers.simulator.plant.drives import Drives, build_drives
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from profiles.machine import MachineProfile
from tests.drivers.conftest import TrueBenchMaker

FATAL_ERROR = 1 << 2

TOOL_MM, CARRIAGE_MM = (-5.0, 78.0), (-8.0, 202.0)
"""The travel of the profile, -2 to 75 and -5 to 199 mm, and 3 mm more."""


def mounted(machine: MachineProfile) -> TrueParameters:
    return plant_named("mounted", machine, 1)


def drives(machine: MachineProfile, true: TrueParameters | None = None) -> Drives:
    return build_drives(machine, true or mounted(machine), settings_with(machine.controller.variables))


@pytest.mark.parametrize("friction_n", [0.0, 0.1])
@pytest.mark.parametrize(("output", "end_mm"), [(1.0, TOOL_MM[1]), (-1.0, TOOL_MM[0])])
def test_a_tool_that_is_pushed_stands_at_its_end(
    machine: MachineProfile, friction_n: float, output: float, end_mm: float
) -> None:
    tool = drives(machine, replace(mounted(machine), coulomb_friction_n=friction_n)).tool
    place = np.array(tool.push(output, 4000)) + tool.origin
    assert place[-1] == pytest.approx(end_mm * 5000.0)
    assert (place.min() >= TOOL_MM[0] * 5000.0, place.max() <= TOOL_MM[1] * 5000.0) == (True, True)
    assert tool.at_end
    for _ in range(2):  # the output of the first cycle is the one before
        tool.push(-output, 20)
    assert not tool.at_end


@pytest.mark.parametrize("block", [11, 4000])
def test_a_loop_that_is_told_to_go_further_pushes_against_it_and_comes_back(
    machine: MachineProfile, block: int
) -> None:
    """Blocks of the card or one long one: the end is where it is."""
    tool = drives(machine).tool
    start = tool.close_loop()
    speed = 100.0 * 5000.0 * 0.00044270837
    there = np.minimum(np.arange(1, 4001) * speed + start, 80.0 * 5000.0).tolist()
    track = [place for at in range(0, 4000, block) for place in tool.follow(there[at : at + block])]
    assert max(track) + tool.origin == pytest.approx(TOOL_MM[1] * 5000.0)
    assert track[-1] == max(track)
    assert tool.output_bits / tool.limit_bits > 0.1
    back = np.maximum(there[-1] - np.arange(1, 4001) * speed, 60.0 * 5000.0).tolist()
    track = [place for at in range(0, 4000, block) for place in tool.follow(back[at : at + block])]
    # What its integrator has taken up at the end, it lets go in seconds.
    assert track[-1] == pytest.approx(60.0 * 5000.0, abs=3000)


def test_far_from_its_ends_a_loop_is_what_it_is_without_any(machine: MachineProfile) -> None:
    near, free = drives(machine).tool, drives(machine, ideal(machine)).tool
    commands = (20_000.0 + 200.0 * np.sin(np.arange(4000) * 0.1)).tolist()
    for tool in (near, free):
        tool.close_loop()
    # One long block takes the careful way, blocks of the card the quick one.
    quick = [x for at in range(0, 4000, 10) for x in free.follow(commands[at : at + 10])]
    assert near.follow(commands) == quick


def test_a_carriage_stands_at_its_end_and_is_at_once_where_it_is_told_to_be_before_it(
    machine: MachineProfile,
) -> None:
    carriage = drives(machine).carriage
    track, at_its_end = carriage.follow([1000.0 * n for n in range(300)]), carriage.at_end
    assert max(track) + carriage.origin == CARRIAGE_MM[1] * 1000.0
    assert carriage.follow([100_000.0])[-1] == 100_000.0
    assert (at_its_end, carriage.at_end) == (True, False)
    assert carriage.push(-1.0, 20_000)[-1] + carriage.origin == CARRIAGE_MM[0] * 1000.0


@pytest.mark.parametrize(("motor", "end"), [(1, TOOL_MM[1] * 5000.0), (3, CARRIAGE_MM[1] * 1000.0)])
def test_without_its_limits_an_axis_runs_into_its_stop_trips_and_it_is_said_once(
    machine: MachineProfile, bench_with: TrueBenchMaker, motor: int, end: float
) -> None:
    bench = bench_with(mounted(machine))
    bench.lathe.enable()
    bench.lathe.home()
    bench.client.request(f"I{motor}13=0 I{motor}14=0")
    bench.client.request(f"#{motor}J+")
    for _ in range(120):
        bench.sim.wait(0.5)
        if not bench.sim.controller.motors[motor].enabled:
            break
    assert int(bench.ask(f"#{motor}?"), 16) & FATAL_ERROR
    assert bench.number(f"#{motor}P") == pytest.approx(end, abs=2)
    kinds = [collision.kind.value for collision in bench.sim.collisions]
    assert kinds.count("end_of_travel") == 1
    assert "end_of_travel: " in answer(bench.sim, "collisions")
