"""Run chart of a job: limits, what is claimed of the process and what is not, and how it is drawn."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from console.session.data.measured_part import RecordedPart
from console.session.learning.job_chart import Figure, JobChart, NoClaim, job_chart
from console.text.catalogue import load
from console.tui.lines import plain, width_of
from console.tui.plot.run_chart_view import chart_cells
from console.tui.records.panels import chart_lines, chart_picture
from console.units import METRIC
from tests.tui.stage import LANGUAGES

POINT = RecordedPart(
    run_id="0",
    at=datetime(2026, 1, 2, tzinfo=UTC),
    part="",
    ront_um=2.0,
    tolerance_um=5.0,
    diameter_mm=51.8,
    nominal_diameter_mm=51.8,
    diameter_tolerance_um=10.0,
    lobe_um_pp=1.0,
    strategy="pvt",
    stage="full",
    compensation="none",
)
ZIGZAG = (2.0, 3.0) * 20
"""Moving ranges of 1 um each: limits are 2.5 +- 3 / 1.128 um (NIST/SEMATECH 6.3.2.2)."""


def parts(ronts_um: Sequence[float], **changes: object) -> tuple[RecordedPart, ...]:
    return tuple(replace(POINT, ront_um=um, **changes) for um in ronts_um)  # type: ignore[arg-type]


def said(chart: JobChart, language: str = "en") -> str:
    return " ".join(plain(chart_lines(chart, load(language), 78)).split())


def test_limits_are_those_of_the_moving_range_and_what_is_beyond_is_named_and_marked() -> None:
    chart = job_chart(parts([*ZIGZAG, 9.0]), Figure.RONT)
    values = np.array([*ZIGZAG, 9.0])
    reach = 3.0 / 1.128 * np.abs(np.diff(values)).mean()
    assert chart.limits is not None
    assert (chart.limits.lower, chart.limits.upper) == pytest.approx(
        (values.mean() - reach, values.mean() + reach)
    )
    assert chart.beyond == (40,) and "Part 41 is beyond the limits" in said(chart)
    drawn = "".join(chart_cells(chart_picture(chart, METRIC), 100, 20).text_rows())
    assert drawn.count("✗") == 1 and drawn.count("•") == 40
    for name in ("UCL", "avg", "tol"):
        assert name in drawn
    assert "LCL" not in drawn, "roundness has no limit below 0"


def test_capability_has_its_number_of_parts_and_its_interval() -> None:
    """Against 5 um alone: mean 2.5, standard deviation 0.5 sqrt(40 / 39)."""
    chart = job_chart(parts(ZIGZAG), Figure.RONT)
    found = re.search(r"Cpk ([0-9.]+) \(([0-9.]+) – ([0-9.]+)\) \(95 %\), 40 parts", said(chart))
    assert found is not None and "Cp " not in said(chart)
    cpk, low, high = map(float, found.groups())
    assert cpk == pytest.approx(2.5 / (3.0 * 0.5 * np.sqrt(40.0 / 39.0)), abs=0.005)
    assert low < cpk < high


def test_a_diameter_is_judged_between_both_limits_of_its_tolerance() -> None:
    points = [replace(POINT, diameter_mm=51.8 + (0.001 if n % 2 else -0.001)) for n in range(40)]
    chart = job_chart(tuple(points), Figure.DIAMETER)
    assert (chart.lower_um, chart.upper_um) == (-10.0, 10.0)
    assert chart.capability is not None and chart.capability.cp is not None
    assert chart.capability.cp == pytest.approx(10.0 / (3.0 * np.sqrt(40.0 / 39.0)), rel=1e-6)
    assert said(chart).count("Cp") == 2
    unmeasured = job_chart(parts(ZIGZAG, diameter_mm=None), Figure.DIAMETER)
    assert "was not measured" in said(unmeasured)


@pytest.mark.parametrize(
    ("made", "why"),
    [
        (parts(ZIGZAG[:29]), NoClaim.FEW),
        (parts([2.0] * 40), NoClaim.SAME),
        (parts(ZIGZAG, tolerance_um=None), NoClaim.NO_TOLERANCE),
        (parts([*ZIGZAG, 9.0, 2.5, 9.0]), NoClaim.UNSTABLE),
    ],
)
def test_what_is_not_claimed_says_why(made: tuple[RecordedPart, ...], why: NoClaim) -> None:
    chart = job_chart(made, Figure.RONT)
    assert (chart.capability, chart.no_claim) == (None, why)
    for language in LANGUAGES:
        rows = chart_lines(chart, load(language), 78)
        assert all(width_of(row) <= 78 for row in rows) and "Cpk –" in plain(rows)
        assert "records_page" not in plain(rows)


def test_parts_with_another_compensation_before_are_shown_and_not_counted() -> None:
    """What was made otherwise says nothing of what is made now."""
    older = parts([8.0] * 12)
    newer = parts(ZIGZAG, compensation="2")
    chart = job_chart((*older, *newer), Figure.RONT)
    assert chart.begins == 12 and chart.alike == 40
    assert chart.limits is not None and chart.limits.mean == pytest.approx(2.5)
    assert chart.capability is not None and chart.capability.parts == 40
    assert "the last 40 parts" in said(chart)


def test_a_growing_lobe_is_told_and_noise_is_not_a_trend() -> None:
    noise = np.random.default_rng(3).normal(size=40) * 0.05
    for slope, words in (
        (0.03, "The lobe is rising: +0.03"),
        (-0.03, "The lobe is falling: -0.03"),
        (0.0, "No trend"),
    ):
        points = [replace(POINT, lobe_um_pp=2.0 + slope * n + float(noise[n])) for n in range(40)]
        chart = job_chart(tuple(points), Figure.RONT)
        assert words in said(chart)


def test_few_parts_have_no_limits_and_none_have_no_chart() -> None:
    few = job_chart(parts(ZIGZAG[:7]), Figure.RONT)
    assert few.limits is None and "limits need 8" in said(few)
    none = job_chart(parts(()), Figure.RONT)
    assert "was measured" in said(none)
    assert set("".join(chart_cells(chart_picture(none, METRIC), 40, 8).text_rows())) == {" "}


@pytest.mark.parametrize("count", [1, 2, 500])
@pytest.mark.parametrize("size", [(1, 1), (8, 3), (74, 8), (156, 30)])
def test_any_number_of_parts_is_drawn_in_any_room(count: int, size: tuple[int, int]) -> None:
    chart = job_chart(parts((ZIGZAG * 13)[:count]), Figure.RONT, judge=False)
    rows = chart_cells(chart_picture(chart, METRIC), *size).text_rows()
    assert [len(row) for row in rows] == [size[0]] * size[1]


def test_parts_that_inverted_another_response_are_not_made_alike() -> None:
    """One alone has no scatter: its limits wait for the parts like it."""
    by_model, found = parts(ZIGZAG), parts([1.0, 1.2], inverted="pvt-20260103T093000000Z.json")
    both = (*by_model, *found)
    assert job_chart(both, Figure.RONT).begins == len(ZIGZAG)
