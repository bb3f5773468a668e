"""The cell separator and number format of a table, detected from its header line and required on every line.

Separators are a semicolon, a comma, a tab or blanks. Where the comma is no separator it may be the decimal
sign, consistently in the whole file.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+", re.ASCII)
_WHOLE_NUMBER = re.compile(r"[+-]?\d+", re.ASCII)
_WORDS_FOR_NO_NUMBER = frozenset({"nan", "inf", "infinity", "bad"})
_LONGEST_CELL = 60


class Dialect:
    """The separator of one file and, once found, its decimal sign."""

    def __init__(self, header: str) -> None:
        """Detect the separator in the header line; the names of columns contain none of its characters.

        Between blanks a unit in brackets belongs to the name before it.
        """
        self.separator = next((mark for mark in ";,\t" if mark in header), " ")
        self.header = re.sub(r"\s+(?=[\[(])", "", header) if self.separator == " " else header
        self._decimal = "." if self.separator == "," else ""

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line without surrounding blanks and quotes."""
        if self.separator == " ":
            return line.split()
        cells = line.split(self.separator)
        if '"' in line:
            try:
                cells = next(csv.reader([line], delimiter=self.separator, skipinitialspace=True))
            except csv.Error:  # then the quotes are not quotes, and the cells are refused as they are
                pass
        return [cell.strip() for cell in cells]

    def cause(self, cells: Sequence[str], target: int) -> str:
        """Return the code of a fault that spoils a whole file, "" where the line shows none."""
        others = [mark for mark in ";\t" if mark != self.separator]
        if any(mark in cell for mark in others for cell in cells):
            return "trace.separator"
        if self.separator == ",":
            if any(_COMMA_NUMBER.fullmatch(cell) for cell in cells):
                return "trace.decimal_comma"
            split = target < len(cells) <= 2 * target and all(_WHOLE_NUMBER.fullmatch(cell) for cell in cells)
            return "trace.decimal_comma" if split and target > 1 else ""
        if len(cells) == 1 < target and "," in cells[0]:
            return "trace.separator"
        signs = {mark for cell in cells for mark in ",." if mark in cell}
        if len(signs | {self._decimal} - {""}) > 1:
            return "trace.mixed_decimals"
        self._decimal = self._decimal or "".join(signs)
        return ""

    def number(self, cell: str) -> tuple[float, str]:
        """Return a number and the problem code if it is none; Python's own parser would accept 1_000 too."""
        if cell.lstrip("+-").lower() in _WORDS_FOR_NO_NUMBER:
            return math.nan, "trace.not_finite"
        plain = cell.replace(",", ".") if self._decimal == "," else cell
        if len(cell) > _LONGEST_CELL or not _NUMBER.fullmatch(plain):
            return math.nan, "trace.not_number"
        value = float(plain)
        return value, "" if math.isfinite(value) else "trace.not_finite"

    def is_point(self, cells: Sequence[str]) -> bool:
        """Whether these are numbers and not names."""
        return all(_NUMBER.fullmatch(cell.replace(",", ".")) for cell in cells)
