"""Part and gauge apart, by readings of several placements that are written down here point by point."""

from __future__ import annotations

import numpy as np
import pytest

from profiles.arrays import Floats
from profiles.metrology.separation import Placement, Separation, separate
from profiles.problem import ProfileError

STEP_DEG = np.arange(720) / 2
PART = {2: (1.5, 20.0), 3: (27.5, 30.0), 4: (0.8, 11.0), 5: (0.4, 50.0)}
GAUGE = {2: (3.0, 65.0), 3: (0.5, 10.0), 4: (0.6, 40.0), 7: (0.2, 3.0)}


def waves(angle_deg: Floats, parts: dict[int, tuple[float, float]]) -> Floats:
    total = np.zeros_like(angle_deg)
    for n, (amplitude, phase_deg) in parts.items():
        total += amplitude * np.cos(n * np.radians(angle_deg - phase_deg))
    return total


def reading(
    turned_deg: float, *, opposite: bool = False, off_deg: float = 0.0, noise: Floats | float = 0.0
) -> Floats:
    """Return what the probe reads: it stands half a turn further round the part, and sees the axis from behind."""
    round_deg = STEP_DEG - turned_deg - off_deg - (180.0 if opposite else 0.0)
    axis_um = waves(STEP_DEG, GAUGE)
    off_axis_um = 4.0 * np.cos(np.radians(STEP_DEG - 17.0 * turned_deg))
    return waves(round_deg, PART) + (-axis_um if opposite else axis_um) + off_axis_um + noise


def separation(*placements: Placement, **more: float) -> Separation:
    read = [(STEP_DEG, reading(each.turned_deg, opposite=each.opposite)) for each in placements]
    return separate(read, placements, **more)


def amplitude_um(found: Separation, n: int) -> tuple[float, float]:
    """Return the amplitude of the gauge and its first maximum, deg."""
    (order,) = (each.gauge for each in found.orders if each.gauge.upr == n)
    phase = np.degrees(np.arctan2(order.sine_um, order.cosine_um)) / n % (360.0 / n)
    return float(np.hypot(order.cosine_um, order.sine_um)), float(phase)


def at(*turned_deg: float) -> tuple[Placement, ...]:
    return tuple(Placement(turned_deg=each) for each in turned_deg)


def test_two_placements_at_90_deg_tell_the_gauge_from_the_part_but_of_4_8_and_12() -> None:
    found = separation(*at(0, 90))
    assert found.blind == (4, 8, 12)
    assert [each.gauge.upr for each in found.orders] == [2, 3, 5, 6, 7, 9, 10, 11, 13, 14, 15]
    for n in (2, 3, 7):
        assert amplitude_um(found, n) == pytest.approx(GAUGE[n], abs=0.002)
    (three,) = (each for each in found.orders if each.gauge.upr == 3)
    assert abs(three.part_um) == pytest.approx(27.5, abs=0.002)


def test_a_part_that_was_turned_the_other_way_does_not_lend_its_lobe_to_the_gauge() -> None:
    """By hand, two at 90 deg: the gauge would get sqrt(2) of the lobe of 27.5 um. Three do not fit then."""
    read = [(STEP_DEG, reading(-each)) for each in (0, 90, 40)]
    with pytest.raises(ProfileError) as refused:
        separate(read[:2], at(0, 90))
    (problem,) = refused.value.problems
    assert (problem.code, problem.value, problem.limit) == ("separation.turned_back", "0,90", "0,-90")
    assert amplitude_um(separate(read[:2], at(0, -90)), 3) == pytest.approx(GAUGE[3], abs=0.02)
    assert not any(each.gauge.proven for each in separate(read, at(0, 90, 40)).orders)


@pytest.mark.parametrize(
    ("placements", "blind"),
    [
        (at(0, 180), tuple(range(2, 16, 2))),
        (at(0, 120, 240), (3, 6, 9, 12, 15)),
        (at(*range(0, 360, 45)), (8,)),
        (at(0, 40, 90), ()),
        ((Placement(turned_deg=0), Placement(turned_deg=180, opposite=True)), ()),
    ],
)
def test_what_placements_are_blind_of_is_named_and_the_rest_is_exact(
    placements: tuple[Placement, ...], blind: tuple[int, ...]
) -> None:
    found = separation(*placements)
    assert found.blind == blind
    for n in sorted(GAUGE.keys() - set(blind)):
        assert amplitude_um(found, n) == pytest.approx(GAUGE[n], abs=1e-6)


def test_a_part_turned_by_eye_and_noise_are_in_the_stated_deviation() -> None:
    rng = np.random.default_rng(7)
    off: dict[int, list[tuple[float, float]]] = {2: [], 3: [], 5: []}
    for _ in range(300):
        noisy = [rng.normal(0.0, 0.2, STEP_DEG.size) for _ in range(2)]
        read = [reading(0, noise=noisy[0]), reading(90, off_deg=rng.normal(0.0, 1.0), noise=noisy[1])]
        found = separate([(STEP_DEG, each) for each in read], at(0, 90))
        for n, pairs in off.items():
            (order,) = (each.gauge for each in found.orders if each.gauge.upr == n)
            true_um, phase_deg = GAUGE.get(n, (0.0, 0.0))
            true = true_um * np.exp(1j * np.radians(n * phase_deg))
            pairs.append((abs(complex(order.cosine_um, order.sine_um) - true), order.sd_um))
    for n, found_off in off.items():
        errors, sds = np.array(found_off).T
        within = float(np.mean(errors <= 2.448 * sds))
        assert within >= 0.94, n  # 95 % or more: the scatter is not the same in each direction
        # Not simply large: the root mean square of an error of two components is near the stated one.
        assert 0.6 <= np.sqrt(np.mean(errors**2)) / np.mean(sds) <= 1.5, n


def test_turning_costs_more_the_higher_the_order_and_its_amplitude_are() -> None:
    by_eye, by_table = separation(*at(0, 90)), separation(*at(0, 90), turning_sd_deg=0.05)
    costs = {each.gauge.upr: each.turning_um for each in by_eye.orders}
    # At 2 UPR and 90 deg the halves are exact: S = (M1 + M2) / 2, so n |P| delta / 2.
    assert costs[2] == pytest.approx(2 * 1.5 * np.radians(1.0) / 2, rel=1e-6)
    assert costs[3] == pytest.approx(3 * 27.5 * np.radians(1.0) / np.sqrt(2), rel=1e-6)
    assert by_table.orders[1].turning_um == pytest.approx(0.05 * costs[3])
    assert not by_eye.orders[1].gauge.proven  # 0.5 um beside 1 um: the lobe is in the way


def test_the_error_that_is_taken_off_is_what_is_proven_and_its_drift_is_told() -> None:
    error = separation(*at(0, 90), turning_sd_deg=0.05).error_of("bench", "2026-11-29", "2027-11-29")
    assert [each.upr for each in error.proven if each.upr in GAUGE] == [2, 3, 7]
    expected = waves(STEP_DEG, {n: GAUGE[n] for n in (2, 3, 7)})
    assert error.at_um(STEP_DEG) == pytest.approx(expected, abs=0.01)
    moved = [(STEP_DEG, reading(each) + waves(STEP_DEG, {2: (0.4, 0.0)})) for each in (0, 90)]
    later = separate(moved, at(0, 90), turning_sd_deg=0.05).error_of("bench", "2027-02-01", "2028-02-01")
    assert later.drift_um(error) == {2: pytest.approx(0.4, abs=0.01)}


@pytest.mark.parametrize(
    ("turned", "code"),
    [((0,), "separation.placements"), ((0, 0), "separation.blind"), ((0, 360), "separation.blind")],
)
def test_placements_that_separate_nothing_are_refused(turned: tuple[float, ...], code: str) -> None:
    with pytest.raises(ProfileError) as caught:
        separation(*at(*turned))
    assert caught.value.problems[0].code == code
