"""What a part is judged by: each tolerance at its worst section, and nothing that was not measured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from profiles.metrology.conformity import (
    DecisionRule,
    JudgedFigure,
    SectionForm,
    ToleranceKind,
    Tolerances,
    judge_part,
    passes_all,
)

LIMITS = Tolerances(roundness_um=5.0, cylindricity_um=8.0, diameter_um=20.0)
SECTIONS = tuple(SectionForm(z_mm=z, ront_um=1.0, mean_um=3.0) for z in (22.8, 26.0, 29.2))


def judged(limits: Tolerances = LIMITS, **changed: Any) -> tuple[JudgedFigure, ...]:
    """A good part, with some of its figures changed."""
    good: dict[str, Any] = {
        "ront_um": 1.0,
        "mean_um": 3.0,
        "off_um": 6.0,
        "z_mm": 26.0,
        "sections": SECTIONS,
        "cylt_um": 2.0,
    }
    return judge_part(limits, **(good | changed))


def with_end(**changed: float) -> dict[str, Any]:
    return {"sections": (*SECTIONS[:-1], replace(SECTIONS[-1], **changed))}


@pytest.mark.parametrize(
    ("changed", "kind", "value_um", "z_mm"),
    [
        (with_end(ront_um=5.1), ToleranceKind.ROUNDNESS, 5.1, 29.2),
        ({"cylt_um": 8.1}, ToleranceKind.CYLINDRICITY, 8.1, None),
        (with_end(mean_um=-11.0), ToleranceKind.DIAMETER, -22.0, 29.2),  # 14 um less on the radius
        ({"ront_um": 5.1}, ToleranceKind.ROUNDNESS, 5.1, 26.0),
    ],
)
def test_a_part_that_is_good_in_its_middle_only_fails(
    changed: dict[str, Any], kind: ToleranceKind, value_um: float, z_mm: float | None
) -> None:
    assert passes_all(judged()) is True
    assert passes_all(judged(**changed)) is False
    (failed,) = [each for each in judged(**changed) if each.passes is False]
    assert (failed.kind, failed.z_mm) == (kind, z_mm)
    assert failed.value_um == pytest.approx(value_um)


def test_a_cylindricity_that_was_not_measured_is_never_passed() -> None:
    one: dict[str, Any] = {"sections": (), "cylt_um": None}
    assert passes_all(judged(**one)) is None
    assert passes_all(judged(**one, ront_um=5.1)) is False
    assert passes_all(judged(replace(LIMITS, cylindricity_um=None), **one)) is True


def test_a_part_without_a_size_is_judged_by_its_form() -> None:
    found = judged(off_um=None)
    assert [each.kind for each in found] == [ToleranceKind.ROUNDNESS, ToleranceKind.CYLINDRICITY]
    assert passes_all(found) is True


@pytest.mark.parametrize(
    ("rule", "kind", "value_um", "passes"),
    [
        # U = 1 um: u = 0.5 um; 1.645 u = 0.8224 um below the one limit of 5 um, U = 1 um by the older edition.
        ("iso-14253-1:2017", "roundness", 4.17, True),
        ("iso-14253-1:2017", "roundness", 4.18, None),
        ("iso-14253-1:2017", "roundness", 5.82, None),
        ("iso-14253-1:2017", "roundness", 5.83, False),
        ("iso-14253-1:2013", "cylindricity", 4.0, True),
        ("iso-14253-1:2013", "cylindricity", 4.01, None),
        ("iso-14253-1:2013", "cylindricity", 6.0, None),
        ("iso-14253-1:2013", "cylindricity", 6.01, False),
        ("iso-14253-1:2017", "diameter", -4.17, True),
        ("iso-14253-1:2017", "diameter", -5.5, None),
        ("simple", "roundness", 5.0, True),
        ("simple", "roundness", 5.01, False),
    ],
)
def test_a_figure_passes_or_fails_beyond_its_guard(
    rule: str, kind: str, value_um: float, passes: bool | None
) -> None:
    figure = JudgedFigure(
        kind=ToleranceKind(kind), value_um=value_um, limit_um=5.0, u_um=1.0, rule=DecisionRule(rule)
    )
    assert figure.passes is passes
    unknown = replace(figure, u_um=None)
    assert unknown.passes is (None if rule != "simple" else passes)


def test_two_limits_of_a_narrow_diameter_take_more_than_one() -> None:
    # Both limits 2 u away: 95.45 % within. 1.9 u away: 94.3 % (tables of the normal distribution).
    figure = JudgedFigure(
        kind=ToleranceKind.DIAMETER, value_um=0.0, limit_um=2.0, u_um=2.0, rule=DecisionRule.ISO_2017
    )
    assert figure.passes is True
    assert replace(figure, limit_um=1.9).passes is None
