"""From the key that arms a cut until it is armed: experiment 1 at its full length, by each strategy.

The session engine of the screens works a simulated lathe in this process. "Computed" is what the console itself
takes, without the simulator; "on the line" the time of the controller meanwhile, which takes in and reports a line
at a time, as a card does; the operator waits for both. The baseline plans the same cut and sends nothing.

python -m benchmarks.arming
"""

from __future__ import annotations

import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from benchmarks.measure import extent, print_table
from console.session.station.commands import Disarm
from drivers.cutting.planning import plan_cut
from drivers.cutting.strategy import Strategy
from profiles.store import load_job
from tests.console.floor import Floor, open_floor

RUNS = extent(5, 1)
STRATEGIES = tuple(Strategy)[: extent(len(Strategy), 1)]
JOB = load_job("lee-2001-experiment-1").job


def planned_s(floor: Floor, strategy: Strategy) -> float:
    """Return the processor time to plan the cut, s."""
    begun_s = time.process_time()
    plan_cut(JOB, floor.context.machine, strategy)
    return time.process_time() - begun_s


def armed_s(floor: Floor, strategy: Strategy) -> tuple[float, float]:
    """Arm once, and disarm; return what was computed and what passed on the line, s.

    Raises:
        RuntimeError: it was not armed.
    """
    simulated_s, wait = 0.0, floor.sim.wait

    def waited(seconds: float) -> None:
        nonlocal simulated_s
        begun = time.process_time()
        wait(seconds)
        simulated_s += time.process_time() - begun

    floor.sim.wait = waited  # type: ignore[method-assign]
    now_s, cpu_s = floor.sim.now_s(), time.process_time()
    state = floor.arm(JOB, strategy)
    computed_s, line_s = time.process_time() - cpu_s - simulated_s, floor.sim.now_s() - now_s
    floor.sim.wait = wait  # type: ignore[method-assign]
    if state.armed is None:
        raise RuntimeError(f"{strategy} is not armed: {state.refusals} {state.alarms}")
    floor.do(Disarm())
    return computed_s, line_s


def main() -> None:
    """Measure and print."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        floor = open_floor(Path(folder))
        floor.set_up(replace(JOB, cut_length_mm=1.5))
        for strategy in STRATEGIES:
            plans_s = [planned_s(floor, strategy) for _ in range(RUNS)]
            found = [armed_s(floor, strategy) for _ in range(RUNS)]
            baseline_s = statistics.median(plans_s)
            computed_s, line_s = (statistics.median(each) for each in zip(*found, strict=True))
            rows.append(
                (
                    str(strategy),
                    f"{baseline_s:.2f} s",
                    f"{computed_s:.2f} s",
                    f"{computed_s / baseline_s:.1f}",
                    f"{line_s:.2f} s",
                    f"{computed_s + line_s:.2f} s",
                )
            )
    head = ("", "planned (baseline)", "computed", "x baseline", "on the line", "armed")
    print_table(f"From the key to armed, median of {RUNS}", head, rows)


if __name__ == "__main__":
    main()
