"""Text of a run chart: its lines, what is claimed of the process, the trend of the lobe; and its picture."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from console.text.units import Units
from console.tui.lines import NOTHING, Line, dim, hanging, line, wrapped
from console.tui.plot.run_chart_view import ChartPicture, Level
from console.tui.records.job_chart import Figure, JobChart, NoClaim
from console.tui.theme import Token
from profiles.files import printable
from profiles.metrology.process_statistics import LEAST_CHART, LEAST_PARTS, LEAST_TREND, Capability

MOST_NAMED = 8  # parts beyond the limits that are named


def chart_picture(chart: JobChart, units: Units) -> ChartPicture:
    """Return the chart as it is drawn, in these units; a limit below 0 of what cannot be below is left out."""
    size, begins = units.size("um"), float(chart.numbers[chart.begins]) if chart.numbers else 0.0
    levels = [
        Level(value=value / size, name="tol", token=Token.WARNING)
        for value in (chart.lower_um, chart.upper_um)
        if value is not None
    ]
    if chart.limits is not None:
        found = chart.limits
        if chart.figure is not Figure.RONT or found.lower > 0.0:
            levels.append(Level(value=found.lower / size, name="LCL", token=Token.DIM, begins=begins, dashed=True))
        levels.append(Level(value=found.upper / size, name="UCL", token=Token.DIM, begins=begins, dashed=True))
        levels.append(Level(value=found.mean / size, name="avg", token=Token.RING, begins=begins))
    values = [each / size for each in chart.values_um]
    return ChartPicture(
        numbers=chart.numbers, values=values, beyond=chart.beyond, levels=levels, unit=units.unit("um")
    )


def chart_title(chart: JobChart, text: Catalogue) -> str:
    """Return whose parts are charted."""
    figure = text(f"records_page.chart.{chart.figure}")
    return f"{figure} · {printable(chart.parts.job, 30)} · {printable(chart.parts.strategy, 12)}"


def chart_lines(chart: JobChart, text: Catalogue, width: int) -> list[Line]:
    """Return what the chart says, the most important first."""
    if not chart.values_um:
        said = "no_parts" if not chart.parts.points else "no_diameters"
        return wrapped(text(f"records_page.chart.{said}"), width)
    lines = _limit_lines(chart, text, width)
    lines += _claim_lines(chart, text, width)
    lines += _lobe_lines(chart, text, width)
    count, dates = len(chart.values_um), {"first": _date(chart.first), "last": _date(chart.last)}
    lines += wrapped(text("records_page.chart.parts", count=count, **dates), width, Token.DIM)
    if chart.begins:
        lines += wrapped(text("records_page.chart.alike", count=chart.alike), width, Token.DIM)
    if chart.parts.others:
        lines += wrapped(text("records_page.chart.others", count=chart.parts.others), width, Token.DIM)
    return lines


def _limit_lines(chart: JobChart, text: Catalogue, width: int) -> list[Line]:
    limits = chart.limits
    if limits is None:
        few = text("records_page.chart.no_limits", count=chart.alike, least=LEAST_CHART)
        return wrapped(few, width)
    found = {"mean": limits.mean, "lower": limits.lower, "upper": limits.upper}
    facts = {name: text.units.figure(value, "um", 2) for name, value in found.items()}
    if chart.figure is Figure.RONT and limits.lower <= 0.0:
        facts["lower"] = "0"
    lines = wrapped(text("records_page.chart.limits", **facts), width)
    if not chart.beyond:
        return [*lines, line(dim(text("records_page.chart.none_beyond")))]
    named = [str(chart.numbers[place]) for place in chart.beyond]
    more = "" if len(named) <= MOST_NAMED else " …"
    which = ", ".join(named[-MOST_NAMED:]) if not more else "… " + ", ".join(named[-MOST_NAMED:])
    beyond = text("records_page.chart.beyond", count=len(named), which=which)
    return [*lines, *hanging(("✗ ", Token.WARNING), beyond, width, Token.WARNING)]


def _claim_lines(chart: JobChart, text: Catalogue, width: int) -> list[Line]:
    """Return the indices with the number of parts and their interval, or why none is claimed."""
    found = chart.capability
    if found is not None:
        return wrapped(capability_words(found, text), width, Token.STRONG)
    facts = {"count": chart.alike, "least": LEAST_PARTS, "beyond": len(chart.beyond)}
    said = text(f"records_page.chart.claim.{chart.no_claim or NoClaim.LATER}", **facts)
    return hanging(dim("Cpk – "), said, width)


def capability_words(found: Capability, text: Catalogue) -> str:
    """Return the indices of a process with their 95 % intervals and the number of parts."""
    said = []
    if found.cp is not None and found.cp_low is not None and found.cp_high is not None:
        said.append(f"Cp {found.cp:.2f} ({found.cp_low:.2f} – {found.cp_high:.2f})")
    said.append(f"Cpk {found.cpk:.2f} ({found.cpk_low:.2f} – {found.cpk_high:.2f})")
    return f"{' · '.join(said)} {text('records_page.chart.confidence', count=found.parts)}"


def _lobe_lines(chart: JobChart, text: Catalogue, width: int) -> list[Line]:
    found = chart.lobe
    if found is None:
        if chart.no_claim is NoClaim.LATER:
            return []
        few = text("records_page.chart.no_trend", least=LEAST_TREND)
        return wrapped(few, width, Token.DIM)
    rising = "rising" if found.per_part > 0.0 else "falling"
    slope, half = text.units.figure(found.per_part, "um", 3, "+"), text.units.figure(found.half_width, "um", 3)
    facts = {"slope": slope, "half": half, "count": found.parts}
    said = text(f"records_page.chart.{rising if found.significant else 'steady'}", **facts)
    return wrapped(said, width, Token.WARNING if found.significant and found.per_part > 0.0 else Token.TEXT)


def _date(date: object) -> str:
    from datetime import datetime

    return date.astimezone().strftime("%Y-%m-%d") if isinstance(date, datetime) and date.year > 1 else NOTHING
