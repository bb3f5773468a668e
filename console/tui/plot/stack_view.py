"""Sections of a part as a stack: the profile of each over the angle, all on one scale, with its Z and its RONt.

The free end is at the top, as on a map of the surface.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from console.text.catalogue import Catalogue
from console.tui.lines import entitle
from console.tui.plot.canvas import BrailleCanvas, Dash
from console.tui.plot.cell_view import Cells, CellView
from console.tui.plot.frame import stepped_125
from console.tui.plot.polar_view import AngleMark
from console.tui.plot.surface_map import WORST, SurfaceMap, SurfaceMapView, write_angles
from console.tui.theme import Token
from console.units import METRIC, Units
from profiles.metrology.unrolled import TURN_DEG, UnrolledPart

_LEAST_HALF_UM = 0.1
_ROWS_FOR_ZERO, _ZERO_DASH = 3, Dash(on=1, off=5)  # in a thinner strip the line of 0 hides the profile


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SectionStack:
    """What a stack shows; `half_um` is half the height of a strip, `marks` are at angles of the part."""

    part: UnrolledPart | None = None
    half_um: float = 1.0
    marks: Sequence[AngleMark] = ()
    units: Units = METRIC


def fitting_half_um(part: UnrolledPart, unit_um: float) -> float:
    """Return the smallest half height of a strip that holds every profile, two digits of the unit."""
    largest = max(float(np.abs(part.round_um).max()), _LEAST_HALF_UM) / unit_um
    digit = 10.0 ** (math.floor(math.log10(largest)) - 1)
    return math.ceil(largest / digit) * digit * unit_um


def shown_sections(part: UnrolledPart, rows: int) -> list[int]:
    """Return the sections that have room, from the free end down: at even distances, and always the worst."""
    room, count = max(rows - 1, 1), part.z_mm.size
    if count <= room:
        return list(range(count))[::-1]
    even = np.linspace(0, count - 1, room - 1).round().astype(int).tolist()
    return sorted({*even, part.worst}, reverse=True)


def stack_cells(picture: SectionStack, columns: int, rows: int) -> Cells:
    """Return the profiles between their Z and their RONt for a size in cells, over the angles."""
    cells, part = Cells.blank(columns, rows), picture.part
    if part is None:
        return cells
    units, shown = picture.units, shown_sections(part, rows)
    heights = [units.figure(float(each), "mm", 1) for each in part.z_mm]
    figures = [units.figure(float(each), "um", 2) for each in part.ront_um]
    left, right = max(map(len, heights)) + 1, max(len(units.unit("um")) + 5, *map(len, figures)) + 1
    width, strip = columns - left - right, max((rows - 1) // len(shown), 1)
    if width < 1:
        return cells
    for place, section in enumerate(shown):
        canvas, top = BrailleCanvas(width, strip), place * strip
        x = TURN_DEG / 360.0 * (canvas.width_dots - 1)
        half, middle = 0.5 * (canvas.height_dots - 1), top + (strip - 1) // 2
        if strip >= _ROWS_FOR_ZERO:
            canvas.polyline([0.0, canvas.width_dots - 1.0], [half, half], 0, _ZERO_DASH)
        canvas.polyline(x, half * (1.0 - part.round_um[section] / picture.half_um), 1)
        cells.lay(canvas, top, left, (Token.AXIS, Token.AFTER))
        worst = section == part.worst
        token, mark = (Token.MARK, WORST) if worst else (Token.TEXT, " ")
        cells.write(middle, 0, heights[section].rjust(left - 1) + mark, token)
        cells.write(middle, left + width, figures[section].rjust(right), token)
    row = len(shown) * strip
    cells.write(row, 0, units.unit("mm").rjust(left - 1), Token.AXIS)
    cells.write(row, left + width, f" RONt {units.unit('um')}", Token.AXIS)
    write_angles(cells, picture.marks, row, left, width)
    return cells


class StackView(CellView):
    """The sections of a part as a stack, under a title."""

    _picture = SectionStack()

    def show_part(self, part: UnrolledPart, marks: Sequence[AngleMark], text: Catalogue, zoom: int = 0) -> None:
        """Draw these sections instead of the last ones, `zoom` steps closer than what holds all of them."""
        units, unit_um = text.units, text.units.size("um")
        half_um = fitting_half_um(part, unit_um) * 2.0**-zoom
        self._picture = SectionStack(part=part, half_um=half_um, marks=marks, units=units)
        strip = text("sections.strip", value=units.format_short(float(f"{half_um:.2g}"), "um"))
        entitle(self, text("sections.stack"), f"{strip} · {worst_words(part, text)}")
        self.redraw()

    def draw(self, columns: int, rows: int) -> Cells:
        """Return the picture of the last sections for a size in cells."""
        return stack_cells(self._picture, columns, rows)


class PartMapView(SurfaceMapView):
    """The sections of a part as a map about their cylinder, under a title."""

    def show_part(self, part: UnrolledPart, marks: Sequence[AngleMark], text: Catalogue, zoom: int = 0) -> None:
        """Draw these sections instead of the last ones, `zoom` steps closer than what holds all of them."""
        unit_um = text.units.size("um")
        picture = SurfaceMap(
            z_mm=part.z_mm,
            angle_deg=TURN_DEG,
            deviation_um=part.cylinder_um,
            worst=part.worst,
            marks=marks,
            units=text.units,
        )
        self.show(replace(picture, um_per_step=stepped_125(picture.scale_um / unit_um, -zoom) * unit_um))
        entitle(self, text("sections.map"), worst_words(part, text))


def worst_words(part: UnrolledPart, text: Catalogue) -> str:
    """Return which section is least round."""
    z, ront = text.units.show(float(part.z_mm[part.worst]), "mm", 1), float(part.ront_um[part.worst])
    return text("sections.worst", z=z, ront=text.units.show(ront, "um", 2))
