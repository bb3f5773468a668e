"""Simulated shifts with random faults and operators, and invariants that hold after each event.

    python -m tests.soak [--hours H] [--seeds N] [--first SEED] [--seconds S] [--workers N]
                         [--short] [--script FILE]

Each of N seeds is H simulated hours at a lathe of its own, in a process of its own; --workers of them at a time.
What breaks an invariant is shortened to a script that repeats it, which is printed and kept in `tests/soak/found`;
`--script` plays one. With --seconds no seed begins later than that; --short is less than a minute. The exit code
is 1 when an invariant was broken.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from tests.soak.shift import Count, Done, as_text, broken_by, from_text, lone_shift, shrunk

FOUND = Path(__file__).parent / "found"
SHORT_HOURS, SHORT_SEEDS, SHORT_S = 0.1, 8, 20.0
SHORTENED_S = 300.0
"""Of processor time, for one script; what it is by then is printed."""

MEMORY_MB = 400
"""How much the memory of the process may grow over a shift, with what it imports first."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the shifts; 1 when an invariant was broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak")
    parser.add_argument("--hours", type=float, default=8.0)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--script", type=Path)
    parser.add_argument("--short", action="store_true", help="six simulated minutes of each of eight, for 20 s")
    options = parser.parse_args(words)
    if options.short:
        options.hours, options.seeds, options.seconds = SHORT_HOURS, SHORT_SEEDS, SHORT_S
    if options.script is not None:
        said = broken_by(from_text(options.script.read_text(encoding="utf-8")), options.first)
        print(said or "nothing is broken")
        return 1 if said else 0
    shift_of = partial(lone_shift, seconds=3600.0 * options.hours, until_s=time.monotonic() + options.seconds)
    seeds, began_s = range(options.first, options.first + options.seeds), time.monotonic()
    done: list[Done] = []
    with ProcessPoolExecutor(options.workers, get_context("spawn"), max_tasks_per_child=1) as pool:
        for each in filter(None, pool.map(shift_of, seeds)):
            done.append(each)
            print(
                f"seed {each.seed}: {each.passed_s / 3600.0:.2f} h, {each.said or 'nothing is broken'}", flush=True
            )
            if each.said:
                _report(each)
    _print_table(done, time.monotonic() - began_s)
    return 1 if any(each.said or each.grown_mb > MEMORY_MB for each in done) else 0


def _print_table(done: Sequence[Done], took_s: float) -> None:
    count, hours = Count(), sum(each.passed_s for each in done) / 3600.0
    for each in done:
        count.add(each.count)
    print(f"{len(done)} seeds, {hours:.2f} simulated hours in {took_s:.0f} s")
    print(f"{count.cuts} cuts started, {count.parts} parts measured, {count.runs} runs in the record")
    print("\n| what happened | times tried | survived |\n|---|---|---|")
    for name, tried in sorted(count.tried.items()):
        print(f"| {name} | {tried} | {count.survived[name]} |")
    grown_mb = max((each.grown_mb for each in done), default=0.0)
    print(
        f"\n{len(count.alarms)} kinds of alarms, each with its sentence; memory grew by {grown_mb:.0f} MB at most"
    )


def _report(done: Done) -> None:
    until_s = time.process_time() + SHORTENED_S
    short = shrunk(done.script, lambda part: time.process_time() < until_s and bool(broken_by(part, done.seed)))
    FOUND.mkdir(exist_ok=True)
    path = FOUND / f"seed-{done.seed}.jsonl"
    path.write_text(as_text(short), encoding="utf-8")
    print(
        f"seed {done.seed}: {done.said}\n{len(done.script)} events, {len(short)} of them repeat it: {path}",
        file=sys.stderr,
    )
    print(as_text(short), file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
