"""Tables that benchmarks have printed, read again: a run of all of them as one file."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """One printed table of a benchmark; the first cell of a row is its name."""

    benchmark: str
    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def numbers(self, row: re.Pattern[str], column: str) -> list[tuple[str, float]]:
        """Return name and number of each row whose whole name matches, from the first column of that heading."""
        if column not in self.head:
            return []
        place = self.head.index(column)
        found = [(each[0], number(each[place])) for each in self.rows if row.fullmatch(each[0])]
        return [(name, value) for name, value in found if value is not None]


def number(cell: str) -> float | None:
    """Return the number with which a cell begins, such as 1.6 of "1.6 / 3.2"; None without one."""
    found = _NUMBER.match(cell.strip())
    return None if found is None else float(found.group())


def printed(benchmark: str, lines: Iterable[str]) -> list[Table]:
    """Return the tables of the lines that `measure.print_table` keeps."""
    return [_table({"benchmark": benchmark, **json.loads(line)}) for line in lines]


def write(path: Path, rounds: Sequence[Sequence[Table]]) -> None:
    """Write the tables of each round as JSON."""
    path.write_text(json.dumps([[asdict(table) for table in tables] for tables in rounds]), encoding="utf-8")


def read(path: Path) -> list[list[Table]]:
    """Return the rounds of a file that `write` has made. OSError, ValueError, KeyError where it is none."""
    return [[_table(table) for table in tables] for tables in json.loads(path.read_text(encoding="utf-8"))]


def added(rounds: Sequence[Sequence[Table]], earlier: Sequence[Sequence[Table]]) -> list[list[Table]]:
    """Return each round with those tables of the earlier one whose benchmark was not run this time."""
    now = {table.benchmark for tables in rounds for table in tables}
    both = zip_longest(rounds, earlier, fillvalue=())
    return [[*mine, *(table for table in theirs if table.benchmark not in now)] for mine, theirs in both]


def _table(found: dict[str, Any]) -> Table:
    return Table(
        benchmark=found["benchmark"],
        title=found["title"],
        head=tuple(found["head"]),
        rows=tuple(tuple(row) for row in found["rows"]),
    )
