"""Which simulated lathe it is: one name for lathes that no seed tells apart, and for no others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.drives import build_drives
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import TrueParameters
from drivers.simulator.plant.which_lathe import options_of
from profiles.machine import MachineProfile
from profiles.store import load_machine


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return load_machine("lee-2001-lathe").machine


@pytest.fixture
def plant(tmp_path: Path, machine: MachineProfile) -> PlantFile:
    return PlantFile(tmp_path, machine)


class PlantFile:
    """A plant file, and the lathes of its seeds."""

    def __init__(self, folder: Path, machine: MachineProfile) -> None:
        self.folder, self._machine = folder, machine

    def lathes(self, text: str, name: str = "mine.toml") -> list[TrueParameters]:
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return [plant_named(str(path), self._machine, seed) for seed in (1, 2)]


def spindle_error_um(machine: MachineProfile, true: TrueParameters) -> np.ndarray:
    wander = build_drives(machine, true, {}).wander
    assert wander is not None
    return np.array([1000.0 * wander.at_mm(place / 720.0) for place in range(720)])


def test_two_lathes_are_one_by_what_they_draw_alone(plant: PlantFile, machine: MachineProfile) -> None:
    one, two = plant.lathes('like = "steady"\n')
    apart = spindle_error_um(machine, one) - spindle_error_um(machine, two)
    assert np.ptp(apart) > 1.0
    assert str(one.lathe) != str(two.lathe) and str(one.lathe).endswith(", seed 1")
    one, two = plant.lathes('like = "steady"\n', "mine, seed 3.toml")
    assert (one.lathe.seed, two.lathe.seed) == (1, 2) and str(one.lathe).startswith("mine, seed 3.toml ")
    assert SimulatedLathe(machine, one).which == one.lathe
    (alike, _) = plant.lathes("", "mine, seed 3.toml")
    assert options_of(str(one.lathe)) == options_of(str(alike.lathe)) == ()
    assert options_of("realistic, seed 6") == ("--plant", "realistic", "--seed", "6")
    assert options_of("ideal") == ("--plant", "ideal") and options_of("") == ()


@pytest.mark.parametrize(
    ("text", "one"),
    [
        ("[spindle]\nradial_error_um_pp = 1.0\n", False),
        ("[spindle]\nspeed_ripple_percent = 0.2\n", False),
        ("[gauge]\nmark_sd_deg = 1.0\n", False),
        ("[chuck]\nlobe_factor = 1.0\n[spread]\nlobe_factor = 0.1\n", False),
        ("[chuck]\nlobe_factor = 1.2\n", True),
        ("[blank]\noval_um_pp = 20.0\n", True),
        ("[tool]\nencoder_noise_um = 0.3\n", True),
        ("[gauge]\nnoise_um = 0.1\neccentricity_um = 5.0\n", True),
    ],
)
def test_lathes_are_one_where_the_seed_draws_nothing_but_of_parts(plant: PlantFile, text: str, one: bool) -> None:
    first, second = plant.lathes(text)
    assert (str(first.lathe) == str(second.lathe)) is one


@pytest.mark.parametrize(("name", "called"), [("ideal", "ideal"), ("mounted", "ideal"), ("paper", "paper")])
def test_lathes_without_anything_drawn_have_one_name(machine: MachineProfile, name: str, called: str) -> None:
    assert {str(plant_named(name, machine, seed).lathe) for seed in (1, 2)} == {called}
    assert not plant_named(name, machine, 1).parts_differ
    assert plant_named(name, machine, 1, 5.0).parts_differ, "--clamping-sd"


@pytest.mark.parametrize(
    ("text", "differ"),
    [
        ("[chuck]\nlobe_factor = 1.2\n", False),
        ("[spindle]\nradial_error_um_pp = 1.0\n", False),
        ("[chuck]\nclamping_sd_percent = 2.0\n", True),
        ("[blank]\nrun_out_um = 20.0\n", True),
        ("[warm-up]\ndrift_um = 5.0\n", True),
        ("[gauge]\nstart_mark = 'unknown'\n", True),
        ("[gauge]\nnoise_um = 0.1\n", True),
        ("[tool]\nencoder_noise_um = 0.3\n", True),
    ],
)
def test_parts_differ_where_anything_is_drawn_of_a_part(plant: PlantFile, text: str, differ: bool) -> None:
    assert [each.parts_differ for each in plant.lathes(text)] == [differ, differ]
