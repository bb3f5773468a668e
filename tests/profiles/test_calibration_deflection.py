"""Stiffness from deflections: the contact model against solved cases, and what was put in comes out again."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from profiles.calibration.deflection import DeflectionFit, bending_um, contact_um, fit_deflection
from profiles.problem import ProfileError

Floats = NDArray[np.float64]
ROUND = tuple(range(0, 360, 30))
K, ALPHA, LENGTH, STEEL = 50.0, 0.5, 40.0, 206.0


def contacts(force: float, load: float, overhang: float = 0.0, alpha: float = ALPHA) -> Floats:
    """Toward a jaw, and between two, with k = 50 N/um held."""
    return contact_um(
        K,
        alpha,
        LENGTH,
        jaws=3,
        force_per_jaw_n=force,
        load_n=load,
        past_jaw_deg=np.array([0.0, 60.0]),
        overhang_mm=overhang,
    )


@pytest.mark.parametrize(
    ("force", "load", "alpha", "toward", "between"),
    [(1000, 150, 0.5, 1.9756, 2.0256), (3000, 150, 0.5, 1.9917, 2.0084), (1000, 150, 1 / 3, 1.9838, 2.0172)],
)
def test_a_ring_of_jaws(force: float, load: float, alpha: float, toward: float, between: float) -> None:
    # The load between two rings that carry half each: P of the case is the load of one whole chuck.
    assert contacts(force, load / 2, alpha=alpha) == pytest.approx([toward, between], abs=2e-4)


@pytest.mark.parametrize(
    ("force", "load", "overhang", "share"),
    [
        (2198, 700, 25, 0.146),
        (2198, 700, 50, 0.161),
        (2198, 700, 75, 0.175),
        (2198, 700, 125, 0.200),
        (2198, 150, 125, 0.034),
        (2198, 400, 125, 0.098),
        (1026, 150, 125, 0.076),
    ],
)
def test_anisotropy_grows_with_overhang_and_load(force: float, load: float, overhang: float, share: float) -> None:
    toward, between = contacts(force, load, overhang)
    assert (between - toward) / (0.5 * (between + toward)) == pytest.approx(share, abs=0.0015)


@pytest.mark.parametrize(
    ("d", "load", "um"), [(35, 150, 6.436), (65, 200, 0.721), (65, 400, 1.443), (68, 700, 2.108)]
)
def test_a_bar_bends(d: float, load: float, um: float) -> None:
    assert bending_um(load, 125.0, d, STEEL) == pytest.approx(um, abs=6e-4)


def table(
    forces: tuple[float, ...], loads: tuple[float, ...], angles: tuple[float, ...], overhangs: tuple[float, ...]
) -> dict[str, Floats]:
    """Deflections of a bar of 65 mm as the model has them, without noise; forces are totals."""
    force, load, angle, overhang = np.array(list(product(forces, loads, angles, overhangs)), dtype=np.float64).T
    contact = contact_um(
        K * (force / 3 / 1000.0) ** ALPHA,
        ALPHA,
        LENGTH,
        jaws=3,
        force_per_jaw_n=force / 3,
        load_n=load,
        past_jaw_deg=angle,
        overhang_mm=overhang,
    )
    sizes = {"chucking_force_n": force, "load_n": load, "angle_deg": angle, "overhang_mm": overhang}
    bending = bending_um(load, overhang, 65.0, STEEL)
    return {**sizes, "diameter_mm": np.full(force.size, 65.0), "deflection_um": contact + bending}


FEW = table((3077.0, 6593.0), (150.0, 400.0), (0.0, 30.0, 60.0), (50.0, 125.0))
FIGURES = table((3077.0, 6593.0), (150.0, 400.0), ROUND, (50.0, 125.0))


def fitted(columns: dict[str, Floats], jaw_length_mm: float | None = None, youngs: float = STEEL) -> DeflectionFit:
    return fit_deflection(columns, jaws=3, youngs_gpa=youngs, jaw_length_mm=jaw_length_mm)


def refused(columns: dict[str, Floats], **known: float) -> tuple[str, str]:
    with pytest.raises(ProfileError) as caught:
        fitted(columns, **known)
    return caught.value.problems[0].code, caught.value.problems[0].key


def with_noise(columns: dict[str, Floats], seed: int, sd_um: float) -> dict[str, Floats]:
    noise = np.random.default_rng(seed).normal(0.0, sd_um, columns["deflection_um"].size)
    return {**columns, "deflection_um": columns["deflection_um"] + noise}


def test_what_was_put_in_comes_out() -> None:
    fit = fitted(FIGURES)
    assert fit.stiffness_n_per_um == pytest.approx(K, rel=1e-6)
    assert (fit.alpha, fit.jaw_length_mm) == pytest.approx((ALPHA, LENGTH), rel=1e-6)
    seen = fit.anisotropy(chucking_force_n=3077.0, load_n=400.0, overhang_mm=125.0, diameter_mm=65.0)
    rows = [FIGURES["deflection_um"][(FIGURES["chucking_force_n"] == 3077.0) & (FIGURES["load_n"] == 400.0)][1::2]]
    assert seen.pp_um == pytest.approx(np.ptp(rows), rel=1e-6)


@pytest.mark.long
def test_with_noise_the_truth_is_within_the_confidence() -> None:
    fits = [fitted(with_noise(FIGURES, seed, 1.0)) for seed in range(10)]
    held = [
        (
            abs(fit.stiffness_n_per_um - K) < 1.5 * fit.stiffness_ci,
            abs(fit.alpha - ALPHA) < 1.5 * fit.alpha_ci,
            abs(fit.jaw_length_mm - LENGTH) < 1.5 * fit.jaw_length_ci,
        )
        for fit in fits
    ]
    assert np.mean(held) > 0.94  # 1.5 half-widths hold 99.7 %
    assert np.mean([fit.sd_um for fit in fits]) == pytest.approx(1.0, rel=0.07)
    scatter = np.std([fit.alpha for fit in fits], ddof=1)
    assert np.mean([fit.alpha_ci for fit in fits]) == pytest.approx(2.0 * scatter, rel=0.6)


@pytest.mark.long
def test_the_confidence_holds_where_the_scatter_grows_with_the_deflection() -> None:
    """5 % of each deflection, 20 tables: with the same scatter everywhere three of four would hold it."""
    rng, true_um = np.random.default_rng(1), FEW["deflection_um"]
    held = []
    for _ in range(20):
        measured = true_um * (1.0 + 0.05 * rng.normal(0.0, 1.0, true_um.size))
        fit = fitted({**FEW, "deflection_um": measured}, LENGTH)
        held.append([abs(fit.stiffness_n_per_um - K) < fit.stiffness_ci, abs(fit.alpha - ALPHA) < fit.alpha_ci])
    assert np.mean(held) > 0.846  # 95 %, less three sd of a share of 40


def test_a_measurement_that_stands_off_is_named() -> None:
    columns = with_noise(FIGURES, 3, 0.5)
    columns["deflection_um"][17] += 6.0
    assert fitted(columns).outliers == (17,)


def test_one_figure_alone_needs_the_length_of_the_jaws() -> None:
    one = table((3077.0,), (150.0,), ROUND, (125.0,))
    assert refused(one) == ("calibration.dependent", "overhang_mm")
    assert fitted(one, LENGTH).alpha == pytest.approx(ALPHA, rel=1e-4)
    assert fitted(one, LENGTH).jaw_length_ci == 0.0


def test_what_cannot_be_fitted_is_refused_with_what_to_vary() -> None:
    straight = table((3077.0,), (150.0,), (0.0,), (25.0, 75.0, 125.0)) | {}
    assert refused({key: np.tile(column, 2) for key, column in straight.items()})[0] == "calibration.dependent"
    assert refused(straight)[0] == "calibration.few_points"
    assert refused(FIGURES, youngs=0.3)[0] == "calibration.bending"
    assert refused(FIGURES, youngs=0.0) == ("calibration.not_positive", "youngs_modulus_gpa")
    assert refused({**FIGURES, "load_n": -FIGURES["load_n"]}) == ("calibration.not_positive", "load_n")
    inverse = {
        **FIGURES,
        "angle_deg": FIGURES["angle_deg"] + 60.0,
    }  # stiffest between the jaws: no contact does that
    inverse["deflection_um"] = np.where(FIGURES["chucking_force_n"] > 5000, 4.0, 1.0) * inverse["deflection_um"]
    assert refused(inverse, jaw_length_mm=LENGTH) == ("calibration.no_alpha", "alpha")
    with pytest.raises(ProfileError):
        fit_deflection(FIGURES, jaws=2, youngs_gpa=STEEL)
