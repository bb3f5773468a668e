"""A bar in jaws whose contacts stiffen: the equilibrium of all jaws against the small-load formulas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from profiles.chucking.contact import (
    Contact,
    cantilever_um,
    deflection,
    overhung_deflection,
    stiffness_at,
)
from profiles.materials import material_named

TURN_DEG = np.arange(0.0, 360.0, 2.0)
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
    moved = deflection(contact(force_n=force_n, alpha=alpha), load_n, TURN_DEG).along_um
    assert moved.mean() == pytest.approx(mean_um, abs=1e-4)
    assert np.ptp(moved) == pytest.approx(pp_um, abs=1e-4)
    # Stiffest where a jaw is opposite to the force: that is what Fig 3 shows.
    assert TURN_DEG[moved.argmin()] % 120 == 0
    # Small loads: alpha P / (3 F_c).
    assert np.ptp(moved) / moved.mean() == pytest.approx(alpha * load_n / (3 * force_n), rel=0.02)


def test_toward_and_between_the_jaws() -> None:
    moved = deflection(contact(), 150.0, [0.0, 60.0]).along_um
    assert moved == pytest.approx([1.9756, 2.0256], abs=1e-4)


@pytest.mark.parametrize(("jaws", "rate"), [(3, 75), (4, 100), (6, 150)])
def test_linear_springs_make_no_lobes(jaws: int, rate: float) -> None:
    moved = deflection(contact(jaws, alpha=0.0), 100.0, TURN_DEG)
    assert moved.along_um == pytest.approx(np.full(TURN_DEG.size, 100 / rate))
    assert moved.across_um == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("jaws", "alpha", "share"), [(4, 0.5, 0.0), (6, 0.5, 0.0), (4, 1 / 3, 0.0006)])
def test_more_jaws_are_even(jaws: int, alpha: float, share: float) -> None:
    moved = deflection(contact(jaws, alpha=alpha), 500.0, TURN_DEG).along_um
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
def test_a_load_in_front_of_the_jaws(
    force_n: float, load_n: float, overhang_mm: float, share: float, lifts: bool
) -> None:
    moved = overhung_deflection(contact(force_n=force_n), overhang_mm / 40.0, load_n, TURN_DEG)
    assert np.ptp(moved.along_um) / moved.along_um.mean() == pytest.approx(share, abs=5e-4)
    assert moved.lifted.any() == lifts


@settings(max_examples=25)
@given(
    jaws=st.sampled_from((3, 4, 5, 6)),
    alpha=st.floats(0.05, 0.7),
    load_n=st.floats(0.1, 2000.0),
    lever=st.floats(0.0, 3.0),
)
def test_it_gives_way_in_the_direction_of_the_load_and_alike_at_every_jaw(
    jaws: int, alpha: float, load_n: float, lever: float
) -> None:
    angle = np.array([17.0, 17.0 + 360 / jaws, -17.0])
    moved = overhung_deflection(contact(jaws, alpha=alpha), lever, load_n, angle).along_um
    assert (moved > 0).all()
    assert moved == pytest.approx(np.full(3, moved[0]), rel=1e-6)


def test_two_jaws_hold_sideways_by_friction_alone() -> None:
    held = Contact(jaws=2, stiffness_n_per_um=50.0, force_per_jaw_n=1000.0, alpha=0.0, tangential_ratio=0.8)
    assert deflection(held, 10.0, [0.0, 90.0]).along_um == pytest.approx([0.1, 0.125])


def test_stiffness_grows_with_the_clamping_force() -> None:
    assert stiffness_at(50.0, 1000.0, 4000.0, 0.5) == pytest.approx(100.0)


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
