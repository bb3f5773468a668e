"""What a fingerprint has shown of a clamping, and what it makes of the compensation: a line, and fields."""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING

from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.compensations.learning import SURE
from profiles.compensations.path import PathHarmonic

if TYPE_CHECKING:
    from console.session.learning.fingerprint import Fingerprint
    from profiles.fingerprint.deflection import Deflection
    from profiles.fingerprint.this_clamping import Clamped


def fingerprint_line(found: Fingerprint, text: Catalogue) -> str:
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


def limit_um_pp(clamped: Clamped) -> float:
    """Return the 95 % half-width of the lobe of this part, um p-p: twice that of its height."""
    return 2.0 * SURE * clamped.sd_um


def turn_deg(clamped: Clamped, lobes: int) -> float:
    """Return by how many degrees of spindle a fingerprint turns the lobe."""
    return -math.degrees(cmath.phase(clamped.ratio)) / lobes


def clamped_fields(clamped: Clamped, lobes: int) -> dict[str, object]:
    """Return the same as fields, unrounded."""
    return {
        "height": abs(clamped.ratio),
        "turned_deg": turn_deg(clamped, lobes),
        "force_deviation": clamped.force_deviation,
        "lobe_um_pp": 2.0 * abs(clamped.lobe_um),
        "lobe_sd_um_pp": 2.0 * clamped.sd_um,
        "weight": clamped.weight,
    }


def fingerprint_fields(found: Fingerprint, lobes: int) -> dict[str, object]:
    """Return a fingerprint as fields, with the deflection that it was found in."""
    shown = found.felt.deflection
    return {
        **clamped_fields(found.clamped, lobes),
        "places": shown.places,
        "upright": shown.upright,
        "reading_sd_um": shown.reading_sd_um,
        "harmonics": [
            {"n": wave.lobes, "amplitude_um": wave.amplitude_um, "limit_um": limit_um, "phase_deg": wave.phase_deg}
            for wave, limit_um in _waves(shown)
        ],
    }


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
    return [(PathHarmonic.of(n, c), shown.limit_um(n)) for n, c in sorted(shown.coefficients_um.items())]
