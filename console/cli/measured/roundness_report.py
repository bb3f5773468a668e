"""Roundness of a trace, and the lobe over a V-block, for people and for JSON; angles from the spindle index."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

from console.cli.output import fields_of
from console.session.learning.evaluated_part import EvaluatedPart
from console.text.catalogue import Catalogue
from console.text.columns import table
from console.text.part_sentences import (
    LEVELLED,
    along_words,
    extraction_words,
    filter_name,
    judged_words,
    states_index,
)
from profiles.metrology.circles import ReferenceCircle
from profiles.metrology.conformity import JudgedFigure, SectionForm, passes_all
from profiles.metrology.cylindricity import CylinderResult
from profiles.metrology.harmonics import usable_factor
from profiles.metrology.length_causes import causes_of_failure
from profiles.metrology.profile_filters import transmission
from profiles.metrology.uncertainty import UncertaintyBudget
from profiles.problem import Problem, ProfileError
from profiles.roundness import RoundnessResult
from profiles.trace_files.header import TraceHeader

PARAMETERS = ("RONt", "RONp", "RONv", "RONq")
SHOWN_HARMONICS = (2, 3, 4, 5, 6, 7, 8, 9, 12, 15)
_STATES = ("free", "clamped", "unknown")


INDEX = {True: "stated", False: "assumed"}

CENTRE = ("centre_x_mm", "centre_y_mm")
"""Of a trace of points in the plane: where its least squares circle is."""


def trace_fields(measured: EvaluatedPart) -> dict[str, object]:
    """Return all results of a trace."""
    result, header, turns = measured.result, measured.header, measured.turns
    return {
        **roundness_fields(result),
        "harmonics": [{**asdict(h), "past_jaw_1_deg": measured.past_jaw_1_deg(h)} for h in result.harmonics],
        "circles": [_circle(circle) for circle in result.circles],
        "above_upr": result.above_upr,
        "filter_kind": result.filter_kind,
        "filter_applied_upr": header.filter_upr,
        **fields_of(result, "recentred", "left_out"),
        "features": [asdict(feature) for feature in result.features],
        "without_features": result.without_features and _parameters(result.without_features),
        "phase_known": header.phase_known,
        **dict(zip(CENTRE, measured.trace.centre_mm or (None, None), strict=True)),
        **fields_of(measured, "jaw_1_deg", "mean_diameter_mm", "tool_offset_um"),
        "turns": turns
        and {
            "count": len(turns.each_um),
            "random_um": turns.random_um,
            "amplitudes": [{"n": h.n, "sd_um": turns.amplitude_sd_um(h.n)} for h in result.harmonics],
        },
    }


def roundness_fields(result: RoundnessResult) -> dict[str, object]:
    """Return the roundness fields that all commands share."""
    return {
        **_parameters(result),
        **fields_of(result, "reference_circle", "filter_upr", "state", "eccentricity_um", "points"),
        "harmonics": [asdict(h) for h in result.harmonics],
    }


def form_fields(whole: CylinderResult, meta: Mapping[str, str]) -> dict[str, object]:
    """Return the form of a part: all reference cylinders, and the extraction strategy (ISO 12180).

    `meta` are the header lines of its file, which may state the index and levelling.
    """
    return {
        "strategy": whole.strategy,
        "filter_upr": whole.filter_upr,
        "filter_kind": whole.filter_kind,
        "points": whole.count,
        "index": INDEX.get(states_index(meta)) if whole.sections else None,
        "levelled": INDEX.get(LEVELLED in meta),
        **whole.event(),
        "cylinders": [
            {"cylinder": each.kind, **{f"CYL{kind}_um": getattr(each, f"cyl{kind}_um") for kind in "tpvq"}}
            for each in whole.cylinders
        ],
    }


def form_lines(
    whole: CylinderResult, meta: Mapping[str, str], judged: Sequence[JudgedFigure], text: Catalogue
) -> list[str]:
    """Return the sections, the reference cylinders, taper, straightnesses and the verdict in words."""
    cylinders: list[tuple[str, ...]] = [("", "CYLt", "CYLp", "CYLv", "CYLq", "")]
    for each in whole.cylinders:
        found = (each.cylt_um, each.cylp_um, each.cylv_um, each.cylq_um)
        cylinders.append((each.kind, *(f"{um:.3f}" for um in found), "um"))
    names = ("taper_um", "crown_um", "axis_straightness_um", "generatrix_straightness_um")
    known = [(name, um) for name in names if (um := getattr(whole, name)) is not None]
    lines = [(text(f"roundness.{name}"), f"{um:.3f}", "um") for name, um in known]
    return [
        *extraction_words(whole, meta, text),
        "",
        *([*section_table(whole.sections, text), ""] if whole.sections else ()),
        *table(cylinders, numeric=(1, 2, 3, 4)),
        "",
        *table(lines, numeric=(1,)),
        *cause_rows(whole, judged, text),
        *(["", *table(judged_rows(judged, text))] if judged else ()),
    ]


def section_table(sections: Sequence[SectionForm], text: Catalogue) -> list[str]:
    """Return RONt and mean deviation of each section as a table."""
    rows = [("Z", "RONt", text("roundness.mean"), "")]
    rows += [(f"{s.z_mm:.3f} mm", f"{s.ront_um:.3f}", f"{s.mean_um:+.3f}", "um") for s in sections]
    return table(rows, numeric=(1, 2))


def judged_rows(figures: Sequence[JudgedFigure], text: Catalogue) -> list[tuple[str, str]]:
    """Return the verdict of each figure as rows of a table of two columns, the first with its name."""
    words = [judged_words(each, text) for each in figures]
    return [("" if number else text("run.verdict"), each) for number, each in enumerate(words)]


def budget_lines(budget: UncertaintyBudget | None, text: Catalogue) -> list[str]:
    """Return the standard uncertainty from each source as a table, with U in its last row; nothing without one."""
    if budget is None:
        return []
    names = ("roundness", "cylindricity", "diameter")
    rows = [(text("budget.source"), "u RONt", "u CYLt", "u D")]
    for row in budget.rows:
        found = [getattr(row, f"{name}_um") for name in names]
        said = [text("budget.unknown") if um is None else f"{um:.3f}" if um else "" for um in found]
        rows.append((text(f"budget.{row.source}"), said[0], said[1], said[2]))
    whole = [
        "" if um is None else f"{um:.3f}" for um in (getattr(budget.expanded, f"{name}_um") for name in names)
    ]
    rows.append((text("budget.expanded"), whole[0], whole[1], whole[2]))
    return ["", text("budget.title", gauge=budget.gauge), *table(rows, numeric=(1, 2, 3))]


def cause_rows(whole: CylinderResult, judged: Sequence[JudgedFigure], text: Catalogue) -> list[str]:
    """Return why the sections of a part differ, or of one that fails what explains that; [] where they do not."""
    along = causes_of_failure(whole.causes, judged)
    title = text("cause.title" if passes_all(judged) is False else "cause.differ")
    causes = [f"  {words}" for words in along_words(along, text)]
    return ["", title, *causes] if causes else []


def _parameters(found: RoundnessResult | ReferenceCircle) -> dict[str, float]:
    return {f"{name}_um": getattr(found, f"{name.lower()}_um") for name in PARAMETERS}


def _circle(circle: ReferenceCircle) -> dict[str, object]:
    return {
        "circle": circle.kind,
        **_parameters(circle),
        **fields_of(circle, "centre_x_um", "centre_y_um", "deviation_um"),
        "contacts": [fields_of(contact, "angle_deg", "outer") for contact in circle.contacts],
    }


def roundness_lines(measured: EvaluatedPart, text: Catalogue) -> list[str]:
    """Return head, figures, the four circles, size, turns and harmonics."""
    result = measured.result
    rows = [(name, f"{um:z.3f}", "um") for name, um in zip(PARAMETERS, _parameters(result).values(), strict=True)]
    if measured.trace.centre_mm is None:  # else it is that about the centre that follows
        rows.append((text("roundness.eccentricity"), f"{result.eccentricity_um:z.3f}", "um"))
    for name, place_mm in zip(CENTRE, measured.trace.centre_mm or (), strict=False):
        rows.append((text(f"roundness.{name}"), f"{place_mm:z.4f}", "mm"))
    if measured.mean_diameter_mm is not None:
        rows.append((text("roundness.mean_diameter"), f"{measured.mean_diameter_mm:.4f}", "mm"))
    if measured.tool_offset_um is not None:
        rows.append((text("roundness.tool_offset"), f"{measured.tool_offset_um:+z.2f}", "um"))
    circles = [(text("roundness.circle"), "RONt", text("roundness.centre_x"), text("roundness.centre_y"))]
    circles += [
        (c.kind, f"{c.ront_um:z.3f} um", f"{c.centre_x_um:z.3f} um", f"{c.centre_y_um:z.3f} um")
        for c in result.circles
    ]
    return [
        *_head(measured, text),
        "",
        *table(rows, numeric=(1,)),
        "",
        *table(circles, numeric=(1, 2, 3)),
        "",
        *_harmonics(measured, text),
    ]


def _head(measured: EvaluatedPart, text: Catalogue) -> list[str]:
    result, header = measured.result, measured.header
    filtered = filter_line(result, text)
    lines = [
        text("roundness.head", circle=result.reference_circle, filter=filtered, points=result.points),
        text("roundness.state", state=state_line(result, text)),
    ]
    if (kind := measured.trace.meta.get("format")) and header.radius_mm is not None:
        lines.append(text("roundness.closed_turn", format=kind, radius=f"{header.radius_mm:.4g}"))
    elif kind:
        lines.append(text("roundness.closed_turn_of_any_size", format=kind))
    if header.filter_upr is not None:
        lines.append(text("roundness.filtered_before", filter=f"{header.filter_upr:g}"))
    if result.recentred:
        lines.append(text("roundness.recentred"))
    if result.left_out:
        lines.append(text("roundness.left_out", count=result.left_out))
    lines += _features(measured, text)
    if measured.turns is not None:
        count, random = len(measured.turns.each_um), f"{measured.turns.random_um:.3f}"
        lines.append(text("roundness.turns", count=count, random=random))
    return lines


def _features(measured: EvaluatedPart, text: Catalogue) -> list[str]:
    """Return the features, and the verdict with and without them."""
    result, job = measured.result, measured.job
    limit_um = None if job is None else job.roundness_tolerance_um
    if result.without_features is None:
        return []
    lines = []
    for each in result.features:
        first, last, height = f"{each.first_deg:.6g}", f"{each.last_deg:.6g}", f"{each.height_um:+.3f}"
        lines.append(text("roundness.feature", first=first, last=last, count=each.points, height=height))
    for key, found in (("with_features", result), ("without_features", result.without_features)):
        within = limit_um is None or found.ront_um <= limit_um
        told = "" if limit_um is None else text("run.within" if within else "run.outside", limit=f"{limit_um:g}")
        verdict = told and f" ({told})"
        lines.append(text(f"roundness.{key}", value=f"{found.ront_um:z.3f}", verdict=verdict))
    return lines


def filter_line(result: RoundnessResult, text: Catalogue) -> str:
    """Return the filter of a result with its cut-offs."""
    if result.filter_upr is None:
        return text("roundness.no_filter")
    above = "" if result.above_upr is None else f"{result.above_upr:g} - "
    return f"{filter_name(result.filter_kind, text)}{above}{result.filter_upr:g} UPR"


def state_line(result: RoundnessResult, text: Catalogue) -> str:
    """Return the state of the measured part, translated where it is one of the usual ones."""
    return text(f"state.{result.state}") if result.state in _STATES else result.state


def _harmonics(measured: EvaluatedPart, text: Catalogue) -> list[str]:
    rows = [(text("roundness.n"), text("roundness.pp"), text("roundness.phase"))]
    shown = [h for h in measured.result.harmonics if h.n in SHOWN_HARMONICS]
    rows += [(str(h.n), f"{2.0 * h.amplitude_um:z.3f} um", f"{h.phase_deg:z.2f} deg") for h in shown]
    past = [deg for h in shown if (deg := measured.past_jaw_1_deg(h)) is not None]
    if not past:
        return [*table(rows, numeric=(0, 1, 2)), _from_index(measured, text)]
    column = [text("roundness.past_jaw_1"), *(f"{deg:z.2f} deg" for deg in past)]
    return table([(*row, cell) for row, cell in zip(rows, column, strict=True)], numeric=(0, 1, 2, 3))


def _from_index(measured: EvaluatedPart, text: Catalogue) -> str:
    """Return which header lines the file needs for angles from jaw 1."""
    if measured.header.phase_known:
        return text("roundness.from_index")
    stated = {"direction": measured.header.direction, "jaw_1_deg": measured.jaw_1_deg}
    missing = ", ".join(key for key, value in stated.items() if value is None)
    return text("roundness.phase_unknown", missing=missing)


def v_block_fields(
    result: RoundnessResult, included_deg: float, lobes: int, header: TraceHeader
) -> dict[str, Any]:
    """Return the lobe from readings that were evaluated like a trace; lengths in um, angles in degrees.

    It is the undulation of the filtered readings over the factor of the V-block and over the fraction of it that
    the filter let pass.

    Raises:
        ProfileError: as `usable_factor`; `value.out_of_range`, the points cannot resolve so many lobes, or the
            filter takes them for roughness or form.
    """
    factor = usable_factor(lobes, included_deg)
    read = next((h for h in result.harmonics if h.n == lobes), None)
    if read is None:
        limit = f"2 - {max((h.n for h in result.harmonics), default=0)}"
        raise ProfileError(Problem(code="value.out_of_range", key="--lobes", value=str(lobes), limit=limit))
    passed = _transmission_excess(result, lobes)
    # With a factor below 0 the indicator reads a valley as a maximum.
    turned_deg = 180.0 / lobes if factor < 0.0 else 0.0
    return {
        "method": "v_block",
        "state": header.state,
        "vblock_deg": included_deg,
        "lobes": lobes,
        "factor": factor,
        "filter_passed": passed,
        "reading_pp_um": result.ront_um,
        "filter_upr": result.filter_upr,
        "above_upr": result.above_upr,
        "lobe_pp_um": 2.0 * (read.amplitude_um / (abs(factor) * passed)),
        "phase_deg": (read.phase_deg + turned_deg) % (360.0 / lobes),
        "phase_known": header.phase_known,
    }


def _transmission_excess(result: RoundnessResult, lobes: int) -> float:
    if result.filter_upr is None:
        return 1.0
    above_upr = result.above_upr or 0.0
    if not above_upr <= lobes <= result.filter_upr:
        limit = f"{above_upr:g} - {result.filter_upr:g} UPR"
        raise ProfileError(Problem(code="value.out_of_range", key="--lobes", value=str(lobes), limit=limit))
    passed = partial(transmission, result.filter_kind, lobes, points=result.points)
    return float(abs(passed(result.filter_upr) - (passed(above_upr) if above_upr else 0.0)))


def v_block_lines(fields: Mapping[str, Any], result: RoundnessResult, text: Catalogue) -> list[str]:
    """Return the output of `v_block_fields` in words."""
    rows = [
        (text("v_block.reading"), f"{result.ront_um:z.3f}", "um p-p"),
        (text("v_block.factor"), f"{fields['factor']:z.3f}", ""),
        (text("v_block.passed"), f"{100.0 * fields['filter_passed']:z.2f}", "%"),
        (text("v_block.lobe", n=fields["lobes"]), f"{fields['lobe_pp_um']:z.3f}", "um p-p"),
        (text("roundness.phase"), f"{fields['phase_deg']:z.2f}", "deg"),
    ]
    head = text("v_block.head", angle=f"{fields['vblock_deg']:g}", filter=filter_line(result, text))
    return [head, text("roundness.state", state=state_line(result, text)), "", *table(rows, numeric=(1,))]
