"""Numbers as other programs write them: which mark is the decimal sign is settled by the file as a whole.

A comma or a point before exactly three digits may also separate thousands: "6,150" is 6.15 in one country and 6150
in another. Such a number is read only if another number in the file shows what its mark means ("12,5", "0,150",
"1,234.5"), or if the file states it (`# decimal: comma`). Between commas the point is the decimal sign.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

DECIMAL_SIGNS: Mapping[str, str] = {"comma": ",", "point": "."}
SPOILING = frozenset({"value.two_readings", "trace.mixed_decimals", "trace.decimal_comma"})
"""The problem codes of numbers that are those of their whole file."""

_LONGEST_CELL = 60
_WORDS_FOR_NO_NUMBER = frozenset({"nan", "inf", "infinity", "bad"})
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_TO_PYTHON = str.maketrans({"\u2212": "-", **dict.fromkeys("'\u2019 \u00a0\u2009\u202f,")})
_SWAPPED = str.maketrans(",.", ".,")
_WITH_POINT = re.compile(
    r"""[+\-\u2212]?(?: (\d+\.?\d*|\.\d+) ([eE][+\-\u2212]?\d+)?
    | ([1-9]\d{0,2}(?P<by>[,'\u2019\x20\u00a0\u2009\u202f])\d{3}((?P=by)\d{3})* | (?P<lakh>[1-9]\d?(,\d\d)+,\d{3}))
      (\.\d*)? )""",
    re.ASCII | re.VERBOSE,
)


def number_readings(text: str) -> dict[str, str]:
    """Return a written number as Python writes it, by its decimal sign; the sign is "" if it makes no difference.

    Two entries if it does, none if the text is no number.
    """
    found = {}
    for sign, swapped in ((".", text), (",", text.translate(_SWAPPED))):
        match = _WITH_POINT.fullmatch(swapped)
        if match and not (match["lakh"] and sign == ","):
            found[sign] = swapped.translate(_TO_PYTHON)
    return {"": found["."]} if found.get(".") == found.get(",", "") else found


def describe_readings(text: str) -> str:
    """Return both readings of a number, each with the header line that states it."""
    found = number_readings(text)
    return " | ".join(f"{float(found[sign]):.15g} (# decimal: {word})" for word, sign in DECIMAL_SIGNS.items())


def point_number(cell: str) -> tuple[float, str]:
    """Return a number with a decimal point, and the problem code if it is none; Python would accept 1_000, too."""
    if len(cell) <= _LONGEST_CELL and _NUMBER.fullmatch(cell):
        value = float(cell)
        return value, "" if math.isfinite(value) else "trace.not_finite"
    return math.nan, "trace.not_finite" if cell.lstrip(
        "+-"
    ).lower() in _WORDS_FOR_NO_NUMBER else "trace.not_number"


class NumberMarks:
    """The marks in the numbers of one file.

    `example` is the first number not written as Python does, with its reading ("1.234,5 = 1234.5"); "" if there is
    none, or if the file states its decimal sign.
    """

    def __init__(self, separator: str, stated: str | None, rows: Callable[[], str]) -> None:
        """Begin with the word that states the decimal sign, if any; `rows` returns all lines with cells."""
        self.example = ""
        self._separator, self._stated, self._rows = separator, stated, rows
        self._decimal = DECIMAL_SIGNS[stated] if stated else "." if separator == "," else ""
        # What each mark in a number shows the decimal sign to be.
        self._sign_by_mark = dict.fromkeys(",." if stated else self._decimal, self._decimal)

    def read(self, cell: str) -> tuple[float, str]:
        """Return a number, and the problem code if it is none."""
        if self._sign_by_mark.get(self._decimal) == self._decimal:  # nearly all cells
            found = point_number(cell if self._decimal == "." else cell.translate(_SWAPPED))
            if not found[1]:
                return found
        readings = number_readings(cell)
        if not readings or len(cell) > _LONGEST_CELL:
            return point_number(cell)
        decimal = self._sign_of("," if "," in cell else ".") if len(readings) == 2 else next(iter(readings))
        if decimal not in readings:
            return math.nan, "value.two_readings"
        if decimal and self._decimal not in ("", decimal):
            return math.nan, "trace.decimal_comma" if self._separator == "," else "trace.mixed_decimals"
        self._decimal = self._decimal or decimal
        self._sign_by_mark |= {mark: decimal for mark in ",." if mark in cell}
        if not (self.example or self._stated or readings[decimal] == cell):
            self.example = f"{' '.join(cell.split())} = {readings[decimal]}"
        return point_number(readings[decimal])

    def _sign_of(self, mark: str) -> str:
        """Return the decimal sign that this mark shows: by the first number with it and one reading, else "-"."""
        if mark not in self._sign_by_mark:
            border = r"\s" if self._separator == " " else self._separator
            cells = re.finditer(rf'^\s*#.*$|"[^"\n]*"|[^"\n{border}]+', self._rows(), re.MULTILINE)
            marked = (number_readings(cell.group().strip('" \t\r')) for cell in cells if mark in cell.group())
            self._sign_by_mark[mark] = next((sign for each in marked if len(each) == 1 for sign in each), "-")
        return self._sign_by_mark[mark]
