"""What of a trim goes into the table: with two jaws an oval blank trims the lobe, at another angle each time."""

from __future__ import annotations

import numpy as np
import pytest

from console.session.learning.learning import TrimFolding


def test_with_three_jaws_all_of_a_trim_goes_into_the_table() -> None:
    folding = TrimFolding(3)
    assert [folding.change(2.0 + 1j, 0.5j) for _ in range(3)] == [2.0 + 1j] * 3
    assert folding.fraction == 1.0


def needs(chance: np.random.Generator, parts: int) -> list[complex]:
    """Return what parts need whose blanks are oval by 6 um at any angle, beside 1 um that repeats."""
    return [1.0 + 6.0 * complex(np.exp(2j * np.pi * chance.uniform())) for _ in range(parts)]


def trims(folding: TrimFolding, needed: list[complex]) -> list[float]:
    """Return the trim of each part, which makes up for what its table does not have."""
    table, found = 0j, []
    for need in needed:
        trim = need - table
        found.append(abs(trim))
        table += folding.change(trim, 0j)
    return found


def test_with_two_jaws_the_trim_of_a_blank_is_not_on_the_next_part() -> None:
    chance = np.random.default_rng(3)
    rows = [needs(chance, 6) for _ in range(300)]
    two = np.array([trims(TrimFolding(2), row) for row in rows])
    all_of_it = np.array([trims(TrimFolding(3), row) for row in rows])
    # A table with the whole trim before: the difference of two blanks, sqrt(2) of one; beyond 8 um for many.
    assert np.mean(all_of_it[:, 1:] > 8.0) > 0.4
    assert np.mean(two[:, 1:] > 8.0) < 0.05
    assert np.sqrt(np.mean(two[:, 1:] ** 2)) < 1.08 * 6.1


def test_with_two_jaws_what_repeats_comes_into_the_table() -> None:
    folding, table = TrimFolding(2), 0j
    for _ in range(36):
        table += folding.change(5.0 - table, 0j)
    assert table == pytest.approx(5.0 * 36 / 40)
    assert folding.fraction == pytest.approx(1 / 37)
