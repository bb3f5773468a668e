"""What an order teaches: the gain against the best filter, what repeats against what does not, and the promise."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from profiles.compensations.certificate import Follows, Standing, promised_orders
from profiles.compensations.learning import REPEATS_SD_UM
from profiles.compensations.optimal_gain import Scatter, optimal_gain, repeats
from profiles.compensations.order_steps import OrderRules, OrderSeen, order_steps


def test_without_changes_of_the_lathe_the_gains_make_the_mean_of_all_parts() -> None:
    known_nothing, scatter_um = 1e6, 50.0  # beside which 0.1 um from part to part is nothing
    gains = [optimal_gain(Scatter(prior_um=known_nothing, part_um=scatter_um), k * [1.0]) for k in range(5)]
    assert gains == pytest.approx([1.0, 1 / 2, 1 / 3, 1 / 4, 1 / 5], rel=1e-4)


def test_in_the_long_run_the_gain_is_that_of_the_riccati_equation() -> None:
    from scipy.linalg import solve_discrete_are

    part_um = 1.5
    scatter = Scatter(prior_um=5.0, part_um=part_um)
    wander, noise = REPEATS_SD_UM**2, part_um**2 + REPEATS_SD_UM**2
    before = float(solve_discrete_are([[1.0]], [[1.0]], [[wander]], [[noise]])[0, 0])
    assert optimal_gain(scatter, 500 * [1.0]) == pytest.approx(before / (before + noise), rel=1e-3)


def test_on_a_wrench_that_scatters_later_parts_are_better_than_with_a_fixed_gain() -> None:
    """Many rows of ten parts: with 0.7 a part keeps 1 + 0.7 / 1.3 of the variance, with the optimal gain 1.1."""
    rng, rows, scatter_um = np.random.default_rng(8), 4000, 1.65
    lobe = rng.normal(0.0, 4.7, rows)  # what the job does not know of it
    left = {}
    for name in ("fixed", "optimal"):
        path = np.zeros(rows)
        for part in range(10):
            error = lobe + rng.normal(0.0, scatter_um, rows) - path
            optimal = optimal_gain(Scatter(prior_um=4.7, part_um=scatter_um), part * [0.0])
            path = path + (optimal if name == "optimal" else 0.7 if part else 1.0) * error
        left[name] = float(np.std(lobe + rng.normal(0.0, scatter_um, rows) - path)) / scatter_um
    assert left["fixed"] == pytest.approx(math.sqrt(2.0 / 1.3), rel=0.04)
    assert left["optimal"] == pytest.approx(math.sqrt(1.1), rel=0.04)


def test_an_error_beyond_all_that_was_expected_is_learned_at_once() -> None:
    scatter = Scatter(prior_um=5.0, part_um=1.0)
    assert optimal_gain(scatter, 20 * [0.1], 2.0) < 0.2
    assert optimal_gain(scatter, 20 * [0.1], 15.0) > 0.95, "the chuck was changed"


@pytest.mark.parametrize("parts", [2, 3, 6])
def test_what_repeats_is_judged_by_fishers_f(parts: int) -> None:
    """Of random numbers without a mean one row in twenty seems to repeat; of jaws with some noise nearly all."""
    from scipy.stats import f as fisher

    rng, rows = np.random.default_rng(parts), 2000
    random = rng.normal(0.0, 2.0, (rows, parts)) + 1j * rng.normal(0.0, 2.0, (rows, parts))
    by_chance = sum(repeats(list(row)) for row in random) / rows
    assert by_chance == pytest.approx(0.05, abs=0.02)
    own = sum(
        count * abs(row.mean()) ** 2 / (row.var(ddof=1) + REPEATS_SD_UM**2) > fisher.ppf(0.95, 2, 2 * (count - 1))
        for row in random
        for count in (parts,)
    )
    assert own / rows == by_chance
    assert sum(repeats(list(4.0 + 0.1 * row)) for row in random) / rows > 0.95
    assert not repeats([4.0 + 0j])


def nominal(spread: float) -> Follows:
    return Follows(response=0.5 + 0j, spread=spread)


def rules(**changes: object) -> OrderRules:
    usual = {
        "lobes": 3,
        "lobe_um": 27.5,
        "scatter": 0.06,
        "chucked": frozenset({3, 6, 9}),
        "frozen": frozenset(),
        "gain": None,
        "follows": lambda _: nominal(0.2),
    }
    return OrderRules(**{**usual, **changes})  # type: ignore[arg-type]


def oval(shown: list[complex], path: complex = 0j) -> OrderSeen:
    return OrderSeen(order=2, error_um=shown[-1] - path, sd_um=0.02, path_um=path, shown_um=shown, steps_um=[])


def test_an_oval_is_learned_from_the_second_part_on_that_shows_the_same_one() -> None:
    once, again = 4.0 + 1j, 4.1 + 1.1j
    (first,) = order_steps([oval([once])], rules()).certificate
    assert (first.standing, first.left_um) == (Standing.ONE_PART, abs(once))
    both = order_steps([oval([once, again])], rules())
    assert both.learned == (2,)
    assert both.changes_um[2] == pytest.approx(again, rel=0.1)


def test_an_oval_at_another_angle_each_time_is_not_learned_and_leaves_the_path_where_it_was() -> None:
    ovals = [3.0 * cmath.exp(1j * angle) for angle in (0.3, 2.9, 5.0)]
    found = order_steps([oval(ovals)], rules())
    assert (found.certificate[0].standing, found.changes_um) == (Standing.VARIES, {})
    assert order_steps([oval(ovals, path=2.5 + 0j)], rules()).changes_um == {2: -2.5}


def test_the_noise_of_the_trace_and_a_frozen_order_teach_nothing() -> None:
    quiet = OrderSeen(order=6, error_um=0.04j, sd_um=0.02, path_um=0j)
    loud = OrderSeen(order=9, error_um=3j, sd_um=0.02, path_um=1j)
    found = order_steps([quiet, loud], rules(frozen=frozenset({9})))
    assert [each.standing for each in found.certificate] == [Standing.NOISE, Standing.GREW]
    assert found.changes_um == {}


def test_no_tool_within_its_disc_and_no_cut_leaves_more_than_the_bound() -> None:
    """Tools anywhere in the disc, and from 0.8 to all of their motion in the surface, many at the ends."""
    rng = np.random.default_rng(2)
    seen = OrderSeen(order=6, error_um=2.0 + 0j, sd_um=0.02, path_um=0j)
    for spread in (0.1, 0.5, 0.9):
        for gain in (1.0, 0.7, 0.2):
            steps = order_steps([seen], rules(gain=gain, follows=lambda _, r=spread: nominal(r)))
            (one,) = steps.certificate
            true = 1.0 + spread * np.sqrt(rng.uniform(size=500)) * np.exp(2j * np.pi * rng.uniform(size=500))
            arrives = np.clip(rng.uniform(0.7, 1.1, size=500), 0.8, 1.0)
            worst = float(np.abs(1.0 - gain * arrives * true).max())
            assert worst <= one.bound
            assert worst == pytest.approx(one.bound, abs=0.1)


def test_the_orders_end_before_the_first_that_has_no_promise() -> None:
    def follows(order: int) -> Follows:
        return Follows(response=complex(1.0 / order), spread=0.08 * order)

    assert promised_orders(follows, 0.05) == tuple(range(2, 12))
    assert promised_orders(follows, 0.15) == tuple(range(2, 7)), "what the tool hardly follows is not commanded"
