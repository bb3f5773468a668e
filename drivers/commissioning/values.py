"""The values of P, Q and M as part of a backup: read range by range, written as lines as they are typed.

A value of 0 is not written; before the others everything is set to 0. What this program itself keeps in P is left
out, and so is M that points at memory: to write there may switch an output.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from drivers.controller import Controller
from drivers.pmac.dialect import Dialect, Scope
from drivers.pmac.expected_replies import replied_number
from drivers.pmac.language.text import format_number
from drivers.pmac.reserved import OWN_VARIABLES

VALUES_A_LINE = 200  # a third of a second at 9600 baud where most are 0
TIMEOUT_S = 20.0  # 200 long numbers take 4 s at 9600 baud

_VALUE = re.compile(r"((?:&\d+)?[PQM]\d+)=(-?[\d.]+)")
_ZERO = re.compile(r"(?:&\d+)?[PQM]\d+\.\.\d+=0")
_NAME = re.compile(r"(?:&(\d+))?([PQM])(\d+)")


def read_values(client: Controller, dialect: Dialect, pointers: Iterable[int]) -> dict[str, float]:
    """Return all values that are not 0, by names such as `P7`, `&2Q5` and `M3`; `pointers` are those of M."""
    found: dict[str, float] = {}
    for before, kind, whole in _ranges(dialect, pointers):
        for start in range(whole.start, whole.stop, VALUES_A_LINE):
            part = range(start, min(start + VALUES_A_LINE, whole.stop))
            line = f"{before}{kind}{part.start}..{part.stop - 1}"
            texts = client.question(line, TIMEOUT_S, lines=len(part))
            values = (replied_number(each, client.link.address, line) for each in texts)
            found.update(
                {f"{before}{kind}{n}": value for n, value in zip(part, values, strict=True) if value != 0.0}
            )
    client.request("&1", lines=0)
    return found


def value_lines(values: Mapping[str, float], dialect: Dialect, pointers: Iterable[int]) -> Iterator[str]:
    """Yield the lines that set them, and 0 wherever there is none."""
    for before, kind, whole in _ranges(dialect, pointers):
        yield f"{before}{kind}{whole.start}..{whole.stop - 1}=0"
    yield from (f"{name}={format_number(values[name])}" for name in sorted(values, key=order_of))


def read_value_line(line: str) -> tuple[str, float] | None:
    """Return name and value of a line; None for one that sets a range to 0. Raises ValueError: neither."""
    found = _VALUE.fullmatch(line)
    if found is not None:
        return found[1], float(found[2])
    if _ZERO.fullmatch(line):
        return None
    raise ValueError(line)


def highest_of(name: str) -> int:
    """Return the index in the name of a value."""
    return order_of(name)[2]


def order_of(name: str) -> tuple[str, int, int]:
    """Return what sorts the names of values: by letter, coordinate system and number."""
    found = _NAME.fullmatch(name)
    assert found is not None
    return found[2], int(found[1] or 0), int(found[3])


def _ranges(dialect: Dialect, pointers: Iterable[int]) -> Iterator[tuple[str, str, range]]:
    """Yield what is kept: the system in front of the letter, the letter, and a range without a gap."""
    every = dialect.highest_index + 1
    yield "", "P", range(OWN_VARIABLES.start)
    if OWN_VARIABLES.stop < every:
        yield "", "P", range(OWN_VARIABLES.stop, every)
    for system in dialect.numbers(Scope.SYSTEM):
        yield f"&{system}", "Q", range(every)
    first = 0
    for pointer in (*sorted(pointers), every):
        if first < pointer:
            yield "", "M", range(first, pointer)
        first = pointer + 1
