"""Iterative learning over a series of parts: from the tool in air, the tool in the cut, and the measured part.

In air the command is learned until the tool follows its target; friction makes the response depend on the
amplitude, so the motion is that of the cut itself. In the cut a trim removes what the cutting force adds. The
measured part then corrects the target. A harmonic that grows instead, in air or from part to part, is set back
to its best state and no longer learned.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from console.session.cut.engine import CutContext, Step
from console.session.cut.recording import PartName
from console.session.cut.run import (
    FILTER_UPR,
    Beside,
    CutOutcome,
    RunPlan,
    RunResult,
    TellPart,
    cut_part,
    planned,
    roundness_of,
)
from console.session.cut.telemetry import CutFigures
from console.session.errors import SessionError, refuse
from console.session.learning.learning_beside import AirWatch, CutLearner
from console.session.learning.order_learning import LearnHow, OrderLearning
from console.session.stages import Stage, nominal_path
from drivers.cutting.planning import CutPlan
from drivers.cutting.sampling import Batch
from drivers.cutting.strategy import TRIMMED, UNCOMPENSATED, Strategy
from drivers.errors import DriverError
from drivers.identification.nominal import nominal_response
from profiles.axis.friction import held_back_um
from profiles.compensations.certificate import Certified
from profiles.compensations.learning import (
    SIGNIFICANT,
    Deviation,
    Grown,
    HarmonicFit,
    Watch,
    fit_harmonics,
    learned_command,
    learned_part,
)
from profiles.compensations.next_version import FIRST_GAIN, LATER_GAIN
from profiles.compensations.part_harmonics import PartHarmonics, part_harmonics
from profiles.compensations.path import CutPath
from profiles.compensations.uncompensated import uncompensated
from profiles.job import Job
from profiles.problem import Problem
from profiles.roundness import RoundnessResult
from profiles.traces import Trace

AIR_PASSES, MOST_AIR_PASSES = 3, 8
AIR_ENOUGH_UM_PP = 1.0
"""Number of air passes; more while the lobe error is above this: a small motion starts within its friction."""

AIR_TURNS = 30

HOW = LearnHow()


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
    certificate: tuple[Certified, ...] = ()


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
            collisions=tuple(dict.fromkeys(kind for each in self.parts for kind in each.collisions)),
        )

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Harmonics that were not learned: `learning.grew`, with an amplitude each."""
        return tuple(
            Problem(
                code="learning.grew",
                key=f"{each.order}/rev",
                value=f"{each.grown_um:.2f} um",
                limit=f"{each.best_um:.2f} um",
            )
            for each in self.parts[-1].grown
        )


def learn(
    plan: RunPlan, open_machine: Callable[[], CutContext], tell: TellPart, parts: int, how: LearnHow | None = None
) -> LearnResult:
    """Cut `parts` parts on one machine, each corrected by the ones before.

    Raises:
        ProblemError: `learning.no_gauge`, `learning.strategy`; why a part cannot be learned from, as for a single
            one; what went wrong, see `cut_part`.
    """
    refuse_unlearnable(plan, measured=True)
    learner = _Learner(plan, open_machine(), tell, how or HOW)
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


class _Learner:
    """One machine, and the path as learned so far."""

    def __init__(self, plan: RunPlan, context: CutContext, tell: TellPart, how: LearnHow) -> None:
        self._plan, self._context, self._tell = plan, context, tell
        self._job, self._machine, self._strategy = plan.job, plan.machine, plan.cut.strategy
        self._path = nominal_path(plan.job, plan.machine, self._strategy)
        self._orders = OrderLearning(plan.job, plan.machine, self._strategy, how)
        self._watch = Watch()
        self._air_um: list[float] = []
        self._homed = False

    def reference(self) -> RoundnessResult:
        """Cut a part without compensation; what its gauge cannot measure now, it cannot measure later either."""
        trace = self._plain(self._job, "before")
        self._teaching(trace)
        return roundness_of(trace)

    def floor(self) -> RoundnessResult:
        """Cut a part without a lobe and without compensation: the remaining error is the machine's own."""
        return roundness_of(self._plain(replace(self._job, lobe_error_um_pp=0.0), "floor"))

    def _teaching(self, trace: Trace) -> PartHarmonics:
        """Return the harmonics of a part, or refuse it by the rule that `console learn` and the screen share."""
        part = part_harmonics(trace, self._job, filter_upr=FILTER_UPR, beside=self._orders.beside)
        refuse(part.reasons)
        return part

    def _plain(self, job: Job, name: str) -> Trace:
        plan = self._planned(job, UNCOMPENSATED, Stage.FULL, None)
        return self._traced(self._cut(job, plan, name))

    def _traced(self, outcome: CutOutcome) -> Trace:
        if outcome.trace is None:
            raise SessionError(Problem(code="learning.no_gauge"))
        return outcome.trace

    def _cut(
        self, job: Job, plan: CutPlan, name: str, beside: Beside | None = None, number: int = 0
    ) -> CutOutcome:
        """Cut a part; reports name it with its number, if it has one. One in air has no blank."""

        def tell(step: Step, detail: str) -> None:
            self._tell(name, step, " · ".join(filter(None, (str(number or ""), detail))))

        part = PartName(name=f"{name} {number or ''}".strip(), product=name == "part")
        blank = name != "air"
        outcome = cut_part(self._context, job, plan, tell, beside, homed=self._homed, blank=blank, name=part)
        self._homed = True
        return outcome

    def in_air(self) -> None:
        """Learn the path clear of the part."""
        job = self._job
        # Some turns of the same feed, over the end of the part.
        short = replace(job, cut_length_mm=min(job.cut_length_mm, AIR_TURNS * job.feed_mm_per_rev))
        for number in range(1, MOST_AIR_PASSES + 1):
            right = not self._learns_lobe or (self._air_um and self._air_um[-1] <= AIR_ENOUGH_UM_PP)
            if number > AIR_PASSES and right:
                break
            try:
                plan = self._planned(short, self._strategy, Stage.AIR, self._path)
            except DriverError as error:
                # A limit exceeded here is the axis's own, for nothing else was measured yet.
                own = {"path.beyond": "learning.axis_beyond"}
                problems = (replace(each, code=own.get(each.code, each.code)) for each in error.problems)
                raise SessionError(*problems) from error
            watch = AirWatch(self._context.lathe, job.jaws)
            self._cut(short, plan, "air", watch, number)
            error_um = self._error(watch.last())
            self._air_um.append(2.0 * abs(error_um.coefficients_um[job.jaws]))
            self._learn_in_air(error_um)
        self._watch = self._watch.afresh()

    @property
    def _learns_lobe(self) -> bool:
        return self._job.jaws not in self._watch.frozen

    def _learn_in_air(self, error: HarmonicFit) -> None:
        left = {n: c for n, c in error.coefficients_um.items() if n in self._orders.learned}
        # Friction couples the overtones to the amplitude of the lobe, which is still being learned.
        allowed = {n: 0.0 if n == self._job.jaws else held_back_um(self._machine, self._job, n) for n in left}
        self._watch = self._watch.judged(self._path, left, lambda _: error.amplitude_sd_um, allowed.__getitem__)
        least_um = SIGNIFICANT * error.amplitude_sd_um
        wrong = {n: c for n, c in left.items() if n % self._job.jaws == 0 or abs(c) > least_um}
        self._path = learned_command(self._watch.kept(self._path), self._watch.learned(wrong), self._response)

    def part(self, number: int) -> LearnedPart:
        """Cut a part, learn during the cut, and from its trace for the next one."""
        plan = self._planned(self._job, self._strategy, Stage.FULL, self._path, trimmed=True)
        watch = CutLearner(
            self._context.lathe, self._job, self._error, trims=self._learns_lobe, oval=self._orders.trims_oval
        )
        outcome = self._cut(self._job, plan, "part", watch, number)
        tool_off, trim_um = watch.in_the_middle()
        trace = self._traced(outcome)
        gain = FIRST_GAIN if number == 1 else LATER_GAIN
        cut_with = self._path
        learned, certificate = self._learn_from(trim_um, trace, tool_off, gain)
        return LearnedPart(
            roundness=roundness_of(trace),
            figures=outcome.figures,
            path=cut_with,
            trim_um=trim_um,
            tool_off=tool_off,
            air_um=tuple(self._air_um) if number == 1 else (),
            part_gain=gain,
            learned=learned,
            grown=self._watch.grown,
            collisions=outcome.collisions,
            certificate=certificate,
        )

    def _learn_from(
        self, trim_um: complex, trace: Trace, tool_off: Deviation, gain: float
    ) -> tuple[tuple[int, ...], tuple[Certified, ...]]:
        """Put the trim and the part's correction into the table; return the learned harmonics, and of each why."""
        job, orders = self._job, self._orders
        found = self._teaching(trace)
        self._refuse_worse(found, tool_off)
        by_program = nominal_response(Strategy.PVT, self._machine, job.lobe_frequency_hz)
        folded = self._path.command.plus({job.jaws: trim_um * by_program / self._response(job.jaws)})
        path = CutPath(target=self._path.target, command=folded)
        left = orders.left(found, tool_off)
        self._watch = self._watch.judged(path, left, orders.sd_um(found, path))
        high = self._watch.learned({n: c for n, c in left.items() if abs(c) > SIGNIFICANT * found.sd_um[n]})
        missed = self._watch.learned(orders.of_tool(tool_off))
        part = Deviation(mean_um=found.mean_um, coefficients_um=high)
        tool = Deviation(mean_um=tool_off.mean_um, coefficients_um=missed)
        errors = {n: c - missed.get(n, 0j) for n, c in high.items()}
        gains = {n: orders.gain(n, e, found, path) for n, e in errors.items()}
        kept = self._watch.kept(path)
        self._path = learned_part(kept, part, tool, self._response, gain, gains)
        orders.step(path, self._path)
        certificate = orders.certificate(left, found, gains, self._watch.frozen)
        return tuple(sorted({*high, *missed})), certificate

    def _refuse_worse(self, part: PartHarmonics, tool_off: Deviation) -> None:
        """Refuse to learn from a part that its compensation has made worse, by the rule for a single part."""
        lobes = self._job.jaws
        # The tool error was measured here.
        done_um = self._path.target.harmonics[0].coefficient - tool_off.coefficients_um.get(lobes, 0j)
        plain = uncompensated(part.coefficients_um[lobes], part.sd_um[lobes], done_um, 1.0, self._job)
        refuse(plain.reasons())

    def _planned(
        self, job: Job, strategy: Strategy, stage: Stage, path: CutPath | None, *, trimmed: bool = False
    ) -> CutPlan:
        """Plan a cut from the whole turn nearest to the spindle position; the spindle need not turn back."""
        turn = 0
        if self._homed:
            turn = round(self._context.lathe.snapshot().spindle.position / self._machine.spindle.counts_per_rev)
        watchdog = self._plan.cut.setup.watchdog
        return planned(
            job, self._machine, strategy, stage, path, watchdog=watchdog, from_turn=turn, trimmed=trimmed
        )

    def _error(self, batch: Batch) -> HarmonicFit:
        """Return the tool error of a batch, positive where the tool was not in far enough."""
        self._context.recorder.gathered(batch)
        target_um = self._path.target.at_um(batch.angle_deg, batch.past_middle_mm)
        return fit_harmonics(batch.angle_deg, target_um - batch.infeed_um, self._orders.fitted)

    def _response(self, order: int) -> complex:
        return nominal_response(self._strategy, self._machine, order * self._job.spindle_speed_rpm / 60.0)
