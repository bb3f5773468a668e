"""Readings of the flanks of jaw 1 so far: the result of each pair, and the spread against what the part allows."""

from __future__ import annotations

from console.session.cut.alignment import Alignment
from console.session.cut.jaw_by_indicator import (
    READINGS,
    RESULTS,
    allowed_spread_deg,
    mean_deg,
    results_deg,
    spread_deg,
)
from console.text.catalogue import Catalogue
from console.tui.lines import Line, line, wrapped
from console.tui.theme import Token
from profiles.job import Job


def flank_lines(text: Catalogue, alignment: Alignment, job: Job, width: int) -> list[Line]:
    """Return the readings, nothing before the first one."""
    flanks = alignment.flanks
    if not flanks:
        return []
    results = results_deg(flanks)
    rows = []
    for place, result in enumerate(results):
        first, second = flanks[2 * place : 2 * place + 2]
        rows.append(line(f"{place + 1}: {first:.2f} {second:.2f} → {result:.2f}°"))
    if len(flanks) % 2:
        rows.append(line(f"{len(results) + 1}: {flanks[-1]:.2f} …"))
    if len(results) < RESULTS:
        return [
            *rows,
            *wrapped(text("align_page.flanks_next", count=len(flanks), of=READINGS), width, Token.STRONG),
        ]
    spread, most = spread_deg(results), allowed_spread_deg(job)
    within = most is None or spread <= most
    words = text(
        "align_page.flanks_result",
        angle=f"{mean_deg(results):.2f}°",
        spread=f"{spread:.2f}°",
        most="∞" if most is None else f"{most:.2f}°",
    )
    return [*rows, *wrapped(words, width, Token.OK if within else Token.WARNING)]
