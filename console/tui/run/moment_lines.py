"""Text of a moment of a cut: the phases that are left, the way to go, the line of the program."""

from __future__ import annotations

import math

from rich.cells import cell_len

from console.session.station.progress import CutProgress, CutStage
from console.text.catalogue import Catalogue
from console.tui.lines import NOTHING, Line, dim, fact, fit_text, line, width_of, wrap_line
from console.tui.run.error_band import ErrorBand
from console.tui.theme import Token
from drivers.lathe.snapshot import AxisName
from profiles.files import printable

LABEL_WIDTH = 7
UNITS = {AxisName.SPINDLE: "°"}
FINE_BELOW = 10.0  # mm or degrees below which hundredths are shown


def moment_lines(text: Catalogue, cut: CutProgress, band: ErrorBand | None, width: int) -> list[Line]:
    """Return what is left of a cut, each phase with its time, where its program is, and what the error repeats."""
    told = [] if band is None else [band_line(text, band, width)]
    if cut.stage is CutStage.PAUSED:
        return [*phase_rows(text, cut, width), *hold_rows(text, cut, width)]
    where, words = _place(text, cut)
    place = line(*where, dim(fit_text(f"  {words}", max(width - width_of(where), 0)).rstrip()))
    return [*phase_rows(text, cut, width), to_go_line(text, cut, width), place, *told]


def moment_in_full(text: Catalogue, cut: CutProgress, band: ErrorBand | None, width: int) -> list[Line]:
    """Return the same with nothing shortened, and in words what repeats and what is random."""
    told = [] if band is None else [band_line(text, band, width), *wrap_line(text("run_page.band_means"), width)]
    where, words = _place(text, cut)
    place = [where, *(wrap_line(words, width, Token.DIM) if words else [])]
    held = hold_rows(text, cut, width)
    return [*held, *phase_rows(text, cut, width), to_go_line(text, cut, width), *place, *told]


def hold_rows(text: Catalogue, cut: CutProgress, width: int) -> list[Line]:
    """Return where the cut was held and what that may leave on the part; how long the program still waits."""
    if not cut.holds_mm:
        return []
    places = ", ".join(text.units.figure(place_mm, "mm", 1) for place_mm in cut.holds_mm)
    rows = wrap_line(text("run_page.hold_mark", z=places), width, Token.WARNING)
    if cut.held_left_s is not None:
        rows = [*wrap_line(text("run_page.hold_left", left=_minutes(cut.held_left_s)), width), *rows]
    return rows


def _minutes(left_s: float) -> str:
    return f"{int(left_s) // 60}:{int(left_s) % 60:02d}"


def phase_rows(text: Catalogue, cut: CutProgress, width: int) -> list[Line]:
    """Return the phases that are not over, with the seconds left, rounded up; the present one stands out."""
    pieces = [
        text(f"run_page.phase.{each.phase}", left=f"{max(math.ceil(each.left_s), 0)}") for each in cut.phases
    ]
    rows: list[list[str]] = [[]]
    for piece in pieces:
        if rows[-1] and cell_len(" · ".join([*rows[-1], piece])) > width:
            rows.append([])
        rows[-1].append(piece)
    return [
        line((first, Token.STRONG), dim("".join(f" · {each}" for each in others)))
        if number == 0
        else line(dim(" · ".join((first, *others))))
        for number, (first, *others) in enumerate(row for row in rows if row)
    ]


def to_go_line(text: Catalogue, cut: CutProgress, width: int) -> Line:
    """Return how far the axes have to go."""
    words = "  ".join(
        f"{text(f'run_page.axis.{each.axis}')} "
        f"{text.units.show(each.left, UNITS.get(each.axis, 'mm'), 2 if each.left < FINE_BELOW else 1)}"
        for each in cut.to_go
    )
    return fact(text("run_page.to_go"), words or NOTHING, width, label_width=LABEL_WIDTH)


def _place(text: Catalogue, cut: CutProgress) -> tuple[Line, str]:
    """Return which line of the program is executed, as the controller has reported it, and its text."""
    place = cut.place
    if place is None:
        return line(dim(text("run_page.no_place"))), ""
    number = "?" if place.line is None else f"{place.line}"
    value = text("run_page.place_of", program=place.program, line=number, lines=place.lines)
    return line(value), printable(place.text)


def band_line(text: Catalogue, band: ErrorBand, width: int) -> Line:
    """Return what of the tool error repeats from turn to turn, and what does not."""
    words = text(
        "run_page.band",
        mean=text.units.figure(band.repeats_um, "um", 2),
        spread=text.units.figure(band.random_um, "um", 2),
    )
    return line((fit_text(words, width).rstrip(), Token.TEXT))
