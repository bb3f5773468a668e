"""What follows a key in the fields of a job: the numbers without a program, and the program of each strategy.

Processor time: all of it is calculation, beside the screen.

python -m benchmarks.preview
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

from benchmarks.measure import print_table
from console.session.outlook import outlook
from console.session.preview import predict, preview
from drivers.cut import Strategy, plan_cut
from profiles.envelope import envelope
from profiles.servo import eq9_summary
from profiles.store import load_job, load_machine

RUNS = 7
JOB, MACHINE = "lee-2001-experiment-1", "lee-2001-lathe"


def measured() -> list[tuple[str, Callable[[], object]]]:
    """Return what is measured with its names; the first is the baseline."""
    job, machine = load_job(JOB).job, load_machine(MACHINE).machine

    def planned(strategy: Strategy) -> Callable[[], object]:
        return lambda: predict(job, machine, plan_cut(job, machine, strategy))

    return [
        ("lobe, command, drive, rules (baseline)", lambda: outlook(job, machine)),
        ("highest speeds", lambda: envelope(job, machine)),
        ("bandwidth and margins of Eq 9", lambda: eq9_summary(machine)),
        *((f"program and prediction, {strategy}", planned(strategy)) for strategy in Strategy),
        ("the whole preview", lambda: preview(job, machine)),
    ]


def main() -> None:
    """Measure and print; the first round warms the caches."""
    works = measured()
    times_s: dict[str, list[float]] = {name: [] for name, _ in works}
    for turn in range(RUNS + 1):
        for name, work in works:
            start_s = time.process_time()
            work()
            if turn:
                times_s[name].append(time.process_time() - start_s)
    baseline_s = statistics.median(times_s[works[0][0]])
    rows = []
    for name, _ in works:
        median_s = statistics.median(times_s[name])
        slowest_s = max(times_s[name])
        rows.append(
            (name, f"{1000 * median_s:.1f} ms", f"{median_s / baseline_s:.0f}", f"{1000 * slowest_s:.1f} ms")
        )
    print_table(f"After a key, processor time, median of {RUNS}", ("", "median", "x baseline", "slowest"), rows)


if __name__ == "__main__":
    main()
