"""What was learned on a bundled lathe holds after an upgrade whose profile has other bytes, but the same path."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.data.learned_store import asked_for, chosen, store, versions
from console.session.data.records import RunRecord
from console.session.errors import SessionError
from console.session.stages import nominal_path
from drivers.cutting.strategy import Strategy
from profiles.compensations.learned import HoldsFor, model_again
from profiles.store import LoadedMachine, load_job, load_machine
from tests.console.test_run_reader import RUN

JOB = load_job("lee-2001-experiment-1")
THEN = load_machine("lee-2001-lathe")

BOUNDS = {
    r"^I111 = .*$": "I111 = 14000",  # fatal following error
    r"^I122 = .*$": "I122 = 40",  # jog speed
    r"^travel_min_mm = -2.0.*$": "travel_min_mm = -1.5",
    r"^jaw_stiffness_n_per_um = .*$": "jaw_stiffness_n_per_um = 60.0",
    r"^max_force_n = .*$": "max_force_n = 6000.0",
    r"^signed_by = .*$": 'signed_by = "somebody else"',
    r"^continuous_force_n = .*$": "continuous_force_n = 380.0",
}
"""What bounds or predicts a cut."""


def upgraded(folder: Path, changes: dict[str, str]) -> LoadedMachine:
    """The bundled lathe as a later release has it."""
    text = THEN.text
    for pattern, line in changes.items():
        text, count = re.subn(pattern, line, text, flags=re.MULTILINE)
        assert count == 1, pattern
    (folder / "lee-2001-lathe.toml").write_text(text)
    found = load_machine("lee-2001-lathe", folder)
    assert found.sha256 != THEN.sha256
    return found


def learned(data: Path, **changes: object) -> None:
    """A version that was learned with the release before."""
    holds = replace(asked_for(JOB, THEN, "cam", simulated=True), **changes)  # type: ignore[arg-type]
    store(data, model_again(holds, nominal_path(JOB.job, THEN.machine, Strategy.CAM), 1, "2026-05-01T08:00:00Z"))


def chosen_now(data: Path, machine: LoadedMachine) -> HoldsFor:
    asked = asked_for(JOB, machine, "cam", simulated=True)
    found = chosen("newest", versions(data, asked), asked)
    assert found is not None
    return found.holds_for


def refused(data: Path, machine: LoadedMachine) -> str:
    with pytest.raises(SessionError) as error:
        chosen_now(data, machine)
    return error.value.problems[0].code


def test_bounds_and_predictions_that_an_upgrade_changes_end_nothing(tmp_path: Path) -> None:
    learned(tmp_path)
    assert chosen_now(tmp_path, upgraded(tmp_path, BOUNDS)).machine_sha256 == THEN.sha256


@pytest.mark.parametrize(
    "change",
    [
        {r"^I130 = .*$": "I130 = 400"},
        {r"^home_radius_mm = .*$": "home_radius_mm = 75.0"},
        {r"^force_per_torque_n_per_n_m = .*$": "force_per_torque_n_per_n_m = 300.0"},
    ],
)
def test_what_shapes_the_path_still_ends_it(tmp_path: Path, change: dict[str, str]) -> None:
    learned(tmp_path)
    assert refused(tmp_path, upgraded(tmp_path, BOUNDS | change)) == "learned.settings_changed"


def test_a_value_that_the_older_console_did_not_know_had_its_default(tmp_path: Path) -> None:
    settings = dict(asked_for(JOB, THEN, "cam", simulated=True).settings)
    del settings["tool.passive_force_fraction"]
    settings["tool.name"] = settings["chuck.name"] = ""  # they had no names
    learned(tmp_path, settings=settings)
    assert chosen_now(tmp_path, upgraded(tmp_path, BOUNDS))
    pushed = {r"^wiper_land_mm = .*$": "wiper_land_mm = 0.4\npassive_force_fraction = 0.4"}
    assert refused(tmp_path, upgraded(tmp_path, pushed)) == "learned.settings_changed"


def test_a_version_without_settings_has_those_of_the_texts_of_its_cuts(tmp_path: Path) -> None:
    learned(tmp_path, settings={})
    later = upgraded(tmp_path, BOUNDS)
    assert refused(tmp_path, later) == "learned.machine_changed"
    hashes = {"job_sha256": JOB.sha256, "machine_sha256": THEN.sha256}
    texts = {"job_text_sha256": JOB.text, "machine_text_sha256": THEN.text}
    RunRecord(tmp_path, {**RUN, **hashes, **texts}).close()
    assert chosen_now(tmp_path, later)
    assert refused(tmp_path, upgraded(tmp_path, {r"^I130 = .*$": "I130 = 400"})) == "learned.settings_changed"
