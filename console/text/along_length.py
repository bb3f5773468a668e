"""Words on a part along its length, from what results and records keep: tool error of stretches, form of sections.

Z is in mm in front of the jaws. Each is the same for commands, screens and the report.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from console.text.catalogue import Catalogue
from profiles.strict_values import number_or_none

NOTHING = "–"


def rows_of(event: Mapping[str, Any], key: str, *names: str) -> list[dict[str, float | None]]:
    """Return a kept table by these columns; None is not known. Empty if it was not kept, or is damaged."""
    kept = event.get(key)
    if not isinstance(kept, list) or not all(isinstance(each, Mapping) for each in kept):
        return []
    return [{name: number_or_none(each.get(name)) for name in names} for each in kept]


def stretch_words(event: Mapping[str, Any], text: Catalogue, form: str = "words") -> str:
    """Return the tool error of each stretch in the order of the cut, and where it is largest; "" without any.

    The `form` is "words", "brief" with what they are, or "where": only where it is largest.
    """
    rows = rows_of(event, "stretches", "from_z_mm", "to_z_mm", "error_um")
    known = [row for row in rows if None not in row.values()]
    if not known:
        return ""
    worst, unit = max(known, key=lambda row: row["error_um"] or 0.0), text.units

    def shown(um: float | None) -> str:
        return NOTHING if um is None else unit.figure(um, "um", 1)

    return text(
        f"stretches.{form}",
        errors=" · ".join(shown(row["error_um"]) for row in rows),
        worst=shown(worst["error_um"]),
        first=unit.figure(worst["from_z_mm"] or 0.0, "mm", 1),
        last=unit.figure(worst["to_z_mm"] or 0.0, "mm", 1),
    )
