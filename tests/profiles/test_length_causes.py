"""Why the sections of a part differ: each cause alone is named with its amount, and noise is none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from profiles.arrays import Floats
from profiles.metrology.conformity import JudgedFigure, ToleranceKind
from profiles.metrology.cylindricity import PartSection, evaluate_cylinder
from profiles.metrology.length_causes import LengthCause, LengthCauseKind, causes_of_failure

HEIGHTS_MM = (22.8, 24.4, 26.0, 27.6, 29.2)
TURN_DEG = np.arange(3600) / 10.0
TURN = np.radians(TURN_DEG)

Form = Callable[[int, float], Floats]
"""Deviation of a section, um, by its number and its place: -1 at the jaws to 1 at the free end."""


def causes(form: Form, *, noise_um: float = 0.1, seed: int = 3, every: int = 1) -> tuple[LengthCause, ...]:
    """The causes of a part that also has 4 um p-p of 4/rev all along, and is off and tilted on the gauge."""
    random, turn = np.random.default_rng(seed), TURN[::every]
    sections = []
    for number, z_mm in enumerate(HEIGHTS_MM):
        along = (z_mm - 26.0) / 3.2
        usual = 2.0 * np.cos(4.0 * turn) + (8.0 + 30.0 * along) * np.cos(turn - 1.0)
        deviation = usual + form(number, along)[::every] + random.normal(0.0, noise_um, turn.size)
        sections.append(PartSection(z_mm=z_mm, angle_deg=TURN_DEG[::every], deviation_um=deviation))
    return evaluate_cylinder(sections).causes


def alone(form: Form) -> LengthCause:
    (found,) = causes(form)
    return found


@pytest.mark.parametrize("taper_um", [-9.0, 2.0, 30.0])
def test_a_taper_is_named_by_the_change_of_the_radius(taper_um: float) -> None:
    found = alone(lambda _, along: np.full(TURN.size, 0.5 * taper_um * along))
    assert found.kind is LengthCauseKind.TAPER
    assert found.last_um == pytest.approx(taper_um, rel=0.03)
    assert (found.first_mm, found.last_mm) == (22.8, 29.2)


@pytest.mark.parametrize("order", [2, 3, 6])
@pytest.mark.parametrize("turned_deg", [0.0, 77.0])
def test_a_lobe_that_changes_along_z_is_named_by_both_ends_against_the_middle(
    order: int, turned_deg: float
) -> None:
    """As where a lobe that dies out towards the free end is cut with that of the middle."""
    wave = np.cos(order * (TURN - np.radians(turned_deg)))
    found = alone(lambda _, along: 12.0 * (np.exp(-0.4 * along) - 1.0) * wave)
    assert (found.kind, found.order) == (LengthCauseKind.LOBE, order)
    jaws_um, free_um = 24.0 * (np.exp(0.4) - 1.0), 24.0 * (np.exp(-0.4) - 1.0)
    assert (found.first_um, found.last_um) == pytest.approx((jaws_um, free_um), rel=0.03)
    assert found.um_pp == pytest.approx(jaws_um, rel=0.03)


@pytest.mark.parametrize("off_um", [-4.0, 3.0])
def test_an_entry_that_is_off_in_its_radius_is_no_taper(off_um: float) -> None:
    found = alone(lambda number, _: np.full(TURN.size, off_um if number == 4 else 0.0))
    assert (found.kind, found.order, found.last_mm) == (LengthCauseKind.ENTRY, 0, 29.2)
    assert found.last_um == pytest.approx(off_um, rel=0.03)


def test_an_entry_that_is_off_in_its_lobe_is_no_lobe_along_z() -> None:
    found = alone(lambda number, _: (2.5 if number == 4 else 0.0) * np.cos(3.0 * TURN + 2.0))
    assert (found.kind, found.order) == (LengthCauseKind.ENTRY, 3)
    assert found.um_pp == pytest.approx(5.0, rel=0.03)


def test_a_bent_axis_is_named_by_its_straightness() -> None:
    """Middles on a parabola, 6 um from end to middle: 4 um above its straight line at most, as 6 (x^2 - 1/2)."""
    found = alone(lambda _, along: 6.0 * along**2 * np.cos(TURN - 0.4))
    assert found.kind is LengthCauseKind.BENT
    line_um = 6.0 * np.mean([1.0, 0.25, 0.0, 0.25, 1.0])
    assert found.um_pp == pytest.approx(2.0 * max(line_um, 6.0 - line_um), rel=0.03)


def test_of_two_causes_the_larger_comes_first() -> None:
    found = causes(lambda _, along: 2.0 * along + 6.0 * along * np.cos(5.0 * TURN))
    assert [(each.kind, each.order) for each in found] == [(LengthCauseKind.LOBE, 5), (LengthCauseKind.TAPER, 0)]


@pytest.mark.parametrize("every", [1, 30])
@pytest.mark.parametrize("noise_um", [0.02, 0.5, 4.0])
def test_noise_has_no_cause(noise_um: float, every: int) -> None:
    round_um = np.zeros(TURN.size)
    for seed in range(30):
        assert causes(lambda *_: round_um, noise_um=noise_um, seed=seed, every=every) == ()


@pytest.mark.parametrize(
    ("fails", "named"),
    [
        ("", "taper lobe bent"),
        ("roundness", "lobe"),
        ("cylindricity", "taper lobe bent"),
        ("diameter", "taper"),
        ("roundness diameter", "taper lobe"),
    ],
)
def test_only_what_can_put_a_figure_beyond_its_limit_explains_that_it_fails(fails: str, named: str) -> None:
    """A cone is as round in each of its sections as a cylinder is, and no lobe changes a mean diameter."""
    orders = {"taper": 0, "lobe": 3, "bent": 1}
    found = [LengthCause(kind=LengthCauseKind(kind), um_pp=9.0, order=n) for kind, n in orders.items()]
    judged = [
        JudgedFigure(kind=kind, value_um=6.0 if kind.value in fails.split() else 4.0, limit_um=5.0)
        for kind in ToleranceKind
    ]
    assert [each.kind.value for each in causes_of_failure(found, judged)] == named.split()
