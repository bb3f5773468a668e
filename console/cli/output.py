"""How results leave the command line: JSON with unrounded numbers, or lines for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping

from console.text.escaping import encodable, escaped
from profiles.roundness import RoundnessResult


def print_json(value: Mapping[str, object]) -> None:
    """Print one JSON object. Numbers are not rounded; there is no NaN in JSON, so none may be in `value`."""
    shown = json.dumps(value, ensure_ascii=False, allow_nan=False, indent=2)
    # What the stream would escape or replace, such as a file name that is no text, JSON can say in its own way.
    if encodable(escaped(shown), sys.stdout.encoding) != shown:
        shown = json.dumps(value, allow_nan=False, indent=2)
    print(shown)


def roundness_fields(result: RoundnessResult) -> dict[str, object]:
    """Return a roundness result for JSON; lengths in um, angles in degrees from the spindle index."""
    return {
        "RONt_um": result.ront_um,
        "RONp_um": result.ronp_um,
        "RONv_um": result.ronv_um,
        "RONq_um": result.ronq_um,
        "reference_circle": result.reference_circle,
        "filter_upr": result.filter_upr,
        "state": result.state,
        "eccentricity_um": result.eccentricity_um,
        "points": result.points,
        "harmonics": [
            {"n": h.n, "amplitude_um": h.amplitude_um, "phase_deg": h.phase_deg} for h in result.harmonics
        ],
    }
