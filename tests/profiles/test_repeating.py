"""Which orders of a row of parts repeat, whatever was learned of them meanwhile."""

from __future__ import annotations

import numpy as np
import pytest

from profiles.compensations.learning import coefficient_of
from profiles.compensations.order_steps import Repeating
from profiles.compensations.path import CutPath, LobedPath

WANTED = LobedPath(mean_um=100.0, amplitude_um=27.5, lobes=3, phase_deg=90.0)
BEGUN = CutPath(target=WANTED.plus({2: 1.0 + 0j}), command=WANTED.plus({2: 1.5 + 0j, 5: 0.3j}))


def seen(order: int, *parts_um: complex) -> Repeating:
    found = Repeating(begun=BEGUN)
    for each in parts_um:
        found = found.seen({order: each})
    return found


def test_an_order_has_to_stand_out_of_its_scatter_over_three_parts() -> None:
    """1 + 0.2 j, 1, 1 - 0.2 j: 3 abs(mean)^2 = 3, of F(2, 4; 95 %) = 6.94 times 0.05. At three angles it is 0."""
    third = np.exp(2j * np.pi * np.arange(3) / 3)
    assert seen(5, 1.0 + 0.2j, 1.0 + 0j, 1.0 - 0.2j).varying(3) == frozenset()
    assert seen(5, *third).varying(3) == {5}
    assert seen(5, *third[:2]).varying(3) == frozenset(), "two parts are no evidence"
    assert seen(5, *(0.2 * third)).varying(3) == frozenset(), "no lathe repeats 0.2 um"
    assert seen(6, *third).varying(3) == frozenset(), "the chuck holds each part alike"


def test_what_is_withdrawn_is_as_the_first_part_had_it_and_the_rest_as_learned() -> None:
    learned = CutPath(
        target=WANTED.plus({2: 4.0 + 0j, 7: 1j}), command=WANTED.plus({2: 6.0 + 0j, 5: 2.0 + 0j, 7: 2j})
    )
    found = Repeating(begun=BEGUN)
    assert found.target_moved_um(learned, 2) == pytest.approx(3.0)
    assert found.command_moved_um(learned, 5) == pytest.approx(2.0 - 0.3j)
    back = found.withdrawn(learned, (2, 5))
    assert coefficient_of(back.target, 2) == pytest.approx(1.0)
    assert coefficient_of(back.command, 2) == pytest.approx(1.5)
    assert coefficient_of(back.command, 5) == pytest.approx(0.3j)
    assert coefficient_of(back.target, 7) == pytest.approx(1j)
    assert coefficient_of(back.command, 7) == pytest.approx(2j)
    assert coefficient_of(back.target, 3) == pytest.approx(coefficient_of(WANTED, 3))
