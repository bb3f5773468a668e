"""Every benchmark, one after the other; in the short form only whether each of them works.

    python -m benchmarks [--short]

The exit code is 1 where one of them fails. In the short form as many run at once as there are processors, and only
what a failed one has printed is shown.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from benchmarks.measure import SHORT, print_table

NAMES = (
    "learning",
    "stop_latency",
    "run_page",
    "simulation_speed",
    "records",
    "study",
    "ship",
    "records_page",
    "jobs_page",
    "command_start",
    "at_rest",
    "first_paint",
    "preview",
    "plots",
    "command_rate",
    "hostile_host",
    "roundness",
    "flight_recorder",
    "shift",
)
"""The longest come first."""


def in_full(name: str) -> bool:
    """Run a benchmark and show what it prints; return whether it worked."""
    print(f"\n== {name}", flush=True)
    return subprocess.run([sys.executable, "-m", f"benchmarks.{name}"], check=False).returncode == 0


def in_short(name: str) -> tuple[bool, str]:
    """Run the short form of a benchmark; return whether it worked, and what it printed."""
    command = [sys.executable, "-m", f"benchmarks.{name}"]
    environment = {**os.environ, SHORT: "1"}
    done = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    return done.returncode == 0, done.stdout


def main() -> int:
    """Run all of them; return 1 where one has failed."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--short", action="store_true", help="only whether each of them works")
    if not options.parse_args().short:
        return 0 if all([in_full(name) for name in NAMES]) else 1
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = dict(zip(NAMES, pool.map(in_short, NAMES), strict=True))
    for name, (works, printed) in found.items():
        if not works:
            print(f"== {name}\n{printed}")
    rows = [(name, "works" if works else "FAILS") for name, (works, _) in found.items()]
    print_table("Benchmarks in their short form", ("", ""), rows)
    return 0 if all(works for works, _ in found.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
