"""What is read at a simulated lathe that does not show the truth: a dial, contact and current, a micrometer."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from console.tui.lines import Line, Piece, dim, line
from console.tui.theme import Token
from drivers.simulator.plant.workshop_view import Dials

CELLS = 13  # of the dial: from its one end to the other, 0 in the middle
RANGE_UM = 500.0


def dial_line(text: Catalogue, dials: Dials) -> Line:
    """Return the indicator at the mark, drawn, with its reading."""
    if dials.indicator_um is None:
        return (_SIM, *_scale(None), dim(" " + text("align_page.dial.free")))
    reading_mm = dials.indicator_um / 1000.0
    pushed = text.units.show(reading_mm, "mm", 3, "+")
    if abs(dials.indicator_um) >= RANGE_UM:
        pushed = text("align_page.dial.end")
    return (_SIM, *_scale(dials.indicator_um), *line(" " + pushed))


def contact_line(text: Catalogue, dials: Dials) -> Line:
    """Return whether the tool is heard on the part and its current, or what the micrometer reads."""
    if dials.micrometer_mm is not None:
        return line(_SIM, text("align_page.micrometer", value=text.units.show(dials.micrometer_mm, "mm", 3)))
    current = text("align_page.current", value=f"{dials.tool_current_percent:.0f}")
    if dials.contact:
        return line(_SIM, ("● " + text("align_page.contact"), Token.STRONG), ", " + current)
    return line(_SIM, "○ " + text("align_page.no_contact"), dim(", " + current))


_SIM: Piece = ("SIM ", Token.SIM)


def _scale(reading_um: float | None) -> Line:
    """Return the scale, with the needle unless the stylus is free."""
    cells = ["─"] * CELLS
    cells[0], cells[CELLS // 2], cells[-1] = "├", "┼", "┤"
    if reading_um is None:
        return (dim("".join(cells)),)
    share = (max(-RANGE_UM, min(reading_um, RANGE_UM)) + RANGE_UM) / (2.0 * RANGE_UM)
    at = round(share * (CELLS - 1))
    return (dim("".join(cells[:at])), ("●", Token.STRONG), dim("".join(cells[at + 1 :])))
