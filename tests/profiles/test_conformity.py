"""What a part is judged by: each tolerance at its worst section, and nothing that was not measured."""

from __future__ import annotations

from dataclasses import replace

import pytest

from profiles.metrology.conformity import (
    MeasuredFigures,
    SectionForm,
    ToleranceKind,
    Tolerances,
    judge_figures,
    passes_all,
)

LIMITS = Tolerances(roundness_um=5.0, cylindricity_um=8.0, diameter_um=20.0)
GOOD = MeasuredFigures(
    ront_um=1.0,
    mean_um=3.0,
    off_um=6.0,
    z_mm=26.0,
    sections=tuple(SectionForm(z_mm=z, ront_um=1.0, mean_um=3.0) for z in (22.8, 26.0, 29.2)),
    cylt_um=2.0,
)


def with_end(**changed: float) -> MeasuredFigures:
    *others, end = GOOD.sections
    return replace(GOOD, sections=(*others, replace(end, **changed)))


@pytest.mark.parametrize(
    ("measured", "kind", "value_um", "z_mm"),
    [
        (with_end(ront_um=5.1), ToleranceKind.ROUNDNESS, 5.1, 29.2),
        (replace(GOOD, cylt_um=8.1), ToleranceKind.CYLINDRICITY, 8.1, None),
        (with_end(mean_um=-11.0), ToleranceKind.DIAMETER, -22.0, 29.2),  # 14 um less on the radius
        (replace(GOOD, ront_um=5.1), ToleranceKind.ROUNDNESS, 5.1, 26.0),
    ],
)
def test_a_part_that_is_good_in_its_middle_only_fails(
    measured: MeasuredFigures, kind: ToleranceKind, value_um: float, z_mm: float | None
) -> None:
    assert passes_all(judge_figures(GOOD, LIMITS)) is True
    judged = judge_figures(measured, LIMITS)
    assert passes_all(judged) is False
    (failed,) = [each for each in judged if each.passes is False]
    assert (failed.kind, failed.z_mm) == (kind, z_mm)
    assert failed.value_um == pytest.approx(value_um)


def test_a_cylindricity_that_was_not_measured_is_never_passed() -> None:
    one = replace(GOOD, sections=(), cylt_um=None)
    assert passes_all(judge_figures(one, LIMITS)) is None
    assert passes_all(judge_figures(replace(one, ront_um=5.1), LIMITS)) is False
    assert passes_all(judge_figures(one, replace(LIMITS, cylindricity_um=None))) is True


def test_a_part_without_a_size_is_judged_by_its_form() -> None:
    judged = judge_figures(replace(GOOD, off_um=None), LIMITS)
    assert [each.kind for each in judged] == [ToleranceKind.ROUNDNESS, ToleranceKind.CYLINDRICITY]
    assert passes_all(judged) is True
