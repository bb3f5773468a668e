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
        errors=("  " if form == "brief" else " · ").join(shown(row["error_um"]) for row in rows),
        worst=shown(worst["error_um"]),
        first=unit.figure(worst["from_z_mm"] or 0.0, "mm", 1),
        last=unit.figure(worst["to_z_mm"] or 0.0, "mm", 1),
    )


def ront_words(ront_um: float | None, text: Catalogue) -> str:
    """Return RONt of a part, a dash where it is not known."""
    return NOTHING if ront_um is None else text.units.show(ront_um, "um", 2)


def form_words(event: Mapping[str, Any], text: Catalogue) -> str:
    """Return CYLt with its sections and the worst of them; of one section its Z, of points that RONt is not known.

    It is "" if none of them was kept.
    """
    from profiles.trace_files.sections import NO_SECTIONS  # the first page loads no numpy

    rows, z_mm = _sections(event), number_or_none(event.get("section_z_mm"))
    cylt_um, taper_um = (number_or_none(event.get(f"{name}_um")) for name in ("CYLt", "taper"))
    extraction = event.get("extraction")
    if cylt_um is not None and taper_um is not None and extraction in NO_SECTIONS:
        how = text(f"section.strategy.{extraction}", count=event.get("points"))
        return text("sections.points", cylt=f"{cylt_um:.2f}", extraction=how, taper=f"{taper_um:+.1f}")
    if not rows or cylt_um is None or taper_um is None:
        return "" if z_mm is None else text("sections.single", z=text.units.show(z_mm, "mm", 2))
    worst_mm, ront_um, _ = max(rows, key=lambda row: row[1])
    return text(
        "run.whole_part",
        cylt=f"{cylt_um:.2f}",
        count=len(rows),
        first=f"{rows[-1][0]:.1f}",
        last=f"{rows[0][0]:.1f}",
        worst=f"{worst_mm:.1f}",
        ront=f"{ront_um:.2f}",
        taper=f"{taper_um:+.1f}",
    )


def section_rows(event: Mapping[str, Any], text: Catalogue) -> list[tuple[str, ...]]:
    """Return the sections as a table with its heading, from the free end down, the worst marked; [] of one."""
    rows, unit = _sections(event), text.units
    worst_um, um = max((ront_um for _, ront_um, _ in rows), default=None), unit.unit("um")
    heading = (f"Z, {unit.unit('mm')}", f"RONt, {um}", f"{text('roundness.mean')}, {um}", "")
    table: list[tuple[str, ...]] = [heading] if rows else []
    for z_mm, ront_um, mean_um in rows:
        figures = (unit.figure(z_mm, "mm", 1), unit.figure(ront_um, "um", 2), unit.figure(mean_um, "um", 1, "+"))
        table.append((*figures, text("sections.is_worst") if ront_um == worst_um else ""))
    return table


def _sections(event: Mapping[str, Any]) -> list[tuple[float, float, float]]:
    """Return Z, RONt and mean deviation of the sections, from the free end down."""
    rows = (tuple(row.values()) for row in rows_of(event, "sections", "z_mm", "RONt_um", "mean_um"))
    known = [(z, um, mean) for z, um, mean in rows if z is not None and um is not None and mean is not None]
    return sorted(known, reverse=True)
