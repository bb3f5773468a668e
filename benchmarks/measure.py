"""What the benchmarks share: timing a call, timing a whole process, and an aligned table.

Nothing is asserted: numbers are printed with their ratio to a baseline of the same run, because only ratios
can be compared between machines.
"""

from __future__ import annotations

import json
import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

KIB_PER_MIB = 1024.0

Number = TypeVar("Number", int, float)

TABLES = "BENCHMARKS_TABLES"
"""An environment variable: the file to which each printed table is added as a line of JSON."""

SHORT = "BENCHMARKS_SHORT"
"""An environment variable: where it is set, a benchmark shows that it works, and its figures mean little."""


def extent(full: Number, short: Number) -> Number:
    """Return how many there are, or how long it takes: in full, or in the short form."""
    return short if os.environ.get(SHORT) else full


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessCost:
    """One whole process: wall time in s, peak resident memory in MiB."""

    wall_s: float
    peak_mib: float


def seconds(work: Callable[[], object]) -> float:
    """Return how long one call takes, s."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def process_cost(arguments: Sequence[str]) -> ProcessCost:
    """Run a command without its output and return what it cost.

    The peak counts from before the command replaces this process's copy, so it is never below the memory of
    the benchmark itself (about that of a bare interpreter).

    Raises:
        RuntimeError: the command failed, so that its time means nothing.
    """
    silent = [(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_RDWR, 0) for fd in (0, 1, 2)]
    start = time.perf_counter()
    child = os.posix_spawn(arguments[0], list(arguments), os.environ, file_actions=silent)
    _, status, usage = os.wait4(child, 0)
    wall_s = time.perf_counter() - start
    code = os.waitstatus_to_exitcode(status)
    if code != 0:
        raise RuntimeError(f"exit code {code}: {' '.join(arguments)}")
    return ProcessCost(wall_s=wall_s, peak_mib=usage.ru_maxrss / KIB_PER_MIB)


def median_process_cost(arguments: Sequence[str], runs: int) -> ProcessCost:
    """Return the medians of several runs, after one that warms the caches."""
    process_cost(arguments)
    costs = [process_cost(arguments) for _ in range(runs)]
    return ProcessCost(
        wall_s=statistics.median(cost.wall_s for cost in costs),
        peak_mib=statistics.median(cost.peak_mib for cost in costs),
    )


def table_lines(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the aligned lines of a table: the first column to the left, numbers to the right."""
    widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
    return [
        "  ".join(
            cell.ljust(w) if column == 0 else cell.rjust(w)
            for column, (cell, w) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in (head, *rows)
    ]


def print_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; keep it, too, where `TABLES` says so."""
    print("\n".join((title, *table_lines(head, rows))))
    if kept := os.environ.get(TABLES):
        with open(kept, "a", encoding="utf-8") as file:
            file.write(
                json.dumps({"title": title, "head": list(head), "rows": [list(row) for row in rows]}) + "\n"
            )
