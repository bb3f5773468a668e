"""Looking at a measured part: circle, filter, zoom, tolerance, spectrum, another part. The verdict stays."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from rich.cells import cell_len

from console.session.data.measured_part import RecordedPart
from console.session.learning.job_chart import ChartedQuantity, JobChart, NoClaim, job_chart
from console.session.station.state import Activity, MeasuredPart, StationState
from console.session.work import with_strategy
from console.text.catalogue import load
from console.tui.inspection.comparison import (
    DisplayFilter,
    compare_parts,
    list_supported_upr,
    next_filter,
    tolerance_rings_um,
)
from console.tui.inspection.panels import Bars, SpectrumPicture, spectrum_cells
from console.tui.lines import plain_text, width_of
from console.tui.pages.inspect import InspectPage
from console.tui.pages.learn_lines import plain_words
from console.tui.plot.frame import stepped_125
from console.tui.plot.polar_view import PolarView, shows_rings
from console.tui.plot.run_chart_view import chart_cells
from console.tui.records.panels import chart_lines, chart_picture
from console.tui.theme import Token
from console.units import METRIC
from drivers.cutting.planning import Strategy
from profiles.metrology.circles import CIRCLES
from profiles.traces import Trace
from tests.tui import records_stage
from tests.tui.page_stage import PageScene, on_page
from tests.tui.scenes import AFTER, part, signed, taught, taught_part
from tests.tui.stage import LANGUAGES

PART = taught_part((*AFTER, (30, 0.4, 5.0), (100, 0.3, 5.0)))
PLAIN = part(Strategy.NONE, ((3, 27.1, 14.3), (2, 1.31, 67.0)))
MEASURED = StationState(activity=Activity.READY, measured=PART, uncompensated=PLAIN)
ROOMS = ((80, 18), (160, 42))


class OnInspect(PageScene):
    page_class = InspectPage


play = partial(on_page, OnInspect, work=with_strategy(signed(), "cam"), size=(160, 42), state=MEASURED)


async def settled(stage: OnInspect) -> None:
    for _ in range(3):
        await stage.show()


def verdict_of(text: str) -> str:
    return next(row for row in text.splitlines() if "PASS" in row or "FAIL" in row).split("│")[-2].strip()


async def test_each_circle_is_named_wherever_its_figures_are_and_the_verdict_stays(tmp_path: Path) -> None:
    async with play(tmp_path) as stage:
        await settled(stage)
        judged = verdict_of(stage.text)
        seen = []
        for kind in (*CIRCLES[1:], CIRCLES[0]):
            await stage.act("inspect.circle")
            assert stage.text.count(f"free · {kind} · 1-50 UPR") == 2, "of the plot and of the table"
            (chosen,) = [row for row in stage.text.splitlines() if "▸" in row]
            assert f"RONt {kind} ▸" in chosen
            circle = PART.result.circle(kind)
            assert f"{circle.ront_um:.2f}" in chosen
            assert verdict_of(stage.text) == judged
            seen.append("judged by LSC, 1-50 UPR" in stage.text)
        assert seen == [True, True, True, False]
        assert stage.control.orders == [] and stage.codes == []


async def test_each_filter_is_named_and_shows_what_it_lets_through(tmp_path: Path) -> None:
    """Half of an undulation remains at the cut-off of a Gaussian filter; 30 UPR at 15 all but vanish."""
    async with play(tmp_path) as stage:
        await settled(stage)
        judged, ront = verdict_of(stage.text), []
        for upr in (150, 500, 15, 50):
            await stage.act("inspect.filter")
            assert stage.text.count(f"LSC · 1-{upr} UPR") == 2
            assert f"p-p · 1-{upr} UPR" in stage.text, "of the harmonics"
            assert verdict_of(stage.text) == judged
            assert ("judged by LSC, 1-50 UPR" in stage.text) is (upr != 50)
            row = next(row for row in stage.text.splitlines() if "RONt LSC" in row)
            ront.append(float(row.split("│")[-2].split()[-1]))
        assert ront[1] > ront[0] > ront[3] > ront[2]
        assert ront[3] == pytest.approx(PART.result.ront_um, abs=0.005)


def test_a_trace_of_few_points_has_only_the_filters_that_it_supports() -> None:
    """Seven points for each undulation: 360 carry 50 UPR (350) and not 150 (1050); a step of 2 deg is as 180."""
    angle_deg = np.arange(360.0)
    trace = Trace(angle_deg=angle_deg, deviation_um=np.cos(np.radians(3 * angle_deg)))
    assert list_supported_upr([trace]) == (15.0, 50.0)
    assert list_supported_upr([PART.trace, trace]) == (15.0, 50.0)
    assert list_supported_upr([Trace(angle_deg=angle_deg[:-1], deviation_um=angle_deg[:-1])]) == (15.0,)
    assert next_filter(DisplayFilter(), None, ()) == DisplayFilter()


async def test_the_only_filter_is_refused_with_what_another_would_need(tmp_path: Path) -> None:
    turn = np.arange(0.0, 360.0, 4.0)
    few = replace(PART, trace=Trace(angle_deg=turn, deviation_um=np.cos(np.radians(3 * turn))))
    async with play(tmp_path, state=replace(MEASURED, measured=few)) as stage:
        await settled(stage)
        await stage.act("inspect.filter")
        assert stage.codes == ["screen.one_filter"]
        assert "1-50 UPR" in stage.text


@pytest.mark.parametrize("kind", CIRCLES)
@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_the_trace_is_between_the_tolerance_rings_exactly_where_ront_is_within(kind: str, factor: float) -> None:
    seen = compare_parts(MEASURED, DisplayFilter(circle=kind))
    assert seen is not None
    tolerance_um = factor * seen.last.ront_um
    inner, outer = tolerance_rings_um(seen.last, tolerance_um)
    assert outer - inner == pytest.approx(tolerance_um)
    profile = seen.last.profile_um
    assert bool(inner <= profile.min() + 1e-9 and profile.max() <= outer + 1e-9) is (factor > 1.0)
    if kind == "MIC":
        assert inner == 0.0


async def test_the_tolerance_is_drawn_once_it_can_be_seen_and_the_scale_says_how(tmp_path: Path) -> None:
    async with play(tmp_path) as stage:
        await settled(stage)
        assert "20 um/div · tolerance 5 um: +" in stage.text
        polar = stage.page.query_one(PolarView)
        scales = []
        for _ in range(4):
            await stage.act("inspect.larger")
            scales.append(polar.scale_um_per_division)
        assert scales == [10.0, 5.0, 2.0, 1.0]
        assert "1 um/div (z: all) · ∙∙ tolerance 5 um" not in stage.text, "5 um are beyond 2 divisions"
        assert "The zoom cuts a trace off" in stage.text
        await stage.act("inspect.smaller")
        assert "2 um/div (z: all) · ∙∙ tolerance 5 um" in stage.text
        await stage.act("inspect.whole")
        assert "20 um/div · tolerance" in stage.text and "cuts a trace off" not in stage.text
        for _ in range(30):
            await stage.act("inspect.smaller")
        assert stage.codes == ["screen.zoom_end"]
        # The next part is shown whole again.
        stage.control.state = replace(MEASURED, measured=replace(PART, trace=replace(PART.trace)))
        await settled(stage)
        assert "20 um/div · tolerance" in stage.text


def test_rings_that_blur_or_leave_the_plot_are_not_drawn() -> None:
    assert shows_rings((-2.5, 2.5), 2.0, 40, 20)
    assert not shows_rings((-2.5, 2.5), 50.0, 40, 20)
    assert not shows_rings((-2.5, 2.5), 0.5, 40, 20)
    assert [stepped_125(20.0, by) for by in (-4, -1, 0, 1, 2)] == [1.0, 10.0, 20.0, 50.0, 100.0]


def test_a_trace_beyond_the_rim_is_not_drawn_elsewhere() -> None:
    """One point of 100 um at 1 um/div: a gap, and no line across the plot."""
    from console.tui.plot.polar_view import PolarTrace, polar_cells

    angle_deg, deviation = np.arange(360.0), np.zeros(360)
    deviation[10:20] = 100.0
    spiked = PolarTrace(angle_deg=angle_deg, deviation_um=deviation, token=Token.AFTER)
    whole = PolarTrace(angle_deg=angle_deg, deviation_um=np.zeros(360), token=Token.AFTER)
    cells, round_ = (polar_cells([each], [], 1.0, 40, 20) for each in (spiked, whole))
    drawn, target = ((each.tokens == Token.AFTER.value) & (each.codes != ord(" ")) for each in (cells, round_))
    assert (drawn & ~target).sum() <= 2 and drawn.sum() > 0.9 * target.sum(), "the ends of the gap round otherwise"


# The spectrum --------------------------------------------------------------------------------------------------


def test_the_spectrum_has_a_bar_for_each_order_and_names_those_of_the_jaws() -> None:
    um_pp = np.zeros(60)
    um_pp[[3, 9, 40]] = 2.0, 1.0, 9.0
    picture = SpectrumPicture(
        bars=[Bars(um_pp=um_pp, token=Token.AFTER)], highest=50, top_um=2.0, marked=(3, 6, 9)
    )
    cells = spectrum_cells(picture, 108, 20)
    rows = cells.text_rows()
    left = rows[0].index("│") + 1
    assert rows[0][left:].split() == ["3", "6", "9"]
    heights = {}
    for order in (3, 9, 40, 22):
        column = left + round((order - 1) / 50 * (108 - left - 0.5))
        near = cells.codes[2:-2, column - 1 : column + 2]
        heights[order] = int((near != ord(" ")).any(axis=1).sum())
    assert heights[3] > 1.7 * heights[9] > 0 and heights[22] <= 1
    assert "↑" in rows[1], "one is higher than the plot"


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", ROOMS)
async def test_h_shows_the_spectrum_with_every_harmonic(
    room: tuple[int, int], language: str, tmp_path: Path
) -> None:
    text = load(language)
    async with play(tmp_path, language=language, size=room) as stage:
        await settled(stage)
        title = text("inspect_page.spectrum", filter="1-50 UPR")
        assert (title in stage.text) is (room[1] > 36), "a large screen has both"
        await stage.act("inspect.view")
        await settled(stage)
        assert title in stage.text and "/rev" in stage.text
        for n in (3, 6, 9, 2, 4, 5, 7):
            assert text("inspect_page.harmonic", n=f"{n:>2}") in stage.text
        assert all(cell_len(row) <= room[0] for row in stage.text.splitlines())
        await stage.act("inspect.larger")
        assert "(z: " in stage.text
        await stage.act("inspect.view")
        await settled(stage)
        assert "RONt MZC" in stage.text and "(z: " not in stage.text


# Another part --------------------------------------------------------------------------------------------------


def recorded(data: Path) -> None:
    records_stage.run(data, 27.1, strategy="none", kind="part")
    records_stage.run(data, 1.3, strategy="cam", compensation=2, kind="part")
    records_stage.run(data, 9.0, job=replace(signed().job, name="another"), kind="part")
    records_stage.run(data, 8.0, machine="another", kind="part")


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", ROOMS)
async def test_another_part_of_the_job_lies_beside_this_one_on_one_scale(
    room: tuple[int, int], language: str, tmp_path: Path
) -> None:
    """It has a lobe of 1.3 um, high at 12 degrees with jaw 1 at 12.63: 2.6 um p-p, 0.6 degrees before jaw 1."""
    recorded(tmp_path)
    text = load(language)
    async with play(tmp_path, size=room, language=language) as stage:
        await settled(stage)
        await stage.act("inspect.beside")
        await settled(stage)
        listed = [row for row in stage.text.splitlines() if " um " in row]
        assert len(listed) == 2 and "2.6" in listed[0] and "54." in listed[1], "newest first, of this job here"
        await stage.act("inspect.measure")
        assert stage.codes == ["screen.close_parts"]
        await stage.act("inspect.down", "inspect.next")
        await settled(stage)
        assert text("made.learned", version="2") in stage.text
        assert "-0.6°" in stage.text and text("inspect_page.other") in stage.text
        polar = stage.page.query_one(PolarView)
        assert polar.scale_um_per_division <= 1.0, "the scale of the two that are shown"
        high = polar._traces[0]
        high_deg = np.asarray(high.angle_deg)[np.argmax(np.asarray(high.deviation_um))]
        assert abs((high_deg - 12.0 + 60.0) % 120.0 - 60.0) < 8.0
        await stage.act("inspect.beside", "inspect.first", "inspect.next")
        await settled(stage)
        assert text("inspect_page.measured_before") in stage.text
        assert stage.control.orders == []


async def test_a_record_without_other_parts_with_one_and_a_damaged_one_are_told(tmp_path: Path) -> None:
    async with play(tmp_path) as stage:
        await settled(stage)
        await stage.act("inspect.beside")
        await settled(stage)
        assert "no other measured part" in stage.text and "b closes" in stage.next_step
        await stage.act("inspect.beside")
        records_stage.run(tmp_path, 1.3, strategy="cam", compensation=2, kind="part")
        await stage.act("inspect.beside")
        await settled(stage)
        assert " 1 part " in stage.text, "a single one is not counted as several"
        await stage.act("inspect.beside")
        await settled(stage)
        for file in filter(Path.is_file, tmp_path.iterdir()):
            file.write_bytes(b"this is no record of runs" * 100)
        await stage.act("inspect.beside")
        await settled(stage)
        assert "PASS" not in stage.text
        await stage.act("inspect.beside")
        await settled(stage)
        assert "PASS" in stage.text


def test_the_figures_of_the_other_part_are_those_of_its_record(tmp_path: Path) -> None:
    from console.session.data.run_reader import measured_parts
    from console.tui.inspection.part_chooser import read_other_part

    recorded(tmp_path)
    work = signed()
    point = measured_parts(tmp_path, work.job.name, work.machine.machine.name, True)[-1]
    other = read_other_part(tmp_path, point)
    assert other.result.ront_um == pytest.approx(point.ront_um)
    seen = compare_parts(MEASURED, DisplayFilter(), other)
    assert seen is not None and seen.before.ront_um == pytest.approx(point.ront_um)
    # With a filter that it does not support both keep that of the verdict.
    wide = compare_parts(MEASURED, DisplayFilter(filter_upr=500.0), other)
    assert wide is not None and wide.looked == DisplayFilter() and wide.supported == (15.0, 50.0)


# In plain words ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("language", LANGUAGES)
async def test_the_first_words_are_what_is_left_and_what_to_press(language: str, tmp_path: Path) -> None:
    text = load(language)
    large = taught(part(Strategy.CAM, ((3, 9.0, 21.7),)))

    cases: list[tuple[MeasuredPart, str]] = [
        (PART, text("inspect_page.plain.scatter", left="1.8", scatter="9.2")),
        (replace(large, job=replace(large.job, roundness_tolerance_um=5.0)), text("inspect_page.plain.missed")),
    ]
    for measured, expected in cases:
        state = replace(MEASURED, measured=measured)
        async with play(tmp_path, language=language, size=(80, 18), state=state) as stage:
            await settled(stage)
            assert expected[:40] in stage.text.splitlines()[1]


def test_a_lobe_that_stands_out_is_corrected_with_a_and_the_page_says_so() -> None:
    text = load("en")
    large = taught(part(Strategy.CAM, ((3, 9.0, 12.63),)))
    assert large.learning is not None
    said = plain_words(large.learning, None, text, failed=False)
    assert said == "Remaining lobe 18.0 um: press a to correct it in the next part."
    quiet = taught(part(Strategy.CAM, ((7, 0.3, 0.0),)))
    assert quiet.learning is not None
    assert plain_words(quiet.learning, None, text, failed=False).startswith("Nothing to learn")


# Run chart of a job: limits, what is claimed of the process and what is not, and how it is drawn.


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
    return " ".join(plain_text(chart_lines(chart, load(language), 78)).split())


def test_limits_are_those_of_the_moving_range_and_what_is_beyond_is_named_and_marked() -> None:
    chart = job_chart(parts([*ZIGZAG, 9.0]), ChartedQuantity.RONT)
    values = np.array([*ZIGZAG, 9.0])
    reach = 3.0 / 1.128 * np.abs(np.diff(values)).mean()
    assert chart.limits is not None
    assert (chart.limits.lower, chart.limits.upper) == pytest.approx(
        (values.mean() - reach, values.mean() + reach)
    )
    assert chart.places_beyond_limits == (40,) and "Part 41 is beyond the limits" in said(chart)
    drawn = "".join(chart_cells(chart_picture(chart, METRIC), 100, 20).text_rows())
    assert drawn.count("✗") == 1 and drawn.count("•") == 40
    for name in ("UCL", "avg", "tol"):
        assert name in drawn
    assert "LCL" not in drawn, "roundness has no limit below 0"


def test_capability_has_its_number_of_parts_and_its_interval() -> None:
    """Against 5 um alone: mean 2.5, standard deviation 0.5 sqrt(40 / 39)."""
    chart = job_chart(parts(ZIGZAG), ChartedQuantity.RONT)
    found = re.search(r"Cpk ([0-9.]+) \(([0-9.]+) – ([0-9.]+)\) \(95 %\), 40 parts", said(chart))
    assert found is not None and "Cp " not in said(chart)
    cpk, low, high = map(float, found.groups())
    assert cpk == pytest.approx(2.5 / (3.0 * 0.5 * np.sqrt(40.0 / 39.0)), abs=0.005)
    assert low < cpk < high


def test_a_diameter_is_judged_between_both_limits_of_its_tolerance() -> None:
    points = [replace(POINT, diameter_mm=51.8 + (0.001 if n % 2 else -0.001)) for n in range(40)]
    chart = job_chart(tuple(points), ChartedQuantity.DIAMETER)
    assert (chart.lower_um, chart.upper_um) == (-10.0, 10.0)
    assert chart.capability is not None and chart.capability.cp is not None
    assert chart.capability.cp == pytest.approx(10.0 / (3.0 * np.sqrt(40.0 / 39.0)), rel=1e-6)
    assert said(chart).count("Cp") == 2
    unmeasured = job_chart(parts(ZIGZAG, diameter_mm=None), ChartedQuantity.DIAMETER)
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
    chart = job_chart(made, ChartedQuantity.RONT)
    assert (chart.capability, chart.no_claim) == (None, why)
    for language in LANGUAGES:
        rows = chart_lines(chart, load(language), 78)
        assert all(width_of(row) <= 78 for row in rows) and "Cpk –" in plain_text(rows)
        assert "records_page" not in plain_text(rows)


def test_parts_with_another_compensation_before_are_shown_and_not_counted() -> None:
    """What was made otherwise says nothing of what is made now."""
    older = parts([8.0] * 12)
    newer = parts(ZIGZAG, compensation="2")
    chart = job_chart((*older, *newer), ChartedQuantity.RONT)
    assert chart.begins == 12 and chart.alike_count == 40
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
        chart = job_chart(tuple(points), ChartedQuantity.RONT)
        assert words in said(chart)


def test_few_parts_have_no_limits_and_none_have_no_chart() -> None:
    few = job_chart(parts(ZIGZAG[:7]), ChartedQuantity.RONT)
    assert few.limits is None and "limits need 8" in said(few)
    none = job_chart(parts(()), ChartedQuantity.RONT)
    assert "was measured" in said(none)
    assert set("".join(chart_cells(chart_picture(none, METRIC), 40, 8).text_rows())) == {" "}


@pytest.mark.parametrize("count", [1, 2, 500])
@pytest.mark.parametrize("size", [(1, 1), (8, 3), (74, 8), (156, 30)])
def test_any_number_of_parts_is_drawn_in_any_room(count: int, size: tuple[int, int]) -> None:
    chart = job_chart(parts((ZIGZAG * 13)[:count]), ChartedQuantity.RONT, judge=False)
    rows = chart_cells(chart_picture(chart, METRIC), *size).text_rows()
    assert [len(row) for row in rows] == [size[0]] * size[1]


def test_parts_that_inverted_another_response_are_not_made_alike() -> None:
    """One alone has no scatter: its limits wait for the parts like it."""
    by_model, found = parts(ZIGZAG), parts([1.0, 1.2], inverted="pvt-20260103T093000000Z.json")
    both = (*by_model, *found)
    assert job_chart(both, ChartedQuantity.RONT).begins == len(ZIGZAG)
