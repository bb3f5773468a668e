"""`docs/performance.md`: the goals with their figures, the machine on which they were taken, and all tables."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path

from benchmarks.goals import HEAD, Figure, cells
from benchmarks.measure import table_lines
from benchmarks.tables import Table

PAGE = Path(__file__).parents[1] / "docs" / "performance.md"

HEADING = """# Performance

The goals of the benchmarks that were run, each with its figure:

```
python -m benchmarks --rounds {rounds} --page
```

writes this page; what was not run is not in it, and what was run again has replaced its tables (`--add`). A figure
with `x` is a ratio to a baseline of the same run, and can be compared between machines; the others belong to
this one: {machine}, {day}.
What is computed from seeds is the same in each round. Of several rows the worst counts. What each benchmark
measures, against what, and what its figures mean is in [benchmarks/README.md](../benchmarks/README.md).
"""

TABLES_HEADING = """## The tables

As each benchmark printed them, in the first round.
"""


def page(figures: Sequence[Figure], rounds: Sequence[Sequence[Table]]) -> str:
    """Return the page as text."""
    heading = HEADING.format(rounds=len(rounds), machine=machine(), day=date.today().isoformat())
    rows = [HEAD, ("-", "-", "-:", "-:", "-", "-"), *map(cells, figures)]
    goals = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    return f"{heading}\n{goals}\n{TABLES_HEADING}{''.join(_as_printed(rounds))}"


def _as_printed(rounds: Sequence[Sequence[Table]]) -> Iterator[str]:
    """Yield the tables of each benchmark, from the first round that has it."""
    first: dict[str, Sequence[Table]] = {
        table.benchmark: tables for tables in reversed(rounds) for table in tables
    }
    for name in sorted(first):
        found = [table for table in first[name] if table.benchmark == name]
        texts = ["\n".join((table.title, *table_lines(table.head, table.rows))) for table in found]
        yield f"\n### {name}\n\n```\n" + "\n\n".join(texts) + "\n```\n"


def machine() -> str:
    """Return processor, memory and interpreter of this computer in words."""
    info = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    model = re.search(r"^model name\s*:\s*(.+)$", info, re.MULTILINE)
    name = re.sub(r"\((R|TM)\)", "", model.group(1)).strip() if model else platform.machine()
    memory_gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{os.cpu_count()} x {name}, {memory_gib:.0f} GiB, Linux, Python {platform.python_version()}"
