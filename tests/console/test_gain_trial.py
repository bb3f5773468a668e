"""Gains on trial: bounded, written with the drives disabled, read back, told exactly, and taken back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.session.cut.alignment import JawAngle, TouchOff
from console.session.data.health import kept_tests
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
from drivers.cutting.strategy import Strategy
from drivers.lathe.standing import Standing
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.console.cable import Cable, cabled, until_back
from tests.console.consoles import MACHINE, WithStation, station_of
from tests.console.floor import experiment_1

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
    owner.do(order(HALF_KP))
    owner.do(EnableDrives())
    owner.do(Home())
    state = owner.do(CheckHealth(step_um=25.0))
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
    owner.do(DisableDrives())
    owner.do(RevertGains())
    assert owner.refusals == [] and stands(owner) == BEFORE


def kept_model_of_the_profile() -> float:
    from profiles.axis.sampled_loop import loop_of

    return float(abs(loop_of(load_machine(MACHINE).machine).closed([40.0])[0]))


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


def test_gains_are_refused_where_the_controller_is_not_as_shown_or_the_model_is_not_the_loop(
    owner: WithStation, tmp_path: Path
) -> None:
    owner.do(order(HALF_KP, {**BEFORE, "I133": 800.0}))
    assert owner.refusals == ["trial.changed_meanwhile"]
    owner.client.request("I168=40", lines=0)
    owner.do(order(HALF_KP))
    assert owner.refusals == ["trial.unmodelled"]
    owner.client.request("I168=0", lines=0)
    owner.do(EnableDrives())
    owner.do(order(HALF_KP))
    assert owner.refusals == ["controller.drives_on"]
    assert stands(owner) == BEFORE and not (tmp_path / "trials").exists()


def test_nothing_is_written_where_the_old_gains_cannot_be_kept(owner: WithStation, tmp_path: Path) -> None:
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
def test_a_value_that_is_not_taken_ends_it_and_what_stands_is_told_and_reverted_after_a_restart(
    owner: WithStation, tmp_path: Path, answer: bytes, code: str
) -> None:
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
    assert again.state.standing is Standing.OWNER and again.alarms == ["trial.stands"]
    state = again.do(RevertGains())
    assert (again.refusals, again.alarms, stands(again), state.trial) == ([], [], BEFORE, None)
    assert cause.code == code


def test_a_link_that_is_cut_while_gains_are_written_leaves_both_sets_on_disk_and_tells_what_stands(
    sim: SimulatedLathe, tmp_path: Path
) -> None:
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


def test_a_restarted_console_knows_gains_on_trial_and_power_up_ends_them(
    owner: WithStation, tmp_path: Path
) -> None:
    owner.do(order(HALF_KP))
    owner.station.close("end")
    again = station_of(owner.sim, tmp_path)
    assert again.alarms == ["trial.active"] and again.state.alignment.settings == ()
    for name, value in BEFORE.items():  # as after a power-up: what was saved
        again.client.request(f"{name}={value:g}", lines=0)
    state = again.do(Verify())
    assert (state.trial, again.alarms, record(tmp_path)["open"]) == (None, [], False)
    assert record(tmp_path)["events"][-1]["what"] == "restored"


def test_further_gains_continue_the_trial_and_a_revert_goes_back_to_its_beginning(
    owner: WithStation, tmp_path: Path
) -> None:
    owner.do(order(HALF_KP))
    owner.do(order({**BEFORE, "I130": 400.0}, HALF_KP))
    assert owner.refusals == [] and stands(owner)["I130"] == 400.0
    owner.do(RevertGains())
    assert stands(owner) == BEFORE and len(list((tmp_path / "trials" / MACHINE).iterdir())) == 1


def test_the_touch_off_is_void_with_other_gains_home_and_jaw_1_are_not(owner: WithStation) -> None:
    jaw = JawAngle(angle_deg=10.0, jaws=3, at="08:00")
    touched = TouchOff(zero_radius_mm=30.0, diameter_mm=40.0, at="08:01")
    owner.context.tell(alignment=replace(owner.state.alignment, jaw=jaw, touch_off=touched))
    state = owner.do(order(HALF_KP))
    assert state.alignment.touch_off is None and state.alignment.jaw is not None
    assert [each.code for each in state.alignment.lost] == ["alignment.retuned"]


def test_a_trial_that_was_kept_without_its_axis_is_read_and_judged_by_the_profile(
    owner: WithStation, tmp_path: Path
) -> None:
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
def test_a_broken_file_is_told_and_the_controller_has_to_be_as_in_the_profile(
    owner: WithStation, tmp_path: Path, content: str
) -> None:
    owner.do(order(HALF_KP))
    (tmp_path / "trials" / MACHINE / "trial-000001.json").write_text(content, encoding="utf-8")
    state = owner.do(Verify())
    assert state.trial is None
    assert [each.key for each in state.alignment.settings or ()] == ["I130"]
    owner.do(EnableDrives())
    assert owner.refusals == ["controller.setting"]
