"""Every benchmark, one after the other, and one table of the goals: which are met, and which are missed.

    python -m benchmarks [NAME ...] [--rounds N] [--add FILE] [--keep FILE] [--compare FILE] [--page]
    python -m benchmarks --short

With several rounds a figure is the middle of them, and its noise is known; what is the same in every round is run
once. `--keep` writes all tables to a file, `--add` takes from such a file what is not run now, `--compare`
says what got worse against one, `--page` writes docs/performance.md.

In the short form only whether each of them works: as many run at once as there are processors, and only what a
failed one has printed is shown. The exit code is 1 where one of them fails.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks import comparison, goals, performance
from benchmarks.measure import SHORT, TABLES, print_table
from benchmarks.tables import Table, added, printed, read, write

NAMES = (
    "learning",
    "faulty_plants",
    "gauge_error",
    "feed_hold",
    "tool_lag",
    "stop_latency",
    "run_page",
    "simulation_speed",
    "records",
    "study",
    "force_null",
    "notch",
    "notch_trial",
    "ship",
    "shop_views",
    "records_page",
    "jobs_page",
    "command_start",
    "at_rest",
    "first_paint",
    "arming",
    "preview",
    "plots",
    "command_rate",
    "hostile_host",
    "roundness",
    "confidence",
    "flight_recorder",
    "shift",
)
"""The longest come first."""

SEEDED = ("learning", "faulty_plants", "gauge_error", "force_null", "notch", "notch_trial", "confidence")
"""Their goals are of what is computed from seeds, and no time: another round would show the same."""


def in_full(name: str) -> tuple[bool, list[Table]]:
    """Run a benchmark and show what it prints; return whether it worked, and its tables."""
    print(f"\n== {name}", flush=True)
    with tempfile.NamedTemporaryFile("r", encoding="utf-8") as kept:
        environment = {**os.environ, TABLES: kept.name}
        done = subprocess.run([sys.executable, "-m", f"benchmarks.{name}"], env=environment, check=False)
        return done.returncode == 0, printed(name, kept)


def in_short(name: str) -> tuple[bool, str]:
    """Run the short form of a benchmark; return whether it worked, and what it printed."""
    command = [sys.executable, "-m", f"benchmarks.{name}"]
    environment = {**os.environ, SHORT: "1"}
    done = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    return done.returncode == 0, done.stdout


def all_short() -> int:
    """Run the short form of all; return 1 where one has failed."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = dict(zip(NAMES, pool.map(in_short, NAMES), strict=True))
    for name, (works, shown) in found.items():
        if not works:
            print(f"== {name}\n{shown}")
    rows = [(name, "works" if works else "FAILS") for name, (works, _) in found.items()]
    print_table("Benchmarks in their short form", ("", ""), rows)
    return 0 if all(works for works, _ in found.values()) else 1


def all_in_full(options: argparse.Namespace) -> int:
    """Run benchmarks in full and print the goals; return 1 where one has failed."""
    earlier = None if options.compare is None else read(options.compare)
    failed, rounds = set[str](), list[list[Table]]()
    for _ in range(options.rounds):
        names = [name for name in options.names or NAMES if not (rounds and name in SEEDED)]
        rounds.append([])
        for name in names:
            works, tables = in_full(name)
            rounds[-1] += tables
            failed |= set() if works else {name}
    if options.add is not None:
        rounds = added(rounds, read(options.add))
    figures = goals.figures(rounds)
    print()
    print_table(f"Goals, {performance.machine()}", goals.HEAD, [goals.cells(figure) for figure in figures])
    if earlier is not None:
        print()
        print_table(f"Against {options.compare}", comparison.HEAD, comparison.compared(earlier, rounds))
    if options.keep is not None:
        write(options.keep, rounds)
    if options.page:
        performance.PAGE.write_text(performance.page(figures, rounds), encoding="utf-8")
    if failed:
        print(f"failed: {', '.join(sorted(failed))}")
    return 1 if failed else 0


def main() -> int:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", choices=[*NAMES, []], metavar="NAME")
    parser.add_argument("--short", action="store_true", help="only whether each of them works")
    parser.add_argument("--rounds", type=int, default=1, help="how often all of them are run")
    parser.add_argument("--add", type=Path, metavar="FILE", help="take what is not run now from an earlier run")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="write the tables to a file")
    parser.add_argument("--compare", type=Path, metavar="FILE", help="compare with the tables of an earlier run")
    parser.add_argument("--page", action="store_true", help="write docs/performance.md")
    options = parser.parse_args()
    return all_short() if options.short else all_in_full(options)


if __name__ == "__main__":
    sys.exit(main())
