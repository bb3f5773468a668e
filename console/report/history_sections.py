"""Sections on the debrief, the learning step, and the run chart of the job."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from console.report.course_figure import chart_figure
from console.report.drawing import figure
from console.report.markup import Markup, element, list_of, paragraph, section
from console.report.quantities import number, time_in, um
from console.session.data.run_rows import recorded_problems
from console.session.learning.job_chart import ChartedQuantity, JobChart, job_chart
from console.session.learning.opened_run import OpenedRun
from console.text.catalogue import Catalogue
from console.text.recorded_words import problem_words
from console.text.run_debrief import debrief_sections
from profiles.forecast import forecast_um
from profiles.metrology.process_statistics import LEAST_CHART, LEAST_PARTS, trend
from profiles.strict_values import number_or_none


def write_debrief(run: OpenedRun, text: Catalogue) -> Markup | None:
    """Write the debrief: cost, causes, advice, course, gaps of the record; None without a debrief."""
    if run.debrief is None:
        return None
    parts = [
        part
        for title, rows in debrief_sections(run.debrief, text)
        for part in (element("h3", title), list_of(rows))
    ]
    return section("debrief", text("report.debrief"), *parts)


def write_learning(run: OpenedRun, text: Catalogue) -> Markup:
    """Write the proposed learning step and whether it was accepted."""
    lines = [*_list_proposed_steps(run, text), *_list_accepted_versions(run, text), *_series(run, text)]
    body = list_of(lines) if lines else paragraph(text("report.nothing_learned_here"))
    return section("learned", text("report.learned"), body)


def _list_proposed_steps(run: OpenedRun, text: Catalogue) -> Iterator[str]:
    for part in run.parts:
        step = part.data.get("learning")
        if not isinstance(step, Mapping):
            continue
        if "version" in step:
            waves = step.get("harmonics")
            orders = ", ".join(map(str, waves)) if isinstance(waves, list) else ""
            calculated_um = number_or_none(step.get("expected_ront_um"))
            ront = um(None if calculated_um is None else forecast_um(calculated_um))
            facts = {"lobe": um(step.get("expected_lobe_um_pp")), "ront": ront}
            gain, version = number(step.get("gain"), 3), str(step["version"])
            yield text("report.proposed", version=version, orders=orders, gain=gain, **facts)
        if reasons := recorded_problems(step):
            yield text("report.not_proposed", reasons="; ".join(problem_words(each, text) for each in reasons))


def _list_accepted_versions(run: OpenedRun, text: Catalogue) -> Iterator[str]:
    for event in run.story.accepted_steps:
        version, name = str(event.data.get("version", "")), str(event.data.get("by", ""))
        yield text(
            "report.accepted", version=version, name=name, at=time_in(run.zone, event.at, run.story.row.started)
        )


def _series(run: OpenedRun, text: Catalogue) -> Iterator[str]:
    """Yield how each of several parts in a row was corrected."""
    results = [event.data for event in run.story.events if event.kind == "result"]
    passes = results[-1].get("passes") if results else None
    for place, each in enumerate(passes if isinstance(passes, list) else (), start=1):
        taught = each.get("learned") if isinstance(each, Mapping) else None
        if not isinstance(taught, Mapping):
            continue
        air = taught.get("air_lobe_error_um_pp")
        if isinstance(air, list) and air:
            yield text("report.pass_air", part=place, errors=" → ".join(number(um_pp, 2) for um_pp in air))
        trim = taught.get("trim")
        if isinstance(trim, list) and trim and isinstance(trim[0], Mapping):
            amplitude_um = number_or_none(trim[0].get("amplitude_um"))
            yield text(
                "report.pass_trim", part=place, value=um(None if amplitude_um is None else 2.0 * amplitude_um)
            )
        waves = taught.get("learned_waves")
        if isinstance(waves, list) and waves:
            yield text("report.pass_learned", part=place, orders=", ".join(map(str, waves)))


def write_chart(run: OpenedRun, text: Catalogue) -> Markup | None:
    """Write the run chart of the parts up to this one; None for a single part."""
    points, row = run.points or (), run.story.row
    if len(points) < 2:
        return None
    found = job_chart(points, ChartedQuantity.RONT)
    own = [place for place, point in enumerate(points) if point.run_id == row.run_id]
    caption = text("report.chart_caption", count=len(points), limit=um(found.upper_um))
    names = (text("part.part"), "RONt, µm")
    drawing = chart_figure("run-chart", text("report.chart"), caption, names, found, own)
    return section("chart", text("report.chart"), figure(drawing, caption), list_of(_statistics(found, text)))


def _statistics(found: JobChart, text: Catalogue) -> Iterator[str]:
    limits = found.limits
    if limits is None:
        yield text("report.chart_few", count=found.alike_count, least=LEAST_CHART)
    else:
        lower, upper = um(max(limits.lower, 0.0)), um(limits.upper)
        yield text("report.chart_limits", mean=um(limits.mean), lower=lower, upper=upper)
        yield text("report.chart_beyond", count=len(limits.beyond))
    if found.begins:
        yield text("records_page.chart.alike", count=found.alike_count)
    slope = trend(found.values_um[found.begins :])
    if slope is not None:
        key = "report.trend" if slope.significant else "report.no_trend"
        yield text(key, slope=f"{slope.per_part:+z.3f}", half=number(slope.half_width, 3))
    able = found.capability
    if able is None:
        facts = {"count": found.alike_count, "least": LEAST_PARTS, "beyond": len(found.places_beyond_limits)}
        yield f"Cpk: {text(f'records_page.chart.claim.{found.no_claim}', **facts)}"
    else:
        shown = {"cpk": able.cpk, "low": able.cpk_low, "high": able.cpk_high}
        yield text("report.capability", parts=able.parts, **{k: number(v, 2) for k, v in shown.items()})
