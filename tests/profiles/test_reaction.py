"""Eqs 1 to 3 in the general steady state: numbers, integration in time, the printed special case."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from profiles.arrays import Floats
from profiles.paper.chuck import (
    Reaction,
    amplification,
    eq3_um,
    forced_harmonics,
)

RPM = 1000.0
RATIO = 0.9
CHUCK = Reaction(
    mass_kg=4.0,
    damping_n_s_per_m=200.0,
    stiffness_n_per_m=4.0 * (2 * np.pi * 50) ** 2,
    jaws=3,
    a_n=(10.0, 4.0, 1.5, 0.5),
    b_n=(0.0, 0.8, 0.0),
    exponent=2.0,
)
"""A chuck that resonates at its own lobe frequency, with the powers of r/R of Eq 1 as printed."""


def displacement_um(
    reaction: Reaction, spindle_speed_rpm: float, angle_deg: ArrayLike, radius_ratio: float = 1.0
) -> Floats:
    """Return x of Eq 2 in the steady state at spindle angles, in the shape of `angle_deg`."""
    angle = np.radians(np.asarray(angle_deg, dtype=float))
    mean_um = 1e6 * reaction.jaws * reaction.a_n[0] * radius_ratio / (2 * reaction.stiffness_n_per_m)
    total = np.full(angle.shape, mean_um)
    for each in forced_harmonics(reaction, spindle_speed_rpm, radius_ratio):
        phase = each.n * reaction.jaws * angle
        total += each.cos_um * np.cos(phase) + each.sin_um * np.sin(phase)
    return total


def depth_um(reaction: Reaction, angle_deg: ArrayLike, ratio: float) -> np.ndarray:
    """The change of the depth of cut: x(R) - x(r)."""
    return displacement_um(reaction, RPM, angle_deg) - displacement_um(reaction, RPM, angle_deg, ratio)


def test_every_harmonic_of_the_steady_state() -> None:
    found = forced_harmonics(CHUCK, RPM, RATIO)
    assert [h.dynamic_n_per_m for h in found] == pytest.approx([62831.853, 1191000.54, 3163893.41], rel=1e-8)
    assert [h.lag_rad for h in found] == pytest.approx([1.570796, 3.035885, 3.081982], abs=2e-6)
    assert [h.amplitude_um for h in found] == pytest.approx([154.6986, 2.809495, 0.251956], rel=1e-6)


def test_integrating_eq_2_in_time_stays_on_the_steady_state() -> None:
    from scipy.integrate import solve_ivp

    omega = 2 * np.pi * RPM / 60
    angle = np.linspace(0.0, 360.0, 61)

    def force(t: float) -> float:
        n = np.arange(1, 4)
        harmonics = np.array(CHUCK.a_n[1:]) * np.cos(3 * n * omega * t) + np.array(CHUCK.b_n) * np.sin(
            3 * n * omega * t
        )
        return float(1.5 * CHUCK.a_n[0] * RATIO + 3 * np.sum(RATIO ** (2 * n) * harmonics))

    def motion(t: float, state: np.ndarray) -> tuple[float, float]:
        x, v = state
        return v, (force(t) - CHUCK.damping_n_s_per_m * v - CHUCK.stiffness_n_per_m * x) / CHUCK.mass_kg

    steady_m = displacement_um(CHUCK, RPM, angle, RATIO) * 1e-6
    ahead_m = displacement_um(CHUCK, RPM, np.array([-0.001, 0.001]), RATIO) * 1e-6
    start = (steady_m[0], (ahead_m[1] - ahead_m[0]) / np.radians(0.002) * omega)
    times = np.radians(angle) / omega
    run = solve_ivp(motion, (0.0, times[-1]), start, t_eval=times, rtol=1e-9, atol=1e-14)
    assert run.y[0] * 1e6 == pytest.approx(steady_m * 1e6, abs=1e-5)


@pytest.mark.parametrize("jaws", [2, 3, 4, 6])
def test_eq_3_is_the_first_harmonic_at_resonance(jaws: int) -> None:
    angle = np.arange(0.0, 360.0, 7.0)
    stiffness = CHUCK.mass_kg * (jaws * 2 * np.pi * RPM / 60) ** 2
    one = replace(CHUCK, jaws=jaws, stiffness_n_per_m=stiffness, a_n=(10.0, 4.0), b_n=(0.8,), exponent=None)
    assert depth_um(one, angle, RATIO) == pytest.approx(eq3_um(one, RPM, angle, RATIO), abs=1e-9)


def test_the_exponents_of_the_paper_differ_by_half() -> None:
    """A 0.1 mm cut on D = 52 mm: 1 - (r/R)^2 = 0.0076775 (Eq 1), 1 - (r/R)^3 = 0.0114941 (Eq 3)."""
    lobes = {
        power: np.ptp(depth_um(replace(CHUCK, a_n=(0.0, 4.0), b_n=(), exponent=power), range(360), 25.9 / 26))
        for power in (2.0, 3.0)
    }
    assert lobes[3.0] / lobes[2.0] == pytest.approx(0.0114941 / 0.0076775, rel=1e-4)


def test_far_below_resonance_the_lobe_is_in_phase_and_small() -> None:
    stiff = replace(CHUCK, stiffness_n_per_m=1e3 * CHUCK.stiffness_n_per_m, a_n=(0.0, 4.0), b_n=())
    (lobe,) = forced_harmonics(stiff, RPM)
    assert lobe.cos_um == pytest.approx(1e6 * 3 * 4.0 / stiff.stiffness_n_per_m, rel=2e-3)
    assert abs(lobe.sin_um) < 1e-3 * lobe.cos_um


@pytest.mark.parametrize(
    ("ratio", "zeta", "gain", "lag_deg"),
    [(0.1, 0.03, 1.0101, 0.347), (0.2, 0.03, 1.0416, 0.716), (0.5, 0.03, 1.3323, 2.29), (1.0, 0.02, 25.0, 90.0)],
)
def test_amplification(ratio: float, zeta: float, gain: float, lag_deg: float) -> None:
    met_gain, met_lag_deg = amplification(ratio, zeta)
    assert met_gain == pytest.approx(gain, rel=1e-4)
    assert met_lag_deg == pytest.approx(lag_deg, abs=0.005)
