"""Bode plots of the loop: the response to a command by the model, the selected identified response, Table 5."""

from __future__ import annotations

import numpy as np

from console.tui.plot.frame import nice_limits
from console.tui.plot.trace_view import Mark, Series, TracePicture
from console.tui.theme import Token
from console.tui.tuning.loop_facts import Curve, LoopFacts

POINT, PAPER = "•", "✗"
X_LIMITS = (0.0, 3.0)  # 1 to 1000 Hz
_LEAST_DB, _LEAST_DEG = -30.0, -270.0


def bode_pictures(facts: LoopFacts, selected: Curve | None) -> tuple[TracePicture, TracePicture]:
    """Return gain in dB and phase in degrees over the frequency; what is far below the band is not shown."""
    return _picture(facts, selected, "gain_db", "dB", _LEAST_DB), _picture(
        facts, selected, "phase_deg", "°", _LEAST_DEG
    )


def _picture(facts: LoopFacts, selected: Curve | None, name: str, unit: str, least: float) -> TracePicture:
    def values(curve: Curve) -> np.ndarray:
        found: np.ndarray = getattr(curve, name)
        return found

    model = values(facts.model)
    # Far above the bandwidth there is nothing to see: the limits are those of the band, and of what was measured.
    shown = [model[model >= least]] + [values(each) for each in (selected, facts.paper) if each is not None]
    every = np.concatenate(shown)
    limits = nice_limits(max(float(every.min()), least), float(every.max()))
    marks = []
    if facts.paper is not None:
        marks.append(Mark(x=np.log10(facts.paper.hz), y=values(facts.paper), sign=PAPER, token=Token.MARK))
    if selected is not None:
        marks.append(Mark(x=np.log10(selected.hz), y=values(selected), sign=POINT, token=Token.BEFORE))
    series = [Series(x=np.log10(facts.model.hz), y=model, token=Token.AFTER)]
    return TracePicture(
        series=series, x_limits=X_LIMITS, y_limits=limits, y_unit=unit, x_unit="Hz", decades=True, marks=marks
    )
