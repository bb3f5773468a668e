"""A chuck that is not the same from part to part: what is told of it, when, and what the next part is cut with."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from random import Random

import pytest

from profiles.compensations.change import ShownOrder, state_of
from profiles.compensations.learning import coefficient_of
from profiles.compensations.next_version import AppliedPath, LearningStep
from tests.profiles.test_next_version import LOBE, MODEL, left, part, taught

WRENCH = 0.034  # 3 % of the force, of which rotation takes some
REFITTED = cmath.exp(-2j * math.pi * 2 / 3)  # twice a turn, with the harder jaw where the next one was


def row(
    random: Random, order_um: complex, parts: int, blank_um: float = 0.0, turn_deg: float = 0.0
) -> list[ShownOrder]:
    """Parts whose force scatters, measured with 0.2 um of noise; the lobe of three jaws turns with each."""
    found = []
    for number in range(parts):
        turned = order_um * cmath.exp(-3j * math.radians(turn_deg) * number) * random.lognormvariate(0.0, WRENCH)
        noise = complex(random.gauss(0.0, 0.2), random.gauss(0.0, 0.2))
        blank = complex(random.gauss(0.0, blank_um), random.gauss(0.0, blank_um))
        found.append(ShownOrder(shown_um=turned + noise + blank, path_um=0j, sd_um=0.2, clamped=WRENCH))
    return found


@pytest.mark.parametrize(("order", "size_um", "blank_um"), [(3, 27.5, 0.0), (2, 14.0, 0.0), (2, 2.0, 5.0)])
def test_no_scatter_is_taken_for_a_change(order: int, size_um: float, blank_um: float) -> None:
    """The wrench, the gauge, and an oval blank that lies at any angle: forty rows of ten parts each."""
    states = [state_of(row(Random(seed), size_um + 0j, 10, blank_um), order, 3) for seed in range(40)]
    assert [each for each in states if each.since or each.is_drifting] == []


@pytest.mark.parametrize("after", [2, 4])
def test_jaws_in_another_order_are_told_by_the_first_part(after: int) -> None:
    for seed in range(20):
        before, behind = row(Random(seed), 14.0 + 0j, after), row(Random(-1 - seed), 14.0 * REFITTED, 1)
        found = state_of([*before, *behind], 2, 3)
        assert (found.fresh, found.since) == (True, after)
        assert abs(found.stepped_um) == pytest.approx(14.0 * abs(REFITTED - 1.0), rel=0.1)


def test_a_lobe_that_turns_is_followed_in_its_angle_and_no_further() -> None:
    """1 degree a part makes 1.44 um of 27.5: the next part is cut within 1 um of it, whatever the wrench did."""
    off_um = []
    for seed in range(40):
        found = state_of(row(Random(seed), 27.5 + 0j, 6, turn_deg=1.0), 3, 3)
        assert found.drifts == (False, True) and not found.since
        expected = 27.5 * cmath.exp(-3j * math.radians(6.0))
        off_um.append(abs(found.follow(27.5 + 0j) - expected))
    assert sorted(off_um)[20] < 0.3 and max(off_um) < 1.0
    assert found.follow(20.0 + 0j) == pytest.approx(20.0 * cmath.exp(-3j * math.radians(6.0)), abs=0.8)


def learn(
    forms: Callable[[int], Mapping[int, complex]], parts: int
) -> list[tuple[dict[int, complex], LearningStep]]:
    """What each of so many parts has left, and its learning step; a part has the form of its number, from 1."""
    cut, found = (
        AppliedPath(path=MODEL, fraction=1.0, version=None),
        list[tuple[dict[int, complex], LearningStep]](),
    )
    for number in range(1, parts + 1):
        harmonics = left(cut.path, 1.0, 1.0, forms(number))
        measured = part(harmonics, noise_um=0.05, seed=number, beside=(2,))
        found.append((harmonics, taught(cut, measured, scatter_um=WRENCH * 27.5, beside=(2,))))
        history = tuple(step.next for _, step in found)
        cut = AppliedPath(
            path=history[-1].path, fraction=1.0, version=history[-1], parent=cut.path, history=history
        )
    return found


def test_after_jaws_were_refitted_the_second_part_is_as_before_and_no_order_varies() -> None:
    """An oval of 14 um p-p is at the next jaw from part 4 on."""
    found = learn(lambda number: {2: 7.0 * (REFITTED if number >= 4 else 1.0)}, 6)
    (told,) = found[3][1].warnings
    assert (told.code, told.key, told.limit) == ("learned.stepped", "2/rev", "3 → 4")
    assert float((told.value or "").removesuffix(" um")) == pytest.approx(24.2, abs=0.3)
    assert [step.warnings for _, step in (*found[:3], *found[4:])] == [()] * 5
    oval = [next(each for each in step.certificate if each.order == 2) for _, step in found]
    stands = [each.standing.value for each in oval]
    assert stands[:2] == ["one_part", "learned"] and stands[3] == "learned" and not {*stands} & {"varies", "grew"}
    assert [each.change is not None for each in oval] == [False, False, False, True, False, False]
    assert 2.0 * abs(found[3][0][2]) == pytest.approx(24.2, abs=0.5), "nobody knew"
    assert 2.0 * abs(found[4][0][2]) < 1.0 and 2.0 * abs(found[5][0][2]) < 1.0
    assert not found[3][1].reasons


def test_a_lobe_that_turns_by_a_degree_a_part_is_left_below_a_micrometre() -> None:
    found = learn(lambda number: {3: LOBE * cmath.exp(-3j * math.radians(number))}, 10)
    assert all(2.0 * abs(harmonics[3]) > 2.8 for harmonics, _ in found[:3]), "1 degree a part, not known yet"
    assert max(2.0 * abs(harmonics[3]) for harmonics, _ in found[3:]) < 1.0
    (told,) = found[-1][1].warnings
    assert (told.code, told.key) == ("learned.drifts", "3/rev")
    assert told.value == "2.9 um" and told.limit == "+1.0 deg"
    assert abs(coefficient_of(found[-1][1].next.path.target, 3)) == pytest.approx(27.5, rel=0.02)
