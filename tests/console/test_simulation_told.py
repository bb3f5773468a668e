"""The lathe behind the screens, as the command line asks for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.cli.commands import build
from console.cli.library import simulated_address, true_parameters_of
from console.text.catalogue import load
from drivers.link.address import SimulatedAddress
from drivers.simulator.hosts.process import SimulatorProcess
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine
from tests.console.commands import Console


def told(*words: str) -> SimulatedAddress | None:
    machine: MachineProfile = load_machine("lee-2001-lathe").machine
    return simulated_address(build(load("en")).parse_args(["--sim", *words]), machine)


def test_nothing_said_is_the_lathe_of_every_day() -> None:
    assert told() is None


def test_a_plant_a_seed_and_a_spread_are_handed_on() -> None:
    asked = told("--plant", "steady", "--seed", "7", "--clamping-sd", "2.5")
    assert asked == SimulatedAddress(plant="steady", seed=7, clamping_sd_percent=2.5)
    assert told("--seed", "7") == SimulatedAddress(seed=7)


def plant(*words: str) -> TrueParameters | None:
    machine: MachineProfile = load_machine("lee-2001-lathe").machine
    return true_parameters_of(
        build(load("en")).parse_args(["run", "lee-2001-experiment-1", "--sim", *words]), machine
    )


def test_a_run_that_nobody_aligns_is_on_a_lathe_that_needs_no_alignment() -> None:
    """A seed or a spread alone leaves it as its profile says, with jaw 1 and the tip where the job has them."""
    nominal = ideal(load_machine("lee-2001-lathe").machine)
    assert plant() is None
    assert plant("--seed", "1") == replace(nominal, seed=1)
    assert plant("--seed", "1", "--clamping-sd", "3") == replace(nominal, seed=1, clamping_force_spread=0.03)
    real = plant("--plant", "steady", "--seed", "1")
    assert real is not None
    assert (real.jaw_1_deg, real.home_radius_mm) == (None, nominal.home_radius_mm)


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_run_on_a_lathe_that_somebody_has_to_align_is_refused_with_what_to_do(
    console: Console, language: str
) -> None:
    words = ("run", "lee-2001-experiment-1", "--sim", "--plant", "mounted", "--seed", "1", "--lang", language)
    said = console(*words)
    assert (said.code, said.out) == (1, "")
    assert all(word in said.err for word in ("console --sim --plant mounted", "ideal", "steady"))


def test_how_the_simulated_lathe_is_says_nothing_of_a_real_one(console: Console) -> None:
    said = console("run", "lee-2001-experiment-1", "--link", "tcp:127.0.0.1:9", "--yes", "--seed", "1")
    assert said.code == 2
    assert "--sim" in said.err


def test_a_file_that_cannot_be_used_is_refused_before_the_screen_opens(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match=r"file.unreadable"):
        told("--plant", str(tmp_path / "no.toml"))


@pytest.mark.long
def test_the_process_behind_the_screen_has_the_iron_that_was_asked_for(tmp_path: Path) -> None:
    """A lobe of 1.1 times the job's, and clampings that scatter; the chuck at an angle that the seed says."""
    plant = tmp_path / "strong.toml"
    plant.write_text("lobe_factor = 1.1\n", encoding="utf-8")
    job, path = load_job("lee-2001-experiment-1").job, load_machine("lee-2001-lathe").path
    lobes, angles = [], []
    for sd_percent in (0.0, 3.0):
        process = SimulatorProcess.start(path, seed=3, plant=str(plant), clamping_sd_percent=sd_percent)
        try:
            angles.append(process.look().jaw_1_past_mark_deg)
            for _ in range(2):
                process.mount(job)
                lobes.append(abs(np.fft.rfft(process.measure().deviation_um)[3]) / 1800)
        finally:
            process.close()
    assert lobes[:2] == pytest.approx([1.1 * 27.5] * 2)
    assert len({round(lobe, 3) for lobe in lobes}) == 3
    assert angles[0] == angles[1] != 124.42
