"""Uncertainty budget of the predicted band: each contribution with its code, its size, and in words."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from drivers.preview.band import Band
from profiles.axis.response import Source


def band_reasons(band: Band, source: Source, text: Catalogue) -> list[tuple[str, float | None, str]]:
    """Return code, um p-p (None is not known) and sentence of each contribution; `source`: the response's."""
    servo, force_n = f"band.servo.{source}", band.assumed_friction_n
    friction, words = "band.friction.identified", text("band.friction.identified")
    if force_n is not None:
        friction, words = "band.friction.assumed", text("band.friction.assumed", assumed=f"{force_n:g}")
    return [
        (servo, band.servo_um, text(servo)),
        ("band.clamping", band.clamping_um, text("band.clamping")),
        ("band.cutting", band.cutting_um, text("band.cutting")),
        (friction, band.friction_um, words),
        ("band.spindle", band.spindle_um, text("band.spindle", assumed=f"{band.spindle_um:g}")),
    ]
