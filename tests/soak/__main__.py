"""Simulated shifts with random faults and operators, and invariants that hold after each event.

    python -m tests.soak [--hours H] [--seeds N] [--first SEED] [--seconds S] [--short] [--script FILE]

Each of N seeds is H simulated hours at a lathe of its own. What breaks an invariant is shortened to a script that
repeats it, which is printed and kept in `tests/soak/found`; `--script` plays one. With --seconds no seed begins
after so much processor time; --short is less than a minute of it. The exit code is 1 when an invariant was broken.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from tests.soak.script import Event, Script, as_text, drawn, from_text
from tests.soak.shift import BrokenError, Count, Shift
from tests.soak.shrinking import shrunk

FOUND = Path(__file__).parent / "found"
SHORT_HOURS, SHORT_SEEDS, SHORT_S = 0.1, 8, 20.0
SHORTENED_S = 300.0
"""Of processor time, for one script; what it is by then is printed."""

MEMORY_MB = 400
"""How much the memory of the process may grow over all shifts."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the shifts; 1 when an invariant was broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak")
    parser.add_argument("--hours", type=float, default=8.0)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--script", type=Path)
    parser.add_argument("--short", action="store_true", help="six simulated minutes of each of eight, for 20 s")
    options = parser.parse_args(words)
    if options.short:
        options.hours, options.seeds, options.seconds = SHORT_HOURS, SHORT_SEEDS, SHORT_S
    if options.script is not None:
        said = broken_by(from_text(options.script.read_text(encoding="utf-8")), options.first)
        print(said or "nothing is broken")
        return 1 if said else 0
    count, began_s, before_mb, done_s, found = Count(), time.monotonic(), _memory_mb(), 0.0, 0
    for seed in range(options.first, options.first + options.seeds):
        if time.process_time() > options.seconds:
            break
        script, said, passed_s = one_shift(seed, 3600.0 * options.hours, count)
        done_s += passed_s
        if said:
            found += 1
            _report(seed, script, said)
    print(f"{done_s / 3600.0:.2f} simulated hours in {time.monotonic() - began_s:.0f} s")
    print(f"{count.cuts} cuts started, {count.parts} parts measured, {count.runs} runs in the record")
    print("\n| what happened | times tried | survived |\n|---|---|---|")
    for name, tried in sorted(count.tried.items()):
        print(f"| {name} | {tried} | {count.survived[name]} |")
    grown_mb = _memory_mb() - before_mb
    print(f"\n{len(count.alarms)} kinds of alarms, each with its sentence; memory grew by {grown_mb:.0f} MB")
    return 1 if found or grown_mb > MEMORY_MB else 0


def one_shift(seed: int, seconds: float, count: Count) -> tuple[Script, str, float]:
    """Run a shift; return what happened, which invariant was broken, and the simulated time, s."""
    random, happened = Random(seed), list[Event]()
    with TemporaryDirectory() as folder:
        shift = Shift(Path(folder), seed, count)
        try:
            while shift.now_s < seconds:
                happened.append(drawn(random))
                shift.happen(happened[-1])
            shift.close()
        except Exception as error:
            return tuple(happened), _said(error), shift.now_s
        return tuple(happened), "", shift.now_s


def broken_by(script: Script, seed: int) -> str:
    """Play a script; return which invariant it breaks, or nothing."""
    with TemporaryDirectory() as folder:
        shift = Shift(Path(folder), seed, Count())
        try:
            shift.play(script)
            shift.close()
        except Exception as error:
            return _said(error)
    return ""


def _said(error: Exception) -> str:
    """Return the invariant that is broken; any other error of a shift breaks one, too."""
    return str(error) if isinstance(error, BrokenError) else f"{type(error).__name__}: {error}"


def _report(seed: int, script: Script, said: str) -> None:
    until_s = time.process_time() + SHORTENED_S
    short = shrunk(script, lambda part: time.process_time() < until_s and bool(broken_by(part, seed)))
    FOUND.mkdir(exist_ok=True)
    path = FOUND / f"seed-{seed}.jsonl"
    path.write_text(as_text(short), encoding="utf-8")
    print(f"seed {seed}: {said}\n{len(script)} events, {len(short)} of them repeat it: {path}", file=sys.stderr)
    print(as_text(short), file=sys.stderr, flush=True)


def _memory_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


if __name__ == "__main__":
    sys.exit(main())
