"""The clamped ring and tube: closed form against Fourier series, and the numbers of the paper's two parts."""

from dataclasses import replace

import numpy as np
import pytest

from profiles.chucking.ring import (
    Ring,
    bending_stress_mpa,
    decay_per_mm,
    fourier_coefficient,
    jaw_stress_mpa,
    ring_coefficients,
    spring_back_um_pp,
)
from profiles.chucking.tube import Tube, axial_fraction, spring_back_um, wall_compliance_um_per_n
from profiles.materials import material_named

AL = material_named("Al")
TURN_DEG = np.arange(0.0, 360.0, 1.0)


def ring(outside_mm: float, wall_mm: float, length_mm: float) -> Ring:
    return Ring(outside_mm=outside_mm, wall_mm=wall_mm, length_mm=length_mm, material=AL)


ONE, TWO = ring(52, 2.5, 40), ring(35, 1.5, 40)
TUBE = Tube(outside_mm=52, wall_mm=2.5, grip_mm=40, overhang_mm=30, material=AL)


def test_coefficients() -> None:
    assert ring_coefficients(2) == pytest.approx((0.074389, 0.068310, 0.142699), abs=1e-6)
    assert ring_coefficients(3) == pytest.approx((0.015939, 0.014257, 0.030195), abs=1e-6)
    assert 2 * fourier_coefficient(3, 3) == pytest.approx(0.029842, abs=1e-6)


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


def test_55_and_33_um_with_ordinary_jaw_forces() -> None:
    assert spring_back_um_pp(ONE, 3, 438.0) == pytest.approx(55.0, abs=0.05)
    assert spring_back_um_pp(TWO, 3, 183.1) == pytest.approx(33.0, abs=0.05)
    assert bending_stress_mpa(ONE, 3, 438.0) == pytest.approx(49.1, abs=0.05)
    assert bending_stress_mpa(TWO, 3, 183.1) == pytest.approx(38.6, abs=0.05)


def test_more_jaws_at_the_same_total_force() -> None:
    um = [spring_back_um_pp(ONE, jaws, 3000.0 / jaws) for jaws in (3, 6, 12)]
    assert um == pytest.approx([125.6, 6.57, 0.39], abs=0.05)
    assert um[0] / um[1] == pytest.approx(19.1, abs=0.05)


def test_a_thinner_wall_springs_back_further() -> None:
    after = ring(51.8, 2.4, 40)
    assert spring_back_um_pp(after, 3, 1.0) / spring_back_um_pp(ONE, 3, 1.0) == pytest.approx(1.124, abs=1e-3)


def test_decay_along_a_tube() -> None:
    assert (1 / decay_per_mm(ONE, 3), 1 / decay_per_mm(TWO, 3)) == pytest.approx((23.47, 16.87), abs=0.005)
    small = replace(TUBE, outside_mm=35, wall_mm=1.5)
    assert axial_fraction(TUBE, 3, 30.0) == pytest.approx(0.347, abs=5e-4)
    assert axial_fraction(small, 3, 30.0) == pytest.approx(0.130, abs=5e-4)
    # A load at one place bends 1/beta to either side: 46.9 mm far from an end, so 23.5 mm with one side alone.
    assert replace(TUBE, grip_mm=1e-6, overhang_mm=1000).bent(3).length_mm == pytest.approx(46.94 / 2, abs=0.01)


def test_the_force_for_55_um_in_front_of_the_jaws() -> None:
    """1481 N on each jaw where 2/beta is bent: the paper's chucking forces are 3.1 to 6.6 kN in all."""
    both_sides = ring(52, 2.5, 2 / decay_per_mm(ONE, 3))
    here_um = spring_back_um_pp(both_sides, 3, 1481.0) * float(axial_fraction(TUBE, 3, 30.0))
    assert here_um == pytest.approx(55.0, abs=0.1)


def test_a_part_that_ends_at_the_jaws_is_a_ring_high_at_the_jaws() -> None:
    short = replace(TUBE, overhang_mm=1e-9)
    um = spring_back_um(short, 3, 438.0, angle_from_jaw_deg=TURN_DEG, z_mm=[0.0])[0]
    assert np.ptp(um) == pytest.approx(spring_back_um_pp(ONE, 3, 438.0), rel=1e-3)
    assert TURN_DEG[um.argmax()] % 120 == 0
    assert um.mean() == pytest.approx(0, abs=1e-9)


def test_the_lobe_falls_towards_the_free_end() -> None:
    um = spring_back_um(TUBE, 3, 438.0, angle_from_jaw_deg=TURN_DEG, z_mm=[-10, 0, 10, 20, 30])
    along = np.ptp(um, axis=1)
    assert um.shape == (5, 360)
    assert along[0] == pytest.approx(along[1])
    assert (np.diff(along[1:]) < 0).all()


@pytest.mark.parametrize("jaws", [2, 3, 4, 6])
def test_a_wall_gives_way_between_the_jaws(jaws: int) -> None:
    soft = wall_compliance_um_per_n(ONE, jaws, TURN_DEG)
    jaw = TURN_DEG % (360 / jaws) == 0
    assert soft[jaw] == pytest.approx(0, abs=1e-9)
    if jaws > 2:  # two jaws let the ring shear: softest a quarter of the way
        assert soft.argmax() % (360 / jaws) == pytest.approx(180 / jaws, abs=1)


def test_the_papers_parts_are_soft_to_the_tool() -> None:
    """Ring stiffness between the jaws lies between 1.1 and 3.2 N/um for these parts."""
    for part, softest in ((TWO, 1.13), (ONE, 1.62), (replace(TWO, length_mm=60), 1.69)):
        assert 1 / wall_compliance_um_per_n(part, 3, 60.0) == pytest.approx(softest, abs=0.01)


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
