"""Iterative learning over a series of parts: from the tool in air, the tool in the cut, and the measured part.

In air the command is learned until the tool follows its target; friction makes the response depend on the
amplitude, so the motion is that of the cut itself. In the cut a trim removes what the cutting force adds. The
measured part then corrects the target. A harmonic that grows instead, in air or from part to part, is set back
to its best state and no longer learned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from console.session.cut.context import CutContext
from console.session.cut.engine import Step
from console.session.cut.headless import Beside, CutOutcome, cut_part
from console.session.cut.planning import planned
from console.session.cut.run import FILTER_UPR, RunPlan, RunResult, TellPart, roundness_of
from console.session.cut.telemetry import CutFigures
from console.session.errors import SessionError
from console.session.learning.learning_beside import AirWatch, CutLearner
from console.session.stages import Stage
from drivers.cutting.planning import CutPlan, nominal_command
from drivers.cutting.sampling import Batch
from drivers.cutting.strategy import TRIMMED, UNCOMPENSATED, Strategy
from drivers.errors import DriverError
from drivers.identification.nominal import nominal_response
from profiles.axis.friction import held_back_um
from profiles.chucking.grip import force_sd_n, lobe_um_per_n
from profiles.compensations.learning import (
    Deviation,
    Grown,
    HarmonicFit,
    Watch,
    fit_harmonics,
    learned_command,
    learned_part,
)
from profiles.compensations.next_version import FIRST_GAIN, LATER_GAIN, uncompensated
from profiles.compensations.part_waves import PartWaves, part_waves
from profiles.compensations.path import CutPath, target_path
from profiles.job import Job
from profiles.problem import Problem
from profiles.roundness import RoundnessResult
from profiles.traces import Trace

AIR_PASSES, MOST_AIR_PASSES = 3, 8
AIR_ENOUGH_UM_PP = 1.0
"""Number of air passes; more while the lobe error is above this: a small motion starts within its friction."""

AIR_TURNS = 30

OVERTONES = (2, 3)
"""Harmonics of the lobe that are learned beside it."""

OTHERS = (1, 2)
"""Harmonics that are fitted but not learned: eccentricity and ovality would leak into the others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedPart:
    """One part: its roundness, the tool error, and the path and trim that it was cut with.

    `tool_off` is the tool error in the middle of the cut, `air_um` the lobe error in each air pass before this
    part, peak to peak. `learned` are the harmonics that the part has changed for the next one, `grown` those no
    longer learned.
    """

    roundness: RoundnessResult
    figures: CutFigures
    path: CutPath
    trim_um: complex
    tool_off: Deviation
    air_um: tuple[float, ...]
    part_gain: float
    learned: tuple[int, ...]
    grown: tuple[Grown, ...]
    collisions: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnResult:
    """Parts made: `before` without compensation, the parts in order, `floor` a part without a lobe."""

    plan: RunPlan
    before: RoundnessResult
    floor: RoundnessResult
    parts: tuple[LearnedPart, ...]

    @property
    def last(self) -> RunResult:
        """The series as a run: its part is the last one, its collisions are those of all parts."""
        part = self.parts[-1]
        return RunResult(
            plan=self.plan,
            simulated=True,
            before=self.before,
            after=part.roundness,
            figures=part.figures,
            collisions=tuple(dict.fromkeys(met for each in self.parts for met in each.collisions)),
        )

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Harmonics that were not learned: `learning.grew`, with an amplitude each."""
        return tuple(
            Problem(
                code="learning.grew",
                key=f"{each.waves}/rev",
                value=f"{each.grown_um:.2f} um",
                limit=f"{each.best_um:.2f} um",
            )
            for each in self.parts[-1].grown
        )


def learn(plan: RunPlan, open_machine: Callable[[], CutContext], tell: TellPart, parts: int) -> LearnResult:
    """Cut `parts` parts on one machine, each corrected by the ones before.

    Raises:
        ProblemError: `learning.no_gauge`, `learning.strategy`; why a part cannot be learned from, as for a single
            one; what went wrong, see `cut_part`.
    """
    refuse_unlearnable(plan, measured=True)
    learner = _Learner(plan, open_machine(), tell)
    before, floor = learner.reference(), learner.floor()
    learner.in_air()
    made = tuple(learner.part(number) for number in range(1, parts + 1))
    return LearnResult(plan=plan, before=before, floor=floor, parts=made)


def refuse_unlearnable(plan: RunPlan, *, measured: bool) -> None:
    """Refuse a cut from which nothing can be learned.

    Raises:
        SessionError: `learning.strategy`, only a table can be learned; `learning.no_gauge`, no gauge measures
            the parts between two cuts.
    """
    if not plan.cut.strategy.traits.trims or plan.reference is None:
        strategy = plan.cut.strategy.value
        raise SessionError(Problem(code="learning.strategy", value=strategy, limit=", ".join(TRIMMED)))
    if not measured:
        raise SessionError(Problem(code="learning.no_gauge"))


def _measured(trace: Trace | None) -> Trace:
    if trace is None:
        raise SessionError(Problem(code="learning.no_gauge"))
    return trace


def _named(tell: TellPart, part: str, number: int) -> Callable[[Step, str], None]:
    """Report a part with its number, if it has one."""
    if not number:
        return lambda step, detail: tell(part, step, detail)
    return lambda step, detail: tell(part, step, f"{number} · {detail}" if detail else f"{number}")


def _of_the_axis(problem: Problem) -> Problem:
    return replace(problem, code="learning.axis_beyond") if problem.code == "path.beyond" else problem


class _Learner:
    """One machine, and the path as learned so far."""

    def __init__(self, plan: RunPlan, context: CutContext, tell: TellPart) -> None:
        self._plan, self._context, self._tell = plan, context, tell
        self._job, self._machine = plan.job, plan.machine
        target = target_path(plan.job)
        self._path = CutPath(target=target, command=nominal_command(plan.job, plan.machine, plan.cut.strategy))
        self._watch = Watch()
        self._air_um: list[float] = []
        self._homed = False

    def reference(self) -> RoundnessResult:
        """Cut a part without compensation; what its gauge cannot measure now, it cannot measure later either.

        Raises:
            SessionError: why nothing can be learned from such a trace.
        """
        trace = self._plain(self._job, "before")
        self._teaching(trace)
        return roundness_of(trace)

    def floor(self) -> RoundnessResult:
        """Cut a part without a lobe and without compensation: the remaining error is the machine's own."""
        return roundness_of(self._plain(replace(self._job, lobe_error_um_pp=0.0), "floor"))

    def _teaching(self, trace: Trace) -> PartWaves:
        """Return the harmonics of a part, by the rule that `console learn` and the screen share.

        Raises:
            SessionError: why nothing may be learned from it.
        """
        part = part_waves(trace, self._job, filter_upr=FILTER_UPR)
        if part.reasons:
            raise SessionError(*part.reasons)
        return part

    def _plain(self, job: Job, name: str) -> Trace:
        watchdog = self._plan.cut.setup.watchdog
        plan = planned(
            job, self._machine, UNCOMPENSATED, Stage.FULL, None, watchdog=watchdog, from_turn=self._turn()
        )
        return _measured(self._cut(job, plan, name).trace)

    def _cut(
        self,
        job: Job,
        plan: CutPlan,
        name: str,
        beside: Beside | None = None,
        number: int = 0,
        *,
        blank: bool = True,
    ) -> CutOutcome:
        tell = _named(self._tell, name, number)
        outcome = cut_part(self._context, job, plan, tell, beside, homed=self._homed, blank=blank)
        self._homed = True
        return outcome

    def _turn(self) -> int:
        """Return the whole turn nearest to the spindle position; the spindle need not turn back."""
        if not self._homed:
            return 0
        return round(self._context.lathe.snapshot().spindle.position / self._machine.spindle.counts_per_rev)

    def in_air(self) -> None:
        """Learn the path clear of the part."""
        job = self._job
        # Some turns of the same feed, over the end of the part.
        short = replace(job, cut_length_mm=min(job.cut_length_mm, AIR_TURNS * job.feed_mm_per_rev))
        for number in range(1, MOST_AIR_PASSES + 1):
            if number > AIR_PASSES and self._right_in_air:
                break
            plan = self._planned_in_air(short)
            watch = AirWatch(self._context.lathe, job.jaws)
            self._cut(short, plan, "air", watch, number, blank=False)
            off = self._off(watch.last())
            self._air_um.append(2.0 * abs(off.coefficients_um[job.jaws]))
            self._learn_in_air(off)
        self._watch = self._watch.afresh()

    @property
    def _right_in_air(self) -> bool:
        """Whether another air pass would improve nothing that matters."""
        return not self._learns_lobe or self._air_um[-1] <= AIR_ENOUGH_UM_PP

    @property
    def _learns_lobe(self) -> bool:
        return self._job.jaws not in self._watch.frozen

    def _learn_in_air(self, off: HarmonicFit) -> None:
        left = self._learnable(off.coefficients_um)
        # Friction couples the overtones to the amplitude of the lobe, which is still being learned.
        allowed = {n: 0.0 if n == self._job.jaws else held_back_um(self._machine, self._job, n) for n in left}
        self._watch = self._watch.judged(self._path, left, lambda _: off.amplitude_sd_um, allowed.__getitem__)
        self._path = learned_command(self._watch.kept(self._path), self._watch.learned(left), self._response)

    def part(self, number: int) -> LearnedPart:
        """Cut a part, learn during the cut, and from its trace for the next one."""
        plan = self._planned(self._job, trimmed=True)
        watch = CutLearner(self._context.lathe, self._job, self._off, trims=self._learns_lobe)
        outcome = self._cut(self._job, plan, "part", watch, number)
        watch.refuse_failed()
        trace = _measured(outcome.trace)
        off, trim_um = watch.in_the_middle()
        gain = FIRST_GAIN if number == 1 else LATER_GAIN
        cut_with = self._path
        learned = self._learn_from(trim_um, trace, off, gain)
        return LearnedPart(
            roundness=roundness_of(trace),
            figures=outcome.figures,
            path=cut_with,
            trim_um=trim_um,
            tool_off=off,
            air_um=tuple(self._air_um) if number == 1 else (),
            part_gain=gain,
            learned=learned,
            grown=self._watch.grown,
            collisions=outcome.collisions,
        )

    def _learn_from(self, trim_um: complex, trace: Trace, off: Deviation, gain: float) -> tuple[int, ...]:
        """Put the trim and the part's correction into the table; return the learned harmonics."""
        job = self._job
        found = self._teaching(trace)
        self._refuse_worse(found, off)
        by_program = nominal_response(Strategy.PVT, self._machine, job.lobe_frequency_hz)
        folded = self._path.command.plus({job.jaws: trim_um * by_program / self._response(job.jaws)})
        path = CutPath(target=self._path.target, command=folded)
        # Another clamping has another lobe, whatever the tool does.
        scatter_um = {job.jaws: 0.5 * lobe_um_per_n(job, self._machine) * force_sd_n(job, self._machine)}
        self._watch = self._watch.judged(
            path,
            self._learnable(found.coefficients_um),
            lambda n: math.hypot(found.sd_um[n], scatter_um.get(n, 0.0)),
        )
        high = self._watch.learned(self._learnable(found.significant_um()))
        missed = self._watch.learned(self._learnable(off.coefficients_um))
        part = Deviation(mean_um=found.mean_um, coefficients_um=high)
        tool = Deviation(mean_um=off.mean_um, coefficients_um=missed)
        self._path = learned_part(self._watch.kept(path), part, tool, self._response, gain)
        return tuple(sorted({*high, *missed}))

    def _refuse_worse(self, part: PartWaves, off: Deviation) -> None:
        """Refuse to learn from a part that its compensation has made worse, by the rule for a single part.

        Raises:
            SessionError: `learned.worse`.
        """
        lobes = self._job.jaws
        # The tool error was measured here.
        done_um = self._path.target.waves[0].coefficient - off.coefficients_um.get(lobes, 0j)
        plain = uncompensated(part.coefficients_um[lobes], part.sd_um[lobes], done_um, 1.0, self._job)
        if plain.reasons():
            raise SessionError(*plain.reasons())

    def _planned_in_air(self, job: Job) -> CutPlan:
        """Plan an air pass; a limit exceeded here is the axis's own, for nothing else was measured yet.

        Raises:
            SessionError: `learning.axis_beyond`.
            ProblemError: as `plan_cut`.
        """
        try:
            return self._planned(job, Stage.AIR)
        except DriverError as error:
            raise SessionError(*map(_of_the_axis, error.problems)) from error

    def _planned(self, job: Job, stage: Stage = Stage.FULL, *, trimmed: bool = False) -> CutPlan:
        return planned(
            job,
            self._machine,
            self._plan.cut.strategy,
            stage,
            self._path,
            watchdog=self._plan.cut.setup.watchdog,
            from_turn=self._turn(),
            trimmed=trimmed,
        )

    def _off(self, batch: Batch) -> HarmonicFit:
        """Return the tool error of a batch, positive where the tool was not in far enough."""
        target_um = self._path.target.at_um(batch.angle_deg, batch.past_middle_mm)
        return fit_harmonics(batch.angle_deg, target_um - batch.infeed_um, self._orders)

    @property
    def _orders(self) -> tuple[int, ...]:
        lobes = self._job.jaws
        waves = {*OTHERS, lobes, *(lobes * overtone for overtone in OVERTONES)}
        return tuple(sorted(waves))

    def _learnable(self, coefficients_um: Mapping[int, complex]) -> dict[int, complex]:
        """Return the coefficients of the lobe and its overtones."""
        return {n: c for n, c in coefficients_um.items() if n % self._job.jaws == 0}

    def _response(self, waves: int) -> complex:
        frequency_hz = waves * self._job.spindle_speed_rpm / 60.0
        return nominal_response(self._plan.cut.strategy, self._machine, frequency_hz)
