"""What a part is judged by: each tolerance at its worst section, and nothing that was not measured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from profiles.metrology.conformity import (
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
