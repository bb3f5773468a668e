"""Alarms of a tool that lags its path: none on good parts, one in each cut with a lag beyond the budget.

    python -m benchmarks.tool_lag [--seeds 10] [--first 1] [--plant steady realistic hard] [--parts 3]
        [--lag 1.2 2 4]

On each simulated lathe parts of experiment 1, 1.5 mm long, are cut with `cam` by the session that the screens use;
each teaches the next one. `alarms` counts the cuts that said "tool lags its path" or "leads" though the part is
within its tolerance, `refused` those that were not armed or not as planned, `stopped` those that the console ended
(such a lathe cuts no more), `not proven` those without a verdict, and `within` the parts within their tolerance.

Then a lag is injected between tool and spindle: what the tool is compared with is turned by so many degrees of
spindle that the lag alone leaves `--lag` times the budget of a lag on the part, late and early in turn. The tool
has a lag of its own besides: `told` counts the cuts that said so among those whose whole lag, from all polls, is
more than 1.1 budgets; within a tenth no cut is sure of it. The exit code is 1 if a part within tolerance has an
alarm, a cut was refused or stopped, or an injected lag was not told.
"""

from __future__ import annotations

import argparse
import cmath
import math
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from benchmarks.measure import extent, print_table
from console.session.cut.cut_verdict import CutJudgement
from console.session.cut.telemetry import lag_left_um_pp, phase_limit_deg, unexpected_deg
from console.session.learning.part_learning import accept
from console.session.station.commands import Acknowledge, Measure, Start
from profiles.compensations.learned_compensation import LearnedCompensation
from profiles.compensations.path import LobedPath
from profiles.job import Job
from profiles.problem import ProblemError
from profiles.store import load_job, load_machine, save_job
from tests.console.floor import open_floor, order
from tests.console.test_learning_on_the_screen import Shop
from tests.system.lathe_sites import compact_text

CUT_MM = 1.5
SURELY = 1.1  # budgets
LAGS = ("cut.out_of_phase", "cut.tool_leads")


@dataclass(frozen=True, slots=True, kw_only=True)
class CutSeen:
    """A cut: what was told of it, and whether its part is within tolerance; `lag` is the one injected, 0 for none.

    `beyond` is the whole lag, with the tool's own, from all polls of the cut, in budgets.
    """

    lag: float = 0.0
    beyond: float = 0.0
    alarm: bool = False
    refused: str = ""
    stopped: str = ""
    proven: bool = True
    within: bool = False

    @property
    def told(self) -> bool:
        """Whether a lag was told, by an alarm or by the stop that it led to."""
        return self.alarm or self.stopped in (*LAGS, "cut.lagged")


def lag_deg(target: LobedPath, job: Job, times: float) -> float:
    """Return the lag that leaves `times` the budget on the part, see `phase_limit_deg`."""
    limit_deg = phase_limit_deg(target, job.roundness_tolerance_um)
    assert limit_deg is not None
    left = times * lag_left_um_pp(target, limit_deg) / (4.0 * target.amplitude_um)
    return math.degrees(2.0 / target.lobes * math.asin(min(left, 1.0)))


def cut_once(shop: Shop, version: LearnedCompensation | None, turned: float = 0.0, lag: float = 0.0) -> CutSeen:
    """Cut a part, with the plan that it is compared with turned by so many times the budget."""
    floor = shop.floor
    shop.clamp()
    while any(not each.acknowledged for each in floor.state.alarms):
        order(floor, Acknowledge())
    if (ready := shop.order(compensation=version)).armed is None:
        return CutSeen(
            lag=lag,
            refused=f"not armed: {', '.join(f'{each.code} {each.key} {each.value}' for each in ready.refusals)}",
        )
    armed = ready.armed
    if turned:
        target = armed.plan.target
        off = replace(target, phase_deg=target.phase_deg - math.copysign(lag_deg(target, armed.job, lag), turned))
        floor.context.tell(armed=replace(armed, plan=replace(armed.plan, target=off)))
    state = floor.do(Start())
    told = {each.problem.code for each in state.alarms if not each.acknowledged}
    refused = [each.code for each in state.refusals]
    cut = state.cut
    figures = None if cut is None else cut.figures
    beyond = 0.0
    if cut is not None and figures is not None and cut.phase_limit_deg:
        target = shop.floor.context.plan.target if shop.floor.context.plan else armed.plan.target
        behind = cmath.phase(
            (target.harmonics[0].coefficient + figures.tool_lobe_um) / target.harmonics[0].coefficient
        )
        whole_deg = unexpected_deg(-math.degrees(behind) / target.lobes, cut.expected_lag)
        beyond = abs(whole_deg) / cut.phase_limit_deg
    judged = CutJudgement.NOT_PROVEN if figures is None else figures.verdict.judgement
    return CutSeen(
        lag=lag,
        beyond=beyond,
        alarm=bool(told & set(LAGS)),
        refused=""
        if state.cut_done or state.stop
        else ", ".join(sorted({*refused, *told} - set(LAGS))) or "not done",
        stopped="" if state.stop is None else state.stop.reason,
        proven=judged is not CutJudgement.NOT_PROVEN,
    )


def row_of_parts(plant: str, parts: int, lags: Sequence[float], seed: int) -> list[CutSeen]:
    """Cut parts that learn from each other on one lathe, then those with a lag."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "trilobe"
        data.mkdir()
        lathe, path = Path(folder) / "lathe.toml", Path(folder) / "ring.toml"
        lathe.write_text(compact_text("pmac"), encoding="utf-8")
        save_job(replace(load_job("lee-2001-experiment-1").job, cut_length_mm=CUT_MM), path)
        job, machine = load_job(str(path)), load_machine(str(lathe))
        floor = open_floor(data, seed, plant, machine)
        floor.set_up(job.job)
        shop, version, seen = Shop(floor=floor, job=job, machine=machine, data=data), None, list[CutSeen]()
        for _ in range(parts):
            cut = cut_once(shop, version)
            if cut.stopped:
                return [*seen, cut]
            part = None if cut.refused else floor.do(Measure()).measured
            if part is not None:
                cut = replace(cut, within=part.result.ront_um <= job.job.roundness_tolerance_um)
                try:
                    version = version if part.learning is None else accept(part.learning, data)
                except ProblemError:
                    pass  # nothing to learn: the next is cut as this one
            seen.append(cut)
        for number, lag in enumerate(lags):
            seen.append(cut_once(shop, version, turned=(-1.0) ** (seed + number), lag=lag))
            if seen[-1].stopped:
                break
    return seen


def surely(cut: CutSeen) -> bool:
    """Return whether a cut with a lag was sure to be told: its whole lag is beyond, or it was stopped for one."""
    return cut.beyond > SURELY or cut.stopped == "cut.lagged"


def counted(reasons: Sequence[str]) -> str:
    """Return how many cuts have a reason, and the first of them."""
    given = [each for each in reasons if each]
    return f"{len(given)} {given[0]}" if given else "0"


def cells(plant: str, found: Sequence[CutSeen], lags: Sequence[float]) -> tuple[str, ...]:
    """Return the row of a plant."""
    plain = [each for each in found if not each.lag]
    good = [each for each in plain if each.within]
    told = (
        f"{sum(each.told for each in beyond)} of {len(beyond)}"
        for beyond in ([each for each in found if each.lag == lag and surely(each)] for lag in lags)
    )
    return (
        plant,
        str(len(plain)),
        str(len(good)),
        str(sum(each.alarm for each in good)),
        counted([each.refused for each in plain]),
        counted([each.stopped for each in plain]),
        str(sum(not each.proven for each in plain if not each.refused and not each.stopped)),
        *told,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tool_lag", description=__doc__)
    parser.add_argument("--seeds", type=int, default=extent(10, 1))
    parser.add_argument("--first", type=int, default=1, help="the first of the seeds")
    parser.add_argument("--plant", nargs="+", default=["steady", "realistic", "hard"][: extent(3, 1)])
    parser.add_argument("--parts", type=int, default=extent(3, 1))
    parser.add_argument("--lag", type=float, nargs="*", default=[1.2, 2.0, 4.0][: extent(3, 1)])
    asked = parser.parse_args(arguments)
    rows, failed = [], False
    with ProcessPoolExecutor() as pool:
        for plant in asked.plant:
            seeds = range(asked.first, asked.first + asked.seeds)
            made = pool.map(partial(row_of_parts, plant, asked.parts, asked.lag), seeds)
            found = [each for row in made for each in row]
            rows.append(cells(plant, found, asked.lag))
            failed |= any(
                (each.within and each.alarm) or each.refused or each.stopped for each in found if not each.lag
            )
            failed |= any(each.lag and surely(each) and not each.told for each in found)
    told = (f"told of {lag:g} x" for lag in asked.lag)
    head = ("plant", "cuts", "within", "alarms", "refused", "stopped", "not proven", *told)
    print_table("Lag of the tool: alarms on parts within tolerance, and injected lags that were told", head, rows)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
