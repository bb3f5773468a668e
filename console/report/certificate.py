"""First page of the report, which is signed: part, verdict, each figure with its tolerance, and how it was found.

It is one A4 page in print; the record of the process is behind it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from console.report.drawing import INK, circle, line, picture
from console.report.markup import Markup, element, facts_table, paragraph, table
from console.report.measured_section import judged_z_mm, plot_judged_section
from console.report.quantities import NOTHING, against_limit, date_in, exact, mm, number, um
from console.report.record_sections import list_gaps
from console.report.verdict import SIGNS, Judgement, ReportVerdict, judge_run
from console.session.data.measured_part import UNCERTAINTY, RecordedPart
from console.session.data.run_facts import program_sha256
from console.session.learning.opened_run import OpenedRun
from console.session.part_identity import KEYS, PartIdentity, identity_of
from console.text.along_length import rows_of
from console.text.catalogue import Catalogue
from profiles.metrology.conformity import JudgedFigure, ToleranceKind
from profiles.strict_values import number_or_none
from profiles.trace_files.header import GAUGE_ERROR

_UNNAMED = "temperature_c"  # of the identity: it is told with how the part was measured
_SYMBOL, _STROKE = 16.0, 1.2
_SIGNS = {ToleranceKind.ROUNDNESS: "○", ToleranceKind.CYLINDRICITY: "⌭", ToleranceKind.DIAMETER: "⌀"}
_STATES = ("free", "clamped", "unknown")


def write_certificate(run: OpenedRun, text: Catalogue) -> Markup:
    """Write the page."""
    identity, verdict = identity_of(run.story) or PartIdentity(), judge_run(run, text)
    gaps = len(list(list_gaps(run, text)))
    pair = (
        facts_table(text("report.certificate.part"), _part_rows(run, identity, text)),
        facts_table(text("report.certificate.made"), _made_rows(run, text)),
    )
    conditions = facts_table(text("report.certificate.conditions"), list(_condition_rows(run, identity, text)))
    return element(
        "section",
        element("h1", text("report.heading")),
        element("div", *pair, class_="pair"),
        _verdict_box(verdict, text),
        _figures(run, verdict, text),
        element("div", plot_judged_section(run, text), conditions, class_="shown"),
        facts_table(text("report.certificate.hashes"), _hash_rows(run, text), "hashes"),
        paragraph(element("strong", text("report.gaps", count=gaps))) if gaps else None,
        _signatures(text),
        id="certificate",
    )


def _part_rows(run: OpenedRun, identity: PartIdentity, text: Catalogue) -> list[tuple[str, str]]:
    """Return by what names the part is found; one that is not stated stays open for a pen."""
    job, name = run.job, identity.part_name or run.story.row.job
    rows = [(text(f"identity.{key}"), getattr(identity, key)) for key in KEYS if key != _UNNAMED]
    rows[0] = (rows[0][0], name)
    facts = {} if job is None else {"diameter": exact(job.diameter_mm), "wall": exact(job.wall_thickness_mm)}
    made_of = "" if job is None else text("report.part_words", material=job.material, jaws=job.jaws, **facts)
    return [*rows, (text("report.certificate.blank"), made_of or text("report.not_recorded"))]


def _made_rows(run: OpenedRun, text: Catalogue) -> list[tuple[str, str]]:
    """Return by whom, when and on what the part was made."""
    row, part, unknown = run.story.row, run.product, text("report.not_recorded")
    return [
        (text("fact.operator"), row.operator or unknown),
        (text("report.certificate.cut_at"), date_in(run.zone, row.started)),
        (text("report.certificate.measured_at"), NOTHING if part is None else date_in(run.zone, part.at)),
        (text("fact.machine"), row.machine),
        (text("fact.job"), row.job),
        (text("report.certificate.software"), run.story.software),
    ]


def _verdict_box(verdict: ReportVerdict, text: Catalogue) -> Markup:
    sign = f"{SIGNS[verdict.judgement]} {text(f'report.verdict.{verdict.judgement}')}"
    return element(
        "div",
        paragraph(element("strong", sign)),
        paragraph(" ".join(verdict.reasons)) if verdict.reasons else None,
        class_=f"verdict {verdict.judgement}",
    )


def _figures(run: OpenedRun, verdict: ReportVerdict, text: Catalogue) -> Markup:
    """Return the table of the figures: characteristic, tolerance, result, uncertainty, section, rule, verdict."""
    part = run.product
    if part is None:
        return paragraph(text("report.nothing_measured"))
    names = ("characteristic", "tolerance", "result", "uncertainty", "section", "rule", "conforms")
    head = [text(f"report.certificate.{name}") for name in names]
    rows = [_figure_row(part, kind, verdict, text) for kind in ToleranceKind]
    shown = [row for row in rows if row]
    return table(text("report.certificate.figures"), head, shown, numeric=(2, 3, 4), style="figures")


def _figure_row(part: RecordedPart, kind: ToleranceKind, verdict: ReportVerdict, text: Catalogue) -> list[str]:
    """Return the row of a figure; one without a tolerance is for information, one not measured either has none."""
    judged, z_mm = part.figure(kind), None
    value_um = _measured_um(part, kind) if judged is None else judged.value_um
    if judged is None and value_um is None:
        return []
    if kind is not ToleranceKind.CYLINDRICITY and value_um is not None:
        z_mm = judged_z_mm(part, judged)
    name = Markup(f"{_symbol(kind)} {text(f'report.certificate.{kind}')}")
    return [
        name,
        _tolerance(part, kind, judged, text),
        _result(part, kind, value_um, judged),
        _uncertainty(judged, text),
        number(z_mm, 1),
        _rule(judged, text),
        _conformity(part, judged, verdict, text),
    ]


def _measured_um(part: RecordedPart, kind: ToleranceKind) -> float | None:
    """Return a figure that has no tolerance."""
    by_kind = {ToleranceKind.ROUNDNESS: part.ront_um, ToleranceKind.DIAMETER: part.off_nominal_um}
    return by_kind.get(kind, number_or_none(part.data.get("CYLt_um")))


def _tolerance(part: RecordedPart, kind: ToleranceKind, judged: JudgedFigure | None, text: Catalogue) -> Markup:
    """Return the tolerance as a drawing states it, in mm: in a frame with its symbol, or nominal and limits."""
    if judged is None:
        return Markup(text("report.none_stated"))
    limit = exact(judged.limit_um / 1000.0)
    if kind is ToleranceKind.DIAMETER:
        return element("span", f"{exact(part.nominal_diameter_mm or 0.0)} ± {limit} mm")
    frame = element("span", _symbol(kind, "frame"), element("b", limit), class_="frame")
    return element("span", frame, f" = {exact(judged.limit_um, 'µm')}")


def _symbol(kind: ToleranceKind, name: str = "symbol") -> Markup:
    """Return the drawn symbol of ISO 1101, or that of a diameter."""
    radius = 3.2 if kind is ToleranceKind.CYLINDRICITY else 5.5
    parts = [circle((_SYMBOL / 2, _SYMBOL / 2), radius, fill="none", stroke=INK, stroke_width=_STROKE)]
    if kind is ToleranceKind.CYLINDRICITY:  # two lines at 60 deg that touch the circle
        parts += [line((x, 14.0), (x + 6.93, 2.0), INK, _STROKE) for x in (0.84, 8.23)]
    elif kind is ToleranceKind.DIAMETER:
        parts.append(line((2.5, 13.5), (13.5, 2.5), INK, _STROKE))
    sign = _SIGNS[kind]
    return element("span", picture(f"{name}-{kind}", (_SYMBOL, _SYMBOL), sign, kind.value, *parts), class_="gps")


def _result(part: RecordedPart, kind: ToleranceKind, value_um: float | None, judged: JudgedFigure | None) -> str:
    if value_um is None:
        return NOTHING
    if kind is ToleranceKind.DIAMETER:
        return f"{mm((part.nominal_diameter_mm or 0.0) + value_um / 1000.0)} ({value_um:+z.1f} µm)"
    return um(value_um) if judged is None else f"{against_limit(value_um, judged.limit_um)[0]} µm"


def _uncertainty(judged: JudgedFigure | None, text: Catalogue) -> str:
    if judged is None or judged.u_um is None:
        return text("report.certificate.no_u")
    return f"± {um(judged.u_um)}"


def _rule(judged: JudgedFigure | None, text: Catalogue) -> str:
    if judged is None:
        return text("report.certificate.information")
    return text("report.certificate.simple") if judged.rule is None else text(f"judged.rule.{judged.rule}")


def _conformity(part: RecordedPart, judged: JudgedFigure | None, verdict: ReportVerdict, text: Catalogue) -> str:
    """Return whether a figure is within; of a doubtful record, or of a part that is not judged, nothing."""
    if judged is None:
        return NOTHING
    if verdict.judgement is Judgement.DOUBTFUL:
        return SIGNS[Judgement.DOUBTFUL]
    if judged.passes is None or (part.passed is None and part.is_good is not None):
        is_open = judged.is_open and part.is_open
        return f"{SIGNS[Judgement.OPEN]} {text('report.unproven' if is_open else 'report.not_judged')}"
    sign = SIGNS[Judgement.GOOD if judged.passes else Judgement.BAD]
    return f"{sign} {text('report.certificate.within' if judged.passes else 'report.certificate.outside')}"


def _condition_rows(run: OpenedRun, identity: PartIdentity, text: Catalogue) -> Iterator[tuple[str, str]]:
    """Yield how the figures were found, and on what gauge."""
    part, found = run.product, run.evaluated(run.product)
    meta = {} if found is None else found.trace.meta

    def row(name: str, value: str) -> tuple[str, str]:
        return text(f"report.certificate.{name}"), value

    yield row("standards", text("report.certificate.standards_named"))
    if found is not None and part is not None:
        result = found.result
        state = text(f"state.{result.state}") if result.state in _STATES else result.state
        upr = NOTHING if result.filter_upr is None else exact(result.filter_upr)
        yield row("filter", text("report.certificate.gaussian", upr=upr))
        yield row("reference", text("report.certificate.circles"))
        yield row(
            "sections", text("report.certificate.points", points=result.points, sections=_sections(part, text))
        )
        yield row("state", state)
    unknown = text("report.none_stated")
    yield row("probe", meta.get("probe", unknown))
    simulated = text("report.certificate.simulated_gauge") if run.story.row.simulated else ""
    stated = {} if part is None else part.data.get(UNCERTAINTY)
    own, dated = (
        stated.get(key) if isinstance(stated, Mapping) else None for key in ("gauge", "gauge_calibrated")
    )
    yield row("gauge", meta.get("gauge") or simulated or (own if isinstance(own, str) else unknown))
    if (off := meta.get(GAUGE_ERROR)) is not None:
        yield row("gauge_error", off)
    uncertain = None if part is None else part.uncertainty
    expired = (
        () if uncertain is None or not uncertain.expired else (text("judged.expired", date=uncertain.expired),)
    )
    day = meta.get("gauge_calibrated") or (dated if isinstance(dated, str) else unknown)
    yield row("calibrated", ", ".join((day, *expired)))
    stated_c = identity.temperature_c
    yield row("temperature", unknown if stated_c is None else exact(stated_c, "°C"))


def _sections(part: RecordedPart, text: Catalogue) -> str:
    """Return which sections were measured."""
    rows = rows_of(part.data, "sections", "z_mm")
    heights = sorted(z for row in rows if (z := row["z_mm"]) is not None)
    if len(heights) > 1:
        return text(
            "report.certificate.several", count=len(heights), first=f"{heights[0]:.1f}", last=f"{heights[-1]:.1f}"
        )
    z_mm = judged_z_mm(part, None)
    return (
        text("report.certificate.single")
        if z_mm is None
        else text("report.certificate.single_at", z=f"{z_mm:.1f}")
    )


def _hash_rows(run: OpenedRun, text: Catalogue) -> list[tuple[str, str]]:
    story = run.story
    trace = None if run.product is None else run.product.trace_sha256
    sums = {
        "job_hash": story.job_sha256,
        "machine_hash": story.machine_sha256,
        "program_hash": program_sha256(story.program),
    }
    rows = [(text("fact.run_id.report"), story.row.run_id)]
    rows += [(text(f"fact.{key}"), value) for key, value in sums.items()]
    return [*rows, *([] if trace is None else [(text("report.certificate.trace_hash"), trace)])]


def _signatures(text: Catalogue) -> Markup:
    """Return the places for whoever has measured and whoever releases."""
    head = ["", *(text(f"report.certificate.{name}") for name in ("name", "date", "signature"))]
    rows = [[text(f"report.certificate.{who}"), "", "", ""] for who in ("measured_by", "released_by")]
    return table(text("report.certificate.signatures"), head, rows, style="signatures")
