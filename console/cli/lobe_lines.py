"""Position of a part's lobe in words: at the jaws or between them, and the mechanism that this suggests."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from profiles.chucking.diagnosis import Diagnosis


def lobe_place_line(seen: Diagnosis, text: Catalogue) -> str:
    """Return the position of a lobe with its mechanism, or that neither is clear."""
    if seen.high_at_jaws is None:
        return text("place.between")
    place = text("predict.high" if seen.high_at_jaws else "predict.low")
    if seen.mechanism is None:
        return text("place.no_mechanism", place=place)
    return text("place.mechanism", place=place, mechanism=text(f"mechanism.{seen.mechanism}"))
