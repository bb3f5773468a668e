"""Cutting force, copying and chatter, against tabulated numbers."""

import pytest

from profiles.cutting import (
    chatter_limit_mm,
    copying,
    cutting_force,
    nearest_mode,
    radial_cutting_stiffness_n_per_mm2,
)
from profiles.materials import material_named
from profiles.problem import ProfileError

AL = material_named("Al")


@pytest.mark.parametrize(
    ("depth", "feed", "main_n"),
    [(0.10, 0.05, 7.40), (0.10, 0.10, 12.45), (0.06, 0.05, 4.44), (0.06, 0.10, 7.47), (0.1275, 0.10, 15.87)],
)
def test_kienzle(depth: float, feed: float, main_n: float) -> None:
    force = cutting_force(AL, depth, feed)
    assert force.main_n == pytest.approx(main_n, abs=0.005)
    assert 0.3 * main_n < force.passive_n < 0.5 * main_n


def test_the_edge_comes_in_below_a_fiftieth_of_a_millimetre() -> None:
    for feed, edge_n in ((0.02, 0.0), (0.01, 0.375), (1e-9, 0.75)):
        assert cutting_force(AL, 0.1, feed).main_n - 70 * feed**0.75 == pytest.approx(edge_n, abs=1e-6)


@pytest.mark.parametrize(("cut", "loop", "left"), [(0.1, 1.2, 0.0769), (0.05, 0.5, 0.0909), (1.0, 20.0, 0.0476)])
def test_copying(cut: float, loop: float, left: float) -> None:
    found = copying(cut, loop)
    assert found.fraction_left() == pytest.approx(left, abs=5e-5)
    assert found.fraction_left(3) == pytest.approx(left**3, rel=3e-3)


@pytest.mark.parametrize(
    ("stiffness", "zeta", "radial", "width"),
    [(20, 0.03, 900, 1.37), (1.2, 0.02, 900, 0.054), (20, 0.03, 2500, 0.49)],
)
def test_chatter(stiffness: float, zeta: float, radial: float, width: float) -> None:
    assert chatter_limit_mm(stiffness, zeta, radial) == pytest.approx(width, rel=0.01)


def test_radial_stiffness_is_a_share_of_kienzles_pressure() -> None:
    assert radial_cutting_stiffness_n_per_mm2(AL, 0.05) == pytest.approx(0.4 * 700 * 0.05**-0.25)


def test_a_mode_near_the_lobe_or_its_multiples() -> None:
    assert nearest_mode(50.0, (540.0,)) is None
    assert nearest_mode(50.0, (160.0, 900.0)) == (3, 160.0)


def test_materials_by_the_words_of_a_job() -> None:
    assert material_named("al") is material_named(" Aluminium ")
    assert material_named("S45C").kc1_n_per_mm2 == 1500
    assert material_named("SUS304").chip_exponent == 0.20
    with pytest.raises(ProfileError, match=r"rule\.material_unknown"):
        material_named("cheese")
