"""The uncertainty budget: it holds the truth, against textures and errors that this test draws by itself."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from profiles.gauge import GaugeProfile
from profiles.metrology.cylindricity import PartSection
from profiles.metrology.uncertainty import UncertaintyBudget, measured_form, uncertainty_budget

Floats = NDArray[np.float64]
POINTS, UPR = 720, 50.0
TURN = 2.0 * math.pi * np.arange(POINTS) / POINTS
GAUGE = GaugeProfile(
    name="own",
    spindle_error_um=0.1,
    probe_noise_um=0.2,
    probe_gain_percent=1.0,
    repeat_um=0.05,
    column_error_um=0.3,
    size_error_um=2.0,
    temperature_off_k=1.0,
)


def texture(falls_as: float, rms_um: float, chance: np.random.Generator) -> Floats:
    """A form whose amplitude falls as n^-falls_as, with random phases; a sum of cosines."""
    n = np.arange(2.0, 200.0)
    amplitude = n**-falls_as
    amplitude *= rms_um * math.sqrt(2.0 / float(amplitude @ amplitude))
    phase = chance.uniform(0.0, 2.0 * math.pi, n.size)
    return np.asarray(amplitude @ np.cos(np.outer(n, TURN) + phase[:, None]))


def ront(profile_um: Floats) -> float:
    """RONt by its definition: Gaussian filter ISO 16610-21, least squares circle, peak to valley."""
    spectrum = np.fft.rfft(profile_um)
    spectrum *= 0.5 ** ((np.arange(spectrum.size) / UPR) ** 2)
    spectrum[:2] = 0.0
    return float(np.ptp(np.fft.irfft(spectrum, POINTS)))


def errors(part_um: Floats, chance: np.random.Generator) -> Floats:
    """What such a gauge adds: a spindle that is wrong once to six times a turn, noise, a wrong amplification."""
    spindle = 0.1 * np.cos(chance.integers(2, 7) * TURN + chance.uniform(0.0, 2.0 * math.pi))
    return np.asarray(spindle + 0.2 * chance.standard_normal(POINTS) + 0.01 * chance.uniform(-1.0, 1.0) * part_um)


def budget(*profiles_um: Floats, gauge: GaugeProfile = GAUGE, **more: Any) -> UncertaintyBudget:
    angle = np.degrees(TURN)
    sections = [
        PartSection(z_mm=4.0 * k, angle_deg=angle, deviation_um=each) for k, each in enumerate(profiles_um)
    ]
    return uncertainty_budget(gauge, measured_form(sections, filter_upr=UPR, radius_mm=25.0, **more))


@pytest.mark.parametrize("falls_as", [0.5, 1.0, 2.0])
def test_u_holds_the_true_roundness_in_95_of_100_measurements(falls_as: float) -> None:
    chance, held = np.random.default_rng(47 + int(10 * falls_as)), 0
    for _ in range(400):
        part_um = texture(falls_as, 1.0, chance)
        measured_um = part_um + errors(part_um, chance)
        said_um = ront(measured_um) + 0.05 * chance.standard_normal()
        u_um = budget(measured_um).expanded.roundness_um
        assert u_um is not None
        held += abs(said_um - ront(part_um)) <= u_um
    assert 0.93 <= held / 400 <= 0.97, held


def test_noise_alone_makes_no_round_part_out_of_round_beyond_its_u() -> None:
    chance, held = np.random.default_rng(3), 0
    for _ in range(200):
        measured_um = 0.2 * chance.standard_normal(POINTS)  # of a perfectly round part
        u_um = budget(measured_um, gauge=replace(GAUGE, spindle_error_um=0.0, repeat_um=0.0)).expanded.roundness_um
        assert u_um is not None
        held += ront(measured_um) <= u_um
    assert held >= 180, held


def test_a_spindle_of_3_um_explains_an_oval_of_6_um_that_it_hides() -> None:
    hidden_um = np.zeros(POINTS)  # what is seen of an oval of 6 um p-p and a spindle that is wrong against it
    gauge = replace(GAUGE, spindle_error_um=3.0, probe_noise_um=0.0, repeat_um=0.0)
    u_um = budget(hidden_um, gauge=gauge).expanded.roundness_um
    assert u_um == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize(
    ("key", "unknown"),
    [
        ("spindle_error_um", "roundness cylindricity"),
        ("probe_noise_um", "roundness cylindricity"),
        ("column_error_um", "cylindricity"),
        ("temperature_off_k", "diameter"),
    ],
)
def test_what_is_not_stated_is_not_0(key: str, unknown: str) -> None:
    three = [1.0 * np.cos(3 * TURN)] * 3
    stated: dict[str, Any] = {key: None}
    gauge = replace(GAUGE, **stated)
    found = budget(*three, gauge=gauge)
    figures = ("roundness", "cylindricity", "diameter")
    assert [each for each in figures if getattr(found.expanded, f"{each}_um") is None] == unknown.split()
    certified = replace(gauge, roundness_u_um=0.3, cylindricity_u_um=0.4, diameter_u_um=3.0)
    said = budget(*three, gauge=certified).expanded
    assert (said.roundness_um, said.cylindricity_um, said.diameter_um) == (0.3, 0.4, 3.0)


def test_a_clamped_part_is_not_known_as_released() -> None:
    assert budget(np.cos(3 * TURN), state="clamped").expanded.roundness_um is None


def test_the_diameter_is_the_root_of_the_sum_of_squares() -> None:
    # Steel, 50 mm, 1 K: 11.5e-6 * 50 mm = 0.575 um; with 2 um, both rectangular.
    u_um = budget(np.cos(3 * TURN), material="S45C").expanded.diameter_um
    assert u_um == pytest.approx(2.0 * math.sqrt((2.0**2 + 0.575**2) / 3.0), abs=1e-9)


def test_an_error_record_takes_the_place_of_the_declared_spindle() -> None:
    part_um, gauge = 5.0 * np.cos(2 * TURN), replace(GAUGE, spindle_error_um=None)
    angle = np.degrees(TURN)
    form = measured_form(
        [PartSection(z_mm=0.0, angle_deg=angle, deviation_um=part_um)], filter_upr=UPR, radius_mm=25.0
    )
    quiet = replace(gauge, probe_noise_um=0.0, probe_gain_percent=0.0, repeat_um=0.0)
    # RONt = 2 |c2|, so that 0.02 um of each component are 2 * 2 * 0.02 um of U.
    u_um = uncertainty_budget(quiet, form, {2: 0.02, 3: 0.0}).expanded.roundness_um
    assert u_um == pytest.approx(0.08, rel=0.1)
    blind = uncertainty_budget(quiet, form, {2: math.inf})
    assert blind.expanded.roundness_um is None


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("falls_as", [0.5, 1.0, 2.0])
def test_u_holds_the_true_cylindricity_in_95_of_100_measurements(falls_as: float) -> None:
    """Five sections, alike in part, with a lobe of 2 to 4 waves that becomes smaller along the part."""
    seeds, held = [np.random.default_rng(seed + int(10 * falls_as)) for seed in (147, 247)], 0
    for chance in seeds * 400:
        alike = texture(falls_as, 0.8, chance)
        lobe = chance.uniform(0.0, 8.0) * np.cos(chance.integers(2, 5) * TURN + chance.uniform(0.0, 2.0 * math.pi))
        part_um = [
            alike + texture(falls_as, 0.6, chance) + chance.normal(0.0, 0.5) + size * lobe
            for size in np.linspace(1.0, chance.uniform(0.0, 1.0), 5)
        ]
        order, phase, gain = chance.integers(2, 7), chance.uniform(0.0, 2.0 * math.pi), chance.uniform(-0.01, 0.01)
        read_um = [
            (1.0 + gain) * each
            + 0.1 * np.cos(order * TURN + phase)
            + 0.2 * chance.standard_normal(POINTS)
            + chance.uniform(-0.3, 0.3)
            for each in part_um
        ]
        u_um = budget(*read_um).expanded.cylindricity_um
        assert u_um is not None
        held += abs(cylt(read_um) + chance.normal(0.0, 0.05) - cylt(part_um)) <= u_um
    assert 0.93 <= held / 800 <= 0.97, held


def cylt(profiles_um: list[Floats]) -> float:
    """CYLt of the minimum zone by a general solver, of sections that are filtered round and evenly apart."""
    from scipy.optimize import linprog

    spectra = np.fft.rfft(profiles_um) * 0.5 ** ((np.arange(POINTS // 2 + 1) / UPR) ** 2)
    form = np.fft.irfft(spectra, POINTS).ravel()
    turn, z = np.tile(TURN, len(profiles_um)), np.repeat(np.linspace(-1.0, 1.0, len(profiles_um)), POINTS)
    ones, x, y = np.ones_like(turn), np.cos(turn), np.sin(turn)
    axis = np.stack([ones, x, y, z * x, z * y], axis=1)
    sides = np.block([[-axis, -ones[:, None]], [axis, -ones[:, None]]])
    found = linprog([0, 0, 0, 0, 0, 2], sides, np.concatenate([-form, form]), bounds=(None, None))
    return float(found.fun)
