"""Text of the page Inspect: the part before and after compensation, compared and in words."""

from __future__ import annotations

import math

from rich.cells import cell_len

from console.session.data.measured_part import RecordedPart
from console.session.data.run_rows import MODEL
from console.session.station.state import MeasuredForm, MeasuredPart
from console.text.catalogue import Catalogue
from console.text.part_sentences import extraction_words, rule_words, section_words
from console.text.recorded_words import local
from console.tui.inspection.comparison import PartComparison, Side
from console.tui.lines import (
    BLANK,
    NOTHING,
    Line,
    Piece,
    clip_lines,
    dim,
    fit_text,
    hanging,
    justify_line,
    line,
    wrap_line,
)
from console.tui.pages.learn_lines import cut_words
from console.tui.pages.preview_lines import AFTER_KEY, BEFORE_KEY
from console.tui.pages.stop_lines import mark_lines
from console.tui.theme import Token
from profiles.files import printable
from profiles.metrology.circles import CIRCLES
from profiles.metrology.conformity import JudgedFigure, ToleranceKind
from profiles.roundness import RoundnessResult

FRONT_MULTIPLES = 3  # multiples of the number of jaws that are listed before the other harmonics
LEAST_PHASED_UM_PP = 0.1  # amplitude below which the phase of a lobe is not shown
_COLUMN = 9
_CHOSEN = " ▸"
_FORM_WIDTH = 60


def name_evaluation(result: RoundnessResult, text: Catalogue, circle: str | None = None) -> str:
    """Return the state, circle and filter that apply to all figures of a result, about its circle or another."""
    filtered = filter_words(result, text)
    return " · ".join((text(f"state.{result.state}"), circle or result.reference_circle, filtered))


def filter_words(result: RoundnessResult, text: Catalogue) -> str:
    """Return the filter of a result."""
    upr = result.filter_upr
    return text("inspect_page.filtered", upr=f"{upr:g}") if upr else text("inspect_page.unfiltered")


def caption_lines(seen: PartComparison, text: Catalogue, width: int, *, beyond: bool = False) -> list[Line]:
    """Return the legend of the traces, jaw 1 and the section; or that the zoom leaves something `beyond`."""
    before, after = seen.before, seen.after
    what = text("inspect_page.measured_before") if before.result else text("inspect_page.stated")
    if seen.other is not None and seen.other.recorded is not None:
        what = other_words(seen.other.recorded, text)
    lines = [_trace_words((BEFORE_KEY, Token.BEFORE), what, before.ront_um, text, width)]
    if after is not None:
        how = text("inspect_page.measured_after", strategy=seen.part.strategy.value)
        lines.append(_trace_words((AFTER_KEY, Token.AFTER), how, after.ront_um, text, width))
    if beyond:
        return [*lines, line((fit_text(text("inspect_page.beyond"), width), Token.WARNING))]
    if seen.other is not None and seen.part.phase_known and before.jaw_1_deg is None:
        return [*lines, line((fit_text(text("inspect_page.not_turned"), width), Token.WARNING))]
    angle = f"{seen.part.jaw_1_deg:.1f}"
    jaw = text("inspect_page.jaw", angle=angle) if seen.part.phase_known else text("inspect_page.jaw_unknown")
    if seen.part.whole is not None and (z_mm := seen.part.section_z_mm) is not None:
        jaw += f" · {text('inspect_page.trace_at', z=text.units.show(z_mm, 'mm', 2))}"
    return [*lines, line(dim(fit_text(jaw, width)))]


def scale_words(
    um_per_division: float, tolerance_um: float | None, text: Catalogue, *, ringed: bool, zoomed: bool
) -> str:
    """Return the scale of the plot, and the tolerance whose rings it shows, or at which zoom it would."""
    words = [
        text(
            "inspect_page.scale_zoomed" if zoomed else "inspect_page.scale",
            value=text.units.format_short(um_per_division, "um"),
        )
    ]
    if tolerance_um is not None:
        key = "tolerance" if ringed else "tolerance_small"
        words.append(text(f"inspect_page.{key}", value=text.units.format_short(tolerance_um, "um")))
    return " · ".join(words)


def other_words(point: RecordedPart, text: Catalogue) -> str:
    """Return when a recorded part was measured, and how it was cut."""
    made = point.strategy if point.compensation is None else point_words(point, text)
    return f"{local(point.at)[5:]} {printable(made, 30)}"


def point_words(point: RecordedPart, text: Catalogue) -> str:
    """Return strategy, compensation and stage of a recorded part."""
    return cut_words(text, point.strategy, point.compensation or MODEL, point.stage, point.inverted, brief=True)


def wrong_lines(part: MeasuredPart, text: Catalogue, width: int) -> list[Line]:
    """Return the defects of a measured part: marks of stops, a doubtful size, warnings of its evaluation."""
    lines = mark_lines(text, part.marks_mm, width, "inspect_page")
    doubts = () if part.size_doubt is None else (part.size_doubt,)
    for problem in (*doubts, *part.result.warnings):
        lines += hanging(("! ", Token.WARNING), text.problem(problem), width, Token.WARNING)
    return lines


def result_lines(
    seen: PartComparison,
    simulated: bool,
    text: Catalogue,
    width: int,
    height: int,
    *,
    lobe_elsewhere: bool = False,
) -> list[Line]:
    """Return the table of both parts and the verdict; in little room lesser figures go, not the defects.

    The lobe is omitted if it is shown elsewhere.
    """
    before, after = seen.before, seen.after.result if seen.after else None
    chosen = seen.looked.circle
    head, four = [_heading(seen, text, width)], [_ront(seen, kind, text, width) for kind in CIRCLES]
    diameter, whole = _diameter(seen.part, text, width), _whole(seen.part, text, width)
    lesser = [
        _columns(
            name, _figure(before.result, chosen, key, text), _figure(after, chosen, key, text), width, Token.TEXT
        )
        for name, key in (("RONp", "ronp_um"), ("RONv", "ronv_um"), ("RONq", "ronq_um"))
    ]
    gained, lines, lobe = _reduction_lines(seen, text, width), _verdict(seen, text, width), list[Line]()
    if simulated:
        lines += wrap_line(text("inspect_page.simulated"), width, Token.SIM)
    rule = hanging(dim("· "), rule_words(seen.part.judged[0], text), width, Token.DIM) if seen.part.judged else []
    if not lobe_elsewhere:
        lobe = _lobe_rows(seen, text, width)
    wrong = wrong_lines(seen.part, text, width)
    room = height - len(head) - len(diameter) - len(lines) - len(wrong)
    circles = four if len(four) <= room else [_ront(seen, chosen, text, width)]
    room -= len(circles)
    kept: list[list[Line]] = []
    for rows in (whole, lobe, gained, lesser, rule):  # the most important first; each as a whole, or not at all
        fits = len(rows) <= room
        kept.append(rows if fits else [])
        room -= len(rows) if fits else 0
    whole, lobe, gained, lesser, rule = kept
    shown = [*head, *circles, *whole, *diameter, *lesser, *lobe, *gained, *lines, *rule, *wrong]
    if room > 1 and before.result is None and seen.after is not None:
        shown += [BLANK, *wrap_line(text("inspect_page.stated_long"), width, Token.DIM)]
    return clip_lines(shown, height, text("panel.more"))


def _ront(seen: PartComparison, kind: str, text: Catalogue, width: int) -> Line:
    """Return RONt of both parts about one circle; the one that is drawn is marked."""
    before, after = seen.before, seen.after
    one, two = (NOTHING if side is None else _ront_of(side, kind, text) for side in (before, after))
    chosen = kind == seen.looked.circle
    name = f"RONt {kind}{_CHOSEN if chosen else ''}"
    return _columns(name, one, two, width, Token.STRONG if chosen else Token.TEXT)


def _ront_of(side: Side, kind: str, text: Catalogue) -> str:
    if side.result is None:  # the job states a lobe, which is as high about each of the circles
        return text.units.figure(side.ront_um, "um", 2)
    return text.units.figure(side.result.circle(kind).ront_um, "um", 2)


def _lobe_rows(seen: PartComparison, text: Catalogue, width: int) -> list[Line]:
    """Return the lobe, peak to peak, and its angle from jaw 1."""
    jaws = seen.part.job.jaws
    return [_harmonic(seen, jaws, text, width, Token.TEXT), _phases(seen, jaws, text, width)]


def _whole(part: MeasuredPart, text: Catalogue, width: int) -> list[Line]:
    """Return CYLt, and the section that is least round; nothing of a part that was measured in one section."""
    if part.whole is None:
        return []
    worst, unit = part.whole.worst, text.units
    cylt = unit.show(part.whole.cylt_um, "um", 2)
    name = text("inspect_page.worst", z=unit.show(worst.z_mm, "mm", 1))
    return [
        justify_line(
            line(dim(text("inspect_page.cylt", count=len(part.whole.sections)))), line((cylt, Token.STRONG)), width
        ),
        justify_line(line(dim(name)), line(unit.show(worst.ront_um, "um", 2)), width),
    ]


def _diameter(part: MeasuredPart, text: Catalogue, width: int) -> list[Line]:
    """Return the mean diameter and how far the tool has to move for the nominal one; nothing without a size."""
    offset_um, diameter_mm = part.tool_offset_um, part.diameter_mm
    if offset_um is None or diameter_mm is None:
        return []
    name = text("inspect_page.diameter_taken" if part.offset_taken else "inspect_page.diameter")
    return [
        justify_line(
            line(dim(name)),
            line(
                f" {text.units.figure(diameter_mm, 'mm', 3)} ",
                (text.units.show(offset_um, "um", 1, "+"), Token.STRONG),
            ),
            width,
        )
    ]


def harmonic_lines(seen: PartComparison, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the harmonics of both parts, those of the jaws first, and the phase of the lobe from jaw 1."""
    jaws, result = seen.part.job.jaws, seen.result
    known = [harmonic.n for harmonic in result.harmonics]
    front = [jaws * multiple for multiple in range(1, FRONT_MULTIPLES + 1) if jaws * multiple in known]
    # In the least room the heading is that of the table above.
    lines = [_heading(seen, text, width)] if height > len(front) + 1 else []
    lines += [_harmonic(seen, n, text, width, Token.STRONG) for n in front]
    lines.append(_phases(seen, jaws, text, width))
    lines += [_harmonic(seen, n, text, width, Token.DIM) for n in known if n not in front]
    return lines[: max(height, 0)]


def phase_from_jaw_deg(side: Side, n: int) -> float | None:
    """Return the phase of harmonic `n` from jaw 1, signed; None if it is not meaningful."""
    if side.result is None or side.jaw_1_deg is None:
        return None
    found = next((harmonic for harmonic in side.result.harmonics if harmonic.n == n), None)
    if found is None or 2.0 * found.amplitude_um < LEAST_PHASED_UM_PP:
        return None
    return math.remainder(found.phase_deg - side.jaw_1_deg, 360.0 / n)


def _trace_words(key: Piece, what: str, ront_um: float, text: Catalogue, width: int) -> Line:
    return justify_line(line(key, " ", what), line((f" {text.units.show(ront_um, 'um', 2)}", key[1])), width)


def _figure(result: RoundnessResult | None, circle: str, key: str, text: Catalogue) -> str:
    return NOTHING if result is None else text.units.figure(getattr(result.circle(circle), key), "um", 2)


def _heading(seen: PartComparison, text: Catalogue, width: int) -> Line:
    before = text("part.before" if seen.other is None else "inspect_page.other")
    after = text("part.after" if seen.other is None else "inspect_page.this")
    return _columns(text.units.unit("um"), before, after, width, Token.DIM)


def _columns(name: str, before: str, after: str, width: int, token: Token) -> Line:
    """Return one row of a table: a name, and two values in columns of cells."""
    values = "".join(text for value in (before, after) for text, _ in justify_line(BLANK, line(value), _COLUMN))
    return justify_line(line(dim(name)), line((values, token)), width)


def _reduction_lines(seen: PartComparison, text: Catalogue, width: int) -> list[Line]:
    if seen.after is None or seen.other is not None or seen.before.ront_um == 0.0:
        return []
    percent = 100.0 * (seen.before.ront_um - seen.after.ront_um) / seen.before.ront_um
    label = text("run.improvement") if seen.before.result else text("inspect_page.improvement_stated")
    return [justify_line(line(dim(label)), line(f" {percent:.1f} %"), width)]


def _verdict(seen: PartComparison, text: Catalogue, width: int) -> list[Line]:
    part, nominal_mm = seen.part, seen.part.job.finished_diameter_mm
    rows = [*_roundness_verdict(seen, text, width)]
    for figure in part.judged:
        is_form = figure.kind is ToleranceKind.CYLINDRICITY and part.proven and not part.is_half
        if is_form or figure.kind is ToleranceKind.DIAMETER:
            rows.append(judged_line(figure, nominal_mm, text, width))
    if part.whole is None:
        rows += hanging(dim("· "), section_words(part.section_z_mm, text), width, Token.DIM)
    return rows


def judged_line(figure: JudgedFigure, nominal_mm: float, text: Catalogue, width: int) -> Line:
    """Return a figure against its limit with the mark of its verdict; a diameter as it was measured."""
    what = "" if figure.kind is ToleranceKind.ROUNDNESS else f"{figure.kind}_"
    mark, token, word = {
        True: ("✓ ", Token.STRONG, "pass"),
        False: ("✗ ", Token.WARNING, "fail"),
        None: ("? ", Token.WARNING, "unproven" if figure.is_open else "open"),
    }[figure.passes]
    facts = roundness_facts(figure.value_um or 0.0, figure.limit_um, text)
    if figure.kind is ToleranceKind.DIAMETER:
        value_mm = nominal_mm + (figure.value_um or 0.0) / 1000.0
        limit = text.units.format_short(figure.limit_um, "um")
        u_mm = "" if figure.u_um is None else f"±{text.units.figure(figure.u_um / 1000.0, 'mm', 4)}"
        facts = {"value": text.units.figure(value_mm, "mm", 3) + u_mm, "limit": limit}
    elif figure.u_um is not None:  # in few cells
        u_um, limit = text.units.figure(figure.u_um, "um", 2), text.units.format_short(figure.limit_um, "um")
        facts = {"value": f"{facts['value']}±{u_um}", "limit": limit}
    z = "" if figure.z_mm is None else text.units.figure(figure.z_mm, "mm", 1)
    at = z and text("inspect_page.at", z=z)
    room, words = max(width - 2, 0), text(f"inspect_page.{what}{word}", at=at, **facts)
    if z and cell_len(words) > room:
        facts["limit"] = text.units.format_short(figure.limit_um, "um")
        words = text(f"inspect_page.{what}{word}_brief", z=z, **facts)
    return line((mark + fit_text(words, room), token))


def form_lines(form: MeasuredForm, text: Catalogue, width: int) -> list[Line]:
    """Return the verdict on a part measured in points that are no sections, and what is known of its form."""
    whole, unit, nominal_mm = form.whole, text.units, form.job.finished_diameter_mm
    rows = [judged_line(each, nominal_mm, text, width) for each in form.judged]
    if form.is_half or not form.proven:
        word = "cut_verdict.not_proven" if not form.proven else "inspect_page.half"
        rows = [line((f"? {fit_text(text(word), max(width - 2, 0))}", Token.WARNING))]
    figures = [(f"CYLt {each.kind}", each.cylt_um) for each in whole.cylinders]
    figures += [(text("roundness.taper_um"), whole.taper_um)]
    straight_um = whole.generatrix_straightness_um
    figures += [] if straight_um is None else [(text("roundness.generatrix_straightness_um"), straight_um)]
    room = min(width, _FORM_WIDTH)
    rows += [BLANK, *(justify_line(line(dim(name)), line(unit.show(um, "um", 2)), room) for name, um in figures)]
    rows.append(BLANK)
    for words in extraction_words(whole, form.meta, text):
        rows += wrap_line(words, width, Token.DIM)
    for problem in (form.no_sections, *form.notes):
        rows += hanging(("! ", Token.WARNING), text.problem(problem), width, Token.WARNING)
    return rows


def roundness_facts(ront_um: float, limit_um: float | None, text: Catalogue) -> dict[str, str]:
    """Return RONt of a part and its tolerance for a sentence."""
    limit = NOTHING if limit_um is None else text.units.figure(limit_um, "um", 2)
    return {"value": text.units.figure(ront_um, "um", 2), "limit": limit}


def _roundness_verdict(seen: PartComparison, text: Catalogue, width: int) -> list[Line]:
    if seen.part.is_half:
        return [line(dim(fit_text(f"· {text('inspect_page.half')}", width)))]
    figure, nominal_mm = seen.part.judged[0], seen.part.job.finished_diameter_mm
    if not seen.part.proven:
        facts = roundness_facts(figure.value_um or 0.0, figure.limit_um, text)
        return [
            line((f"? {fit_text(text('inspect_page.not_proven', **facts), max(width - 2, 0))}", Token.WARNING))
        ]
    rows = [judged_line(figure, nominal_mm, text, width)]
    if not seen.looked.is_verdict:  # figures beside it are by something else
        result = seen.part.result
        by = text("inspect_page.judged_by", circle=result.reference_circle, filter=filter_words(result, text))
        rows += wrap_line(by, width, Token.DIM)
    return rows


def _harmonic(seen: PartComparison, n: int, text: Catalogue, width: int, token: Token) -> Line:
    jaws, before = seen.part.job.jaws, seen.before
    if before.result is not None:
        one = text.units.figure(2.0 * before.result.amplitude_um(n), "um", 2)
    else:
        one = text.units.figure(before.ront_um, "um", 2) if n == jaws else NOTHING
    after = seen.after.result if seen.after else None
    other = NOTHING if after is None else text.units.figure(2.0 * after.amplitude_um(n), "um", 2)
    return _columns(text("inspect_page.harmonic", n=f"{n:>2}"), one, other, width, token)


def _phases(seen: PartComparison, jaws: int, text: Catalogue, width: int) -> Line:
    phases = (phase_from_jaw_deg(side, jaws) if side else None for side in (seen.before, seen.after))
    before, after = (NOTHING if phase is None else f"{phase:+z.1f}°" for phase in phases)
    return _columns(text("inspect_page.phase", n=jaws), before, after, width, Token.TEXT)
