"""Section on the measurement: the part before and after compensation as plots, figures and harmonics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from console.report.drawing import (
    ACCENT,
    DASHED,
    GREY,
    INK,
    PALE,
    Axes,
    Point,
    circle,
    figure,
    frame,
    label,
    line,
    path,
    picture,
    step_125,
)
from console.report.markup import Markup, element, list_of, paragraph, section, table
from console.report.quantities import NOTHING, exact, mm, number, um
from console.report.verdict import SIGNS, Judgement
from console.session.data.measured_part import SECTION_Z, RecordedPart
from console.session.learning.evaluated_part import EvaluatedPart
from console.session.learning.opened_run import OpenedRun
from console.text.along_length import form_words, section_rows
from console.text.catalogue import Catalogue
from console.text.part_sentences import place_words
from console.text.recorded_words import is_plain, part_words
from profiles.arrays import Floats
from profiles.compensations.path import free_state_lobe
from profiles.job import Job
from profiles.metrology.circles import CIRCLES
from profiles.metrology.conformity import JudgedFigure, ToleranceKind
from profiles.metrology.unrolled import TURN_DEG, UnrolledPart, unroll_kept
from profiles.roundness import RoundnessResult
from profiles.strict_values import number_or_none

_TURN_DEG = np.arange(0.0, 360.0, 0.5)


def write_measurement(run: OpenedRun, text: Catalogue) -> Markup:
    """Write the section; without a measured part it says so."""
    title = text("report.measured")
    if not run.parts:
        return section("measured", title, paragraph(text("report.nothing_measured")))
    return section(
        "measured",
        title,
        _describe_evaluation(run, text),
        _plots(run, text),
        _figures(run, text),
        _sections(run, text),
        _diameters(run, text),
        _harmonics(run, text),
        _all_parts(run, text),
        _checks(run, text),
    )


def _describe_evaluation(run: OpenedRun, text: Catalogue) -> Markup | None:
    """Return the conditions of every figure: circle, filter, state, number of points."""
    shown = run.product or run.parts[-1]
    found = run.evaluated(shown)
    if found is None:
        return None
    result = found.result
    state = text(f"state.{result.state}") if result.state in ("free", "clamped", "unknown") else result.state
    upr = NOTHING if result.filter_upr is None else exact(result.filter_upr)
    how = text("report.how_evaluated", upr=upr, state=state, points=result.points)
    lines = [how, *(text.problem(each) for each in (*found.warnings, *result.warnings))]
    if shown.trace_name:
        lines.append(text("report.imported", name=shown.trace_name))
    return list_of(lines)


SIZE, CENTRE = 340.0, 170.0
REFERENCE, DIVISION = 76.0, 27.0
DIVISIONS = 2
RIM = REFERENCE + DIVISIONS * DIVISION
SCALE_DEG = -78.0
DRAWN_POINTS = 720  # some fourteen for each undulation that the filter passes
LEAST_STEP_UM = 0.1  # a part is not shown rounder than it can be measured


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profile:
    """Deviations of M points, um, outwards from the reference circle; shape (M,) each. `bold` is the product."""

    angle_deg: Floats
    deviation_um: Floats
    bold: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Marks:
    """The tolerance zone, um from the circle, and the jaws, drawn with the profiles.

    The zone is None if nothing is judged, `jaw_1_deg` None if the angles are not tied to the jaws.
    """

    zone_um: tuple[float, float] | None = None
    jaw_1_deg: float | None = None
    jaws: int = 0


def zone_of(profile: Profile, tolerance_um: float) -> tuple[float, float]:
    """Return the zone of a tolerance about the middle of a profile: it holds the profile if RONt is within it."""
    middle = 0.5 * float(profile.deviation_um.max() + profile.deviation_um.min())
    return middle - 0.5 * tolerance_um, middle + 0.5 * tolerance_um


def division_um(profiles: Sequence[Profile], marks: Marks) -> float:
    """Return the um of a division by which everything fits."""
    reach = max((float(np.abs(each.deviation_um).max()) for each in profiles), default=0.0)
    reach = max(reach, *(abs(each) for each in marks.zone_um or (0.0,)), LEAST_STEP_UM)
    return step_125(reach / DIVISIONS)


def roundness_figure(
    name: str, title: str, description: str, profiles: Sequence[Profile], marks: Marks, jaw_word: str
) -> Markup:
    """Return the plot; `jaw_word` is the label of a jaw, with its number added. Angles run counter-clockwise."""
    step_um = division_um(profiles, marks)

    def spot(angle_deg: float, um: float) -> Point:
        return _spot(angle_deg, REFERENCE + DIVISION * um / step_um)

    drawn = _rings(step_um)
    if marks.zone_um is not None:
        for edge_um in marks.zone_um:
            radius = REFERENCE + DIVISION * edge_um / step_um
            drawn.append(
                circle((CENTRE, CENTRE), radius, fill="none", stroke=INK, stroke_width=1, stroke_dasharray="2 3")
            )
    for each in profiles:
        points = [spot(*pair) for pair in zip(each.angle_deg.tolist(), each.deviation_um.tolist(), strict=True)]
        ink, dash = (ACCENT, None) if each.bold else (GREY, DASHED)
        drawn.append(path(points, ink, 2.0 if each.bold else 1.5, dash, closed=True))
    drawn += _numbers(step_um)
    if marks.jaw_1_deg is not None:
        drawn += _jaws(marks.jaw_1_deg, marks.jaws, jaw_word)
    return picture(name, (SIZE, SIZE), title, description, *drawn)


def _spot(angle_deg: float, radius: float) -> Point:
    angle = math.radians(angle_deg)
    return CENTRE + radius * math.cos(angle), CENTRE - radius * math.sin(angle)


def _rings(step_um: float) -> list[Markup]:
    middle = (CENTRE, CENTRE)
    rings = [
        circle(middle, REFERENCE + place * DIVISION, fill="none", stroke=GREY if place == 0 else PALE)
        for place in range(-DIVISIONS, DIVISIONS + 1)
    ]
    return [*rings, *(line(_spot(turn, REFERENCE - 2 * DIVISION), _spot(turn, RIM)) for turn in (0, 90, 180, 270))]


def _numbers(step_um: float) -> list[Markup]:
    """Return the scale, on a steep ray, where the numbers stand one below the other."""
    numbers = []
    for place in range(-DIVISIONS, DIVISIONS + 1):
        x, y = _spot(SCALE_DEG, REFERENCE + place * DIVISION)
        unit = " µm" if place == DIVISIONS else ""
        numbers.append(label((x, y + 4.0), f"{place * step_um:+.6g}{unit}" if place else "0", "start", GREY))
    return numbers


def _jaws(jaw_1_deg: float, jaws: int, word: str) -> list[Markup]:
    drawn = []
    for jaw in range(jaws):
        angle = jaw_1_deg + 360.0 * jaw / jaws
        tip, left, right = _spot(angle, RIM + 3), _spot(angle - 3.0, RIM + 12), _spot(angle + 3.0, RIM + 12)
        drawn.append(path([tip, left, right], INK, 1.5, closed=True))
        x, y = _spot(angle, RIM + 24)
        drawn.append(label((x, y + 4.0), f"{word} {jaw + 1}" if jaw == 0 else str(jaw + 1)))
    return drawn


def plot_judged_section(run: OpenedRun, text: Catalogue) -> Markup | None:
    """Return the section by which the roundness of the product is judged, with its zone; None without a trace."""
    part, found = run.product, run.evaluated(run.product)
    if part is None or found is None:
        return None
    judged = part.figure(ToleranceKind.ROUNDNESS)
    z_mm = judged_z_mm(part, judged)
    mine, jaw_1_deg = _plotted_profile(found), found.jaw_1_deg
    kept = unroll_kept(part.data)
    if judged is not None and judged.z_mm is not None and kept is not None and judged.z_mm in kept.z_mm:
        place = int(np.flatnonzero(kept.z_mm == judged.z_mm)[0])
        mine = Profile(angle_deg=TURN_DEG, deviation_um=kept.round_um[place], bold=True)
        spindle_deg = number_or_none(part.data.get("jaw_1_deg", run.story.setup.get("jaw_1_deg")))
        jaw_1_deg = spindle_deg if found.header.phase_known else None
    marks = replace(_marks(run, part, mine), jaw_1_deg=jaw_1_deg)
    what = text("report.plot_judged", at=place_words(z_mm, text))
    return _plot("judged", [mine], marks, text, what, None if kept is None else _draw_surface(kept, text))


SHADES = 4  # each way


def _draw_surface(kept: UnrolledPart, text: Catalogue) -> Markup:
    """Return the unrolled surface about its least squares cylinder, the higher the darker."""
    z_mm, off_um, title = kept.z_mm, kept.cylinder_um, text("report.surface_plot")
    step_um = step_125(max(float(np.abs(off_um).max()), LEAST_STEP_UM) / (SHADES + 0.5))
    middles = 0.5 * (z_mm[1:] + z_mm[:-1])
    edges = [2.0 * z_mm[0] - middles[0], *middles, 2.0 * z_mm[-1] - middles[-1]]
    axes, drawn = (
        Axes(left=52.0, width=276.0, height=56.0, x_range=(0.0, 360.0), y_range=(edges[0], edges[-1])),
        [],
    )
    for (low, high), row in zip(pairwise(edges), np.rint(off_um / step_um), strict=True):
        for first, end in pairwise([0, *(np.flatnonzero(np.diff(row)) + 1).tolist(), row.size]):
            (left, top), (right, foot) = axes.point_at(first, high), axes.point_at(end, low)
            grey, y = round(127.5 * (1.0 - row[first] / SHADES)), 0.5 * (top + foot)
            drawn.append(line((left, y), (right, y), f"rgb({grey},{grey},{grey})", foot - top))
    names = (text("report.surface_scale", step=f"{step_um:g}"), text("report.certificate.section"))
    drawn += frame(axes, names, (0.0, 90.0, 180.0, 270.0, 360.0), (float(z_mm[0]), float(z_mm[-1])))
    return picture("surface", axes.size, title, f"{title}: {names[0]}", *drawn)


def judged_z_mm(part: RecordedPart, judged: JudgedFigure | None) -> float | None:
    """Return the height of the section of a figure; without several that of the one that was measured."""
    known = None if judged is None else judged.z_mm
    return number_or_none(part.data.get(SECTION_Z)) if known is None else known


def _plots(run: OpenedRun, text: Catalogue) -> Markup | None:
    """Return the part before compensation, with the product on one scale; the first page has that alone."""
    product = run.evaluated(run.product)
    before, measured_before = _uncompensated_profile(run)
    if before is None:
        return None
    if product is None:
        said = text("report.plot_before_only")
        return _plot("before", [before], _marks(run, run.before, None), text, said) if measured_before else None
    mine = _plotted_profile(product)
    key = "report.plot_both" if measured_before else "report.plot_stated"
    return _plot("both", [before, mine], _marks(run, run.product, mine), text, text(key))


def _plot(
    name: str, profiles: list[Profile], marks: Marks, text: Catalogue, what: str, below: Markup | None = None
) -> Markup:
    words = [what, text("report.plot_scale", division=f"{division_um(profiles, marks):g}")]
    if marks.zone_um is not None:
        words.append(text("report.plot_zone", width=exact(round(marks.zone_um[1] - marks.zone_um[0], 9))))
    words.append(text("report.plot_jaws") if marks.jaw_1_deg is not None else text("report.plot_no_jaws"))
    caption = " ".join(words)
    drawing = roundness_figure(
        f"roundness-{name}", text("report.roundness_plot"), caption, profiles, marks, text("report.jaw")
    )
    return figure(drawing if below is None else element("div", drawing, below), caption, "round")


def _uncompensated_profile(run: OpenedRun) -> tuple[Profile | None, bool]:
    """Return the part without compensation, turned to the jaws of the product, and whether it was measured."""
    product, found = run.evaluated(run.product), run.evaluated(run.before)
    jaw_1_deg = product.jaw_1_deg if product else None
    if found is not None:
        by_deg = 0.0 if jaw_1_deg is None or found.jaw_1_deg is None else jaw_1_deg - found.jaw_1_deg
        return _plotted_profile(found, by_deg, bold=False), True
    if run.before is not None or run.job is None or jaw_1_deg is None or not run.job.lobe_error_um_pp:
        return None, False
    if is_plain(run.story.row.strategy):
        return None, False
    return _job_lobe_profile(run.job, jaw_1_deg), False


def _plotted_profile(found: EvaluatedPart, by_deg: float = 0.0, *, bold: bool = True) -> Profile:
    """Return the profile of a part, turned by an angle, with as many points as are drawn."""
    angle_deg = found.turn.angle_deg
    order = np.argsort(np.mod(angle_deg, 360.0), kind="stable")
    kept = order[:: max(1, math.ceil(order.size / DRAWN_POINTS))]
    return Profile(angle_deg=angle_deg[kept] + by_deg, deviation_um=found.profile_um[kept], bold=bold)


def _job_lobe_profile(job: Job, jaw_1_deg: float) -> Profile:
    """Return the lobe that a job states, turned to jaw 1 of the trace."""
    turned = _TURN_DEG - jaw_1_deg + job.jaw_1_deg
    return Profile(angle_deg=_TURN_DEG, deviation_um=free_state_lobe(job).at_um(turned), bold=False)


def _marks(run: OpenedRun, part: RecordedPart | None, mine: Profile | None) -> Marks:
    tolerance_um, found = part.tolerance_um if part is not None else None, run.evaluated(part)
    jaws = 0 if run.job is None else run.job.jaws
    return Marks(
        zone_um=None if mine is None or tolerance_um is None else zone_of(mine, tolerance_um),
        jaw_1_deg=None if found is None or not jaws else found.jaw_1_deg,
        jaws=jaws,
    )


def _pair(run: OpenedRun) -> list[tuple[str, EvaluatedPart]]:
    """Return the parts of the columns, with the word of each."""
    chosen = (("before", run.evaluated(run.before)), ("after", run.evaluated(run.product)))
    return [(word, found) for word, found in chosen if found is not None]


def _figures(run: OpenedRun, text: Catalogue) -> Markup | None:
    pair = _pair(run)
    if not pair:
        return None
    head = [text("report.figure_um"), *(text(f"part.{word}") for word, _ in pair)]
    rows = [
        [f"RONt {kind}", *(number(found.result.circle(kind).ront_um, 3) for _, found in pair)] for kind in CIRCLES
    ]
    rows += [
        [f"{name} LSC", *(number(getattr(found.result, name.lower() + "_um"), 3) for _, found in pair)]
        for name in ("RONp", "RONv", "RONq")
    ]
    rows.append([text("report.eccentricity"), *(number(f.result.eccentricity_um, 3) for _, f in pair)])
    return table(text("report.figures"), head, rows, numeric=range(1, len(head)))


def _sections(run: OpenedRun, text: Catalogue) -> Markup | None:
    """Return the form of the product over its length, with its sections, or where its one section is."""
    data = {} if run.product is None else run.product.data
    form, rows = form_words(data, text), section_rows(data, text)
    if not rows:
        return paragraph(form) if form else None
    return element("div", table(text("run.whole"), rows[0], rows[1:], numeric=(0, 1, 2)), paragraph(form))


def _diameters(run: OpenedRun, text: Catalogue) -> Markup | None:
    """Return the mean diameter against its tolerance."""
    part = run.product
    if part is None or part.diameter_mm is None:
        return paragraph(text("report.no_diameter")) if part is not None else None
    diameter, off_um = mm(part.diameter_mm), part.off_nominal_um
    if off_um is None:
        return paragraph(text("report.diameter", diameter=diameter))
    facts = {"diameter": diameter, "nominal": mm(part.nominal_diameter_mm), "off": f"{off_um:+z.1f} µm"}
    judged, limit_um = part.figure(ToleranceKind.DIAMETER), part.diameter_tolerance_um
    is_unjudged = part.passed is None and part.is_good is not None
    if limit_um is None or is_unjudged or judged is None or judged.value_um is None:
        return paragraph(text("report.diameter_free", **facts))
    worst = mm((part.nominal_diameter_mm or 0.0) + judged.value_um / 1000.0) + place_words(judged.z_mm, text)
    facts |= {"diameter": worst, "off": f"{judged.value_um:+z.1f} µm"}
    judgement = {True: Judgement.GOOD, False: Judgement.BAD, None: Judgement.OPEN}[judged.passes]
    return paragraph(f"{SIGNS[judgement]} {text('report.diameter_judged', **facts, limit=exact(limit_um, 'µm'))}")


LEAST_UM = 0.01
"""Foot of the bars: below it a harmonic is no more than noise of the gauge."""


def harmonics_figure(
    name: str,
    title: str,
    description: str,
    names: tuple[str, str],
    orders: Sequence[int],
    parts: Sequence[tuple[RoundnessResult, bool]],
) -> Markup:
    """Return the bars of some orders; `parts` are results, each with whether it is the product."""
    largest = max((2.0 * each.amplitude_um(n) for each, _ in parts for n in orders), default=0.0)
    decades = max(2, math.ceil(math.log10(max(largest, LEAST_UM) / LEAST_UM)))
    axes = Axes(x_range=(orders[0] - 0.7, orders[-1] + 0.7), y_range=(0.0, float(decades)))
    drawn = frame(axes, names, [float(n) for n in orders], ())
    drawn += _decades(axes, decades)
    wide = axes.width / (len(orders) + 0.4) * 0.8 / max(len(parts), 1)
    for place, (result, product) in enumerate(parts):
        for n in orders:
            height = math.log10(max(2.0 * result.amplitude_um(n), LEAST_UM) / LEAST_UM)
            (x, y), (_, foot) = axes.point_at(float(n), height), axes.point_at(float(n), 0.0)
            left = x + wide * (place - 0.5 * len(parts))
            drawn.append(_bar(left, y, wide - 1.0, foot - y, product=product))
    return picture(name, axes.size, title, description, *drawn)


def _decades(axes: Axes, decades: int) -> list[Markup]:
    drawn = []
    for decade in range(decades + 1):
        left, height = axes.point_at(axes.x_range[0], float(decade))
        drawn += [axes.level(float(decade), PALE, 0.75)]
        drawn += [label((left - 6.0, height + 4.0), f"{LEAST_UM * 10**decade:g}", "end")]
    return drawn


def _bar(left: float, top: float, width: float, height: float, *, product: bool) -> Markup:
    fill, stroke = (ACCENT, ACCENT) if product else ("#fff", GREY)
    return element(
        "rect", x=left, y=top, width=width, height=max(height, 0.0), fill=fill, stroke=stroke, stroke_width=1
    )


def _harmonics(run: OpenedRun, text: Catalogue) -> Markup | None:
    pair = _pair(run)
    if not pair:
        return None
    orders = [harmonic.n for harmonic in pair[-1][1].result.harmonics]
    parts = [(found.result, word == "after") for word, found in pair]
    jaws = 0 if run.job is None else run.job.jaws
    caption = text("report.harmonics_caption")
    names = (text("report.harmonics_axis"), text("report.pp_axis"))
    drawing = harmonics_figure("harmonics", text("report.harmonics"), caption, names, orders, parts)
    last = pair[-1][1]
    head = [
        text("report.order"),
        *(text("report.pp_of", part=text(f"part.{word}")) for word, _ in pair),
        text("report.past_jaw" if last.jaw_1_deg is not None else "report.phase"),
    ]
    rows = [
        [
            f"{n} ◂" if jaws and n % jaws == 0 else str(n),
            *(number(2.0 * found.result.amplitude_um(n), 3) for _, found in pair),
            _phase(last, n),
        ]
        for n in orders
    ]
    said = table(text("report.harmonics_table"), head, rows, numeric=range(len(head)))
    return element("div", figure(drawing, caption), said)


def _phase(found: EvaluatedPart, n: int) -> str:
    harmonic = next(each for each in found.result.harmonics if each.n == n)
    past_deg = found.past_jaw_1_deg(harmonic)
    phase_deg = harmonic.phase_deg if past_deg is None else past_deg
    # Rounded up to a whole undulation it would be no first maximum.
    return number(0.0 if round(phase_deg, 2) >= round(360.0 / n, 2) else phase_deg, 2)


def _all_parts(run: OpenedRun, text: Catalogue) -> Markup | None:
    """Return all measurements of the run; None if they are the two that are compared."""
    again = [(part, text("report.measured_again")) for part in run.again]
    parts = [(part, "") for part in run.parts]
    if not again and all(part in (run.before, run.product) for part in run.parts):
        return None
    head = [text("part.part"), text("report.ront_um"), text("report.lobe_um"), text("report.diameter_mm")]
    rows = [
        [
            " · ".join(filter(None, (part_words(part.part or "part", text), note))),
            f"{number(part.worst[0], 3)}{place_words(part.worst[1], text)}",
            number(part.lobe_um_pp, 3),
            number(part.diameter_mm, 4),
            _describe_pass(part, text),
        ]
        for part, note in (*again, *parts)
    ]
    return table(text("report.all_parts"), [*head, text("report.judged")], rows, numeric=(1, 2, 3))


def _describe_pass(part: RecordedPart, text: Catalogue) -> str:
    if part.passed is None:
        return text("report.unproven" if part.is_open else "report.not_judged")
    sign = SIGNS[Judgement.GOOD if part.passed else Judgement.BAD]
    return f"{sign} {text('report.good' if part.passed else 'report.bad')}"


def _checks(run: OpenedRun, text: Catalogue) -> Markup:
    """Return whether each trace reproduces its recorded figures."""
    lines = []
    for part in run.parts:
        name, found = part_words(part.part or "part", text), run.evaluated(part)
        if part.trace is None:
            lines.append(text("report.check_no_trace", part=name, value=um(part.ront_um)))
        elif found is None:
            why = "; ".join(text.problem(each) for each in run.problems_of(part))
            lines.append(text("report.check_unusable", part=name, why=why))
        elif differing := found.differing:
            facts = {"recorded": um(part.ront_um), "found": um(found.result.ront_um)}
            lines.append(text("report.check_differs", part=name, figures=", ".join(differing), **facts))
        else:
            lines.append(text("report.check_same", part=name))
        if not part.has_its_trace:
            lines.append(text("report.check_hash", part=name))
    return element("div", element("h3", text("report.checks")), list_of(lines))
