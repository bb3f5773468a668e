"""Why a predicted residual is a band: its contributions in words, for the command and the screen."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from drivers.preview.band import Band
from profiles.axis.response import ServoResponse


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
