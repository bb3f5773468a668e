"""Iterative learning over a series of parts: from the tool in air, the tool in the cut, and the measured part.

In air the command is learned until the tool follows its target; friction makes the response depend on the
amplitude, so the motion is that of the cut itself. In the cut a trim removes what the cutting force adds. The
measured part then corrects the target. A harmonic that grows instead, in air or from part to part, is set back
to its best state and no longer learned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from console.session.cut.engine import STILL_RPM, CutContext, PartStep
from console.session.cut.run import (
    FILTER_UPR,
    CutObserver,
    CutOutcome,
    RunPlan,
    TellPart,
    cut_part,
    plan_stage,
    roundness_of,
)
from console.session.errors import SessionError, refuse
from console.session.learning.learning_beside import AirWatch, CutLearner
from console.session.learning.learning_steps import parts_along, sections_like
from console.session.learning.lobe_learning import LobeLearning
from console.session.learning.order_learning import LearnHow, OrderLearning
from console.session.learning.row_result import LearnedPart, LearnResult
from console.session.stages import Stage, nominal_path
from drivers.cutting.planning import CutBand, CutPlan
from drivers.cutting.sampling import Batch
from drivers.cutting.strategy import TRIMMED, UNCOMPENSATED, Strategy
from drivers.identification.nominal import nominal_response
from profiles.axis.stiffness import held_back_um
from profiles.compensations.axial_learning import AxialHistory, AxialRules, axial_steps, fit_axial
from profiles.compensations.certificate import PROCESS_GAINS, CertifiedOrder, certify_push, refuse_orders
from profiles.compensations.learning import (
    REPEATS_SD_UM,
    SIGNIFICANT,
    Deviation,
    HarmonicFit,
    HarmonicWatch,
    coefficient_of,
    fit_harmonics,
    learned_command,
    learned_part,
)
from profiles.compensations.next_version import FIRST_GAIN, LATER_GAIN, compare_uncompensated
from profiles.compensations.part_harmonics import PartHarmonics, part_harmonics
from profiles.compensations.path import OVAL, CutPath
from profiles.compensations.push import NO_PUSH, Push
from profiles.compensations.trial_band import (
    LEFT_MM,
    LENGTH_MM,
    band_job,
    band_middle_mm,
    band_path,
    find_on_band,
    refuse_uncleaned,
    shown_path,
    wanted_at,
    without_play,
)
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.lobe.along import along_cut
from profiles.metrology.cylindricity import CylinderResult
from profiles.problem import Problem, ProblemError
from profiles.roundness import RoundnessResult
from profiles.trace_files.sections import TraceSection
from profiles.traces import Trace

AIR_PASSES, MOST_AIR_PASSES = 3, 8
AIR_ENOUGH_UM_PP = 1.0
"""Number of air passes; more while the lobe error is above this: a small motion starts within its friction."""

AIR_TURNS = 30
COMPARED = 2  # parts that a row begins with: one without compensation, and one without a lobe
MOST_GAIN = 1.0 / PROCESS_GAINS[0]  # of the lobe: what arrives in part is asked for in full
MOVED_UM = 1.0
"""Change of the target, at an order that a blank disturbs too, from which the tool learns it in air anew."""

HOW = LearnHow()


def learn(
    plan: RunPlan,
    open_machine: Callable[[], CutContext],
    tell: TellPart,
    parts: int,
    how: LearnHow | None = None,
    *,
    fingerprint: bool = False,
    band: bool = False,
) -> LearnResult:
    """Cut `parts` parts on one machine, each corrected by the ones before and by its `fingerprint`.

    The first one is corrected by a trial `band`, too.

    Raises:
        ProblemError: `learning.no_gauge`, `learning.strategy`; why a part cannot be learned from, as for a single
            one; what went wrong, see `cut_part`. A later part whose path is refused ends the series: `ended`.
    """
    refuse_unlearnable(plan, measured=True)
    how = how or HOW
    learner = _Learner(
        plan, open_machine(), tell, replace(how, fingerprint=fingerprint or how.fingerprint, band=band or how.band)
    )
    before, (floor, floor_whole) = learner.reference(), learner.floor()
    learner.in_air()
    made: list[LearnedPart] = []
    ended: tuple[Problem, ...] = ()
    while len(made) < parts and not ended:
        try:
            made.append(learner.part(len(made) + 1))
        except _RefusedPathError as refused:
            if not made:
                raise
            made[-1] = replace(made[-1], learned=(), certificate=refuse_orders(made[-1].certificate))
            ended = (Problem(code="learning.ended", key=str(len(made) + 1), limit=str(parts)), *refused.problems)
    return LearnResult(
        plan=plan,
        simulated=True,
        before=before,
        after=made[-1].roundness,
        figures=made[-1].figures,
        collisions=tuple(dict.fromkeys(kind for each in made for kind in each.collisions)),
        whole=made[-1].whole,
        budget=made[-1].budget,
        floor=floor,
        floor_whole=floor_whole,
        parts=tuple(made),
        ended=ended,
    )


class _RefusedPathError(SessionError):
    """The next cut cannot be planned with the path as learned; nothing was sent."""


def refuse_unlearnable(plan: RunPlan, *, measured: bool) -> None:
    """Refuse a cut from which nothing can be learned.

    Raises:
        SessionError: `learning.strategy`, only a table can be learned; `learning.no_gauge`, no gauge measures
            the parts between two cuts.
    """
    refuse_untrimmed(plan.cut.strategy, driven=plan.reference is not None)
    if not measured:
        raise SessionError(Problem(code="learning.no_gauge"))


def refuse_untrimmed(strategy: Strategy, *, driven: bool = True) -> None:
    """Refuse a strategy that cannot be learned, or a spindle not `driven` by it: `learning.strategy`."""
    if not (strategy.traits.trims and driven):
        raise SessionError(Problem(code="learning.strategy", value=strategy.value, limit=", ".join(TRIMMED)))


NEEDED_NOTHING = 4
"""Parts that needed nothing: the force of an oval blank is twice what repeats of it. Assumed."""


class TrimFolding:
    """The corrections, um of the command at the order of the lobe, that the parts of one row have needed.

    With three jaws or more the trim at the lobe is the tool's own error, and repeats: all of it goes into the
    table. With two jaws the lobe comes twice a turn, and so does the force of an oval blank, at another angle each
    time. Then only the mean of what the parts have needed goes in, with some that needed nothing: the oval of one
    blank would be on the next part with the wrong angle, and each trim would begin from it.
    """

    def __init__(self, lobes: int) -> None:
        self.of_blanks = lobes == OVAL
        self._needed: list[complex] = []
        self._in_table = 0j

    @property
    def fraction(self) -> float:
        """What goes into the table of the tool's error at the other orders, after the parts so far.

        Friction couples them to the motion that the oval of a blank makes: the mean, with one part without any.
        """
        return 1.0 / (len(self._needed) + 1) if self.of_blanks else 1.0

    def change(self, trim_um: complex, off_um: complex) -> complex:
        """Return the change of the table, after a part with this trim which the tool was still off by."""
        if not self.of_blanks:
            return trim_um
        self._needed.append(self._in_table + trim_um + off_um)
        before, self._in_table = self._in_table, sum(self._needed) / (len(self._needed) + NEEDED_NOTHING)
        return self._in_table - before


class _Learner:
    """One machine, and the path as learned so far."""

    def __init__(self, plan: RunPlan, context: CutContext, tell: TellPart, how: LearnHow) -> None:
        self._plan, self._context, self._tell = plan, context, tell
        self._job, self._machine, self._strategy = plan.job, plan.machine, plan.cut.strategy
        self._path = nominal_path(plan.job, plan.machine, self._strategy)
        self._orders = OrderLearning(plan.job, plan.machine, self._strategy, how)
        self._lobe = LobeLearning(plan.job, plan.machine)
        self._how = how
        self._folding = TrimFolding(plan.job.jaws)
        self._target = plan.cut.target  # of the present cut: a part's is that of the mean lobe, by its fingerprint
        self._watch = HarmonicWatch()
        self._air_um: list[float] = []
        self._air_passes = 0
        self._in_air_at = self._path.target  # what the tool has followed in air
        self._axial = AxialHistory()
        self._homed = False

    def reference(self) -> RoundnessResult:
        """Cut a part without compensation; a gauge that cannot measure it is refused now and not later."""
        trace = self._trace_part(self._cut_uncompensated(self._job, "before"))
        self._teaching(trace)
        return roundness_of(trace)

    def floor(self) -> tuple[RoundnessResult, CylinderResult | None]:
        """Cut a part without a lobe and without compensation: what is left is the machine's own."""
        outcome = self._cut_uncompensated(replace(self._job, lobe_error_um_pp=0.0), "floor")
        return roundness_of(self._trace_part(outcome)), outcome.whole

    def _teaching(self, trace: Trace) -> PartHarmonics:
        """Return the harmonics of a part, or refuse it by the rule that `console learn` and the screen share."""
        part = self._harmonics(trace)
        refuse(part.reasons)
        return part

    def _harmonics(self, trace: Trace) -> PartHarmonics:
        how: dict[str, Any] = {"beside": self._orders.beside, "gauge": self._context.gauge}
        return part_harmonics(trace, self._job, filter_upr=FILTER_UPR, **how)

    def _cut_uncompensated(self, job: Job, name: str) -> CutOutcome:
        return self._cut_part(job, self._plan_part(job, UNCOMPENSATED, Stage.FULL, None), name)

    def _trace_part(self, outcome: CutOutcome) -> Trace:
        if outcome.trace is None:
            raise SessionError(Problem(code="learning.no_gauge"))
        return outcome.trace

    def _cut_part(
        self,
        job: Job,
        plan: CutPlan,
        name: str,
        beside: CutObserver | None = None,
        number: int = 0,
        **how: Any,
    ) -> CutOutcome:
        """Cut a part; reports name it with its number, if it has one. One in air has no blank."""

        def tell(step: PartStep, detail: str) -> None:
            self._tell(name, step, " · ".join(filter(None, (str(number or ""), detail))))

        how |= {"homed": self._homed, "blank": name != "air"}
        how |= {"name": f"{name} {number or ''}".strip(), "product": name == "part"}
        outcome = cut_part(self._context, job, plan, tell, beside, **how)
        self._homed = True
        return outcome

    def in_air(self) -> None:
        """Learn the path clear of the part."""
        for number in range(1, MOST_AIR_PASSES + 1):
            right = not self._learns_lobe or (self._air_um and self._air_um[-1] <= AIR_ENOUGH_UM_PP)
            if number > AIR_PASSES and right:
                break
            error_um = self._first_air_pass()
            self._air_um.append(2.0 * abs(error_um.coefficients_um[self._job.jaws]))
            self._learn_in_air(error_um)
        self._watch = self._watch.afresh()

    def _first_air_pass(self) -> HarmonicFit:
        try:
            return self._air_pass()
        except _RefusedPathError as error:
            # A limit exceeded here is the axis's own, for nothing else was measured yet.
            own = {"learning.beyond": "learning.axis_beyond"}
            problems = (replace(each, code=own.get(each.code, each.code)) for each in error.problems)
            raise SessionError(*problems) from error

    def _air_pass(self) -> HarmonicFit:
        """Return the tool error of one pass in air."""
        job = self._job
        # Some turns of the same feed, over the end of the part.
        short = replace(job, cut_length_mm=min(job.cut_length_mm, AIR_TURNS * job.feed_mm_per_rev))
        plan = self._plan_part(short, self._strategy, Stage.AIR, self._path)
        self._air_passes += 1
        self._in_air_at = plan.target
        watch = AirWatch(self._context.lathe, job.jaws, self._orders.samples_a_turn)
        self._cut_part(short, plan, "air", watch, self._air_passes)
        return self._error(watch.last())

    def _in_air_anew(self) -> None:
        """Learn in air what a part has added where the blank disturbs the tool, too: in air there is none.

        After a step the motion is another one, and so is what friction makes of it at the orders beside the lobe.
        """
        moved = [
            n
            for n in self._watch.select_learned(dict.fromkeys(self._orders.of_blanks))
            if self._moved_um(n) > MOVED_UM
        ]
        if moved and self._orders.has_stepped:
            moved = list(self._watch.select_learned(dict.fromkeys(self._orders.beside)))
        watch = HarmonicWatch()
        for _ in range(AIR_PASSES if moved else 0):
            error = self._air_pass()
            left = {n: error.coefficients_um[n] for n in moved}
            if all(2.0 * abs(c) <= AIR_ENOUGH_UM_PP for c in left.values()):
                break
            watch = watch.judge_pass(self._path, left, dict.fromkeys(moved, error.amplitude_sd_um).__getitem__)
            self._path = learned_command(watch.keep_best(self._path), watch.select_learned(left), self._response)

    def _moved_um(self, order: int) -> float:
        return abs(coefficient_of(self._path.target, order) - coefficient_of(self._in_air_at, order))

    @property
    def _learns_lobe(self) -> bool:
        return self._job.jaws not in self._watch.frozen_orders

    def _learn_in_air(self, error: HarmonicFit) -> None:
        left = {n: c for n, c in error.coefficients_um.items() if n in self._orders.learned}
        # Friction couples the overtones to the amplitude of the lobe, which is still being learned.
        allowed = {n: 0.0 if n == self._job.jaws else held_back_um(self._machine, self._job, n) for n in left}
        self._watch = self._watch.judge_pass(
            self._path, left, lambda _: error.amplitude_sd_um, allowed.__getitem__
        )
        least_um = SIGNIFICANT * error.amplitude_sd_um
        wrong = {n: c for n, c in left.items() if n % self._job.jaws == 0 or abs(c) > least_um}
        self._path = learned_command(
            self._watch.keep_best(self._path), self._watch.select_learned(wrong), self._response
        )

    def part(self, number: int) -> LearnedPart:
        """Cut a part, learn during the cut, and from its trace for the next one."""
        self._in_air_anew()
        readings = self._clamp_blank()
        self._path, path = self._lobe.clamp(self._path, readings, self._response)
        before, how = None, dict[str, Any](clamped=readings is not None)
        if self._how.band and self._lobe.known and number == 1:  # the parts after it are known from this one
            path = self._trial_band(path, number)
            before = CutBand(length_mm=LENGTH_MM, left_mm=LEFT_MM)
            how = {"clamped": True, "touched_mm": LENGTH_MM}
        plan = self._plan_part(self._job, self._strategy, Stage.FULL, path, trimmed=True, before=before)
        self._orders.begin(self._path, self._watch)
        watch = self._cut_learner(self._job)
        outcome = self._cut_part(self._job, plan, "part", watch, number, **how)
        tool_off, trim_um = watch.in_the_middle()
        trace = self._trace_part(outcome)
        gain = FIRST_GAIN if number == 1 else LATER_GAIN
        # Behind a band the push jumps from a fifth to the whole: the decay along this cut is no measure of it.
        push = NO_PUSH if before is not None else watch.left_push()
        tool_off = replace(tool_off, mean_um=tool_off.mean_um - push.in_middle_um)
        sections = sections_like(trace, outcome.sections)
        learned, certificate = self._learn_from(trim_um, trace, tool_off, gain, push, sections)
        return LearnedPart(
            roundness=roundness_of(trace),
            whole=outcome.whole,
            budget=outcome.budget,
            figures=outcome.figures,
            path=path,
            trim_um=trim_um,
            tool_off=tool_off,
            air_um=tuple(self._air_um) if number == 1 else (),
            part_gain=gain,
            learned=learned,
            grown=self._watch.grown,
            collisions=outcome.collisions,
            certificate=certificate,
            clamped=self._lobe.clamped,
            trim_short=watch.short_um,
            left=self._lobe.left,
            changes=self._orders.changes,
            band=self._lobe.band,
        )

    def _cut_learner(self, job: Job) -> CutLearner:
        return CutLearner(
            self._context.lathe,
            job,
            self._error,
            samples_a_turn=self._orders.samples_a_turn,
            trims=self._learns_lobe,
            oval=self._orders.trims_oval,
        )

    def _trial_band(self, path: CutPath, number: int) -> CutPath:
        """Cut and indicate a trial band of the clamped blank; return the path of the rest.

        Raises ProfileError: `band.*`; the band stays on the part, and nothing more is cut.
        """
        job, workshop = self._job, self._context.workshop
        assert workshop is not None  # a series is measured
        lobes, along = job.jaws, along_cut(job, self._machine)
        short = band_job(job, float(along.factor(lobes, band_middle_mm(job))))
        cut = band_path(path, along, job, 1.0 / self._response(lobes))
        plan = self._plan_part(short, self._strategy, Stage.FULL, cut, trimmed=True)
        watch = self._cut_learner(short)
        self._cut_part(short, plan, "band", watch, number, clamped=True, measured=False)
        self._refuse_turning()
        behind_mm = LENGTH_MM - self._machine.tool.wiper_land_mm
        tool_off, _ = watch.in_the_middle()
        shown = shown_path(workshop.indicate_band(behind_mm), lobes)
        wanted = wanted_at(plan.target, behind_mm - 0.5 * LENGTH_MM)
        push_um = watch.entry_push_um() / (1.0 - LEFT_MM / job.depth_of_cut_mm)
        found = find_on_band(shown, wanted, tool_off.coefficients_um, lobes, push_um)
        self._path, corrected = self._lobe.correct(self._path, path, found, self._response)
        refuse_uncleaned(path, corrected)
        if self._lobe.band is not None:
            self._context.recorder.record_band(self._lobe.band.event())
        off = {n: c for n, c in self._orders.of_tool(tool_off).items() if n not in wanted}
        self._path = learned_command(self._path, off, self._response)
        return learned_command(corrected, off, self._response)

    def _refuse_turning(self) -> None:
        """Refuse to have the band read while the spindle turns: `band.spindle_turns`."""
        if abs(rpm := self._context.lathe.spindle_rpm()) > STILL_RPM:
            limit = f"<= {STILL_RPM:g} rpm"
            raise SessionError(Problem(code="band.spindle_turns", value=f"{rpm:.1f} rpm", limit=limit))

    def _clamp_blank(self) -> ClampReadings | None:
        """Clamp the blank and return its fingerprint, None if none is taken."""
        workshop, how = self._context.workshop, self._how
        if not (how.fingerprint or how.band) or workshop is None or not self._lobe.known:
            return None
        workshop.mount(self._job)
        if not how.fingerprint:
            return None
        readings = workshop.indicate()
        return without_play(readings, self._job.jaws) if how.band else readings

    def _learn_from(
        self,
        trim_um: complex,
        trace: Trace,
        tool_off: Deviation,
        gain: float,
        push: Push = NO_PUSH,
        sections: Sequence[TraceSection] = (),
    ) -> tuple[tuple[int, ...], tuple[CertifiedOrder, ...]]:
        """Put the trim and the part's correction into the table; return the learned harmonics, and of each why."""
        job, orders = self._job, self._orders
        found = self._teaching(trace)
        self._refuse_worse(found, tool_off)
        path = self._fold_trim(trim_um, tool_off)
        left = self._lobe.of_mean(orders.residual_orders(found, tool_off), path)
        orders.judge_changes(left, path, found, tool_off, self._lobe.known_now(path))
        self._watch = orders.judge_part(self._watch, path, left, found)
        high = self._watch.select_learned({n: c for n, c in left.items() if orders.teaches(n, c, found)})
        missed = self._watch.select_learned(orders.of_tool(tool_off))
        errors = {n: c - missed.get(n, 0j) for n, c in high.items()}
        gains = {n: orders.gain(n, e, found, path) for n, e in errors.items()}
        self._lobe_step(found, tool_off, path, high, missed, gains)
        fraction = self._folding.fraction
        tabled = {n: fraction * c for n, c in missed.items()}
        high = {n: c - missed.get(n, 0j) + tabled.get(n, 0j) for n, c in high.items()}
        tool = Deviation(mean_um=tool_off.mean_um, coefficients_um=tabled)
        kept = orders.withdrawn(self._watch.keep_best(path))
        steps = {n: g / (1.0 - orders.state(n).lost) for n, g in gains.items()}
        steps |= {job.jaws: 1.0} if self._filters and job.jaws in steps else {}
        self._follow_changes(kept, tabled, high, steps)
        left_um = found.mean_um - push.in_middle_um - tool_off.mean_um
        mean_um = tool_off.mean_um + orders.size_step_um(left_um, path, gain) / gain
        part = Deviation(mean_um=mean_um, coefficients_um=high)
        self._path = learned_part(kept, part, tool, self._response, gain, steps).add_push(push.um)
        orders.step(path, self._path)
        certificate = orders.certificate(left, found, tool_off, gains, self._watch.frozen_orders)
        rows = (*certificate, *self._learn_along(sections, push), *certify_push(push.um))
        return tuple(sorted({*high, *missed})), rows

    def _follow_changes(
        self, path: CutPath, tool_um: Mapping[int, complex], high: dict[int, complex], steps: dict[int, float]
    ) -> None:
        """Set the entries of orders of which the next part is known, so that the path is for that."""
        for n in [n for n in high if self._orders.state(n).is_known]:
            off_um, had_um = tool_um.get(n, 0j), coefficient_of(path.target, n)
            next_um = had_um + steps[n] * (high[n] - off_um)
            ahead_um = self._orders.state(n).follow(next_um)
            high[n], steps[n] = off_um + ahead_um - had_um, 1.0
            if n == self._job.jaws and self._filters:
                self._lobe.move(ahead_um - next_um)

    def _learn_along(self, sections: Sequence[TraceSection], push: Push) -> tuple[CertifiedOrder, ...]:
        """Put what the sections of the part show along the cut into the path; return the certificate of it."""
        orders = self._orders
        if not self._how.along:
            return ()
        parts = parts_along(sections, self._job, self._machine, push.um, self._harmonics)
        rules = AxialRules(
            lobes=self._job.jaws,
            orders=frozenset(orders.learned) - orders.varying,
            chucked=frozenset(orders.learned) - {*orders.beside},
            frozen=self._watch.frozen_orders,
            scatter=orders.scatter,
            follows=orders.follows,
        )
        fitted = fit_axial(parts, self._target.along, rules.orders)
        steps = axial_steps(fitted, self._path.target, rules, self._axial)
        self._axial = self._axial.add(steps)
        self._path = steps.applied(self._path, orders.follows)
        return steps.certificate

    def _fold_trim(self, trim_um: complex, tool_off: Deviation) -> CutPath:
        """Return the path with the part of the trim that goes into its table."""
        lobes = self._job.jaws
        by_program = nominal_response(Strategy.PVT, self._machine, self._job.lobe_frequency_hz)
        through, off_um = self._response(lobes), tool_off.coefficients_um.get(lobes, 0j)
        change_um = self._folding.change(trim_um * by_program / through, off_um / through)
        return CutPath(target=self._path.target, command=self._path.command.plus({lobes: change_um}))

    @property
    def _filters(self) -> bool:
        """Whether the lobe is learned by the filter over all parts instead of the gain of its order."""
        return self._how.optimal and self._lobe.known and self._learns_lobe

    def _lobe_step(
        self,
        found: PartHarmonics,
        tool_off: Deviation,
        path: CutPath,
        high: dict[int, complex],
        missed: Mapping[int, complex],
        gains: dict[int, float],
    ) -> None:
        """Update the lobe by the part; set its entry of `high` so that the path is that of the mean lobe."""
        if not self._lobe.known:
            return
        lobes, tool_um = self._job.jaws, tool_off.coefficients_um.get(self._job.jaws, 0j)
        done_um = coefficient_of(self._target, lobes) - tool_um
        sd_um = math.hypot(found.sd_um[lobes], tool_off.sd_um, REPEATS_SD_UM)
        mean_um = self._lobe.update_path(found.coefficients_um[lobes], done_um, sd_um)
        if not self._filters:
            return
        step_um = mean_um - coefficient_of(path.target, lobes)
        error_um = abs(high.get(lobes, found.coefficients_um[lobes]) - missed.get(lobes, 0j))
        high[lobes] = missed.get(lobes, 0j) + step_um
        gains[lobes] = min(abs(step_um) / error_um, MOST_GAIN) if error_um else 0.0

    def _refuse_worse(self, part: PartHarmonics, tool_off: Deviation) -> None:
        """Refuse to learn from a part that its compensation has made worse, by the rule for a single part."""
        lobes = self._job.jaws
        # The tool error was measured here.
        done_um = self._target.harmonics[0].coefficient - tool_off.coefficients_um.get(lobes, 0j)
        plain = compare_uncompensated(part.coefficients_um[lobes], part.sd_um[lobes], done_um, 1.0, self._job)
        refuse(plain.reasons())

    def _plan_part(self, job: Job, strategy: Strategy, stage: Stage, path: CutPath | None, **how: Any) -> CutPlan:
        """Plan a cut from the whole turn nearest to the spindle position; the spindle need not turn back.

        `how` it is, trimmed or behind a band, is as for `plan_stage`.
        """
        turn = 0
        if self._homed:
            turn = round(self._context.lathe.snapshot().spindle.position / self._machine.spindle.counts_per_rev)
        watchdog = self._plan.cut.setup.watchdog
        try:
            plan = plan_stage(job, self._machine, strategy, stage, path, watchdog=watchdog, from_turn=turn, **how)
        except ProblemError as error:
            own = {"path.beyond": "learning.beyond"}
            problems = (replace(each, code=own.get(each.code, each.code)) for each in error.problems)
            raise _RefusedPathError(*problems) from error
        self._target = plan.target
        return plan

    def _error(self, batch: Batch) -> HarmonicFit:
        """Return the tool error of a batch, positive where the tool was not in far enough."""
        self._context.recorder.record_window(batch)
        target_um = self._target.at_um(batch.angle_deg, batch.past_middle_mm)
        return fit_harmonics(batch.angle_deg, target_um - batch.infeed_um, self._orders.fitted)

    def _response(self, order: int) -> complex:
        return nominal_response(self._strategy, self._machine, order * self._job.spindle_speed_rpm / 60.0)
