"""Status of motors, coordinate system and controller in words, bit by bit."""

from __future__ import annotations

from collections.abc import Sequence

from rich.cells import cell_len

from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, dim, fitted, line
from console.tui.theme import Token
from drivers.beside.status_words import StatusBit, StatusWords

FAULTS = frozenset(
    "negative_limit positive_limit integrated_fatal_error i2t_fault amplifier_fault fatal_following_error "
    "phasing_error stopped_on_limit stopped_on_desired_limit runtime_error circle_radius_error resume_error "
    "interrupt_overrun servo_error watchdog checksum_error dpram_error flash_error interrupt_warning "
    "configuration_error phase_clock_missing fixed_buffer_full abort_input data_block_error "
    "warning_following_error".split()
)
"""Bits that deserve attention where they are set."""

_PLACE = 7
Cell = tuple[str, str, Token]
"""A bit: its place, its words, how they are shown."""

_SET, _UNSET = "●", "·"


def status_lines(words: Sequence[StatusWords], text: Catalogue, width: int, *, all_bits: bool) -> list[Line]:
    """Return each status word with its set bits, or with all; two columns where they fit."""
    rows: list[Line] = []
    for each in words:
        if rows:
            rows.append(BLANK)
        subject = text(f"controller_page.subject.{each.subject}")
        rows.append(line((subject, Token.TITLE), dim(f"  {each.item}  "), each.digits))
        bits = [bit for bit in each.bits if all_bits or bit.is_set]
        cells = [_cell(bit, text) for bit in bits]
        rows += _rows(cells, width)
        if not cells:
            rows.append(line(dim("  " + text("controller_page.no_bit"))))
    return rows


def bit_words(name: str, text: Catalogue) -> str:
    """Return what a bit means, by its name in the tables of the families."""
    axis, _, kind = name.partition("_")
    if len(axis) == 1:
        return text(f"bit.axis_{kind}", axis=axis.upper())
    return text(f"bit.{name}") if name else text("controller_page.unnamed_bit")


def _cell(bit: StatusBit, text: Catalogue) -> Cell:
    token = Token.DIM
    if bit.is_set:
        token = Token.WARNING if bit.name in FAULTS else Token.TEXT
    place = f"{bit.word}.{bit.bit:02d}"
    words = bit_words(bit.name, text)
    return place, f"{_SET if bit.is_set else _UNSET} {words}", token


def _rows(cells: Sequence[Cell], width: int) -> list[Line]:
    """Return two cells a row where both fit beside each other, else one."""
    half = width // 2
    rows: list[Line] = []
    left: Cell | None = None
    for cell in cells:
        if left is not None and _fits(left, half) and _fits(cell, half):
            rows.append((*_pieces(left, half), *_pieces(cell, half)))
            left = None
            continue
        if left is not None:
            rows.append(_pieces(left, width))
        left = cell
    return rows if left is None else [*rows, _pieces(left, width)]


def _fits(cell: Cell, width: int) -> bool:
    return cell_len(cell[1]) < width - _PLACE


def _pieces(cell: Cell, width: int) -> Line:
    place, words, token = cell
    return dim("  " + fitted(place, _PLACE - 2)), (fitted(words, max(width - _PLACE, 1)), token)
