"""What the cutting force of the half stage says, on simulated lathes: right, wrong and turned compensations.

`python -m benchmarks.force_null --seeds 10 --plant realistic`. Blanks are round before they are clamped, or were
turned in the same clamping (`--round`). The lobe of the lathe is turned against the job: by nothing, by half a
lobe, which is the wrong sign, and by degrees of spindle.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from benchmarks.measure import extent, print_table
from console.session.cut.in_process import simulated_context
from console.session.cut.run import plan_run, run_once
from console.session.stages import Stage
from drivers.cutting.strategy import Strategy
from drivers.simulator.plant.presets import BUNDLED, plant_named
from profiles.compensations.force_null import ForceNull, Sign
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import load_job, load_machine

CUT_MM = 1.5  # long enough for what is gathered at the bundled feeds
TURNED_DEG = 30.0


def half_stage(
    job: Job, machine: MachineProfile, plant: str, seed: int, turned_deg: float, *, pressed: bool, strategy: str
) -> ForceNull | None:
    """Return what the force says of a half-stage cut on a lathe whose lobe is turned so much further.

    None is a cut that was not accepted, as where the tool was not on its path.
    """
    true = plant_named(plant, machine, seed)
    true = replace(true, lobe_turned_deg=true.lobe_turned_deg + turned_deg, blank_pressed=1.0 if pressed else 0.0)
    plan = plan_run(job, machine, Strategy(strategy), stage=Stage.PARTIAL, simulated=True)
    context, _ = simulated_context(machine, true)
    try:
        return run_once(plan, context, lambda *_: None).force
    except ProblemError:
        return None


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each compensation: how often each verdict was given, and the errors of the angle."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.force_null", description=__doc__)
    parser.add_argument("--plant", choices=BUNDLED, default="realistic")
    parser.add_argument("--seeds", type=int, default=extent(10, 1))
    parser.add_argument("--job", default="lee-2001-experiment-1")
    parser.add_argument("--machine", default="lee-2001-lathe")
    parser.add_argument("--strategy", choices=("pvt", "cam", "timebase"), default="cam")
    parser.add_argument("--round", action="store_true", help="blanks that were turned in the same clamping")
    options = parser.parse_args(arguments)
    job = replace(load_job(options.job).job, cut_length_mm=CUT_MM)
    machine = load_machine(options.machine).machine
    rows = []
    for name, turned_deg in (("right", 0.0), ("wrong sign", 180.0 / job.jaws), ("turned 30", TURNED_DEG)):
        found = []
        for seed in range(1, options.seeds + 1):
            each = half_stage(
                job,
                machine,
                options.plant,
                seed,
                turned_deg,
                pressed=not options.round,
                strategy=options.strategy,
            )
            off_deg = plant_named(options.plant, machine, seed).lobe_turned_deg + turned_deg
            if each is not None:
                found.append((each, off_deg))
        rows.append(_row(name, found, options.seeds))
    title = f"{options.job}, {options.plant}, {options.strategy}, {options.seeds} seeds"
    print_table(
        title, ("compensation", *Sign, "no cut", "error of angle: mean, worst, deg", "stated sd, deg"), rows
    )


def _row(name: str, found: Sequence[tuple[ForceNull, float]], asked: int) -> tuple[str, ...]:
    counts = Counter(each.sign for each, _ in found)
    told = [(each, deg) for each, deg in found if each.sign is not Sign.UNKNOWN]
    errors = [math.remainder(each.turned_deg - deg, 360.0 / each.lobes) for each, deg in told]
    figures = ("-", "-")
    if errors:
        worst = max(errors, key=abs)
        sd_deg = sum(each.turned_sd_deg for each, _ in told) / len(told)
        figures = (f"{sum(errors) / len(errors):+.1f} {worst:+.1f}", f"{sd_deg:.1f}")
    return (name, *(str(counts[sign]) for sign in Sign), str(asked - len(found)), *figures)


if __name__ == "__main__":
    main()
