"""A tool that bends at 300 Hz, which no profile knows: gains that would make it oscillate are not written."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.station.commands import ApplyGains, CheckHealth, EnableDrives, Home
from console.session.station.state import Activity
from console.session.tuning.bounds import FAST_SWEEP, SLOW_SWEEP
from console.session.tuning.proposal import gain_facts
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from profiles.store import load_machine
from tests.console.commands import Console
from tests.console.consoles import MACHINE, station_of
from tests.console.test_gain_trial import BEFORE, NO_FILTER, order, stands

BENDS = """\
schema = 1
source = "a tool that bends at 300 Hz with 2 % of damping, by 40 % of its motion"
[tool]
flexible_hz = 300
flexible_damping = 0.02
flexible_fraction = 0.4
"""
FOR_A_RIGID_TOOL = {"I130": 2954.0, "I131": 1263.0, "I132": 1263.0, "I133": 55_697.0, **NO_FILTER}
"""Stiff gains with an Ms of 1.6 on the tool of the profile, and unstable on this one: test_loop_design.py."""


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    file = tmp_path / "bends.toml"
    file.write_text(BENDS, encoding="utf-8")
    return file


def lathe_of(plant: Path) -> SimulatedLathe:
    machine = load_machine(MACHINE).machine
    return SimulatedLathe(machine, plant_named(str(plant), machine, seed=1))


def test_what_nobody_has_measured_is_not_tuned_up(plant: Path, tmp_path: Path) -> None:
    owner = station_of(lathe_of(plant), tmp_path)
    state = owner.do(order(FOR_A_RIGID_TOOL))
    assert owner.refusals == ["trial.unmeasured"] and stands(owner) == BEFORE
    assert "console identify --frequencies 25" in str(state.refusals[0])


def test_written_past_the_console_such_gains_make_the_tool_oscillate(plant: Path, tmp_path: Path) -> None:
    """That this plant is one where the refusals matter."""
    owner = station_of(lathe_of(plant), tmp_path)
    for name, value in FOR_A_RIGID_TOOL.items():
        owner.client.request(f"{name}={value:g}", lines=0)
    owner.client.request("#1J/", lines=0)
    owner.client.request("I120=0", lines=0)
    owner.client.request("#1J^400", lines=0)  # at once, without an S-curve: a knock
    owner.sim.wait(1.5)
    assert "fatal_following_error" in owner.lathe.snapshot().tool.flags, (
        "it swung up until the controller killed it"
    )


@pytest.mark.long
def test_once_measured_it_gets_gains_with_which_it_is_steadier_than_before(
    console: Console, plant: Path, data_folder: Path
) -> None:
    for sweep in (SLOW_SWEEP, FAST_SWEEP):
        said = console("identify", "--sim", "--plant", str(plant), "--yes", "--strategy", "pvt", *sweep.split())
        assert said.code == 0, said.err
    data = data_folder / "trilobe"
    # The consoles of these tests take their lathe for a real one.
    for file in data.glob("identified/*/*.json"):
        file.write_text(file.read_text("utf-8").replace('"simulated": true', '"simulated": false'), "utf-8")
    facts = gain_facts(load_machine(MACHINE).machine, None, data, simulated=False)
    assert facts.proposal is not None and facts.reasons == ()
    (mode,) = facts.known.loop.plant.modes
    assert mode.hz == pytest.approx(300.0, rel=0.02)
    assert mode.fraction == pytest.approx(0.4, rel=0.1)
    owner = station_of(lathe_of(plant), data)
    owner.do(order(FOR_A_RIGID_TOOL))
    assert "trial.unstable" in owner.refusals and stands(owner) == BEFORE
    settings = {name: float(value) for name, value in facts.proposal.settings.items()}
    owner.do(ApplyGains(settings=tuple(settings.items()), shown=tuple(BEFORE.items())))
    assert owner.refusals == [] and stands(owner) == settings
    owner.do(EnableDrives())
    owner.do(Home())
    state = owner.do(CheckHealth(step_um=25.0))
    assert (owner.refusals, state.activity) == ([], Activity.READY)
    at_rest = []
    for _ in range(30):
        owner.sim.wait(0.0137)
        at_rest.append(float(owner.client.request("#1P")[0]))
    assert max(at_rest) - min(at_rest) <= 2.0, "nothing swings at rest"
