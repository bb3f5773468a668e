"""The lobe along a clamped tube: two methods for one statement, and what each limit must be."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from drivers.simulator.plant.clamped_shell import ClampedShell
from profiles.arrays import Floats
from profiles.chucking.ring import Ring, fourier_coefficient
from profiles.chucking.tube import Tube, axial_fraction, pressed_um_per_n, wall_compliance_um_per_n
from profiles.materials import material_named

AL = replace(material_named("Al"), poisson=0.33)


def tube(outside_mm: float, wall_mm: float, overhang_mm: float, grip_mm: float, straight: float = 1.0) -> Tube:
    return Tube(
        outside_mm=outside_mm,
        wall_mm=wall_mm,
        grip_mm=grip_mm,
        overhang_mm=overhang_mm,
        material=AL,
        straight_fraction=straight,
    )


def sixths(part: Tube, harmonic: int) -> Floats:
    return axial_fraction(part, harmonic, np.linspace(0.0, part.overhang_mm, 7))


ONE, TWO, LONG = tube(52, 2.5, 30, 40), tube(35, 1.5, 30, 40), tube(52, 2.5, 60, 40)
SHORT_JAWS, FLANGE = tube(52, 2.5, 30, 10), tube(123, 3, 15, 10)


@pytest.mark.parametrize(
    ("part", "harmonic", "fractions"),
    [
        (ONE, 3, (0.902, 0.741, 0.595, 0.477, 0.387, 0.332)),
        (ONE, 2, (0.980, 0.948, 0.919, 0.897, 0.884, 0.894)),
        (ONE, 4, (0.823, 0.566, 0.363, 0.221, 0.125, 0.063)),
        (ONE, 6, (0.668, 0.319, 0.134, 0.051, 0.016, 0.000)),
        (replace(ONE, straight_fraction=0.0), 3, (0.769, 0.567, 0.395, 0.249, 0.124, 0.020)),
        (SHORT_JAWS, 3, (0.895, 0.722, 0.565, 0.437, 0.338, 0.270)),
        (TWO, 2, (0.950, 0.887, 0.833, 0.783, 0.738, 0.719)),
        (TWO, 3, (0.820, 0.589, 0.404, 0.253, 0.128, 0.029)),
        (TWO, 6, (0.481, 0.142, 0.033, 0.005, -0.001, 0.0)),
        (LONG, 3, (0.725, 0.440, 0.244, 0.108, 0.008, -0.073)),
        (FLANGE, 3, (1.00, 1.00, 1.01, 1.01, 1.02, 1.04)),
        (FLANGE, 6, (0.988, 0.963, 0.936, 0.916, 0.908, 0.915)),
    ],
)
def test_the_lobe_along_the_part_is_that_of_a_shell(
    part: Tube, harmonic: int, fractions: tuple[float, ...]
) -> None:
    """Love-Sanders shell, E 70 GPa, nu 0.33, solved with another mesh; in sixths of the length in front."""
    assert sixths(part, harmonic) == pytest.approx((1.0, *fractions), abs=0.006)


@pytest.mark.parametrize("part", [ONE, TWO, LONG, SHORT_JAWS, FLANGE])
@pytest.mark.parametrize(("straight", "jaw_stiffness"), [(1.0, 1e8), (0.0, 1e-5)])
def test_finite_differences_bend_the_part_alike(part: Tube, straight: float, jaw_stiffness: float) -> None:
    """On springs so stiff that the jaws stay straight, or so soft that they press evenly."""
    lobes = (3, 6)
    other = ClampedShell(
        radius_mm=part.shell.radius_mm,
        wall_mm=part.wall_mm,
        grip_mm=part.grip_mm,
        overhang_mm=part.overhang_mm,
        poisson=0.33,
        jaw_stiffness=jaw_stiffness,
    ).pressed(lobes)
    z = np.linspace(0.0, part.overhang_mm, 13)
    # Its motions are for 1 / (pi R D) of the force; here 1 N on one jaw.
    rigidity = 70_000.0 * part.wall_mm**3 / (12 * (1 - 0.33**2))
    um_per_n = (
        1000.0 * np.array([np.interp(z, other.z_mm, w) for w in other.w]) / (pi * part.shell.radius_mm * rigidity)
    )
    found = pressed_um_per_n(replace(part, straight_fraction=straight), 1, lobes, z)
    assert found == pytest.approx(um_per_n, abs=0.01 * float(um_per_n[0, 0]))


def test_a_thinner_wall_in_front_bends_as_by_finite_differences() -> None:
    part = replace(TWO, turned_mm=0.3, turned_from_mm=12.0, straight_fraction=0.0)
    other = ClampedShell(
        radius_mm=16.75, wall_mm=1.5, grip_mm=40.0, overhang_mm=30.0, poisson=0.33, jaw_stiffness=1e-5
    ).pressed((3,), turned_mm=0.3, turned_from_mm=12.0)
    whole = replace(part, turned_mm=0.0)
    at = np.array([0.0, 10.0, 15.0, 20.0])
    thinner, thicker = (pressed_um_per_n(each, 1, (3,), at)[0] for each in (part, whole))
    unturned = ClampedShell(
        radius_mm=16.75, wall_mm=1.5, grip_mm=40.0, overhang_mm=30.0, poisson=0.33, jaw_stiffness=1e-5
    ).pressed((3,))
    ratio = np.interp(at, other.z_mm, other.w[0]) / np.interp(at, unturned.z_mm, unturned.w[0])
    assert thinner / thicker == pytest.approx(ratio, abs=0.01)


@pytest.mark.parametrize("jaws", [2, 3, 4, 6])
def test_a_part_that_ends_at_straight_jaws_is_a_ring_in_plane_strain(jaws: int) -> None:
    """W R^3 / (E I) N / (pi (n^2 - 1)^2), stiffer by 1 - nu^2: straight jaws let it bend one way."""
    short = tube(52, 2.5, 1e-6, 40)
    ring = Ring(outside_mm=52, wall_mm=2.5, length_mm=40, material=AL)
    expected = (1 - 0.33**2) * fourier_coefficient(jaws, jaws) * ring.scale_um_per_n
    assert pressed_um_per_n(short, jaws, (jaws,), [0.0])[0, 0] == pytest.approx(expected, rel=1e-3)


def test_a_bell_mouth_adds_its_length_to_the_part_in_front() -> None:
    whole, open_ = tube(52, 2.5, 36, 34), replace(ONE, bell_mouth_mm=6.0)
    at = np.linspace(0.0, 30.0, 7)
    assert pressed_um_per_n(open_, 3, (3,), at) == pytest.approx(pressed_um_per_n(whole, 3, (3,), at + 6.0))


def test_the_wall_moves_between_the_jaws_and_everywhere_at_the_free_end() -> None:
    angle = np.linspace(0.0, 60.0, 7)
    at_jaws, in_front, end = wall_compliance_um_per_n(ONE, 3, angle, [0.0, 15.0, 30.0])
    assert at_jaws[0] == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(at_jaws) > 2 * np.ptp(in_front)
    assert at_jaws.mean() < in_front.mean() < end.mean()


def test_a_long_slender_tube_bends_as_a_cantilever() -> None:
    """P a^3 / (3 E I) plus what its root turns: a^3 and a, separated by the second difference over equal steps."""
    slender = replace(tube(20, 1.9, 300, 60), grip_mm=60.0)
    a = np.array([160.0, 200.0, 240.0, 280.0])
    um = wall_compliance_um_per_n(slender, 3, [0.0], a)[:, 0]
    second_moment = pi / 64 * (20.0**4 - 16.2**4)
    beam = 1000.0 * a**3 / (3 * 70_000.0 * second_moment)
    assert np.diff(um, n=3)[0] == pytest.approx(np.diff(beam, n=3)[0], rel=0.05)


@pytest.mark.parametrize("places", [2, 8, 9, 10])
def test_the_wall_gives_way_at_a_place_whichever_others_are_asked_with_it(places: int) -> None:
    z_mm, angle_deg = np.linspace(2.0, 30.0, places), np.arange(0.0, 120.0, 15.0)
    together = wall_compliance_um_per_n(ONE, 3, angle_deg, z_mm)
    alone = [wall_compliance_um_per_n(ONE, 3, angle_deg, [z])[0] for z in z_mm]
    np.testing.assert_allclose(together, alone, rtol=1e-9)
