"""Gains that the profile has taken over from a trial: nothing is cut with them before they were proven in air."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.session.data.health import kept_tests, store
from console.session.station.commands import CheckHealth, EnableDrives, Home
from console.session.tuning.air_proof import unproven
from console.session.tuning.standing import StandingTrial, listed
from console.session.tuning.trial import TrialPlace, standing_trial
from drivers.simulator.machine import SimulatedLathe
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import with_variables
from profiles.store import load_machine
from tests.console.consoles import MACHINE, WithStation, station_of
from tests.console.test_gain_trial import HALF_KP, NO_FILTER, order, record
from tests.console.test_notch_trial import fill
from tests.tui.tune_stage import FIRST


def test_adopted_gains_stay_on_trial_until_a_health_test_with_them(tmp_path: Path) -> None:
    machine = load_machine(MACHINE).machine
    owner = station_of(SimulatedLathe(machine), tmp_path)
    owner.do(order(HALF_KP))
    assert owner.refusals == []
    # A profile without a filter states none: what the controller has of it is 0.
    entered = {name: value for name, value in HALF_KP.items() if name not in NO_FILTER}
    assert not NO_FILTER.keys() & machine.controller.variables.keys()
    variables = {**machine.controller.variables, **entered}
    adopted = replace(machine, controller=replace(machine.controller, variables=variables))
    place = TrialPlace(client=owner.client, machine=adopted, data=tmp_path, simulated=False)
    trial = standing_trial(place, settle=True)
    assert trial is not None and [problem.code for problem in trial.problems] == ["trial.unproven"]
    owner.do(EnableDrives())
    owner.do(Home())
    owner.do(CheckHealth(step_um=25.0))
    assert standing_trial(place, settle=True) is None
    assert record(tmp_path)["events"][-1]["what"] == "adopted"


def standing_with(owner: WithStation, data: Path, settings: dict[str, float]) -> StandingTrial | None:
    """What stands of a trial by a profile that has these gains."""
    machine = with_variables(load_machine(MACHINE).machine, settings)
    return standing_trial(
        TrialPlace(client=owner.client, machine=machine, data=data, simulated=False), settle=True
    )


def test_a_trial_is_over_when_the_controller_has_the_gains_of_the_profile_whatever_those_are(
    tmp_path: Path,
) -> None:
    """As `controller apply` writes them: neither those that were tried, nor those of before."""
    owner = station_of(SimulatedLathe(load_machine(MACHINE).machine), tmp_path)
    owner.do(order(HALF_KP))
    owner.client.request("I130=400", lines=0)
    trial = standing_with(owner, tmp_path, {})
    assert trial is not None and not trial.whole, "gains of nobody"
    assert standing_with(owner, tmp_path, {"I130": 400.0}) is None
    kept, last = record(tmp_path), record(tmp_path)["events"][-1]
    assert (kept["open"], last["what"], last["found"]["I130"]) == (False, "restored", 400.0)


def test_a_coefficient_of_the_profile_need_not_have_its_last_digit(tmp_path: Path) -> None:
    fill(tmp_path)
    owner = station_of(SimulatedLathe(load_machine(MACHINE).machine), tmp_path)
    owner.do(order(FIRST | {"I136": -1.0927734375}))
    assert owner.refusals == []
    assert "I136 -1.0927734375" in listed(tuple(record(tmp_path)["proposed"].items())), "it is shown with it"
    trial = standing_with(owner, tmp_path, FIRST | {"I136": -1.092773438})
    assert trial is not None and trial.whole
    assert [each.code for each in trial.problems] == ["trial.unproven"], "the profile has taken it over"


@pytest.mark.parametrize(
    ("amplitude_um", "overshoot", "codes"),
    [(0.2, 3.0, []), (3.0, 3.0, ["trial.swings"]), (0.2, 70.0, ["trial.overshoots"])],
)
def test_a_tool_that_swings_or_overshoots_proves_nothing(
    tmp_path: Path, amplitude_um: float, overshoot: float, codes: list[str]
) -> None:
    """A sine of 3 um has 2.1 um rms; a twentieth of the step of 25 um is 1.25."""
    from tests.tui.tune_stage import health

    made = health()
    position = np.array(made.position_um) + amplitude_um * np.sin(1.9 * np.array(made.times_ms))
    step = replace(made.step, overshoot_percent=overshoot)
    store(tmp_path, replace(made, position_um=tuple(position.tolist()), step=step))
    (kept,) = kept_tests(tmp_path, MACHINE, 5)
    assert kept.result is not None
    machine = load_machine(MACHINE).machine
    loop = loop_of(machine)
    found = unproven(tmp_path, machine, made.origin.gains, loop, simulated=True)
    assert [problem.code for problem in found] == codes
    assert "I160" not in made.origin.gains
    unknown = unproven(tmp_path, machine, {**made.origin.gains, "I160": 0.0}, loop, simulated=True)
    assert [problem.code for problem in unknown] == ["trial.unproven"], "what a test does not name it did not have"
    other = {**made.origin.gains, "I130": 1.0}
    untried = unproven(tmp_path, machine, other, loop, simulated=True)
    assert [problem.code for problem in untried] == ["trial.unproven"]
