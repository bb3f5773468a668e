"""What a controller would answer, as far as a client gets before it is refused: variables, reports, no listings.

It knows no motion: it is the honest half of a controller that does not cooperate, and no simulator.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping

VERSION, TYPE = "1.17F", "PMAC1"
ACK, CR = b"\x06", b"\r"

_WORD = re.compile(
    r"""
      (?P<name>[IPQM]\d+)\s*(?:->\s*(?P<place>[^\s#&]*)|(?:\.\.(?P<last>\d+)|,(?P<count>\d+),\d+)?
        (?:\s*=\s*(?P<value>[^\s#&]+))?)
    | (?P<axis>\#\d+->)(?P<axis_place>[^\s#&]*)
    | (?P<listing>LIST\s*[A-Z]+\s*\d*)
    | (?P<report>VERSION|VER|TYPE|DATE|CID|CPU|SIZE|\?{1,3}|%|[PVF](?![\dA-Z]))
    | RH?Y:\$[\dA-F]+,(?P<words>\d+)
    | (?P<buffer>OPEN|CLOSE)
    | .
    """,
    re.VERBOSE | re.IGNORECASE,
)
_REPORTS = {
    "VERSION": VERSION,
    "VER": VERSION,
    "TYPE": TYPE,
    "DATE": "01/01/01",
    "CID": "602413",
    "CPU": "DSP56303",
    "%": "100",
}


class PlausibleCard:
    """Answers lines; `variables` are its settings by name, whatever is not there is 0; `axes` as `#1->X`."""

    def __init__(self, variables: Mapping[str, float], axes: Iterable[str]) -> None:
        self._values = {name.upper(): f"{value:.12g}" for name, value in variables.items()}
        self._places = {f"{motor}->": place for motor, place in (each.split("->") for each in axes)}
        self._open = False

    def reply(self, line: str) -> bytes:
        """Answer one line, with I3=2 and I6=1."""
        data: list[str] = []
        for word in _WORD.finditer(line):
            data += self._obey(word)
        return b"".join(each.encode("latin-1") + CR for each in data) + ACK

    def _obey(self, word: re.Match[str]) -> list[str]:
        if word["buffer"]:
            self._open = word["buffer"].upper() == "OPEN"
        if self._open:
            return []
        if word["words"]:
            return [" ".join(["000000"] * int(word["words"]))]
        if word["report"]:
            return [_REPORTS.get(word["report"].upper(), "000000000000" if "?" in word["report"] else "0")]
        if word["axis"]:
            return self._place(word["axis"], word["axis_place"], "0")
        if word["name"] is None:
            return []
        if word["place"] is not None:
            return self._place(word["name"].upper(), word["place"], "*")
        return self._variable(word)

    def _variable(self, word: re.Match[str]) -> list[str]:
        name = word["name"].upper()
        first = int(name[1:])
        last = int(word["last"] or first + int(word["count"] or 1) - 1)
        names = [f"{name[0]}{number}" for number in range(first, min(last, first + 9000) + 1)]
        if word["value"] is not None:
            self._values.update(dict.fromkeys(names, self._value(word["value"])))
            return []
        return [self._values.get(each, "0") for each in names]

    def _value(self, text: str) -> str:
        """Return what is assigned: a console claims a controller with an expression."""
        formula = re.sub(r"[IPQM]\d+", lambda name: self._values.get(name[0], "0"), text)
        formula = re.sub(r"INT|ABS", lambda name: {"INT": "floor", "ABS": "abs"}[name[0]], formula)
        if "floor" not in formula or not re.fullmatch(r"(?:floor|abs|[-+*/().\d])+", formula):
            return text
        return f"{eval(formula, {'floor': math.floor, 'abs': abs}):.12g}"

    def _place(self, name: str, place: str, absent: str) -> list[str]:
        if not place:
            return [self._places.get(name, absent)]
        self._places[name] = place
        return []
