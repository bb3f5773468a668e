"""Rings, contacts and cuts: what force does to a part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from profiles.arrays import Floats
from profiles.chucking.contact import Contact, cantilever_um, deflection, overhung_deflection, stiffness_at
from profiles.chucking.ring import (
    Ring,
    bending_stress_mpa,
    fourier_coefficient,
    jaw_stress_mpa,
    ring_coefficients,
    spring_back_um_pp,
)
from profiles.chucking.tube import Tube, spring_back_um
from profiles.cutting import (
    chatter_limit_mm,
    copying,
    cutting_force,
    nearest_mode,
    radial_cutting_stiffness_n_per_mm2,
)
from profiles.materials import material_named
from profiles.paper.chuck import Reaction, amplification, eq3_um, forced_harmonics
from profiles.problem import ProfileError

AL = material_named("Al")
TURN_DEG = np.arange(0.0, 360.0, 1.0)


def ring(outside_mm: float, wall_mm: float, length_mm: float) -> Ring:
    return Ring(outside_mm=outside_mm, wall_mm=wall_mm, length_mm=length_mm, material=AL)


ONE, TWO = ring(52, 2.5, 40), ring(35, 1.5, 40)
TUBE = Tube(outside_mm=52, wall_mm=2.5, grip_mm=40, overhang_mm=30, material=AL)


def test_coefficients_and_jaw_forces_of_the_papers_parts() -> None:
    assert ring_coefficients(2) == pytest.approx((0.074389, 0.068310, 0.142699), abs=1e-6)
    assert ring_coefficients(3) == pytest.approx((0.015939, 0.014257, 0.030195), abs=1e-6)
    assert 2 * fourier_coefficient(3, 3) == pytest.approx(0.029842, abs=1e-6)
    assert spring_back_um_pp(ONE, 3, 438.0) == pytest.approx(55.0, abs=0.05)
    assert spring_back_um_pp(TWO, 3, 183.1) == pytest.approx(33.0, abs=0.05)
    assert bending_stress_mpa(ONE, 3, 438.0) == pytest.approx(49.1, abs=0.05)
    assert bending_stress_mpa(TWO, 3, 183.1) == pytest.approx(38.6, abs=0.05)


@pytest.mark.parametrize("jaws", [2, 3, 4, 6, 12])
def test_the_series_is_the_closed_form(jaws: int) -> None:
    n = jaws * np.arange(1, 2000)
    series = np.array([fourier_coefficient(jaws, int(each)) for each in n])
    at_jaw, between = series.sum(), -(series * (-1.0) ** np.arange(1, 2000)).sum()
    assert ring_coefficients(jaws)[:2] == pytest.approx((at_jaw, between), rel=1e-8)


@pytest.mark.parametrize(
    ("outside", "wall", "length", "um_per_n"),
    [
        (52, 2.5, 20, 0.2511),
        (52, 2.5, 30, 0.1674),
        (52, 2.5, 40, 0.1256),
        (52, 2.5, 60, 0.0837),
        (35, 1.5, 20, 0.3604),
        (35, 1.5, 30, 0.2403),
        (35, 1.5, 40, 0.1802),
        (35, 1.5, 60, 0.1201),
    ],
)
def test_spring_back_of_the_papers_parts(outside: float, wall: float, length: float, um_per_n: float) -> None:
    assert spring_back_um_pp(ring(outside, wall, length), 3, 1.0) == pytest.approx(um_per_n, abs=5e-5)


def test_jaws_walls_and_lengths_change_the_spring_back() -> None:
    um = [spring_back_um_pp(ONE, jaws, 3000.0 / jaws) for jaws in (3, 6, 12)]
    assert um == pytest.approx([125.6, 6.57, 0.39], abs=0.05)
    assert um[0] / um[1] == pytest.approx(19.1, abs=0.05)
    after = ring(51.8, 2.4, 40)
    assert spring_back_um_pp(after, 3, 1.0) / spring_back_um_pp(ONE, 3, 1.0) == pytest.approx(1.124, abs=1e-3)


def test_where_the_jaws_end_the_ring_is_high_and_the_lobe_falls_to_the_free_end() -> None:
    short = replace(TUBE, overhang_mm=1e-9)
    um = spring_back_um(short, 3, 438.0, angle_from_jaw_deg=TURN_DEG, z_mm=[0.0])[0]
    assert np.ptp(um) == pytest.approx((1 - 0.33**2) * spring_back_um_pp(ONE, 3, 438.0), rel=1e-3)
    assert TURN_DEG[um.argmax()] % 120 == 0
    assert um.mean() == pytest.approx(0, abs=1e-9)
    um = spring_back_um(TUBE, 3, 438.0, angle_from_jaw_deg=TURN_DEG, z_mm=[-10, 0, 10, 20, 30])
    along = np.ptp(um, axis=1)
    assert um.shape == (5, 360)
    assert along[0] == pytest.approx(along[1])
    assert (np.diff(along[1:]) < 0).all()


def framed(outside: float, wall: float, length: float, jaws: int, force: float) -> tuple[float, float]:
    """Return the stress (MPa) under a jaw and the swing of the radius (um) of a ring of straight beams.

    Finite elements: 2 x 180 Euler-Bernoulli beams with axial stiffness, of aluminium, a point load at each jaw.
    Nothing of it is from the ring's formulas.
    """
    count, modulus, area, second = 360, 70_000.0, length * wall, length * wall**3 / 12.0
    angle = 2.0 * np.pi * np.arange(count) / count
    radius = (outside - wall) / 2.0
    places = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    whole, loads = np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
    beams = []
    for first in range(count):
        ends = (first, (first + 1) % count)
        along = places[ends[1]] - places[ends[0]]
        long = float(np.hypot(*along))
        c, s = along / long
        turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        turn = np.kron(np.eye(2), turned)
        ea, ei = modulus * area / long, modulus * second / long**3
        own = np.zeros((6, 6))
        own[np.ix_([0, 3], [0, 3])] = ea * np.array([[1.0, -1.0], [-1.0, 1.0]])
        own[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = ei * np.array(
            [
                [12.0, 6.0 * long, -12.0, 6.0 * long],
                [6.0 * long, 4.0 * long**2, -6.0 * long, 2.0 * long**2],
                [-12.0, -6.0 * long, 12.0, -6.0 * long],
                [6.0 * long, 2.0 * long**2, -6.0 * long, 4.0 * long**2],
            ]
        )
        at = np.concatenate([3 * ends[0] + np.arange(3), 3 * ends[1] + np.arange(3)])
        whole[np.ix_(at, at)] += turn.T @ own @ turn
        beams.append((own @ turn, at))
    for jaw in range(jaws):
        node = jaw * count // jaws
        loads[3 * node : 3 * node + 2] = -force * places[node] / radius
    moved = np.linalg.lstsq(whole, loads, rcond=1e-13)[0]  # the rigid motions are free, and left at 0
    own, at = beams[0]
    ends = own @ moved[at]  # along the first beam, across it, and the moment: at jaw 1
    stress = abs(float(ends[2])) * 6.0 / (length * wall**2) + abs(float(ends[0])) / (length * wall)
    radial = moved.reshape(-1, 3)[:, :2] @ (places / radius).T
    return stress, 1000.0 * float(np.ptp(np.diagonal(radial)))


@pytest.mark.first(1)
@pytest.mark.parametrize("jaws", [3, 2, 4, 6])
def test_the_stress_under_a_jaw_is_that_of_finite_elements(jaws: int) -> None:
    """OD 52, wall 1, 40 mm, 438 N a jaw; the swing of the formula leaves the stretching out."""
    stress, swing = framed(52.0, 1.0, 40.0, jaws, 438.0)
    thin = ring(52.0, 1.0, 40.0)
    assert jaw_stress_mpa(thin, jaws, 438.0) == pytest.approx(stress, rel=0.01)
    assert spring_back_um_pp(thin, jaws, 438.0) == pytest.approx(swing, rel=0.02)


# A bar in jaws whose contacts stiffen: the equilibrium of all jaws against the small-load formulas.

CONTACT_TURN_DEG = np.arange(0.0, 360.0, 2.0)
STEEL = material_named("steel")


def contact(jaws: int = 3, force_n: float = 1000.0, alpha: float = 0.5) -> Contact:
    return Contact(jaws=jaws, stiffness_n_per_um=50.0, force_per_jaw_n=force_n, alpha=alpha)


@pytest.mark.parametrize(
    ("force_n", "load_n", "alpha", "mean_um", "pp_um"),
    [
        (1000, 150, 0.5, 2.0006, 0.0500),
        (1000, 500, 0.5, 6.6901, 0.5604),
        (3000, 150, 0.5, 2.0001, 0.0167),
        (1000, 150, 0.33, 2.0006, 0.0330),
    ],
)
def test_three_jaws(force_n: float, load_n: float, alpha: float, mean_um: float, pp_um: float) -> None:
    moved = deflection(contact(force_n=force_n, alpha=alpha), load_n, CONTACT_TURN_DEG).along_um
    assert moved.mean() == pytest.approx(mean_um, abs=1e-4)
    assert np.ptp(moved) == pytest.approx(pp_um, abs=1e-4)
    # Stiffest where a jaw is opposite to the force: that is what Fig 3 shows.
    assert CONTACT_TURN_DEG[moved.argmin()] % 120 == 0
    # Small loads: alpha P / (3 F_c).
    assert np.ptp(moved) / moved.mean() == pytest.approx(alpha * load_n / (3 * force_n), rel=0.02)


def test_toward_and_between_the_jaws_two_hold_sideways_by_friction() -> None:
    moved = deflection(contact(), 150.0, [0.0, 60.0]).along_um
    assert moved == pytest.approx([1.9756, 2.0256], abs=1e-4)
    held = Contact(jaws=2, stiffness_n_per_um=50.0, force_per_jaw_n=1000.0, alpha=0.0, tangential_ratio=0.8)
    assert deflection(held, 10.0, [0.0, 90.0]).along_um == pytest.approx([0.1, 0.125])
    assert stiffness_at(50.0, 1000.0, 4000.0, 0.5) == pytest.approx(100.0)


@pytest.mark.parametrize(("jaws", "rate"), [(3, 75), (4, 100), (6, 150)])
def test_linear_springs_make_no_lobes(jaws: int, rate: float) -> None:
    moved = deflection(contact(jaws, alpha=0.0), 100.0, CONTACT_TURN_DEG)
    assert moved.along_um == pytest.approx(np.full(CONTACT_TURN_DEG.size, 100 / rate))
    assert moved.across_um == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("jaws", "alpha", "share"), [(4, 0.5, 0.0), (6, 0.5, 0.0), (4, 1 / 3, 0.0006)])
def test_more_jaws_are_even(jaws: int, alpha: float, share: float) -> None:
    moved = deflection(contact(jaws, alpha=alpha), 500.0, CONTACT_TURN_DEG).along_um
    assert np.ptp(moved) / moved.mean() == pytest.approx(share, abs=2e-5)


@pytest.mark.parametrize(
    ("force_n", "load_n", "overhang_mm", "share", "lifts"),
    [
        (2198, 700, 25, 0.146, False),
        (2198, 700, 50, 0.161, False),
        (2198, 700, 75, 0.175, False),
        (2198, 700, 125, 0.200, True),
        (2198, 150, 125, 0.034, False),
        (2198, 400, 125, 0.098, False),
        (1026, 150, 125, 0.076, False),
    ],
)
def test_a_load_beyond_jaws(force_n: float, load_n: float, overhang_mm: float, share: float, lifts: bool) -> None:
    moved = overhung_deflection(contact(force_n=force_n), overhang_mm / 40.0, load_n, CONTACT_TURN_DEG)
    assert np.ptp(moved.along_um) / moved.along_um.mean() == pytest.approx(share, abs=5e-4)
    assert moved.lifted.any() == lifts


@settings(max_examples=25)
@given(
    jaws=st.sampled_from((3, 4, 5, 6)),
    alpha=st.floats(0.05, 0.7),
    load_n=st.floats(0.1, 2000.0),
    lever=st.floats(0.0, 3.0),
)
def test_it_gives_way_along_the_load_at_every_jaw(jaws: int, alpha: float, load_n: float, lever: float) -> None:
    angle = np.array([17.0, 17.0 + 360 / jaws, -17.0])
    moved = overhung_deflection(contact(jaws, alpha=alpha), lever, load_n, angle).along_um
    assert (moved > 0).all()
    assert moved == pytest.approx(np.full(3, moved[0]), rel=1e-6)


@pytest.mark.parametrize(
    ("diameter", "overhang", "load", "bent_um"),
    [
        (35, 125, 150, 6.436),
        (65, 125, 200, 0.721),
        (65, 125, 400, 1.443),
        (68, 125, 700, 2.108),
        (68, 50, 700, 0.135),
    ],
)
def test_cantilever(diameter: float, overhang: float, load: float, bent_um: float) -> None:
    assert float(cantilever_um(STEEL, diameter, overhang, load)) == pytest.approx(bent_um, abs=1e-3)


# Eqs 1 to 3 in the general steady state: numbers, integration in time, the printed special case.

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


def test_exponents_differ_by_half_and_far_below_resonance_the_lobe_is_in_phase() -> None:
    """A 0.1 mm cut on D = 52 mm: 1 - (r/R)^2 = 0.0076775 (Eq 1), 1 - (r/R)^3 = 0.0114941 (Eq 3)."""
    lobes = {
        power: np.ptp(depth_um(replace(CHUCK, a_n=(0.0, 4.0), b_n=(), exponent=power), range(360), 25.9 / 26))
        for power in (2.0, 3.0)
    }
    assert lobes[3.0] / lobes[2.0] == pytest.approx(0.0114941 / 0.0076775, rel=1e-4)
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


# Cutting force, copying and chatter, against tabulated numbers.


@pytest.mark.parametrize(
    ("depth", "feed", "main_n"),
    [(0.10, 0.05, 7.40), (0.10, 0.10, 12.45), (0.06, 0.05, 4.44), (0.06, 0.10, 7.47), (0.1275, 0.10, 15.87)],
)
def test_kienzle(depth: float, feed: float, main_n: float) -> None:
    force = cutting_force(AL, depth, feed)
    assert force.main_n == pytest.approx(main_n, abs=0.005)
    assert 0.3 * main_n < force.passive_n < 0.5 * main_n


def test_an_edge_force_comes_in_late() -> None:
    """Fp has an offset below the least chip thickness: the edge rubs."""
    for feed, edge_n in ((0.02, 0.0), (0.01, 0.375), (1e-9, 0.75)):
        assert cutting_force(AL, 0.1, feed).main_n - 70 * feed**0.75 == pytest.approx(edge_n, abs=1e-6)


@pytest.mark.parametrize(("cut", "loop", "left"), [(0.1, 1.2, 0.0769), (0.05, 0.5, 0.0909), (1.0, 20.0, 0.0476)])
def test_copying(cut: float, loop: float, left: float) -> None:
    found = copying(cut, loop)
    assert found.fraction_left() == pytest.approx(left, abs=5e-5)


@pytest.mark.parametrize(
    ("stiffness", "zeta", "radial", "width"),
    [(20, 0.03, 900, 1.37), (1.2, 0.02, 900, 0.054), (20, 0.03, 2500, 0.49)],
)
def test_chatter(stiffness: float, zeta: float, radial: float, width: float) -> None:
    assert chatter_limit_mm(stiffness, zeta, radial) == pytest.approx(width, rel=0.01)


def test_stiffness_modes_and_materials() -> None:
    assert radial_cutting_stiffness_n_per_mm2(AL, 0.05) == pytest.approx(0.4 * 700 * 0.05**-0.25)
    assert nearest_mode(50.0, (540.0,)) is None
    assert nearest_mode(50.0, (160.0, 900.0)) == (3, 160.0)
    assert material_named("al") is material_named(" Aluminium ")
    assert material_named("S45C").kc1_n_per_mm2 == 1500
    assert material_named("SUS304").chip_exponent == 0.20
    with pytest.raises(ProfileError, match=r"rule\.material_unknown"):
        material_named("cheese")
