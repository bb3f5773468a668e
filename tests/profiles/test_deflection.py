"""Deflections in the chuck: what a dial shows, and what follows from it."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from profiles.calibration.deflection import DeflectionFit, bending_um, contact_um, fit_deflection
from profiles.fingerprint.deflection import deflection_of, places_needed
from profiles.fingerprint.readings import ClampReadings, parse_readings, read_readings, readings_text
from profiles.job import Job
from profiles.problem import ProfileError
from profiles.store import load_job

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


def test_a_figure_that_stands_off_or_alone_is_named() -> None:
    columns = with_noise(FIGURES, 3, 0.5)
    columns["deflection_um"][17] += 6.0
    assert fitted(columns).outliers == (17,)
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


# The deflection of a clamping from readings: what drops out, how sure it is, and what the places do not show.

JAWS_DEG = 40.0  # jaw 1, and the lobe, from the spindle index


def job(jaws: int = 3) -> Job:
    return replace(load_job("lee-2001-experiment-1").job, jaws=jaws, lobe_phase_deg=JAWS_DEG)


def readings(places: Sequence[float], *, jaws: int = 3, sd_um: float = 0.0, seed: int = 1) -> ClampReadings:
    """Return readings of a ring that is pressed in by 30 um at each jaw, on a spindle and in a form of its own."""
    chance = np.random.default_rng(seed)
    angle = np.radians(np.array(places))
    own = 40.0 * np.cos(angle - 1.0) + 9.0 * np.cos(2 * angle + 0.4) + 1.5 * np.sin(3 * angle) + 7.0
    pressed = 30.0 * np.cos(jaws * (angle - math.radians(JAWS_DEG))) + 1.6 * np.cos(
        2 * jaws * (angle - math.radians(JAWS_DEG))
    )
    shifted = 2.0 * np.cos(angle + 2.0) - 3.0
    noise = chance.normal(0.0, sd_um / math.sqrt(2.0), (2, len(places)))
    return ClampReadings(
        angle_deg=tuple(places),
        finger_um=tuple(own + noise[0]),
        full_um=tuple(own - pressed + shifted + noise[1]),
        graduation_um=0.01,
    )


def evenly(count: int) -> list[float]:
    return [360.0 * place / count for place in range(count)]


@pytest.mark.parametrize("jaws", [2, 3, 4, 6])
def test_form_and_spindle_drop_out_and_a_shifted_part_is_once_a_turn(jaws: int) -> None:
    found = deflection_of(readings(evenly(32), jaws=jaws), job(jaws))
    lobe = 30.0 * cmath.exp(-1j * jaws * math.radians(JAWS_DEG))
    assert found.coefficients_um[jaws] == pytest.approx(lobe, abs=1e-9)
    assert abs(found.coefficients_um[2 * jaws]) == pytest.approx(1.6, abs=1e-9)
    assert abs(found.coefficients_um[1]) == pytest.approx(2.0, abs=1e-9)
    assert not found.upright


def test_the_angles_may_count_from_jaw_1_or_backwards_and_the_dial_may_be_upside_down() -> None:
    plain = readings(evenly(16))
    turned = tuple((angle - JAWS_DEG) % 360.0 for angle in plain.angle_deg)
    lobe = deflection_of(plain, job()).coefficients_um[3]
    others = [
        replace(plain, angle_deg=turned, from_jaw_1=True),
        replace(plain, angle_deg=tuple((-angle) % 360.0 for angle in plain.angle_deg), against=True),
        replace(
            plain,
            finger_um=tuple(-r for r in plain.finger_um),
            full_um=tuple(-r for r in plain.full_um),
            inward=True,
        ),
    ]
    for other in others:
        assert deflection_of(other, job()).coefficients_um[3] == pytest.approx(lobe, abs=1e-9)


def test_six_places_show_the_height_alone_or_nothing() -> None:
    found = deflection_of(readings([JAWS_DEG + place for place in evenly(6)]), job())
    assert found.upright
    # The second harmonic is as high between the jaws as at them: the mean takes it.
    assert found.coefficients_um[3] == pytest.approx(30.0 * cmath.exp(-3j * math.radians(JAWS_DEG)), abs=1e-9)
    with pytest.raises(ProfileError) as refused:
        deflection_of(readings([JAWS_DEG + 30.0 + place for place in evenly(6)]), job())
    assert refused.value.problems[0].code == "clamping.dependent"


@pytest.mark.parametrize(("jaws", "count"), [(4, 6), (6, 6), (6, 7), (6, 8)])
def test_places_that_see_no_lobe_beside_an_oval_are_refused_with_a_number(jaws: int, count: int) -> None:
    """Order 2 and the lobe fall together where count - jaws or jaws - count is 2: Nyquist."""
    for first in (JAWS_DEG, JAWS_DEG + 7.0):
        with pytest.raises(ProfileError) as refused:
            deflection_of(readings([first + place for place in evenly(count)], jaws=jaws), job(jaws))
        (problem,) = refused.value.problems
        assert (problem.code, problem.key, problem.limit) == ("clamping.dependent", str(count), f">= {2 * jaws}")


@pytest.mark.parametrize("jaws", [3, 4, 6])
@pytest.mark.parametrize("more", [0, 1, 4])
def test_as_many_places_as_are_asked_for_tell_the_lobe_from_an_oval(jaws: int, more: int) -> None:
    """The oval is (N^2 - 1)^2 / (90 (N - 1)) of the lobe for 10 %: 10.7 um of 30 with three jaws, 82 with six."""
    places = [JAWS_DEG + place for place in evenly(places_needed(jaws) + more)]
    plain = readings(places, jaws=jaws)
    oval_um = 30.0 * (jaws**2 - 1) ** 2 / (90.0 * (jaws - 1))
    oval = oval_um * np.cos(2.0 * np.radians(np.array(places) - JAWS_DEG))
    found = deflection_of(replace(plain, full_um=tuple(np.array(plain.full_um) - oval)), job(jaws))
    lobe = 30.0 * cmath.exp(-1j * jaws * math.radians(JAWS_DEG))
    assert found.coefficients_um[jaws] == pytest.approx(lobe, abs=1.7), "the second harmonic is 1.6 um"
    assert found.upright == (more == 0)


@pytest.mark.long
def test_the_confidence_holds_the_truth_as_often_as_it_says() -> None:
    """Readings drawn with 1 um, of a dial of 1 um: both components within their 95 % in 95 % of 600 clampings."""
    truth, inside = 30.0 * cmath.exp(-3j * math.radians(JAWS_DEG)), []
    for seed in range(600):
        drawn = replace(readings(evenly(12), sd_um=math.sqrt(2.0), seed=seed), graduation_um=1.0)
        found = deflection_of(drawn, job())
        off = found.coefficients_um[3] - truth
        inside += [abs(off.real) <= found.limit_um(3), abs(off.imag) <= found.limit_um(3)]
    # 12 places cannot show the second harmonic: 1.6 um of it is scatter of theirs, which widens the limits.
    assert 0.94 <= np.mean(inside) <= 1.0
    sharp = []
    for seed in range(600):
        found = deflection_of(
            replace(readings(evenly(16), sd_um=math.sqrt(2.0), seed=seed), graduation_um=1.0), job()
        )
        off = found.coefficients_um[3] - truth
        sharp += [abs(off.real) <= found.limit_um(3), abs(off.imag) <= found.limit_um(3)]
    assert 0.93 <= np.mean(sharp) <= 0.975


# The file of indicator readings of a clamping: what it says, and what is refused, with line and column.

HEAD = """\
# fingerprint: 1
# units: um
# angle_zero: spindle index
# direction: spindle
# positive: outward
"""
COLUMNS = "angle_deg,finger_tight_um,full_force_um\n"
ROWS = "".join(f"{angle},{angle / 100:g},-30\n" for angle in range(0, 360, 45))


def refusals(text: str | bytes) -> list[tuple[str, str]]:
    """Return code and place of every refusal of a file."""
    with pytest.raises(ProfileError) as refused:
        parse_readings(text.encode() if isinstance(text, str) else text, "f.csv")
    return [(each.code, each.where) for each in refused.value.problems]


def test_a_file_is_read_as_it_was_written() -> None:
    more = HEAD.replace("spindle index", "jaw 1").replace("outward", "inward")
    more += "# graduation_um: 2\n# finger_force_n: 60\n# note: third shift\n"
    found = parse_readings((more + COLUMNS + ROWS).encode())
    assert found.angle_deg == tuple(range(0, 360, 45))
    assert found.finger_um[2] == 0.9 and set(found.full_um) == {-30.0}
    assert (found.from_jaw_1, found.inward, found.against) == (True, True, False)
    assert (found.graduation_um, found.finger_force_n, found.simulated) == (2.0, 60.0, False)
    assert parse_readings(readings_text(found).encode()) == found


@pytest.mark.parametrize(
    "content", [f"\ufeff{HEAD}\n{COLUMNS}\n{ROWS}\n\n", (HEAD + COLUMNS + ROWS).replace("\n", "\r\n")]
)
def test_editors_may_leave_their_marks(content: str) -> None:
    assert parse_readings(content.encode()).places == 8


@pytest.mark.parametrize(
    ("before", "after", "refused"),
    [
        ("# fingerprint: 1", "# fingerprint: 2", [("clamping.schema", "f.csv:1:16")]),
        ("# units: um", "# units: mm", [("clamping.value", "f.csv:2:10")]),
        ("# units: um\n", "", [("clamping.missing", "f.csv")]),
        ("# units: um", "# unit: um", [("clamping.missing", "f.csv"), ("clamping.unknown_key", "f.csv:2:3")]),
        ("# units: um", "# units: um\n# units: um", [("clamping.meta", "f.csv:3:3")]),
        ("# units: um", "# units: um\n# graduation_um: 0", [("clamping.value", "f.csv:3:18")]),
        ("# units: um", "# units: um\n# graduation_um: nan", [("clamping.value", "f.csv:3:18")]),
        ("full_force_um", "full_um", [("clamping.columns", "f.csv:6:1")]),
        ("90,0.9,-30", "90,0.9", [("clamping.cells", "f.csv:9:7")]),
        ("90,0.9,-30", "90,0.9,-30,4", [("clamping.cells", "f.csv:9:11")]),
        ("90,0.9,-30", "90,0.9,-3x", [("clamping.cell", "f.csv:9:8")]),
        ("90,0.9,-30", "90, 1e3,-30", [("clamping.cell", "f.csv:9:5")]),
        ("90,0.9,-30", "360,0.9,-30", [("clamping.cell", "f.csv:9:1")]),
        ("90,0.9,-30", "90,0.9,5001", [("clamping.cell", "f.csv:9:8")]),
        ("0,0,-30\n45,0.45,-30\n90,0.9,-30\n", "", [("clamping.few_places", "f.csv")]),
        (COLUMNS + ROWS, "", [("clamping.columns", "f.csv")]),
    ],
)
def test_a_mistake_is_refused_with_its_place(before: str, after: str, refused: list[tuple[str, str]]) -> None:
    text = HEAD + COLUMNS + ROWS
    assert before in text
    assert refusals(text.replace(before, after)) == refused


def test_all_mistakes_come_at_once_but_not_by_the_thousand() -> None:
    assert len(refusals(HEAD + COLUMNS + "x,y,z\n" * 1000)) < 30
    assert refusals(b"\xff\xfe\xff") and refusals(b"") and refusals(b"\xff# fingerprint: 1")


def test_a_path_may_name_anything(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.csv"):
        with pytest.raises(ProfileError) as refused:
            read_readings(path)
        assert refused.value.problems[0].code == "clamping.unreadable"
