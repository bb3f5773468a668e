"""The certificate of the learned harmonics, in words and as plain values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.compensations.certificate import Certified, Standing

COLUMNS = ("order", "left", "gain", "factor", "bound", "standing")


def certificate_fields(certificate: Sequence[Certified]) -> list[dict[str, object]]:
    """Return the certificate as plain values."""
    return [asdict(each) for each in certificate]


def certificate_lines(certificate: Sequence[Certified], text: Catalogue) -> list[str]:
    """Return the certificate as a table with its title; nothing for none."""
    if not certificate:
        return []
    rows = [tuple(text(f"certificate.{name}") for name in COLUMNS)]
    rows += [certificate_row(each, text) for each in certificate]
    return [text("certificate.title"), *table(rows, numeric=(0, 1, 2, 3, 4))]


def certificate_row(each: Certified, text: Catalogue) -> tuple[str, ...]:
    """Return one order; what is not learned has no gain and no factor."""
    learned = each.standing is Standing.LEARNED
    factors = (f"{value:.2f}" if learned else "" for value in (each.gain, each.factor))
    return (
        str(each.order),
        text.units.figure(2.0 * each.left_um, "um", 2),
        *factors,
        f"{each.bound:.2f}" if learned or each.standing is Standing.NO_PROMISE else "",
        text(f"certificate.standing.{each.standing}"),
    )
