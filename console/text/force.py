"""What the cutting force says of sign and angle of a half-stage cut, in words: the case, then what to do."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from profiles.compensations.force_null import SURE, ForceNull, Sign


def force_words(found: ForceNull, text: Catalogue) -> str:
    """Return the verdict with its figures, and what it rests on; why there is none."""
    if found.sign is Sign.UNKNOWN:
        return text("force.unknown", why=text(f"force.why.{found.why}"))
    said = text(
        f"force.{found.sign}",
        turned=f"{round(found.turned_deg, 1) + 0.0:+.1f}",  # never -0.0
        sd=f"{SURE * found.turned_sd_deg:.1f}",
        force=f"{abs(found.force_n):.2f}",
        right=f"{abs(found.right_n):.2f}",
        wrong=f"{abs(found.wrong_n):.2f}",
        n=found.lobes,
    )
    return f"{said} {text('force.assumes')}"
