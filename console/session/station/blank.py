"""Material removed from the clamped blank; an interrupted cut leaves it a blank no longer, too."""

from __future__ import annotations

from console.session.station.progress import CutProgress, CutStage
from console.session.station.state import TouchedBlank


def touched_by(cut: CutProgress, before: TouchedBlank | None) -> TouchedBlank | None:
    """Return how far the blank is cut after a moment of a cut; None as long as no tool has been in it."""
    if cut.stage is not CutStage.CUT or cut.in_air:
        return before
    if before is not None and before.to_mm >= cut.z_mm:
        return before
    return TouchedBlank(to_mm=cut.z_mm, of_mm=cut.length_mm)
