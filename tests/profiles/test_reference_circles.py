"""Reference circles, and statistics of a process."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.arrays import Floats
from profiles.metrology.circles import CIRCLES, ContactPoint, limacon_circle
from profiles.metrology.geometric import geometric_circle
from profiles.metrology.points import HANDFUL
from profiles.metrology.process_statistics import (
    LEAST_CHART,
    LEAST_PARTS,
    LEAST_TREND,
    capability_below,
    capability_within,
    run_chart,
    trend,
)
from profiles.problem import ProfileError
from profiles.roundness import evaluate


def sample(count: int, mean: float, sd: float) -> Floats:
    """Values with exactly this mean and standard deviation."""
    values = np.random.default_rng(count).normal(size=count)
    values -= values.mean()
    return np.asarray(mean + sd * values / values.std(ddof=1))


def test_the_individuals_chart_is_that_of_the_handbook() -> None:
    """NIST/SEMATECH e-Handbook, 6.3.2.2: flow rates of ten batches."""
    flow = [49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1]
    chart = run_chart(flow)
    assert chart is not None
    assert (round(chart.mean, 2), round(chart.moving_range, 4)) == (50.81, 1.8778)
    assert (round(chart.lower, 4), round(chart.upper, 4)) == (45.8159, 55.8041)
    assert chart.beyond == ()
    outside = run_chart([*flow, 60.0])
    assert outside is not None and outside.beyond == (10,)
    assert run_chart(flow[: LEAST_CHART - 1]) is None


def test_two_limits_give_the_indices_of_the_handbook_and_intervals_by_the_tables() -> None:
    """6.1.6: limits 8 and 20, mean 16, standard deviation 2; chi-square with 29 degrees: 16.047 and 45.722."""
    found = capability_within(sample(30, 16.0, 2.0), 8.0, 20.0)
    assert found is not None and found.cp is not None and found.cp_low is not None and found.cp_high is not None
    assert (round(found.cp, 4), round(found.cpk, 4), found.parts) == (1.0, 0.6667, 30)
    assert found.cp_low == pytest.approx(math.sqrt(16.047 / 29), abs=1e-4)
    assert found.cp_high == pytest.approx(math.sqrt(45.722 / 29), abs=1e-4)
    half = 1.95996 * math.sqrt(1 / (9 * 30) + 0.66667**2 / (2 * 29))
    assert (found.cpk - found.cpk_low, found.cpk_high - found.cpk) == pytest.approx((half, half), abs=1e-4)


@pytest.mark.parametrize(("count", "factor"), [(30, 3.064), (50, 2.862), (100, 2.684)])
def test_one_limit_gives_the_tolerance_factors_of_the_tables(count: int, factor: float) -> None:
    """One-sided normal tolerance limits, 95 % confidence that 99 % lie below (Owen): z = 2.3263 is the bound."""
    found = capability_below(sample(count, 0.0, 1.0), upper=factor, confidence=0.90)
    assert found is not None and found.cpk == pytest.approx(factor / 3.0)
    assert found.cpk_low == pytest.approx(2.3263 / 3.0, abs=3e-4)
    assert found.cp is None


@pytest.mark.parametrize("upper", [-2.0, 0.0, 0.5, 4.0, 40.0])
def test_the_interval_of_one_limit_is_that_of_the_noncentral_t(upper: float) -> None:
    from scipy.stats import nct

    found = capability_below(sample(40, 0.0, 1.0), upper)
    assert found is not None and found.cpk_low < found.cpk < found.cpk_high
    root = math.sqrt(40)
    for bound, probability in ((found.cpk_low, 0.975), (found.cpk_high, 0.025)):
        # Mirrored, which is the same: for negative values the function fails.
        side, above = (1.0, probability) if upper >= 0.0 else (-1.0, 1.0 - probability)
        assert nct.cdf(side * upper * root, 39, side * 3.0 * bound * root) == pytest.approx(above, abs=1e-6)


def test_an_interval_holds_the_truth_and_of_few_parts_none_is_claimed() -> None:
    few, same = sample(LEAST_PARTS - 1, 1.0, 0.1), np.ones(LEAST_PARTS)
    for values in (few, same):
        assert capability_below(values, 5.0) is None
        assert capability_within(values, 0.0, 5.0) is None
    # Of 400 processes with Cpk 1.2, 19 of 20 within, give or take what chance may do (3 sd of a binomial).
    random = np.random.default_rng(7)
    inside = 0
    for _ in range(400):
        found = capability_below(random.normal(0.0, 1.0, 30), 3.6)
        assert found is not None
        inside += found.cpk_low <= 1.2 <= found.cpk_high
    assert abs(inside / 400 - 0.95) < 3.0 * math.sqrt(0.95 * 0.05 / 400)


def test_a_trend_is_that_of_linear_regression() -> None:
    from scipy.stats import linregress, t

    values = 0.3 * np.arange(12) + np.random.default_rng(3).normal(size=12)
    found, other = trend(values), linregress(np.arange(12), values)
    assert found is not None and found.significant
    assert found.per_part == pytest.approx(other.slope)
    assert found.half_width == pytest.approx(t.ppf(0.975, 10) * other.stderr)
    flat = trend([1.0, 3.0, 2.0, 3.0, 1.0])
    assert flat is not None and flat.per_part == pytest.approx(0.0) and not flat.significant
    assert trend(values[: LEAST_TREND - 1]) is None


@pytest.mark.parametrize("values", [[[1.0, 2.0]], [1.0, math.nan], [1.0, math.inf]])
def test_what_is_no_row_of_numbers_is_refused(values: list[float]) -> None:
    with pytest.raises(ValueError, match="finite"):
        run_chart(values)


# The four reference circles against published numbers, a plain linear programme, and what must always hold.

ANGLE = np.arange(3600) / 10
THETA = np.radians(ANGLE)
LOBES = 27.5 * np.sin(3 * THETA)
EIGHT = [0.0, 3.0, 1.0, -2.0, 4.0, -1.0, 2.0, -3.0]


def programmed_um(kind: str, angle_deg: Floats, deviation_um: Floats) -> float:
    """What the circle optimises, by the plain linear programme over all points: zone, or radius."""
    from scipy.optimize import linprog

    theta = np.radians(angle_deg)
    x, y, one, none = np.cos(theta), np.sin(theta), np.ones(theta.size), np.zeros(theta.size)
    outer, inner = np.column_stack((-x, -y, -one, none)), np.column_stack((x, y, none, one))
    rows, limits, cost = {
        "MZC": (np.vstack((outer, inner)), np.concatenate((-deviation_um, deviation_um)), [0, 0, 1, -1]),
        "MCC": (outer, -deviation_um, [0, 0, 1, 0]),
        "MIC": (inner, deviation_um, [0, 0, 0, -1]),
    }[kind]
    tight = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    bounds = [(None, None)] * 3 + [(None, None) if kind != "MCC" else (0, 0)]
    if kind == "MIC":
        bounds[2] = (0, 0)
    found = linprog(cost, A_ub=rows, b_ub=limits, bounds=bounds, method="highs", options=tight)
    assert found.success
    return float(found.fun if kind != "MIC" else -found.fun)


def least_ront_um(kind: str, angle_deg: Floats, deviation_um: Floats) -> float:
    """The least RONt of all circles with the best radius, by a second plain programme over the best places."""
    from scipy.optimize import linprog

    theta, sign = np.radians(angle_deg), 1.0 if kind == "MCC" else -1.0
    radius_um = programmed_um(kind, angle_deg, deviation_um)
    turned = np.column_stack((np.cos(theta), np.sin(theta)))
    held = np.column_stack((-sign * turned, np.zeros(theta.size)))
    within = np.column_stack((sign * turned, -np.ones(theta.size)))
    left = sign * (radius_um - deviation_um)
    tight = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    found = linprog(
        [0, 0, 1],
        A_ub=np.vstack((held, within)),
        b_ub=np.concatenate((left + 1e-9, -left)),
        bounds=(None, None),
        method="highs",
        options=tight,
    )
    assert found.success
    return float(found.x[2])


def alternating(contacts: tuple[ContactPoint, ...]) -> bool:
    sides = [contact.outer for contact in contacts]
    return len(sides) == 4 and all(a is not b for a, b in itertools.pairwise(sides))


@pytest.mark.parametrize("offset", [(0.0, 0.0), (12.0, -7.0)])
@pytest.mark.parametrize("kind", CIRCLES)
def test_three_lobes_are_55_um_by_any_circle(kind: str, offset: tuple[float, float]) -> None:
    circle = limacon_circle(kind, ANGLE, LOBES + offset[0] * np.cos(THETA) + offset[1] * np.sin(THETA))
    assert circle.ront_um == pytest.approx(55, abs=1e-9)
    assert (circle.centre_x_um, circle.centre_y_um) == pytest.approx(offset, abs=1e-9)
    radius_um = {"MCC": 27.5, "MIC": -27.5}.get(kind, 0.0)
    assert circle.deviation_um == pytest.approx(radius_um, abs=1e-9)
    assert (circle.ronp_um, circle.ronv_um) == pytest.approx((27.5 - radius_um, 27.5 + radius_um), abs=1e-9)


@pytest.mark.parametrize(
    ("kind", "ront_um", "x_um", "y_um"),
    [
        ("LSC", 6.310660, -0.469670, 0.633883),
        ("MZC", 5.878680, -0.621320, 0.085786),
        ("MCC", 6.414214, -1.0, 1.0),
        ("MIC", 7.0, -1.414214, -0.707107),
    ],
)
def test_eight_points(kind: str, ront_um: float, x_um: float, y_um: float) -> None:
    circle = limacon_circle(kind, np.arange(8) * 45, EIGHT)
    assert (circle.ront_um, circle.centre_x_um, circle.centre_y_um) == pytest.approx(
        (ront_um, x_um, y_um), abs=1e-6
    )
    if kind == "MZC":
        assert alternating(circle.contacts)


def test_four_circles_rest_on_their_points() -> None:
    result = evaluate(np.arange(8) * 45, EIGHT, None)
    assert [circle.kind for circle in result.circles] == list(CIRCLES)
    assert result.circle("LSC").ront_um == pytest.approx(result.ront_um, abs=1e-12)
    assert result.circle("MZC").centre_y_um == pytest.approx(0.085786, abs=1e-6)
    rough = LOBES + np.random.default_rng(7).normal(0, 1, 3600) + 30 * np.cos(THETA)
    zone = limacon_circle("MZC", ANGLE, rough)
    assert alternating(zone.contacts)
    assert zone.ront_um == pytest.approx(programmed_um("MZC", ANGLE, rough), abs=1e-9)
    left = rough - zone.centre_x_um * np.cos(THETA) - zone.centre_y_um * np.sin(THETA)
    for contact in zone.contacts:
        assert left[contact.index] == pytest.approx(left.max() if contact.outer else left.min(), abs=1e-9)


ROUGH = st.floats(-100, 100)
FEW_VALUES = st.sampled_from([-1.0, 0.0, 1.0])
PROFILES = st.one_of(
    st.lists(ROUGH, min_size=8, max_size=60),
    st.lists(FEW_VALUES, min_size=8, max_size=60),
    st.integers(8, 60).map(lambda size: [3.0] * size),
)


@given(PROFILES, st.sampled_from([1, 2, 3]), st.booleans())
def test_each_circle_is_the_optimum_of_a_programme(values: list[float], turns: int, eccentric: bool) -> None:
    """Degenerate profiles too: exact circles, few distinct values, several points at one angle."""
    deviation = np.array(values * turns)
    angle = np.tile(np.arange(len(values)) * 360 / len(values), turns)
    deviation += np.repeat(np.arange(turns) * 0.5, len(values))
    if eccentric:
        deviation += 40 * np.cos(np.radians(angle))
    zone, circumscribed, inscribed = (limacon_circle(kind, angle, deviation) for kind in CIRCLES[1:])
    assert zone.ront_um == pytest.approx(programmed_um("MZC", angle, deviation), abs=1e-9)
    assert circumscribed.deviation_um == pytest.approx(programmed_um("MCC", angle, deviation), abs=1e-9)
    assert inscribed.deviation_um == pytest.approx(programmed_um("MIC", angle, deviation), abs=1e-9)
    if len({contact.angle_deg for contact in zone.contacts}) == 4:
        assert alternating(zone.contacts)


@given(st.lists(ROUGH, min_size=16, max_size=64), st.floats(-50, 50), st.floats(0, 360), st.floats(0.01, 100))
def test_no_circle_minds_centre_or_start(values: list[float], x: float, start: float, factor: float) -> None:
    deviation = np.array(values)
    angle = np.arange(deviation.size) * 360 / deviation.size
    moved = factor * deviation + 5 + x * np.cos(np.radians(angle)) - x * np.sin(np.radians(angle))
    for kind in CIRCLES:
        plain, turned = limacon_circle(kind, angle, deviation), limacon_circle(kind, angle + start, moved)
        assert turned.ront_um == pytest.approx(factor * plain.ront_um, abs=1e-8, rel=1e-11)
        if kind in ("MCC", "MIC"):
            assert turned.deviation_um == pytest.approx(5 + factor * plain.deviation_um, abs=1e-8, rel=1e-11)


STARTS_DEG = [0.0, 0.013, 90.0, 211.7777]


@pytest.mark.parametrize("start_deg", STARTS_DEG)
@pytest.mark.parametrize("radius_mm", [None, 26.0])
def test_an_oval_is_55_um_about_its_middle_wherever_it_starts(radius_mm: float | None, start_deg: float) -> None:
    """Two opposite crests hold a circle across their line only: along it the middle is chosen, by any circle."""
    for offset in (0.0, 12.0):
        oval = 27.5 * np.cos(2 * THETA) + (offset * np.cos(THETA) if radius_mm is None else 0.0)
        result = evaluate(ANGLE + start_deg, oval, None, radius_mm=radius_mm)
        assert [circle.ront_um for circle in result.circles] == pytest.approx([55] * 4, abs=1e-9)
        centre = (offset * np.cos(np.radians(start_deg)), offset * np.sin(np.radians(start_deg)))
        for circle in result.circles if radius_mm is None else ():
            assert (circle.centre_x_um, circle.centre_y_um) == pytest.approx(centre, abs=1e-9)


def test_half_a_turn_and_a_sliding_circle() -> None:
    """Two crests opposite each other on a part that is round otherwise: RONt is the same over a whole stretch."""
    deviation = np.zeros(40)
    deviation[[0, 20]] = 10.0
    circle = limacon_circle("MCC", np.arange(40) * 9.0, deviation)
    assert (circle.deviation_um, circle.ront_um) == pytest.approx((10, 10), abs=1e-12)
    assert (circle.centre_x_um, circle.centre_y_um) == pytest.approx((0, 0), abs=1e-12)
    for kind in CIRCLES:
        with pytest.raises(ProfileError) as caught:
            limacon_circle(kind, np.arange(180), np.zeros(180))
        assert caught.value.problems[0].code == "trace.narrow_angles"


@given(
    st.one_of(
        st.lists(st.floats(-100, 100), min_size=HANDFUL, max_size=48),
        st.lists(st.sampled_from([-2.0, -1.0, 0.0, 1.0, 2.0]), min_size=HANDFUL, max_size=40),
    ).filter(lambda values: len(values) % 2 == 0),
    st.sampled_from(["MCC", "MIC"]),
)
def test_of_all_circles_as_good_a_profile_has_one_with_the_least_ront(values: list[float], kind: str) -> None:
    angle, deviation = np.arange(len(values)) * 360 / len(values), np.array(values)
    circle = limacon_circle(kind, angle, deviation)
    assert circle.ront_um == pytest.approx(least_ront_um(kind, angle, deviation), abs=1e-6)


@pytest.mark.parametrize("size", [72, 720])
def test_the_inscribed_circle_in_the_plane_turns_with_the_part(size: int) -> None:
    angle, noise = np.arange(size) * 360 / size, np.random.default_rng(size).normal(0, 3, size)
    radius = 26_000 + 10 * np.cos(3 * np.radians(angle)) + noise
    met = []
    for start_deg in STARTS_DEG:
        theta = np.radians(angle + start_deg)
        circle = geometric_circle("MIC", 300 + radius * np.cos(theta), radius * np.sin(theta) - 100)
        met.append((circle.deviation_um, circle.ront_um))
    np.testing.assert_allclose(met, [met[0]] * len(met), rtol=0, atol=1e-8)


@pytest.mark.parametrize(("radius_um", "lobe_um"), [(26_000.0, 27.5), (26_000.0, 900.0), (1000.0, 40.0)])
def test_a_gap_is_judged_from_the_axis_not_from_where_a_search_begins(radius_um: float, lobe_um: float) -> None:
    """Sixty degrees are not measured, which is allowed; the search for a circle sees more from other places."""
    from scipy.optimize import minimize

    angle = np.arange(60.0, 360.1, 4.0)
    theta, lobes = np.radians(angle), lobe_um * np.cos(3 * np.radians(angle))
    x, y = (radius_um + lobes) * np.cos(theta), (radius_um + lobes) * np.sin(theta)
    found = evaluate(angle, lobes, None, radius_mm=radius_um / 1000.0)
    place = found.circle("MIC")
    inscribed_um = float(np.hypot(x - place.centre_x_um, y - place.centre_y_um).min())

    def reaches(centre: Floats) -> float:
        outside = np.hypot(*centre) > radius_um / 2
        return 0.0 if outside else -float(np.hypot(x - centre[0], y - centre[1]).min())

    precise = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000, "maxfev": 8000}
    starts = [(a, b) for a in (-lobe_um, 0.0, lobe_um) for b in (-lobe_um, 0.0, lobe_um)]
    best_um = -min(minimize(reaches, s, method="Nelder-Mead", options=precise).fun for s in starts)
    assert inscribed_um >= best_um - 2e-3  # circles within 1e-3 um of the largest are as good
    assert found.circle("MZC").ront_um <= min(circle.ront_um for circle in found.circles) + 1e-9


def test_points_in_the_plane_by_another_method() -> None:
    """Against a direct search (Nelder-Mead) for the same objectives, of an oval part a third off its axis.

    Least squares are those of the angles that the points stand for, about the centre that is found.
    """
    from scipy.optimize import minimize

    random = np.random.default_rng(11)
    angle = np.sort(random.uniform(0, 2 * np.pi, 90))
    radius = 10_000 + 900 * np.cos(2 * angle) + random.normal(0, 60, 90)
    x, y = 3000 + radius * np.cos(angle), -2000 + radius * np.sin(angle)

    def distances(centre: Floats) -> Floats:
        return np.asarray(np.hypot(x - centre[0], y - centre[1]))

    def mean(centre: Floats) -> float:
        return float(np.average(distances(centre), weights=stood))

    found = geometric_circle("LSC", x, y)
    about = np.unwrap(np.arctan2(y - found.centre_y_um, x - found.centre_x_um))
    around = np.concatenate(([about[-1] - 2 * np.pi], about, [about[0] + 2 * np.pi]))
    stood = around[2:] - around[:-2]
    objectives: dict[str, Callable[[Floats], float]] = {
        "LSC": lambda c: float(np.sqrt(np.average(distances(c) ** 2, weights=stood) - mean(c) ** 2)),
        "MZC": lambda c: float(np.ptp(distances(c))),
        "MCC": lambda c: float(distances(c).max()),
        "MIC": lambda c: -float(distances(c).min()),
    }
    precise = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000, "maxfev": 8000}
    for kind, objective in objectives.items():
        circle = geometric_circle(kind, x, y)
        starts = [(3000 + a, -2000 + b) for a in (-700, 0, 700) for b in (-100, 100)]
        best = min(minimize(objective, s, method="Nelder-Mead", options=precise).fun for s in starts)
        assert objective(np.array([circle.centre_x_um, circle.centre_y_um])) <= best + 1e-6, kind
        assert circle.ront_um == pytest.approx(
            float(np.ptp(distances(np.array([circle.centre_x_um, circle.centre_y_um])))), abs=1e-6
        )


@pytest.mark.parametrize("kind", CIRCLES)
def test_an_exact_circle_in_the_plane(kind: str) -> None:
    circle = geometric_circle(kind, 7e5 + 26_000 * np.cos(THETA[::10]), -3e5 + 26_000 * np.sin(THETA[::10]))
    assert (circle.centre_x_um, circle.centre_y_um) == pytest.approx((7e5, -3e5), abs=1e-6)
    assert (circle.deviation_um, circle.ront_um) == pytest.approx((26_000, 0), abs=1e-6)
