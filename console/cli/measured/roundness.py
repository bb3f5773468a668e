"""`console roundness`: the roundness of a measured trace."""

from __future__ import annotations

import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.arguments import (
    OUT_OF_TOLERANCE,
    WRONG_USAGE,
    add_fail_out_of_tolerance,
    add_gauge,
    number,
    number_or_nan,
    whole_number,
)
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from profiles.metrology.conformity import JudgedFigure, SectionForm
    from profiles.metrology.cylindricity import CylinderResult, PartSection
    from profiles.metrology.profile_filters import FilterKind
    from profiles.metrology.separation import GaugeError, Placement
    from profiles.metrology.uncertainty import UncertaintyBudget
    from profiles.problem import Problem
    from profiles.roundness import RoundnessResult
    from profiles.trace_files.header import TraceHeader
    from profiles.trace_files.sections import SurfacePoints, TraceSection

REFERENCE_CIRCLES = ("LSC", "MZC", "MCC", "MIC")
OF_ONE_SECTION = ("band", "circle", "robust", "vblock", "lobes")  # options that several sections have no use for
DEFAULT_UPR = "50"
LOWEST_UPR, HIGHEST_UPR = 1.0, 10_000.0


def add(parser: Parser, text: Catalogue) -> None:
    """Add the trace, its filter, the reference circle and what a V-block needs."""
    parser.add_argument("file", metavar="FILE.csv", help=text("help.file"))
    parser.add_argument("others", metavar="SECTION.csv", nargs="*", help=text("help.sections"))
    filters = parser.add_mutually_exclusive_group()
    filters.add_argument(
        "--filter", metavar="UPR|KIND|KIND:UPR|none", default=DEFAULT_UPR, type=_filter, help=text("help.filter")
    )
    filters.add_argument("--band", metavar="LOW:HIGH", type=_band, help=text("help.band"))
    parser.add_argument("--filter-along", metavar="MM", type=number, help=text("help.filter_along"))
    parser.add_argument("--circle", choices=REFERENCE_CIRCLES, default="LSC", help=text("help.circle"))
    parser.add_argument("--robust", action="store_true", help=text("help.robust"))
    parser.add_argument("--vblock", metavar="DEG", type=number, help=text("help.vblock"))
    parser.add_argument("--lobes", metavar="N", type=whole_number, help=text("help.lobes"))
    parser.add_argument("--job", metavar="JOB", help=text("help.roundness_job"))
    apart_or_off = parser.add_mutually_exclusive_group()
    apart_or_off.add_argument("--separate", metavar="DEG,DEG", type=_placements, help=text("help.separate"))
    apart_or_off.add_argument("--gauge-error", metavar="NAME", help=text("help.gauge_error"))
    parser.add_argument("--save-gauge-error", metavar="NAME", help=text("help.save_gauge_error"))
    add_gauge(parser, text)
    add_fail_out_of_tolerance(parser, text)


def main(options: Namespace, text: Catalogue) -> int:
    """Evaluate a trace and print its roundness; warnings go to stderr."""
    from console.cli.library import naming
    from console.cli.measured.gauge_separation import (
        separate_files,
        separation_fields,
        separation_lines,
        without_kept_error,
    )
    from console.cli.measured.roundness_report import (
        budget_lines,
        judged_rows,
        roundness_lines,
        trace_fields,
        v_block_fields,
        v_block_lines,
    )
    from console.cli.measured.trace_evaluation import evaluate_trace_file
    from console.cli.output import show, tell
    from console.session.cut.recording import budget_event
    from console.text.columns import table
    from console.text.part_sentences import at_height, judged_fields, section_words
    from profiles.files import printable
    from profiles.metrology.conformity import passes_all
    from profiles.metrology.cylindricity import PartSection, few_sections
    from profiles.problem import ProfileError
    from profiles.trace_files.sections import SurfacePoints, read_surface

    if options.fail_out_of_tolerance and options.job is None:
        print(f"console roundness: {text('usage.tolerance_without_job')}", file=sys.stderr)
        return WRONG_USAGE
    if options.save_gauge_error is not None and options.separate is None:
        print(f"console roundness: {text('usage.error_without_separate')}", file=sys.stderr)
        return WRONG_USAGE
    apart = None if options.separate is None else separate_files(options)
    off: tuple[Problem, ...] = ()
    if apart is None:
        sections = read_surface([Path(file) for file in (options.file, *options.others)])
        sections, error, off = without_kept_error(options, sections)
    else:
        sections, error, off = (apart.first,), apart.error, apart.told
    told = tell(off, text)
    if isinstance(sections, SurfacePoints) or len(sections) > 1:
        return _whole(options, sections, text, told, error)
    if options.filter_along is not None:
        with naming(printable(options.file)):
            raise ProfileError(few_sections(1, "--filter-along"))
    measured = evaluate_trace_file(options, sections[0].trace)
    warnings = [*told, *tell(measured.result.warnings, text)]
    if options.vblock is not None:
        with naming(printable(options.file)):
            fields = v_block_fields(measured.result, options.vblock, options.lobes, measured.header)
        lines = v_block_lines(fields, measured.result, text)
    else:
        fields, lines = trace_fields(measured), roundness_lines(measured, text)
    more = {"meta": dict(measured.trace.meta), "warnings": warnings}
    z_mm, result = sections[0].z_mm, measured.result
    fields, lines = {**fields, "z_mm": z_mm, "CYLt_um": None}, [at_height(z_mm, text), *lines]
    lines += [] if options.vblock is not None else ["", f"CYLt -: {text.problem(few_sections(1))}"]
    place = PartSection(
        z_mm=z_mm or 0.0, angle_deg=measured.turn.angle_deg, deviation_um=measured.turn.deviation_um
    )
    places = [] if options.vblock is not None else [place]
    budget = _budget(options, places, measured.trace.meta, measured.header, result, error)
    judged = _judged(options, budget, measured.header, z_mm, result.ront_um, result.mean_deviation_um)
    said = ["", section_words(z_mm, text), *table(judged_rows(judged, text))] if judged else []
    fields |= judged_fields(judged) | budget_event(budget)
    if apart is not None:
        fields["separation"], lines = separation_fields(apart), [*separation_lines(apart, text), *lines]
    show(
        options,
        lambda: {"file": options.file, **fields, **more},
        lambda: [*lines, *budget_lines(budget, text), *said],
    )
    return OUT_OF_TOLERANCE if options.fail_out_of_tolerance and passes_all(judged) is False else 0


def _whole(
    options: Namespace,
    found: Sequence[TraceSection] | SurfacePoints,
    text: Catalogue,
    told: Sequence[str],
    error: GaugeError | None,
) -> int:
    """Print the form over the length of a part that was measured in several sections, or in points."""
    from console.cli.library import job_of, naming
    from console.cli.measured.roundness_report import budget_lines, form_fields, form_lines
    from console.cli.output import show, tell
    from console.session.cut.recording import budget_event
    from console.text.part_sentences import judged_fields
    from profiles.files import printable
    from profiles.metrology.conformity import passes_all
    from profiles.metrology.cylindricity import LEAST_SECTIONS, LEAST_SQUARES, coarse_points, part_section
    from profiles.problem import ProfileError
    from profiles.trace_files.header import header_of
    from profiles.trace_files.sections import SurfacePoints, no_sections

    if unused := [f"--{name}" for name in OF_ONE_SECTION if getattr(options, name) not in (None, False, "LSC")]:
        print(f"console roundness: {text('usage.one_section', options=', '.join(unused))}", file=sys.stderr)
        return WRONG_USAGE
    where = printable(options.file)
    meta = found.meta if isinstance(found, SurfacePoints) else found[0].trace.meta
    header, doubts = header_of(meta)
    with naming(where):
        if not isinstance(found, SurfacePoints):
            doubts = (*doubts, *_doubts(options, found, header))
            found = _on_part(options, found, header)
            header = replace(header, z_from=None)  # they count from the jaw faces now
            if len(found) < LEAST_SECTIONS:
                return _few(options, found, header, [*told, *tell(doubts, text)], text, error)
        elif options.job is not None and (coarse := coarse_points(found, job_of(options).job.jaws)):
            raise ProfileError(*coarse)
        whole = _evaluate(options, found)
    warnings = tell(doubts, text)
    if isinstance(found, SurfacePoints):  # of points that are no sections only the form is known
        budget = _budget(options, (), meta, header, None, error)
        mean_um = whole.cylinder(LEAST_SQUARES).deviation_um
        heights = found.z_mm.tolist()
        judged = _judged(options, budget, header, None, None, mean_um, whole, (min(heights), max(heights)))
    else:
        budget = _budget(options, [part_section(each) for each in found], meta, header, None, error)
        first, heights = whole.sections[0], [each.z_mm for each in whole.sections]
        judged = _judged(options, budget, header, first.z_mm, first.ront_um, first.mean_um, whole, heights)
    fields = {"files": [options.file, *options.others], **form_fields(whole, meta), **judged_fields(judged)}
    fields |= {"warnings": [*told, *warnings], **budget_event(budget)}
    show(options, lambda: fields, lambda: [*budget_lines(budget, text), *form_lines(whole, meta, judged, text)])
    if options.fail_out_of_tolerance and passes_all(judged) is False:
        return OUT_OF_TOLERANCE
    if options.fail_out_of_tolerance and isinstance(found, SurfacePoints):  # its roundness is not known
        raise ProfileError(no_sections(found, where))
    return 0


def _few(
    options: Namespace,
    found: Sequence[TraceSection],
    header: TraceHeader,
    warnings: list[str],
    text: Catalogue,
    error: GaugeError | None,
) -> int:
    """Print the roundness of sections that are too few for a form over the length, and say so."""
    from console.cli.measured.roundness_report import budget_lines, judged_rows, section_table
    from console.cli.output import show, tell
    from console.session.cut.recording import budget_event
    from console.text.columns import table
    from console.text.part_sentences import judged_fields
    from profiles.metrology.conformity import passes_all
    from profiles.metrology.cylindricity import few_sections, filtered_section, part_section, section_form
    from profiles.problem import ProfileError

    if options.filter_along is not None:
        raise ProfileError(few_sections(len(found), "--filter-along"))
    warnings += tell([few_sections(len(found))], text)
    sections, meta = [part_section(each) for each in found], found[0].trace.meta
    forms = [section_form(filtered_section(each, *options.filter)) for each in sections]
    budget, first = _budget(options, sections, meta, header, None, error), forms[0]
    judged = _judged(options, budget, header, first.z_mm, first.ront_um, first.mean_um, sections=forms)
    fields = {"files": [options.file, *options.others], "CYLt_um": None, **judged_fields(judged)}
    fields |= {"sections": [each.fields() for each in forms], "warnings": warnings, **budget_event(budget)}
    said = ["", *table(judged_rows(judged, text))] if judged else []
    show(options, lambda: fields, lambda: [*budget_lines(budget, text), *section_table(forms, text), *said])
    return OUT_OF_TOLERANCE if options.fail_out_of_tolerance and passes_all(judged) is False else 0


def _doubts(options: Namespace, found: Sequence[TraceSection], header: TraceHeader) -> list[Problem]:
    """Return what is doubtful in a section, with its height."""
    from console.session.learning.evaluated_part import at_height, fold_turns
    from profiles.roundness import evaluate

    doubts = []
    for each in found:
        with at_height(each.z_mm):
            turn, _ = fold_turns(each.trace, header)
            upr, kind = options.filter
            result = evaluate(turn.angle_deg, turn.deviation_um, upr, radius_mm=header.radius_mm, filter_kind=kind)
        doubts += [replace(doubt, where=f"Z {each.z_mm:g} mm") for doubt in result.warnings]
    return doubts


def _on_part(options: Namespace, found: Sequence[TraceSection], header: TraceHeader) -> Sequence[TraceSection]:
    """Return the sections at their heights from the jaw faces, if they are counted from the free end of a job."""
    from console.cli.library import job_of
    from console.session.learning.evaluated_part import place_heights
    from profiles.problem import ProfileError

    if options.job is None or header.z_from is None:
        return found
    heights, outside = place_heights([each.z_mm for each in found], header, job_of(options).job)
    if outside:
        raise ProfileError(*outside)
    placed = [replace(each, z_mm=z_mm) for each, z_mm in zip(found, heights, strict=True)]
    return sorted(placed, key=lambda each: each.z_mm or 0.0)


def _evaluate(options: Namespace, found: Sequence[TraceSection] | SurfacePoints) -> CylinderResult:
    from profiles.metrology.cylindricity import evaluate_cylinder, evaluate_points, part_section
    from profiles.trace_files.sections import SurfacePoints

    if isinstance(found, SurfacePoints):
        return evaluate_points(found, filter_along_mm=options.filter_along)
    sections = [part_section(each) for each in found]
    upr, kind = options.filter
    return evaluate_cylinder(sections, filter_upr=upr, filter_along_mm=options.filter_along, filter_kind=kind)


def _budget(
    options: Namespace,
    sections: Sequence[PartSection],
    meta: Mapping[str, str],
    header: TraceHeader,
    result: RoundnessResult | None,
    error: GaugeError | None,
) -> UncertaintyBudget | None:
    """Return the uncertainty by the gauge named on the command line, None without one; of points no sections.

    `error` is that of the gauge, if it was taken off.
    """
    from console.cli.library import gauge_of, job_of
    from profiles.metrology.uncertainty import part_budget, points_budget
    from profiles.trace_files.header import GAUGE_ERROR

    gauge = gauge_of(options)
    if gauge is None or not sections:
        return None if gauge is None else points_budget(gauge)
    job = None if options.job is None else job_of(options).job
    upr, kind = options.filter
    return part_budget(
        gauge,
        sections,
        result,
        filter_upr=upr if result is None else result.filter_upr,
        filter_kind=kind,
        header=header,
        job=job,
        error=error if GAUGE_ERROR in meta else None,
    )


def _judged(
    options: Namespace,
    budget: UncertaintyBudget | None,
    header: TraceHeader,
    z_mm: float | None,
    ront_um: float | None,
    mean_um: float,
    whole: CylinderResult | None = None,
    heights: Sequence[float] = (),
    sections: Sequence[SectionForm] = (),
) -> tuple[JudgedFigure, ...]:
    """Return the figures of a part against the limits of its job, none without a job; `heights` are its own.

    `sections` are those of a part that has too few for a form over its length.

    Raises ProfileError: `trace.off_cut`, a section lies off the cut; heights count from the jaw faces, if the
    header says nothing else.
    """
    from console.cli.library import job_of
    from console.session.learning.evaluated_part import place_heights
    from profiles.metrology.conformity import judge_part
    from profiles.metrology.cylindricity import LEAST_SPAN
    from profiles.problem import ProfileError
    from profiles.trace_files.header import Z_FROM

    if options.job is None:
        return ()
    job, off_um = job_of(options).job, None
    if heights := heights or [each.z_mm for each in sections]:
        counted = replace(header, z_from=header.z_from or Z_FROM[0])
        if outside := place_heights(heights, counted, job)[1]:
            raise ProfileError(*outside)
    if header.radius_mm is not None and header.size != "relative":
        off_um = 2000.0 * (header.radius_mm - job.finished_radius_mm) + 2.0 * mean_um
    sections, cylt_um = (sections, None) if whole is None else (whole.sections, whole.cylt_um)
    if heights and heights[-1] - heights[0] < LEAST_SPAN * job.cut_length_mm:
        cylt_um = None  # a sliver says nothing about the length
    return judge_part(
        job.tolerances,
        ront_um=ront_um,
        mean_um=mean_um,
        off_um=off_um,
        z_mm=z_mm,
        sections=sections,
        taper_um=0.0 if whole is None else whole.taper_um,
        cylt_um=cylt_um,
        uncertainty=None if budget is None else budget.expanded,
    )


def _placements(words: str) -> tuple[Placement, ...]:
    from console.cli.measured.gauge_separation import placements

    return placements(words)


def _filter(word: str) -> tuple[float | None, FilterKind]:
    """Return the cut-off and the kind of a filter: "15", "spline", "2rc:15", "none"."""
    from profiles.metrology.profile_filters import FilterKind

    if word == "none":
        return None, FilterKind.GAUSS
    first, colon, last = word.partition(":")
    kind = FilterKind(first) if first in [*FilterKind] else None
    value = number_or_nan(last if colon else DEFAULT_UPR if kind else word)
    if not LOWEST_UPR <= value <= HIGHEST_UPR or (colon and kind is None):
        raise ArgumentTypeError(Parser.text("usage.filter", value=word, choices=", ".join(FilterKind)))
    return value, kind or FilterKind.GAUSS


def _band(word: str) -> tuple[float, float]:
    low, _, high = word.partition(":")
    band = number_or_nan(low), number_or_nan(high)
    if not LOWEST_UPR <= band[0] < band[1] <= HIGHEST_UPR:
        raise ArgumentTypeError(Parser.text("usage.band", value=word))
    return band
