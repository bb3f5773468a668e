"""Words for what is predicted of a job: its chucking forces, its lobe error, and why a residual is a band."""

from __future__ import annotations

from typing import TYPE_CHECKING

from console.text.catalogue import Catalogue
from console.units import METRIC, Units
from profiles.job import NO_LOBE, Job

if TYPE_CHECKING:
    from drivers.preview.band import Band
    from profiles.axis.response import ServoResponse
    from profiles.chucking.advice import ForceSpan


def span_words(span: ForceSpan, text: Catalogue) -> str:
    """Return the permitted forces with the limit at which they end, or that there is none, with both numbers."""
    key = "clamping.no_force" if span.empty else "clamping.span"
    return text(key, **_ends(span), limit=text(f"clamp_limit.{span.binding}"))


def short_span_words(span: ForceSpan, text: Catalogue) -> str:
    """Return the same for a narrow column, without the limit."""
    return text("clamping.no_force.short", **_ends(span)) if span.empty else span_ends(span, text)


def span_ends(span: ForceSpan, text: Catalogue) -> str:
    """Return both numbers alone, beside a label that says whether any force holds."""
    ends = _ends(span)
    return text("clamping.no_force.bounds", **ends) if span.empty else f"{ends['least']} … {ends['most']} N"


def _ends(span: ForceSpan) -> dict[str, str]:
    least, most = span.shown_n
    return {"least": least, "most": most}


def no_force_remedy(span: ForceSpan, text: Catalogue) -> str:
    """Return what makes room where no force holds the part, by what bounds the force; "" where one does."""
    return text(f"clamping.room.{span.binding}") if span.empty else ""


NOT_YET = "–"
_LEAST_UM = 0.05  # below it one decimal would read 0.0


def lobe_number(job: Job, units: Units = METRIC) -> str:
    """Return the lobe error p-p in these units: a dash where it is not known, never 0.0 for a small one."""
    if job.lobe_error_source == NO_LOBE:
        return NOT_YET
    if 0.0 < job.lobe_error_um_pp < _LEAST_UM:
        return f"< {units.figure(0.1, 'um', 1)}"
    return units.figure(job.lobe_error_um_pp, "um", 1)


def band_reasons(band: Band, response: ServoResponse, text: Catalogue) -> list[tuple[str, float | None, str]]:
    """Return code, um p-p (None: not known) and sentence of each contribution; the cut inverts `response`."""
    servo, force_n = f"band.servo.{response.source}", band.assumed_friction_n
    friction, words = "band.friction.identified", text("band.friction.identified")
    if force_n is not None:
        friction, words = "band.friction.assumed", text("band.friction.assumed", assumed=f"{force_n:g}")
    typical = {"low": text.units.format_short(1.0, "um"), "high": text.units.format_short(2.0, "um")}
    return [
        (servo, band.servo_um, text(servo)),
        ("band.clamping", band.clamping_um, text("band.clamping")),
        ("band.cutting", band.cutting_um, text("band.cutting")),
        (friction, band.friction_um, words),
        (
            "band.spindle",
            band.spindle_um,
            text("band.spindle", **typical, assumed=text.units.format_short(band.spindle_um, "um")),
        ),
    ]
