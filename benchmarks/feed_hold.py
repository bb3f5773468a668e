"""How the mean radius runs along a cut from its entry, and the step that a feed hold leaves, on simulated parts.

    python -m benchmarks.feed_hold [--seeds 3] [--first 1] [--plant steady realistic] [--machine NAME ...]
        [--strategy NAME ...] [--parts 3] [--gains KP KI KD] [--passive 0.4]

`entry fall` is the mean radius 0.4 cut lengths before the middle less that as far behind it, um, of a first part
that nothing has taught; `third part` is the same after a row of parts has learned (`cam` alone learns within the
cut). `RONt there` is that of the section next to the entry, `in the middle` that of the middle.

`hold step` is what a hold in mid-cut adds: the same lathe cuts the same part without a hold, and the difference of
both is the larger for it, peak to peak at 50 UPR, in the worst of the sections about the place of the hold. All of
it is of parts that are released, by the gauge of the plant. Each figure is the worst of the seeds.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from benchmarks.measure import extent, print_table
from console.session.cut.engine import CutContext
from console.session.cut.in_process import simulated_context
from console.session.cut.run import FILTER_UPR, cut_part, plan_run
from console.session.errors import SessionError
from console.session.learning.learning import learn
from drivers.cutting.feed_hold import HoldState
from drivers.cutting.planning import CutPlan
from drivers.cutting.strategy import TRIMMED, Strategy
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant import workshop
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.which_lathe import with_one_lobe
from profiles.axis.servo_gains import PidGains, variables_from_gains, with_variables
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.roundness import evaluate
from profiles.store import load_job, load_machine
from profiles.traces import Trace

ENTRY = 0.4  # cut lengths from the middle
HELD_AT_MM = 3.9
HELD_FOR_S = 10.0
ABOUT_HOLD_MM = tuple(
    0.1 * step for step in range(-7, 8)
)  # sections, from the place at which the hold is asked for
SECTIONS = (0.0, -ENTRY, ENTRY)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cutting:
    """What is cut: a job by a strategy on a machine, on a plant with a seed."""

    job_name: str
    machine_name: str
    strategy: Strategy
    plant: str
    parts: int
    gains: tuple[float, ...] | None = None
    passive_fraction: float = 0.0
    one_lobe: bool = False

    @property
    def job(self) -> Job:
        """The job, as its file has it."""
        return load_job(self.job_name).job

    @property
    def machine(self) -> MachineProfile:
        """The machine, with the gains that were asked for."""
        machine = load_machine(self.machine_name).machine
        machine = replace(machine, tool=replace(machine.tool, passive_force_fraction=self.passive_fraction))
        machine = with_one_lobe(machine) if self.one_lobe else machine
        return machine if self.gains is None else _with_gains(machine, self.gains)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """What one seed gives, um; None where it was not made. `refused` says why a cut was not accepted."""

    fall_um: float | None = None
    ront_entry_um: float | None = None
    ront_middle_um: float | None = None
    third_um: float | None = None
    step_um: float | None = None
    refused: str = ""


class _Holder:
    """Holds a cut once at a place, and resumes it."""

    def __init__(self, context: CutContext, now_s: SimulatedLathe, counts: float) -> None:
        self._context, self._clock, self._counts = context, now_s, counts
        self._since_s: float | None = None
        self._asked = self._resumed = False

    def begin(self, plan: CutPlan) -> None:
        """Do nothing: the hold is asked for in the cut."""

    def see(self, snapshot: Snapshot) -> None:
        """Ask for the hold at its place, and for the rest of the cut some seconds after the tool is out."""
        hold = self._context.lathe.program.hold
        if not self._asked and snapshot.carriage.position > self._counts:
            self._asked = True
            hold.ask()
        if hold.report.state is HoldState.HELD and not self._resumed:
            self._since_s = self._since_s or self._clock.now_s()
            if self._clock.now_s() > self._since_s + HELD_FOR_S:
                self._resumed = True
                hold.resume()


def _mean_um(trace: Trace) -> float:
    return float(np.mean(trace.deviation_um))


def _ront_um(trace: Trace, less: Trace | None = None) -> float:
    values = trace.deviation_um if less is None else np.subtract(trace.deviation_um, less.deviation_um)
    return evaluate(trace.angle_deg, values, FILTER_UPR).ront_um


def _sections(job: Job) -> tuple[float, ...]:
    about = tuple((HELD_AT_MM + past_mm) / job.cut_length_mm - 0.5 for past_mm in ABOUT_HOLD_MM)
    return SECTIONS + about


def _made(cutting: Cutting, seed: int, *, hold: bool) -> tuple[Trace, ...]:
    """Cut a part, and return the traces of its sections."""
    true = plant_named(cutting.plant, cutting.machine, seed)
    plan = plan_run(cutting.job, cutting.machine, cutting.strategy, simulated=True)
    context, lathe = simulated_context(cutting.machine, true)
    carriage = cutting.machine.carriage
    counts = plan.cut.setup.carriage_face + HELD_AT_MM * carriage.counts_per_mm
    beside = _Holder(context, lathe, counts) if hold else None
    cut_part(context, cutting.job, plan.cut, lambda *_: None, beside, measured=False)
    return tuple(lathe.measure(each * cutting.job.cut_length_mm) for each in _sections(cutting.job))


def row_fall_um(cutting: Cutting, seed: int) -> float:
    """Return the fall of the last part of a row that learns."""
    true = plant_named(cutting.plant, cutting.machine, seed)
    plan = plan_run(cutting.job, cutting.machine, cutting.strategy, simulated=True)
    context, lathe = simulated_context(cutting.machine, true)
    learn(plan, lambda: context, lambda *_: None, cutting.parts)
    front, back = (lathe.measure(each * cutting.job.cut_length_mm) for each in (-ENTRY, ENTRY))
    return _mean_um(front) - _mean_um(back)


def figures(cutting: Cutting, seed: int) -> Figures:
    """Return the figures of one seed."""
    workshop.SECTIONS = _sections(cutting.job)
    try:
        plain = _made(cutting, seed, hold=False)
        found = Figures(
            fall_um=_mean_um(plain[1]) - _mean_um(plain[2]),
            ront_entry_um=_ront_um(plain[1]),
            ront_middle_um=_ront_um(plain[0]),
        )
        if cutting.strategy in TRIMMED and cutting.parts:
            found = replace(found, third_um=row_fall_um(cutting, seed))
        if cutting.strategy is not Strategy.PAPER:
            held = _made(cutting, seed, hold=True)
            pairs = list(zip(held, plain, strict=True))[len(SECTIONS) :]
            found = replace(found, step_um=max(_ront_um(*pair) for pair in pairs))
    except (ProblemError, SessionError) as error:
        codes = ", ".join(f"{each.code} {each.value}" for each in error.problems)
        return Figures(refused=codes)
    return found


def _worst(values: Sequence[float | None]) -> str:
    known = [each for each in values if each is not None]
    return f"{max(known, key=abs):.2f}" if known else "-"


def row(cutting: Cutting, rows: Sequence[Figures]) -> tuple[str, ...]:
    """Return the row of the table: the worst of the seeds."""
    refused = [each.refused for each in rows if each.refused]
    return (
        cutting.machine_name,
        cutting.plant,
        cutting.strategy.value,
        _worst([each.fall_um for each in rows]),
        _worst([each.ront_entry_um for each in rows]),
        _worst([each.ront_middle_um for each in rows]),
        _worst([each.third_um for each in rows]),
        _worst([each.step_um for each in rows]),
        f"{len(refused)} {refused[0]}" if refused else "0",
    )


def _with_gains(machine: MachineProfile, gains: Sequence[float]) -> MachineProfile:
    kp, ki, kd = gains
    asked = PidGains(kp_v_per_m=kp, ki_v_per_m_s=ki, kd_v_s_per_m=kd, velocity_feedforward_v_s_per_m=kd)
    tool = replace(machine.tool, gain_kp_v_per_m=kp, gain_ki_v_per_m_s=ki, gain_kd_v_s_per_m=kd)
    return replace(with_variables(machine, variables_from_gains(machine, asked)), tool=tool)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.feed_hold", description=__doc__)
    parser.add_argument("--seeds", type=int, default=extent(3, 1))
    parser.add_argument("--first", type=int, default=1, help="the first of the seeds")
    parser.add_argument("--plant", nargs="+", default=["steady", "realistic"][: extent(2, 1)])
    parser.add_argument("--job", default="lee-2001-experiment-1")
    families = ["lee-2001-lathe", "turbo-ethernet-lathe"]
    parser.add_argument("--machine", nargs="+", default=families[: extent(2, 1)])
    by_default = ["none", "pvt", "timebase", "cam"][:: extent(1, 3)]
    parser.add_argument("--strategy", nargs="+", default=by_default)
    parser.add_argument("--parts", type=int, default=extent(3, 0), help="parts that learn; 0 for none")
    parser.add_argument("--gains", type=float, nargs=3, help="of the tool: V/m, V/(m s), V s/m")
    parser.add_argument("--passive", type=float, default=0.0, help="passive force over the main one that is known")
    asked = parser.parse_args(arguments)
    seeds, rows = range(asked.first, asked.first + asked.seeds), []
    gains = None if asked.gains is None else tuple(asked.gains)
    with ProcessPoolExecutor() as pool:
        for name in asked.machine:
            for plant in asked.plant:
                for strategy in asked.strategy:
                    cutting = Cutting(
                        job_name=asked.job,
                        machine_name=name,
                        strategy=Strategy(strategy),
                        plant=plant,
                        parts=asked.parts,
                        gains=gains,
                        passive_fraction=asked.passive,
                    )
                    rows.append(row(cutting, list(pool.map(partial(figures, cutting), seeds))))
    head = ("machine", "plant", "strategy", "entry fall", "RONt there", "in the middle")
    print_table(
        "Entry and feed hold: um, the worst of the seeds", (*head, "third part", "hold step", "refused"), rows
    )


if __name__ == "__main__":
    main()
