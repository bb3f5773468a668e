"""The floor of the learning benchmark: against arithmetic for each thing that it has in it, one at a time."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from benchmarks import learning_floor
from benchmarks.learning_floor import floor_um
from profiles.store import load_job, load_machine

JOB = load_job("lee-2001-experiment-1").job
MACHINE = load_machine("lee-2001-lathe").machine
MEDIAN = 0.67449  # of the absolute value of a normal distribution
PASSED_3 = math.exp(-math.log(2.0) * (3 / 50) ** 2)  # Gaussian filter of 50 UPR, three times a turn


def floor(tmp_path: Path, plant: str, sd_percent: float | None = None, seed: int = 1) -> float:
    path = tmp_path / "plant.toml"
    path.write_text(f"schema = 1\n{plant}", encoding="utf-8")
    return floor_um(JOB, MACHINE, str(path), seed, sd_percent)


def test_a_lathe_that_repeats_everything_has_none(tmp_path: Path) -> None:
    assert floor(tmp_path, "[chuck]\nlobe_factor = 1.1\n[spindle]\nradial_error_um_pp = 0.0\n") < 1e-6


@pytest.mark.long
def test_the_scatter_of_the_wrench_is_the_lobe_times_what_is_left_of_its_force(tmp_path: Path) -> None:
    """5 % of 1314 N, over the 1083.7 N that hold at 1000 rpm, are 6.06 % of 55 um; the median is 0.67 of that."""
    left_n = 1314.0 - 3 * 0.2 * 0.035 * (1000 * math.pi / 30) ** 2
    expected = MEDIAN * 0.05 * 1314.0 / left_n * 55.0 * PASSED_3
    found = [floor(tmp_path, "", 5.0, seed) for seed in (1, 2)]
    # The median of a hundred draws scatters by 12 %, the mean of two by 9 %.
    assert sum(found) / len(found) == pytest.approx(expected, rel=0.25)


@pytest.mark.long
def test_the_spindle_that_does_not_repeat_is_a_tenth_of_its_error(tmp_path: Path) -> None:
    """Two sines of a 40th of the radial error each, 0.43 and 2.57 times a turn: between one and both of them."""
    found = floor(tmp_path, "[spindle]\nradial_error_um_pp = 4.0\n")
    assert 0.1 < found < 0.4


@pytest.mark.long
def test_noise_of_the_gauge_alone_is_what_the_filter_lets_through(tmp_path: Path) -> None:
    """Of 0.05 um rms at 3600 points the filter leaves 0.007 um; RONt of so many is some six of them."""
    passed = 0.05 * math.sqrt(2 * 50 * math.sqrt(math.pi / (2 * math.log(2))) / math.sqrt(2) / 3600)
    found = floor(tmp_path, "[gauge]\nnoise_um = 0.05\n")
    assert 4.5 * passed < found < 8.5 * passed


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few clampings, where each is like the other."""
    monkeypatch.setattr(learning_floor, "CLAMPINGS", 5)


def test_a_process_gain_costs_a_perfect_controller_nothing_that_repeats(tmp_path: Path, few: None) -> None:
    assert floor(tmp_path, "[cut]\nprocess_gain = 0.8\n[chuck]\nlobe_factor = 1.1\n") < 1e-6


def test_of_the_spindle_that_does_not_repeat_the_gain_arrives(tmp_path: Path, few: None) -> None:
    spindle = "[spindle]\nradial_error_um_pp = 4.0\n"
    plain = floor(tmp_path, spindle)
    assert floor(tmp_path, f"{spindle}[cut]\nprocess_gain = 0.8\n") == pytest.approx(0.8 * plain, rel=1e-6)


def test_a_part_that_gives_way_keeps_of_each_blank_what_nobody_knows(tmp_path: Path, few: None) -> None:
    """Wrought aluminium, 700 x 0.05^0.75 N for each mm, 0.4 of it outwards: 0.0296 N/um.

    Of 40 um oval 0.5 um/N copy 0.0146, 0.58 um. What repeats, the force itself, is compensated.
    """
    stiff = 0.4 * 700.0 * 0.05**0.75 / 1000.0
    plant = "[cut]\npassive_force_share = 0.4\nwork_compliance_um_per_n = 0.5\n[blank]\noval_um_pp = 40.0\n"
    copied = 0.5 * stiff / (1.0 + 0.5 * stiff)
    assert floor(tmp_path, plant) == pytest.approx(40.0 * copied, rel=0.01)
    assert floor(tmp_path, plant.replace("oval_um_pp = 40.0", "oval_um_pp = 0.0")) < 1e-6
