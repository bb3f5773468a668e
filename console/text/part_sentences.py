"""Sentences about a part that was cut: verdict of its cut, force, causes, learned orders, clamping fingerprint.

Each is the same for commands and screens.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from console.session.cut.cut_verdict import CutJudgement, CutVerdict
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.compensations.certificate import PROMISED, CertifiedOrder, OrderStatus
from profiles.compensations.force_null import SURE as SURE_OF_FORCE
from profiles.compensations.force_null import ForceNull, Sign
from profiles.compensations.learning import SURE
from profiles.compensations.path import PathHarmonic
from profiles.files import printable
from profiles.metrology.conformity import JudgedFigure, ToleranceKind, passes_all
from profiles.metrology.cylindricity import LEAST_SQUARES, CylinderResult
from profiles.metrology.length_causes import LengthCause, LengthCauseKind
from profiles.metrology.profile_filters import FilterKind
from profiles.trace_files.sections import INDEX

if TYPE_CHECKING:
    from console.session.learning.fingerprint import FingerprintedCut
    from profiles.fingerprint.blank_form import BlankOval
    from profiles.fingerprint.deflection import Deflection
    from profiles.fingerprint.this_clamping import ClampingCorrection

COLUMNS = ("order", "left", "tool_off", "gain", "factor", "bound", "standing")
TOOL_OFF = COLUMNS.index("tool_off")


LEVELLED = "levelled"  # header line of a file whose sections were levelled where they were measured


def at_height(z_mm: float | None, text: Catalogue) -> str:
    """Return at which Z the one section is that a result is of."""
    return text("section.no_z") if z_mm is None else text("section.at", z=text.units.show(z_mm, "mm", 2))


def states_index(meta: Mapping[str, str]) -> bool:
    """Whether the header lines of a file say where angle 0 is; for several sections it is the same."""
    return meta.get("start_mark", "unknown") != "unknown" or any(key in meta for key in (INDEX, "jaw_1_deg"))


def extraction_words(whole: CylinderResult, meta: Mapping[str, str], text: Catalogue) -> list[str]:
    """Return how the form of a part was extracted and filtered, and what its index and levelling rest on.

    `meta` are the header lines of its file, which states them or not.
    """
    count, none = len(whole.sections) or whole.count, text("roundness.no_filter")
    upr, mm = whole.filter_upr, whole.filter_along_mm
    filters = {
        "filter": none if upr is None else f"{filter_name(whole.filter_kind, text)}{upr:g} UPR",
        "along": none if mm is None else f"{mm:g} mm",
    }
    filtered = "section.filters" if whole.filter_kind is FilterKind.GAUSS else "section.filters_other"
    said = [text(f"section.strategy.{whole.strategy}", count=count), text(filtered, **filters)]
    axis = whole.cylinder(LEAST_SQUARES)
    tilt = f"{math.hypot(axis.tilt_x_um_per_mm, axis.tilt_y_um_per_mm):.2f}"
    index = text("section.index_stated" if states_index(meta) else "section.index_assumed")
    levelled = text("section.levelled" if LEVELLED in meta else "section.tilt_out", tilt=tilt)
    return [*said, index if whole.sections else text("section.no_roundness"), levelled]


def filter_name(kind: FilterKind, text: Catalogue) -> str:
    """Return the name of a filter, to stand before its cut-off; "" of the Gaussian, which is the usual one."""
    return "" if kind is FilterKind.GAUSS else f"{text(f'filter.{kind}')} "


def verdict_words(event: Mapping[str, Any], text: Catalogue) -> str:
    """Return the recorded judgement with the tool error in roundness and diameter; "" without one."""
    judgement, tool = event.get("cut_verdict"), event.get("tool")
    if judgement not in [*CutJudgement]:
        return ""
    said = text(f"cut_verdict.{judgement}")
    figures = tool if isinstance(tool, Mapping) else {}
    took = [each for name in ("roundness", "size") if isinstance(each := figures.get(f"{name}_um"), float)]
    if len(took) < 2:
        return said
    round_um, size_um = (text.units.show(each, "um", 1) for each in took)
    return f"{said} · {text('cut_verdict.tool', round=round_um, size=size_um)}"


def tool_words(verdict: CutVerdict, text: Catalogue) -> str:
    """Return the tool error in roundness and, at most, in diameter; "" with too few polls."""
    tool = verdict.tool
    if tool is None:
        return ""
    return f"{text.units.figure(tool.roundness_um, 'um', 1)} / {text.units.show(tool.size_um, 'um', 1)}"


def force_words(found: ForceNull, text: Catalogue) -> str:
    """Return the verdict of the force with its figures and assumption, or why there is none."""
    if found.sign is Sign.UNKNOWN:
        return text("force.unknown", why=text(f"force.why.{found.why}"))
    said = text(
        f"force.{found.sign}",
        turned=f"{round(found.turned_deg, 1) + 0.0:+.1f}",  # never -0.0
        sd=f"{SURE_OF_FORCE * found.turned_sd_deg:.1f}",
        force=f"{abs(found.force_n):.2f}",
        right=f"{abs(found.right_n):.2f}",
        wrong=f"{abs(found.wrong_n):.2f}",
        n=found.lobes,
    )
    return f"{said} {text('force.assumes')}"


def length_cause_words(cause: LengthCause, text: Catalogue) -> str:
    """Return the sentence for a cause by which the sections of a part differ."""
    kind = cause.kind.value
    if cause.kind is LengthCauseKind.ENTRY:
        kind += "_order" if cause.order else "_mean"
    first, last = (text.units.figure(each, "mm", 1) for each in (cause.first_mm, cause.last_mm))
    first_um, last_um = (text.units.figure(each, "um", 1, "+") for each in (cause.first_um, cause.last_um))
    um = text.units.figure(cause.um_pp, "um", 1)
    facts = {"first": first, "last": last, "first_um": first_um, "last_um": last_um, "um": um}
    return text(f"length_cause.{kind}", order=cause.order, **facts)


def along_words(along: Sequence[LengthCause], text: Catalogue) -> list[str]:
    """Return the sentences for what makes the sections of a part differ, largest first."""
    return [length_cause_words(each, text) for each in sorted(along, key=lambda each: -each.um_pp)]


def place_words(z_mm: float | None, text: Catalogue) -> str:
    """Return the height of a section, to follow a figure; "" if it is not known."""
    return "" if z_mm is None else text("judged.at", z=text.units.figure(z_mm, "mm", 1))


def section_words(z_mm: float | None, text: Catalogue) -> str:
    """Return that a part was measured in one section, and where."""
    if z_mm is None:
        return text("judged.section")
    return text("judged.section_at", z=text.units.figure(z_mm, "mm", 1))


def judged_words(figure: JudgedFigure, text: Catalogue) -> str:
    """Return a figure with its section and its verdict, or that it was not judged."""
    limit = f"{figure.limit_um:g}"
    if figure.value_um is None:
        is_form = figure.kind is ToleranceKind.CYLINDRICITY
        return text("judged.open" if is_form else "judged.open_roundness", limit=limit)
    sign = "+" if figure.kind is ToleranceKind.DIAMETER else ""
    value = text.units.figure(figure.value_um, "um", 2, sign) + u_words(figure, text)
    words = text(f"judged.{figure.kind}", value=value, at=place_words(figure.z_mm, text))
    verdict = {True: "run.within", False: "run.outside", None: "run.unproven"}[figure.passes]
    return f"{words}: {text(verdict, limit=limit)} ({rule_words(figure, text)})"


def u_words(figure: JudgedFigure, text: Catalogue) -> str:
    """Return the expanded uncertainty of a figure, to follow its value; "" if it is not known."""
    return "" if figure.u_um is None else f" ± {text.units.figure(figure.u_um, 'um', 2)}"


def rule_words(figure: JudgedFigure, text: Catalogue) -> str:
    """Return by which rule a figure was judged, with its guard; that U is not stated, or its gauge expired."""
    expired = text("judged.expired", date=printable(figure.expired)) if figure.expired else ""
    return ", ".join(filter(None, (_rule_words(figure, text), expired)))


def _rule_words(figure: JudgedFigure, text: Catalogue) -> str:
    if figure.rule is None or figure.u_um is None:
        rule = "" if figure.rule is None else f", {text(f'judged.rule.{figure.rule}')}"
        return text("judged.no_u") + rule
    guard = text.units.figure(figure.guard_um or 0.0, "um", 2)
    rule = text(f"judged.rule.{figure.rule}")
    return text("judged.guard", rule=rule, guard=guard) if figure.guarded else rule


def judged_fields(figures: Sequence[JudgedFigure]) -> dict[str, object]:
    """Return figures against their limits and the verdict on all as plain values; nothing without any."""
    own = ("kind", "value_um", "limit_um", "z_mm", "passes", "guard_um")
    judged = [
        {**{name: getattr(each, name) for name in own}, "U_um": each.u_um, "decision_rule": each.rule}
        for each in figures
    ]
    return {"judged": judged, "within_tolerance": passes_all(figures)} if figures else {}


def certificate_fields(certificate: Sequence[CertifiedOrder]) -> list[dict[str, object]]:
    """Return the certificate as plain values."""
    return [asdict(each) for each in certificate]


def certificate_lines(certificate: Sequence[CertifiedOrder], lobes: int, text: Catalogue) -> list[str]:
    """Return the certificate of a lobe of this order as a table with its title; nothing for none."""
    if not certificate:
        return []
    rows = [tuple(text(f"certificate.{name}") for name in COLUMNS)]
    rows += [certificate_row(each, text) for each in certificate if not _says_nothing(each, lobes)]
    if all(each.tool_off_um is None for each in certificate):
        rows = [(*row[:TOOL_OFF], *row[TOOL_OFF + 1 :]) for row in rows]
    return [text("certificate.title"), *table(rows, numeric=range(len(rows[0]) - 1))]


def certificate_row(each: CertifiedOrder, text: Catalogue) -> tuple[str, ...]:
    """Return the row of an order: heights only if a trace has shown them, the others only if it is learned."""
    learned = each.standing is OrderStatus.LEARNED
    factors = (f"{value:.2f}" if learned else "" for value in (each.gain, each.factor))
    on_part, tool_off, most = (
        "" if um is None else text.units.figure(2.0 * um, "um", 2)
        for um in (each.on_part_um, each.tool_off_um, each.most_um if learned else None)
    )
    return (
        _term(each, text),
        on_part,
        tool_off,
        *factors,
        most,
        _standing(each, text),
    )


def _says_nothing(each: CertifiedOrder, lobes: int) -> bool:
    """Whether a row is of noise along the cut, of which there are two an order, and not of the lobe itself."""
    return each.axial > 0 and each.order != lobes and each.standing in (OrderStatus.NOISE, OrderStatus.ONE_PART)


def _term(each: CertifiedOrder, text: Catalogue) -> str:
    if not each.order and not each.axial:
        return text("certificate.push")
    order = str(each.order) if each.order else text("certificate.mean")
    return text(f"certificate.axial.{each.axial}", order=order) if each.axial else order


def _standing(each: CertifiedOrder, text: Catalogue) -> str:
    """Return whether an order is learned, or why not: a promise may also be missing as the tool hardly follows."""
    if each.standing is OrderStatus.NO_PROMISE and each.bound_gain_1 <= PROMISED:
        return text("certificate.standing.not_followed")
    if each.known_within_um is not None:
        return text("certificate.standing.unseen", within=text.units.figure(2.0 * each.known_within_um, "um", 1))
    if each.change is not None and each.standing is OrderStatus.LEARNED:
        return text(f"certificate.change.{'step' if each.change.step else 'drift'}")
    judged = {"bound": f"{each.bound:.2f}", "limit": f"{PROMISED:g}"}
    return text(f"certificate.standing.{each.standing}", **judged)


def fingerprint_line(found: FingerprintedCut, text: Catalogue) -> str:
    """Return a fingerprint in one line: the force, the lobe of this part, and how sure that is."""
    clamped, deflection = found.clamped, found.felt.deflection
    lobes = next(iter(found.path.target.harmonics)).lobes
    return text(
        "fingerprint.line_upright" if deflection.upright else "fingerprint.line",
        force=f"{100.0 * clamped.force_deviation:+.1f}",
        lobe=f"{2.0 * abs(clamped.lobe_um):.1f}",
        sd=f"{limit_um_pp(clamped):.1f}",
        turn=f"{turn_deg(clamped, lobes):+.1f}",
        places=deflection.places,
        weight=f"{100.0 * clamped.weight:.0f}",
    )


def limit_um_pp(clamped: ClampingCorrection) -> float:
    """Return the 95 % half-width of the lobe of this part, um p-p: twice that of its height."""
    return 2.0 * SURE * clamped.sd_um


def turn_deg(clamped: ClampingCorrection, lobes: int) -> float:
    """Return by how many degrees of spindle a fingerprint turns the lobe."""
    return -math.degrees(cmath.phase(clamped.ratio)) / lobes


def clamped_fields(clamped: ClampingCorrection, lobes: int) -> dict[str, object]:
    """Return the same as fields, unrounded."""
    return {
        "height": abs(clamped.ratio),
        "turned_deg": turn_deg(clamped, lobes),
        "force_deviation": clamped.force_deviation,
        "lobe_um_pp": 2.0 * abs(clamped.lobe_um),
        "lobe_sd_um_pp": 2.0 * clamped.sd_um,
        "weight": clamped.weight,
    }


def fingerprint_fields(found: FingerprintedCut, lobes: int) -> dict[str, object]:
    """Return a fingerprint as fields, with the deflection that it was found in."""
    shown = found.felt.deflection
    return {
        **clamped_fields(found.clamped, lobes),
        "places": shown.places,
        "upright": shown.upright,
        "reading_sd_um": shown.reading_sd_um,
        "blank": None if found.blank is None else asdict(found.blank),
        "harmonics": [
            {"n": wave.lobes, "amplitude_um": wave.amplitude_um, "limit_um": limit_um, "phase_deg": wave.phase_deg}
            for wave, limit_um in _waves(shown)
        ],
    }


def blank_lines(blank: BlankOval | None, text: Catalogue) -> list[str]:
    """Return the oval of the blank itself and how much of it the cut copies; nothing where it is not known."""
    if blank is None:
        return []
    ums = {"oval": 2.0 * blank.wave.amplitude_um, "limit": 2.0 * blank.limit_um}
    if blank.copied is not None and blank.copied_by_part is not None:
        ums |= {"copied": blank.copied * ums["oval"], "part": blank.copied_by_part * ums["oval"]}
    facts = {name: text.units.figure(um, "um", 1) for name, um in ums.items()}
    key = "blank_copied" if "copied" in facts else "blank"
    return [text(f"fingerprint.{key}", angle=f"{blank.wave.phase_deg:.0f}", **facts)]


def deflection_lines(shown: Deflection, text: Catalogue) -> list[str]:
    """Return the table of a deflection: each order with its 95 % limit, and the noise."""
    head = tuple(text(f"fingerprint.{each}") for each in ("order", "pp", "limit", "phase"))
    rows = [
        (str(wave.lobes), f"{2.0 * wave.amplitude_um:.2f} um", f"± {2.0 * um:.2f}", f"{wave.phase_deg:.1f} deg")
        for wave, um in _waves(shown)
    ]
    noise = f"{text('fingerprint.reading')}: {shown.reading_sd_um:.2f} um"
    return [text("fingerprint.head"), *table([head, *rows], numeric=(0, 1, 2, 3)), noise]


def _waves(shown: Deflection) -> list[tuple[PathHarmonic, float]]:
    return [
        (PathHarmonic.from_coefficient(n, c), shown.limit_um(n)) for n, c in sorted(shown.coefficients_um.items())
    ]
