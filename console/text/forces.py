"""Words for the permitted chucking forces of a job: from where to where, or that none holds the part, and why."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from console.units import METRIC, Units
from profiles.chucking.advice import ForceSpan
from profiles.job import NO_LOBE, Job


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
