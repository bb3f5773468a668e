"""Gains on trial: bounded, written with the drives disabled, proven in air, and taken back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.cut.alignment import JawAngle, TouchOff
from console.session.data.health import kept_tests
from console.session.data.health import store as store_test
from console.session.data.identified_responses import store
from console.session.station.commands import (
    ApplyGains,
    Arm,
    CheckHealth,
    DisableDrives,
    EnableDrives,
    Home,
    Recover,
    RevertGains,
    Verify,
)
from console.session.station.state import Activity
from console.session.tuning.air_proof import find_missing_proofs
from console.session.tuning.bounds import FAST_SWEEP, SLOW_SWEEP
from console.session.tuning.proposal import gain_facts
from console.session.tuning.standing_trial import StandingTrial, format_gains
from console.session.tuning.trial import TrialPlace, standing_trial
from drivers.cutting.strategy import Strategy
from drivers.lathe.console_role import ConsoleRole
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import with_variables
from profiles.store import load_machine
from tests.console.commands import Console
from tests.console.consoles import MACHINE, Cable, WithStation, cabled, station_of, until_back
from tests.console.floor import experiment_1
from tests.tui.tune_stage import FIRST, bending, identified, swept

LATHE = load_machine(MACHINE).machine
PUBLISHED = {name: value for name, value in LATHE.controller.variables.items() if "I130" <= name <= "I135"}


def fill(data: Path) -> None:
    """Keep the response of a tool that bends at 300 Hz by 40 % of its motion, with the published gains.

    It names Ix30 to Ix35 alone, as before there was a filter.
    """
    store(data, identified(swept(bending(), 0.0002), PUBLISHED, simulated=False))


NO_FILTER = {"I136": 0.0, "I137": 0.0, "I138": 0.0, "I139": 0.0}
BEFORE = {"I130": 528.0, "I131": 4905.0, "I132": 4905.0, "I133": 811.0, **NO_FILTER}
HALF_KP = {**BEFORE, "I130": 264.0}
"""Half of every gain: Ix31 to Ix33 are relative to Ix30. The gain margin of 5.58 is twice as large."""


def order(settings: dict[str, float], shown: dict[str, float] | None = None) -> ApplyGains:
    return ApplyGains(settings=tuple(settings.items()), shown=tuple((shown or BEFORE).items()))


def stands(owner: WithStation) -> dict[str, float]:
    """What the controller has, asked past the console."""
    return {name: owner.sim.controller.variables.i(int(name[1:])) for name in BEFORE}


def record(data: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((data / "trials" / MACHINE / "trial-000001.json").read_text("utf-8"))
    return found


@pytest.fixture
def sim() -> SimulatedLathe:
    return SimulatedLathe(load_machine(MACHINE).machine)


@pytest.fixture
def owner(sim: SimulatedLathe, tmp_path: Path) -> WithStation:
    return station_of(sim, tmp_path)


def test_gains_are_applied_read_back_kept_on_disk_and_taken_back(owner: WithStation, tmp_path: Path) -> None:
    state = owner.do(order(HALF_KP))
    assert (owner.refusals, owner.alarms, stands(owner)) == ([], ["trial.active"], HALF_KP)
    assert state.trial is not None and state.trial.whole and dict(state.trial.before) == BEFORE
    assert state.tool_loop is not None and state.tool_loop.gains["I130"] == 264.0
    assert state.alignment.settings == () and [each.code for each in state.uncommissioned] == ["trial.active"]
    kept = record(tmp_path)
    assert (kept["open"], kept["before"], kept["proposed"]) == (True, BEFORE, HALF_KP)
    assert [event["what"] for event in kept["events"]] == ["begun", "applied"]
    assert kept["margins"]["gain_margin"] == pytest.approx(2.0 * 5.58, rel=0.002)
    assert kept["axis"]["acceleration_per_v"] == pytest.approx(624.025 / 4.74, rel=1e-4)
    state = owner.do(RevertGains())
    assert (owner.refusals, owner.alarms, stands(owner)) == ([], [], BEFORE)
    assert state.trial is None and state.uncommissioned == () and state.alignment.settings == ()
    assert record(tmp_path)["open"] is False
    owner.do(RevertGains())
    assert owner.refusals == ["trial.none"]
    assert b"SAVE" not in owner.line.heard


def test_a_test_with_gains_on_trial_finds_what_the_model_says_of_them(owner: WithStation, tmp_path: Path) -> None:
    state = owner.do(order(HALF_KP), EnableDrives(), Home(), CheckHealth(step_um=25.0))
    assert (owner.refusals, state.activity) == ([], Activity.READY)
    (kept,) = kept_tests(tmp_path, MACHINE, 5)
    result = kept.result
    assert result is not None and result.origin.gains["I130"] == 264.0
    assert result.sine.gain == pytest.approx(result.model.gain, rel=0.002)
    # The loop of the profile has another response at 40 Hz than the one that is half as stiff.
    assert result.sine.phase_deg == pytest.approx(result.model.phase_deg, abs=0.2)
    assert result.model.gain != pytest.approx(kept_model_of_the_profile(), rel=0.05)
    owner.do(Arm(job=experiment_1(), job_sha256="0" * 64, strategy=Strategy.PVT))
    assert owner.refusals == ["trial.active"], "nothing is cut with gains on trial"
    owner.do(RevertGains())
    assert owner.refusals == ["controller.drives_on"] and stands(owner) == HALF_KP
    owner.do(DisableDrives(), RevertGains())
    assert owner.refusals == [] and stands(owner) == BEFORE


def kept_model_of_the_profile() -> float:
    from profiles.axis.sampled_loop import loop_of

    return float(abs(loop_of(load_machine(MACHINE).machine).closed_loop([40.0])[0]))


@pytest.mark.parametrize(
    ("changed", "code", "value"),
    [
        # 5.58 / 4 = 1.39: tests/profiles/test_margins.py
        ({"I130": 2112.0}, "trial.gain_margin", "1.39"),
        ({"I130": 4000.0}, "trial.unstable", ""),
        ({"I131": 500.0, "I132": 500.0}, "trial.phase_margin", ""),
        ({"I130": 32_768.0}, "trial.range", "32768"),
        ({"I130": 0.0}, "trial.range", "0"),
        ({"I130": 264.5}, "trial.range", "264.5"),
    ],
)
def test_gains_without_the_margins_are_refused_with_the_number(
    owner: WithStation, tmp_path: Path, changed: dict[str, float], code: str, value: str
) -> None:
    state = owner.do(order({**BEFORE, **changed}))
    assert code in owner.refusals and stands(owner) == BEFORE
    (problem,) = (each for each in state.refusals if each.code == code)
    assert value in problem.value
    assert not (tmp_path / "trials").exists() and state.activity is Activity.READY and owner.alarms == []


def test_gains_are_refused_where_controller_model_or_disk_is_another(owner: WithStation, tmp_path: Path) -> None:
    owner.do(order(HALF_KP, {**BEFORE, "I133": 800.0}))
    assert owner.refusals == ["trial.changed_meanwhile"]
    owner.client.request("I168=40", lines=0)
    owner.do(order(HALF_KP))
    assert owner.refusals == ["trial.unmodelled"]
    owner.client.request("I168=0", lines=0)
    owner.do(EnableDrives(), order(HALF_KP))
    assert owner.refusals == ["controller.drives_on"]
    assert stands(owner) == BEFORE and not (tmp_path / "trials").exists()
    owner.do(DisableDrives())
    (tmp_path / "trials").write_text("in the way", encoding="utf-8")
    state = owner.do(order(HALF_KP))
    assert owner.refusals == ["file.not_writable"] and stands(owner) == BEFORE
    assert state.activity is Activity.READY and state.stop is None


def refuse(owner: WithStation, line: bytes, answer: bytes) -> None:
    """Let the card take one line otherwise than it was sent."""
    heard = owner.line.receive

    def receive(data: bytes) -> None:
        heard(data.replace(line, answer))

    owner.line.receive = receive  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("answer", "code"), [(b"I132=4000", "controller.not_taken"), (b"I132=(", "controller.err003")]
)
def test_a_value_that_is_not_taken_ends_it(owner: WithStation, tmp_path: Path, answer: bytes, code: str) -> None:
    wanted = {"I130": 300.0, "I131": 4800.0, "I132": 4800.0, "I133": 800.0, **NO_FILTER}
    refuse(owner, b"I132=4800", answer)
    state = owner.do(order(wanted))
    third = 4000.0 if b"4000" in answer else 4905.0
    assert stands(owner) == {**BEFORE, "I130": 300.0, "I131": 4800.0, "I132": third}
    cause, told = state.refusals
    assert told.code == "trial.stands" and told.key == "I130 300, I131 4800"
    assert (told.value, told.limit) == (
        ("I133 811", "I132 4000") if third == 4000.0 else ("I132 4905, I133 811", "-")
    )
    assert state.stop is None and state.activity is Activity.READY and "trial.stands" in owner.alarms
    owner.do(EnableDrives())
    assert owner.refusals[0] == "trial.stands" and "controller.setting" in owner.refusals
    assert [event["what"] for event in record(tmp_path)["events"]] == ["begun", "ended_early"]
    owner.station.close("end")
    again = station_of(owner.sim, tmp_path)
    assert again.state.standing is ConsoleRole.OWNER and again.alarms == ["trial.stands"]
    state = again.do(RevertGains())
    assert (again.refusals, again.alarms, stands(again), state.trial) == ([], [], BEFORE, None)
    assert cause.code == code


def test_a_cut_link_leaves_both_sets_of_gains_on_disk(sim: SimulatedLathe, tmp_path: Path) -> None:
    owner, cable = cabled(sim, tmp_path, load_machine(MACHINE))
    owner.context.client = owner.client
    cut_after(owner, cable, b"I131=4800")
    owner.do(order({**BEFORE, "I131": 4800.0, "I132": 4800.0}))
    assert "trial.unknown" in owner.alarms and record(tmp_path)["open"] is True
    cable.mend()
    until_back(owner)
    trial = owner.state.trial
    assert trial is not None and not trial.whole
    assert dict(trial.found) == stands(owner) == {**BEFORE, "I131": 4800.0}
    assert "trial.stands" in owner.alarms and "trial.unknown" not in owner.alarms
    owner.do(Recover())
    assert "trial.stands" in owner.alarms, "F2 does not change what stands"
    owner.do(RevertGains())
    assert (owner.refusals, owner.alarms, stands(owner)) == ([], [], BEFORE)


def cut_after(owner: WithStation, cable: Cable, line: bytes) -> None:
    """Cut the cable when the card has taken a line, and is asked what it has now."""
    heard = owner.line.receive
    taken: list[bytes] = []

    def receive(data: bytes) -> None:
        heard(data)
        if taken and not cable.cuts:
            cable.cut()
        taken.extend([line] if line in data else [])

    owner.line.receive = receive  # type: ignore[method-assign]


def test_further_gains_continue_the_trial_a_restart_knows_them_and_power_up_ends_it(
    owner: WithStation, tmp_path: Path
) -> None:
    owner.do(order(HALF_KP), order({**BEFORE, "I130": 400.0}, HALF_KP))
    assert owner.refusals == [] and stands(owner)["I130"] == 400.0
    owner.do(RevertGains())
    assert stands(owner) == BEFORE and len(list((tmp_path / "trials" / MACHINE).iterdir())) == 1
    owner.do(order(HALF_KP))
    owner.station.close("end")
    again = station_of(owner.sim, tmp_path)
    assert again.alarms == ["trial.active"] and again.state.alignment.settings == ()
    for name, value in BEFORE.items():  # as after a power-up: what was saved
        again.client.request(f"{name}={value:g}", lines=0)
    state = again.do(Verify())
    (last,) = sorted((tmp_path / "trials" / MACHINE).iterdir())[-1:]
    kept = json.loads(last.read_text("utf-8"))
    assert (state.trial, again.alarms, kept["open"]) == (None, [], False)
    assert kept["events"][-1]["what"] == "restored"


def test_the_touch_off_is_void_with_other_gains_home_and_jaw_1_are_not(owner: WithStation) -> None:
    jaw = JawAngle(angle_deg=10.0, jaws=3, at="08:00")
    touched = TouchOff(zero_radius_mm=30.0, diameter_mm=40.0, at="08:01")
    owner.context.tell(alignment=replace(owner.state.alignment, jaw=jaw, touch_off=touched))
    state = owner.do(order(HALF_KP))
    assert state.alignment.touch_off is None and state.alignment.jaw is not None
    assert [each.code for each in state.alignment.lost] == ["alignment.retuned"]


def test_a_trial_without_its_axis_is_judged_by_the_profile(owner: WithStation, tmp_path: Path) -> None:
    owner.do(order(HALF_KP))
    file = tmp_path / "trials" / MACHINE / "trial-000001.json"
    kept = record(tmp_path)
    del kept["axis"]
    file.write_text(json.dumps(kept), encoding="utf-8")
    state = owner.do(Verify())
    assert state.trial is not None and state.trial.whole
    file.write_text(json.dumps({**kept, "axis": {"delay_s": 0.1}}), encoding="utf-8")
    assert owner.do(Verify()).trial is None and "trial.file" in owner.alarms


@pytest.mark.parametrize("content", ["{", '{"schema": 9}'])
def test_a_broken_file_is_told(owner: WithStation, tmp_path: Path, content: str) -> None:
    owner.do(order(HALF_KP))
    (tmp_path / "trials" / MACHINE / "trial-000001.json").write_text(content, encoding="utf-8")
    state = owner.do(Verify())
    assert state.trial is None
    assert [each.key for each in state.alignment.settings or ()] == ["I130"]
    owner.do(EnableDrives())
    assert owner.refusals == ["controller.setting"]


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
    owner.do(EnableDrives(), Home(), CheckHealth(step_um=25.0))
    assert standing_trial(place, settle=True) is None
    assert record(tmp_path)["events"][-1]["what"] == "adopted"


def standing_with(owner: WithStation, data: Path, settings: dict[str, float]) -> StandingTrial | None:
    """What stands of a trial by a profile that has these gains."""
    machine = with_variables(load_machine(MACHINE).machine, settings)
    return standing_trial(
        TrialPlace(client=owner.client, machine=machine, data=data, simulated=False), settle=True
    )


def test_a_trial_is_over_when_the_controller_has_the_gains_of_the_profile(tmp_path: Path) -> None:
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
    assert "I136 -1.0927734375" in format_gains(tuple(record(tmp_path)["proposed"].items())), "it is shown with it"
    trial = standing_with(owner, tmp_path, FIRST | {"I136": -1.092773438})
    assert trial is not None and trial.whole
    assert [each.code for each in trial.problems] == ["trial.unproven"], "the profile has taken it over"


@pytest.mark.parametrize(
    ("amplitude_um", "overshoot", "codes"),
    [(0.2, 3.0, []), (3.0, 3.0, ["trial.swings"]), (0.2, 70.0, ["trial.overshoots"])],
)
def test_a_bad_tool_proves_none(tmp_path: Path, amplitude_um: float, overshoot: float, codes: list[str]) -> None:
    """A sine of 3 um has 2.1 um rms; a twentieth of the step of 25 um is 1.25."""
    from tests.tui.tune_stage import health

    made = health()
    position = np.array(made.position_um) + amplitude_um * np.sin(1.9 * np.array(made.times_ms))
    step = replace(made.step, overshoot_percent=overshoot)
    store_test(tmp_path, replace(made, position_um=tuple(position.tolist()), step=step))
    (kept,) = kept_tests(tmp_path, MACHINE, 5)
    assert kept.result is not None
    machine = load_machine(MACHINE).machine
    loop = loop_of(machine)
    found = find_missing_proofs(tmp_path, machine, made.origin.gains, loop, simulated=True)
    assert [problem.code for problem in found] == codes
    assert "I160" not in made.origin.gains
    unknown = find_missing_proofs(tmp_path, machine, {**made.origin.gains, "I160": 0.0}, loop, simulated=True)
    assert [problem.code for problem in unknown] == ["trial.unproven"], "what a test does not name it did not have"
    other = {**made.origin.gains, "I130": 1.0}
    untried = find_missing_proofs(tmp_path, machine, other, loop, simulated=True)
    assert [problem.code for problem in untried] == ["trial.unproven"]


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
def test_once_measured_it_gets_steadier_gains(console: Console, plant: Path, data_folder: Path) -> None:
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
    state = owner.do(EnableDrives(), Home(), CheckHealth(step_um=25.0))
    assert (owner.refusals, state.activity) == ([], Activity.READY)
    at_rest = []
    for _ in range(30):
        owner.sim.wait(0.0137)
        at_rest.append(float(owner.client.request("#1P")[0]))
    assert max(at_rest) - min(at_rest) <= 2.0, "nothing swings at rest"
