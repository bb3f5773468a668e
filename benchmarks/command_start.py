"""What a command costs from exec to exit, against a bare interpreter.

python -m benchmarks.command_start
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from benchmarks.measure import extent, median_process_cost, print_table

RUNS = extent(7, 1)
JOB = "lee-2001-experiment-1"


def commands(data_folder: str) -> list[tuple[str, list[str]]]:
    """Return the measured commands with their names; the first is the baseline."""
    script = Path(sys.executable).with_name("console")
    console = [str(script)] if script.exists() else [sys.executable, "-m", "console"]
    return [
        ("python -c pass (baseline)", [sys.executable, "-c", "pass"]),
        ("python -c 'import numpy'", [sys.executable, "-c", "import numpy"]),
        ("console --help", [*console, "--help"]),
        ("console jobs", [*console, "jobs"]),
        *(
            (f"console run --strategy {strategy}", [*console, *run_arguments(strategy, data_folder)])
            for strategy in ("none", "paper", "pvt")[: extent(3, 1)]
        ),
    ]


def run_arguments(strategy: str, data_folder: str) -> list[str]:
    """Return the arguments of a simulated run whose record goes to a folder that is thrown away."""
    return ["run", JOB, "--sim", "--strategy", strategy, "--data", data_folder]


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        costs = [(name, median_process_cost(arguments, RUNS)) for name, arguments in commands(folder)]
    baseline = costs[0][1]
    rows = [
        (
            name,
            f"{1000.0 * cost.wall_s:.0f} ms",
            f"{cost.wall_s / baseline.wall_s:.1f}",
            f"{cost.peak_mib:.0f} MiB",
            f"{cost.peak_mib / baseline.peak_mib:.1f}",
        )
        for name, cost in costs
    ]
    title = f"Whole processes, median of {RUNS}"
    print_table(title, ("", "wall", "x baseline", "peak memory", "x baseline"), rows)


if __name__ == "__main__":
    main()
