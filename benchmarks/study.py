"""How a study scales: the same cells by one process and by two, against each other.

python -m benchmarks.study

Start of the processes included; both tables have to be the same. On a computer that has other work the
processor time says more than the clock: two workers should need what one needs.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

from benchmarks.measure import extent, print_table, seconds
from console.site.study.cells import cells, read_study, write_table
from console.site.study.running import carry_out
from console.site.study.workers import processes

HEADS = ("", "by the clock", "processor time", "x as fast", "of a processor each")
SEEDS = extent(24, 2)
STUDY = f"""\
schema = 1
jobs = ["lee-2001-experiment-1"]
machines = ["lee-2001-lathe"]
plants = ["realistic"]
strategies = ["cam"]
seeds = {{ from = 1, count = {SEEDS} }}
cut_length_mm = {extent(4.0, 1.0)}
"""


def main() -> int:
    """Carry the study out twice, and print how long that took."""
    times, busy_s, tables = list[float](), list[float](), list[bytes]()
    with tempfile.TemporaryDirectory() as made:
        path = Path(made) / "scaling.toml"
        path.write_text(STUDY, encoding="utf-8")
        for count in (1, 2):
            folder = Path(made) / f"{count}"

            def work(count: int = count, folder: Path = folder) -> None:
                found = cells(read_study(path), folder / "data", path.parent)
                rows = carry_out(found, folder, lambda: processes(count), lambda _: None)
                tables.append(write_table(folder, rows).read_bytes())

            before = getrusage(RUSAGE_CHILDREN)
            times.append(seconds(work))
            after = getrusage(RUSAGE_CHILDREN)
            busy_s.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    rows = [
        (
            f"{count} workers",
            f"{took:.1f} s",
            f"{busy:.1f} s",
            f"{times[0] / took:.2f}",
            f"{busy / took / count:.2f}",
        )
        for count, took, busy in zip((1, 2), times, busy_s, strict=True)
    ]
    load = ", ".join(f"{each:.0f}" for each in os.getloadavg())
    title = f"A study of {SEEDS} cells, {os.cpu_count()} processors, load {load}"
    print_table(title, HEADS, rows)
    if tables[0] != tables[1]:
        print("the tables differ", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
