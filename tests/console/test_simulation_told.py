"""The lathe behind the screens, as the command line asks for it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.cli.parser import build
from console.cli.simulation import simulation_told
from console.text.catalogue import load
from drivers.link.address import SimulatedAddress
from drivers.simulator.process import SimulatorProcess
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine

Console = Callable[..., Any]


def told(*words: str) -> SimulatedAddress | None:
    machine: MachineProfile = load_machine("lee-2001-lathe").machine
    return simulation_told(build(load("en")).parse_args(["--sim", *words]), machine)


def test_nothing_said_is_the_lathe_of_every_day() -> None:
    assert told() is None


def test_a_plant_a_seed_and_a_spread_are_handed_on() -> None:
    asked = told("--plant", "realistic", "--seed", "7", "--clamping-sd", "2.5")
    assert asked == SimulatedAddress(plant="realistic", seed=7, clamping_sd_percent=2.5)
    assert told("--seed", "7") == SimulatedAddress(seed=7)


def test_a_file_that_cannot_be_used_is_refused_before_the_screen_opens(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match=r"file.unreadable"):
        told("--plant", str(tmp_path / "no.toml"))


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
