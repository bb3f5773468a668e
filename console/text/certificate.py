"""The certificate of the learned harmonics, in words and as plain values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.compensations.certificate import PROMISED, Certified, Standing

COLUMNS = ("order", "left", "tool_off", "gain", "factor", "bound", "standing")
TOOL_OFF = COLUMNS.index("tool_off")


def certificate_fields(certificate: Sequence[Certified]) -> list[dict[str, object]]:
    """Return the certificate as plain values."""
    return [asdict(each) for each in certificate]


def certificate_lines(certificate: Sequence[Certified], text: Catalogue) -> list[str]:
    """Return the certificate as a table with its title; nothing for none."""
    if not certificate:
        return []
    rows = [tuple(text(f"certificate.{name}") for name in COLUMNS)]
    rows += [certificate_row(each, text) for each in certificate]
    if all(each.tool_off_um is None for each in certificate):
        rows = [(*row[:TOOL_OFF], *row[TOOL_OFF + 1 :]) for row in rows]
    return [text("certificate.title"), *table(rows, numeric=range(len(rows[0]) - 1))]


def certificate_row(each: Certified, text: Catalogue) -> tuple[str, ...]:
    """Return one order; what is not learned has no gain and no factor, what no trace has shown no height."""
    learned = each.standing is Standing.LEARNED
    factors = (f"{value:.2f}" if learned else "" for value in (each.gain, each.factor))
    heights = (
        "" if um is None else text.units.figure(2.0 * um, "um", 2) for um in (each.on_part_um, each.tool_off_um)
    )
    return (
        str(each.order),
        *heights,
        *factors,
        f"{each.bound:.2f}" if learned or each.standing is Standing.NO_PROMISE else "",
        _standing(each, text),
    )


def _standing(each: Certified, text: Catalogue) -> str:
    """Return whether an order is learned, or why not: a promise may also be missing as the tool hardly follows."""
    if each.standing is Standing.NO_PROMISE and each.bound_gain_1 <= PROMISED:
        return text("certificate.standing.not_followed")
    return text(f"certificate.standing.{each.standing}", limit=f"{PROMISED:g}")
