"""Fuzz the readers of what comes from outside.

    python -m tests.fuzz [TARGET ...] [--inputs N] [--seconds S] [--seed N] [--workers N] [--short] [--plain]

Without a target all are fuzzed, each until N inputs were tried (default 1000000) or S seconds are over; one after
the other, or as many at a time as there are --workers. Coverage-guided where Atheris is installed (the extra
`fuzz`), else, and with --plain, by the mutations of `tests/fuzz/mutating.py`. --short is about a second for each.
The table is that of docs/reliability.md. What breaks a reader is kept in `tests/fuzz_corpus`, and the exit code is
then 1.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

from tests.fuzz.all_targets import TARGETS, fuzzed
from tests.fuzz.guided import is_installed
from tests.fuzz.mutating import Outcome
from tests.fuzz.target import CORPUS, Target

SHORT_INPUTS, SHORT_S = 20_000, 1.0


def main(words: Sequence[str] | None = None) -> int:
    """Fuzz what is asked for; 1 when a reader was broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("targets", nargs="*", metavar="TARGET", choices=[[], *TARGETS])
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seconds", type=float, default=86_400.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--plain", action="store_true")
    options = parser.parse_args(words)
    guided = is_installed() and not (options.plain or options.short)
    how = "coverage-guided (Atheris)" if guided else "seeded mutations, not coverage-guided"
    print(f"{how}; seed {options.seed}\n\n| target | what | inputs | seconds | found |\n|---|---|---|---|---|")
    inputs, seconds = (SHORT_INPUTS, SHORT_S) if options.short else (options.inputs, options.seconds)
    fuzz = partial(fuzzed, inputs=inputs, seconds=seconds, seed=options.seed, guided=guided)
    names, broken = options.targets or list(TARGETS), 0
    with ProcessPoolExecutor(options.workers, get_context("spawn"), max_tasks_per_child=1) as pool:
        for name, outcome in zip(names, pool.map(fuzz, names), strict=True):
            found = "nothing" if outcome.broken_by is None else _kept(TARGETS[name], outcome)
            print(
                f"| `{name}` | {TARGETS[name].what} | {outcome.tried} | {outcome.seconds:.0f} | {found} |",
                flush=True,
            )
            broken += outcome.broken_by is not None
    return 1 if broken else 0


def _kept(target: Target, outcome: Outcome) -> str:
    """Keep the input that broke the reader; return where, and print the error."""
    data = outcome.broken_by or b""
    folder = CORPUS / target.name
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / hashlib.sha256(data).hexdigest()[:12]
    path.write_bytes(data)
    print(f"{target.name}: {outcome.error}\n{data[:200]!r}", file=sys.stderr)
    return f"`{path.relative_to(CORPUS.parent)}`"


if __name__ == "__main__":
    sys.exit(main())
