"""Sentences for why a part is not round: what is the case, how much it explains, what to do."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from profiles.compensations.causes import Cause, CauseKind


def cause_words(cause: Cause, text: Catalogue) -> str:
    """Return the sentence for a cause."""
    return text(
        f"cause.{_word(cause)}",
        um=text.units.figure(cause.um_pp, "um", 1),
        order=cause.order,
        jaw=cause.jaw,
        value=f"{cause.value:+.1f}",
        sd=f"{cause.sd:.1f}",
        percent=f"{100.0 * abs(cause.value):.0f}",
    )


def _word(cause: Cause) -> str:
    if cause.kind is CauseKind.FORCE:
        return "force_high" if cause.value > 0.0 else "force_low"
    return cause.kind.value
