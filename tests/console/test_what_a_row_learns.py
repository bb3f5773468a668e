"""What the parts of a row teach of an order, and what of the lobe that a part has left repeats."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from console.session.learning.lobe_learning import LobeLearning
from console.session.learning.order_learning import LearnHow, OrderLearning
from drivers.cutting.planning import Strategy
from profiles.compensations.certificate import Standing
from profiles.compensations.learning import Deviation
from profiles.compensations.part_harmonics import PartHarmonics
from profiles.compensations.path import CutPath, free_state_lobe, target_path
from profiles.store import load_job, load_machine

MACHINE = load_machine("lee-2001-lathe").machine
RING = load_job("lee-2001-experiment-1").job


def part_with(sd_um: float) -> PartHarmonics:
    return cast(PartHarmonics, SimpleNamespace(sd_um=dict.fromkeys(range(1, 13), sd_um), coefficients_um={}))


def orders_after(step_um: float, how: LearnHow | None = None) -> OrderLearning:
    """Return the orders of a row whose first part has moved twice a turn by so much."""
    orders = OrderLearning(RING, MACHINE, Strategy.CAM, how or LearnHow())
    path = CutPath(target=target_path(RING), command=target_path(RING))
    moved = replace(path, target=path.target.plus({2: complex(step_um)}))
    orders.step(path, moved if step_um else path)
    return orders


def test_the_rest_of_a_large_step_is_learned_by_its_gain_though_a_trace_alone_would_not_show_it() -> None:
    """A tenth of an oval of 6 um that does not arrive is 0.6 um: below 2.45 standard errors of 0.4 um."""
    part = part_with(0.4)
    path = CutPath(target=target_path(RING), command=target_path(RING))
    assert not orders_after(0.0).teaches(2, 0.6 + 0j, part), "one part alone may show it by chance"
    orders = orders_after(6.0)
    assert orders.teaches(2, 0.6 + 0j, part)
    # P, um^2: 5 um seen with 0.41 um leave 0.17; 10 % of the step, 0.36, and 0.01 come to it. R: 0.17.
    assert orders.gain(2, 0.6 + 0j, part, path) == pytest.approx(0.75, abs=0.02), "0.54 / (0.54 + 0.17)"
    assert not orders_after(6.0, LearnHow(optimal=False)).teaches(2, 0.6 + 0j, part), "no gain weighs it there"


def test_what_is_left_of_a_lobe_is_told_apart_into_this_clamping_and_what_repeats() -> None:
    """Eleven parts of one force show the mean; a twelfth has 5 % more force: 6.1 % more of the lobe at speed."""
    learning = LobeLearning(RING, MACHINE)
    lobe_um = free_state_lobe(RING).harmonics[0].coefficient
    for factor in (*(1.0,) * 11, 1.061):
        learning.clamp(CutPath(target=target_path(RING), command=target_path(RING)), None, lambda _: 1.0 + 0j)
        learning.measured(factor * lobe_um - lobe_um, lobe_um, 0.05)
    left = learning.left
    assert left is not None
    assert left.left_um_pp == pytest.approx(0.061 * 55.0)
    assert left.own_um_pp == pytest.approx(0.061 * 55.0, rel=0.12) and left.repeats_um_pp < 0.4
    assert left.force_deviation == pytest.approx(0.05, rel=0.12)


def test_the_certificate_has_what_is_on_the_part_and_what_of_it_is_learned_apart() -> None:
    """The trim of an oval blank was at its limit: 5.5 um stay on the part, of which the table may learn 0.4."""
    orders, off = orders_after(6.0), Deviation(coefficients_um={2: 5.1 + 0j, 5: 0.9j}, sd_um=0.05)
    part = part_with(0.02)
    part.coefficients_um.update({2: 5.5 + 0j, 5: 0.8j})  # type: ignore[attr-defined]
    shown = {each.order: each for each in orders.certificate(orders.left(part, off), part, off, {}, frozenset())}
    oval, fifth, beyond = shown[2], shown[5], shown[orders.learned[-1] + 1]
    assert (oval.on_part_um, oval.tool_off_um, oval.left_um) == pytest.approx((5.5, 5.1, 0.4))
    assert (fifth.on_part_um, fifth.tool_off_um, fifth.left_um) == pytest.approx((0.8, 0.9, 0.8))
    assert beyond.standing is Standing.NO_PROMISE and beyond.bound == beyond.bound_gain_1 > 0.95
    assert beyond.on_part_um is beyond.left_um is None, "it was not measured"
