"""Derive the next compensation from a measured part, and judge whether the parts improve.

Order n of the path W and of the part r, with the fraction s of the path in the cut, should leave (1 - s) W; a
significant deviation e = r - (1 - s) W is cut deeper: W <- W + gain e. The gain of each order is the one that
leaves the least of it on the next part (`optimal_gain`): near 1 where the error is large, less from part to part,
since each part adds noise of its own (clamping, gauge).

Two consecutive parts give the actual response of the tool to the path: T'/T = (r1 - r2) / (W2 - W1). An error
shrinks by |1 - gain T'/T| with each part; from 1 on it does not. This is judged for every learned harmonic: an
axis may follow well at the lobe and not at three times its frequency. Before the first part comes the plain cut
of the job, where its lobe was measured: W = 0, r = the lobe. For the other harmonics of the previous part only
the learned step is recorded: their e is the step of the path over the gain.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

from profiles.compensations.axial_learning import (
    NO_SECTIONS,
    AxialFit,
    AxialHistory,
    AxialRules,
    AxialSteps,
    axial_steps,
)
from profiles.compensations.certificate import CertifiedOrder, ToolResponse
from profiles.compensations.change import MARK_SD_DEG, ShownOrder, change_warnings, state_of
from profiles.compensations.learned_compensation import (
    MODEL,
    ClampingReading,
    HoldsFor,
    LearnedCompensation,
    PartReading,
)
from profiles.compensations.learning import (
    REPEATS_SD_UM,
    SIGNIFICANT,
    SURE,
    Deviation,
    coefficient_of,
    convergence,
    learned_part,
)
from profiles.compensations.optimal_gain import PROCESS_LOSS_SD
from profiles.compensations.order_steps import STEP_UM, OrderRules, OrderSeen, OrderSteps, order_steps
from profiles.compensations.part_harmonics import PartHarmonics
from profiles.compensations.path import (
    CutPath,
    PathHarmonic,
    axial_terms,
    axial_um,
    fraction_of,
    free_state_lobe,
    target_path,
)
from profiles.job import Job
from profiles.lobe.lobe_conditions import found_on_a_part
from profiles.problem import Problem, refusal_error

# Gain of the first part, where errors are large, and of later ones, where a part of them is noise.
FIRST_GAIN, LATER_GAIN = 1.0, 0.7

_NONE = Deviation(coefficients_um={})
IN_PLACE_DEG = 30.0
"""Tolerance of its position in degrees of lobe: a choice. That is half of what makes a
part worse than none, 10 degrees of spindle with three jaws; dry friction of 3 N makes 12 of it at 50 Hz."""


class ImprovementVerdict(StrEnum):
    """Whether the parts improve, as far as two of them show."""

    CONVERGES = "converges"
    UNCLEAR = "unclear"
    DIVERGES = "diverges"


@dataclass(frozen=True, slots=True, kw_only=True)
class Contraction:
    """The factor of an error from part to part, 95 % sure within `half_width`.

    `arrives` is T'/T: the fraction of the path's harmonic that reaches the part, its phase in angles of that
    harmonic.
    """

    value: float
    half_width: float
    arrives: complex

    @property
    def verdict(self) -> ImprovementVerdict:
        """Whether the factor is below 1, or above."""
        if self.value - self.half_width >= 1.0:
            return ImprovementVerdict.DIVERGES
        return ImprovementVerdict.CONVERGES if self.value + self.half_width < 1.0 else ImprovementVerdict.UNCLEAR


@dataclass(frozen=True, slots=True, kw_only=True)
class AppliedPath:
    """The compensation of the part: the whole path, the fraction of it that was cut, the version (None: model).

    `parent` is the path of the previous part, from which the version was learned: without it only the
    convergence of the lobe can be judged. `history` are the versions that led to this one, which is the last.
    `clamped` is the fingerprint of its clamping: path and part are then those of the mean clamping. `tool_um` is
    the tool error at the order of the lobe, infeed positive; 0 if unknown.
    """

    path: CutPath
    fraction: float
    version: LearnedCompensation | None
    parent: CutPath | None = None
    history: tuple[LearnedCompensation, ...] = ()
    clamped: ClampingReading | None = None
    tool_um: complex = 0j

    @property
    def number(self) -> int:
        """The number of the version."""
        return MODEL if self.version is None else self.version.version

    @property
    def spared_um(self) -> dict[int, complex]:
        """The harmonics of the path that were not commanded and should remain on the part."""
        return {
            harmonic.lobes: (1.0 - self.fraction) * harmonic.coefficient for harmonic in self.path.target.harmonics
        }


def half_width_um_pp(lobe_sd_um: float, scatter_um: float) -> float:
    """Return the 95 % half-width of a lobe expected from a part, um p-p.

    `lobe_sd_um` is the standard error of the lobe read from the part, which is off in any direction; `scatter_um`
    that of one of two clampings, whose force changes the height alone.
    """
    return 2.0 * math.hypot(SIGNIFICANT * lobe_sd_um, SURE * scatter_um, SURE * scatter_um)


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningStep:
    """What was learned from a part: the next version, the changed harmonics, and the expected next part.

    The expected lobe has a 95 % half-width from the noise of the trace and the scatter of two clampings.
    `contractions` are those of the harmonics, by order, that two parts determine. `reasons` are why it must not
    be kept, `warnings` do not forbid it. Where the part is not `placed` on the spindle, nothing is learned, and
    nothing said that rests on its angles: only its RONt and the height of its lobe are true.
    """

    next: LearnedCompensation
    learned: tuple[int, ...]
    contractions: Mapping[int, Contraction]
    expected_lobe_um_pp: float
    expected_half_width_um_pp: float
    reasons: tuple[Problem, ...]
    warnings: tuple[Problem, ...] = ()
    certificate: tuple[CertifiedOrder, ...] = ()
    placed: bool = True

    @property
    def expected_ront_um(self) -> float:
        """The roundness of the trace with the learned harmonics removed."""
        found = self.next.expected_ront_um
        assert found is not None
        return found

    @property
    def contraction(self) -> Contraction | None:
        """The contraction of the lobe."""
        return self.contractions.get(self.next.path.target.lobes)


@dataclass(frozen=True, slots=True, kw_only=True)
class UncompensatedPart:
    """A part as it would have been: coefficients in um, positive outwards, of the lobe alone.

    `whole_um` is what all of the path would leave, `without_um` what no compensation would, `expected_um` the
    lobe by job and jaw 1; `sd_um` is the standard error of each. `found`: seen on a part before.
    """

    whole_um: complex
    without_um: complex
    expected_um: complex
    sd_um: float
    lobes: int
    found: bool

    @property
    def off_deg(self) -> float:
        """How far past its expected position the lobe is, degrees of spindle, if the tool followed its path."""
        if not self.expected_um or not self.without_um:
            return 0.0
        return -math.degrees(cmath.phase(self.without_um / self.expected_um)) / self.lobes

    @property
    def in_place(self) -> bool:
        """Whether the lobe stands where it was expected."""
        return self.lobes * abs(self.off_deg) <= IN_PLACE_DEG

    @property
    def plain_um(self) -> float:
        """The amplitude of the lobe without compensation."""
        return abs(self.expected_um if self.found else self.without_um)

    def reasons(self) -> tuple[Problem, ...]:
        """Return why nothing may be learned from the part: its compensation makes it worse than none would."""
        if self.found and self.in_place:
            return ()
        if abs(self.whole_um) - self.plain_um <= self._noise_um or self._trivial:
            return ()
        value, limit = f"{2 * abs(self.whole_um):.1f} um", f"{2 * self.plain_um:.1f} um"
        return (Problem(code="learned.worse", key=f"{self.off_deg:+.0f} deg", value=value, limit=limit),)

    def warnings(self) -> tuple[Problem, ...]:
        """Return what the operator should know before this learning step is kept."""
        if self.in_place or self._trivial or self.reasons():
            return ()
        limit = f"± {IN_PLACE_DEG / self.lobes:.0f} deg"
        return (Problem(code="learned.lobe_elsewhere", value=f"{self.off_deg:+.0f} deg", limit=limit),)

    @property
    def _noise_um(self) -> float:
        return SIGNIFICANT * math.hypot(self.sd_um, REPEATS_SD_UM)

    @property
    def _trivial(self) -> bool:
        return min(abs(self.without_um - self.whole_um), self.plain_um) <= 2.0 * self._noise_um


def compare_uncompensated(
    left_um: complex, sd_um: float, path_um: complex, fraction: float, job: Job
) -> UncompensatedPart:
    """Compare a part that has `left_um` of its lobe, cut with `fraction` of `path_um`."""
    without_um = left_um + fraction * path_um
    return UncompensatedPart(
        whole_um=without_um - path_um,
        without_um=without_um,
        expected_um=free_state_lobe(job).harmonics[0].coefficient,
        sd_um=sd_um,
        lobes=job.jaws,
        found=found_on_a_part(job),
    )


def next_version(
    cut: AppliedPath,
    part: PartHarmonics,
    holds_for: HoldsFor,
    job: Job,
    *,
    number: int,
    gain: float | None,
    orders: Sequence[int],
    follows: Callable[[int], ToolResponse],
    scatter_um: float,
    date: str,
    beside: Sequence[int] = (),
    asked: Sequence[int] = (),
    along: AxialFit = NO_SECTIONS,
    in_phase: bool = False,
    known_within: tuple[float, ...] = (),
) -> LearningStep:
    """Learn from a measured part.

    `along` is what its sections show along the cut, which a program can change `in_phase` with the lobe alone, and
    `known_within` how well that of the lobe is known without them (`AxialRules`).

    `number` is that of the new version, `gain` None the optimal one of each order. `orders` are the harmonics that
    one part may teach, `beside` those that two must show; of the `orders` some may be `asked` for though they
    have grown before. `follows` is the tool at an order. `scatter_um` is the standard deviation of the
    lobe's amplitude from clamping to clamping. Raises `ProfileError` (`learned.gain`).
    """
    if gain is not None and not 0.0 < gain <= 1.0:
        raise refusal_error("learned.gain", key="--gain", value=f"{gain:g}", limit="> 0, <= 1")
    rules = _rules(cut, job, orders, asked, gain, follows, scatter_um)
    every = [n for n in sorted((*orders, *beside)) if n in part.coefficients_um]
    parts = [_order_evidence(n, cut, part, job, rules) for n in every]
    gains = order_steps(parts, rules).gains
    read, path_um = _read(cut, part, job.jaws, parts), cut.path.target.harmonics[0].coefficient
    plain = compare_uncompensated(read.lobe.coefficient, read.lobe_sd_um, path_um, cut.fraction, job)
    contractions = _of_lobe(cut, read, job, gains[job.jaws], scatter_um) | _of_others(cut, part, gains)
    stepped = {each.order for each in parts if each.state.fresh}  # not by the path
    contractions = {n: each for n, each in contractions.items() if n not in stepped}
    grown = _find_grown_harmonics(contractions, job.jaws)
    rules = replace(rules, frozen=(rules.frozen | grown.keys()) - stepped)
    steps = order_steps(parts, rules)
    changes = {**steps.changes_um, **_back(cut, grown)}
    axial = _along_z(along, cut, rules, steps, in_phase=in_phase, known_within=known_within)
    path = learned_part(cut.path, Deviation(coefficients_um=changes), _NONE, lambda n: follows(n).response)
    kept = LearnedCompensation(
        holds_for=holds_for,
        version=number,
        parent=cut.number,
        gain=gains[job.jaws],
        path=axial.applied(path, follows),
        part=replace(read, axial=axial_terms(axial.shown_um)),
        date=date,
        frozen=tuple(sorted(rules.frozen)),
    )
    reasons = plain.reasons() or _reasons(
        contractions, job.jaws, learns=bool(changes or axial.changes_um), version=cut.version
    )
    changes_told = change_warnings(each.change for each in steps.certificate if each.change is not None)
    warnings = (*plain.warnings(), *grown.values(), *changes_told)
    steps = replace(steps, certificate=(*steps.certificate, *axial.certificate))
    return _step(kept, part, cut, changes, steps, contractions, scatter_um, reasons, warnings)


def _along_z(
    along: AxialFit,
    cut: AppliedPath,
    rules: OrderRules,
    steps: OrderSteps,
    *,
    in_phase: bool,
    known_within: tuple[float, ...],
) -> AxialSteps:
    """Return what the sections teach; of the orders that one part may not teach, those that this one teaches."""
    learned = rules.chucked | {n for n in steps.learned_orders if not in_phase}
    how = AxialRules(
        lobes=rules.lobes,
        orders=frozenset({rules.lobes}) if in_phase else learned,
        chucked=rules.chucked,
        frozen=rules.frozen,
        scatter=rules.scatter,
        follows=rules.follows,
        in_phase=in_phase,
        known_within=known_within,
    )
    return axial_steps(along, cut.path.target, how, _axial_history(cut.history), cut.fraction)


def _axial_history(versions: Sequence[LearnedCompensation]) -> AxialHistory:
    """Return what the parts of these versions have shown along the cut, and the steps of their paths."""
    found = AxialHistory()
    before: dict[tuple[int, int], complex] = {}
    for each in versions:
        now, shown = axial_um(each.path.target.axial), axial_um(each.part.axial if each.part else ())
        changes = {key: c - before.get(key, 0j) for key, c in now.items()}
        found, before = found.add(AxialSteps(changes_um=changes, shown_um=shown)), now
    return found


def _rules(
    cut: AppliedPath,
    job: Job,
    orders: Sequence[int],
    asked: Sequence[int],
    gain: float | None,
    follows: Callable[[int], ToolResponse],
    scatter_um: float,
) -> OrderRules:
    return OrderRules(
        lobes=job.jaws,
        lobe_um=job.lobe_amplitude_um,
        scatter=scatter_um / job.lobe_amplitude_um if job.lobe_amplitude_um else 0.0,
        chucked=frozenset(orders),
        frozen=frozenset(() if cut.version is None else cut.version.frozen) - frozenset(asked),
        gain=gain,
        follows=follows,
    )


def _step(
    following: LearnedCompensation,
    part: PartHarmonics,
    cut: AppliedPath,
    changes: Mapping[int, complex],
    steps: OrderSteps,
    contractions: Mapping[int, Contraction],
    scatter_um: float,
    reasons: tuple[Problem, ...],
    warnings: tuple[Problem, ...],
) -> LearningStep:
    """Return a learning step, and the expected next part: lower by the additional depth of the tool."""
    deeper = {n: cut.spared_um.get(n, 0j) + changes.get(n, 0j) for n in {*cut.spared_um, *changes}}
    lobes, placed = following.path.target.lobes, part.is_placed
    return LearningStep(
        next=replace(following, expected_ront_um=part.ront_um(deeper)),
        learned=steps.learned_orders if placed else (),
        contractions=contractions if placed else {},
        expected_lobe_um_pp=2.0 * abs(part.coefficients_um[lobes] - deeper[lobes]),
        expected_half_width_um_pp=half_width_um_pp(part.sd_um[lobes], scatter_um),
        reasons=(*part.reasons, *(reasons if placed else ())),
        warnings=warnings if placed else (),
        certificate=steps.certificate if placed else (),
        placed=placed,
    )


def _order_evidence(n: int, cut: AppliedPath, part: PartHarmonics, job: Job, rules: OrderRules) -> OrderSeen:
    """Return an order as this part and those before it show it."""
    path_um, spared_um = coefficient_of(cut.path.target, n), cut.spared_um.get(n, 0j)
    error_um = part.coefficients_um[n] - spared_um
    paths = [coefficient_of(target_path(job), n), *(coefficient_of(each.path.target, n) for each in cut.history)]
    lost = math.hypot(rules.follows(n).spread / SIGNIFICANT, PROCESS_LOSS_SD)
    taught = [each.part for each in cut.history if each.part is not None]
    parts = [(each.plain_um(n), each.fraction, each.lobe_sd_um) for each in taught]
    shown: list[ShownOrder] = []
    for (plain_um, fraction, sd_um), had_um in zip(
        (*parts, (error_um + path_um, cut.fraction, part.sd_um[n])), paths[-len(parts) - 1 :], strict=True
    ):
        if plain_um is None:  # an older version has not recorded it
            shown = []
            continue
        mark_um = n * math.radians(MARK_SD_DEG) * abs(plain_um - fraction * had_um)
        shown.append(
            ShownOrder(
                shown_um=plain_um,
                path_um=fraction * had_um,
                sd_um=math.hypot(sd_um, REPEATS_SD_UM, mark_um),
                clamped=rules.scatter,
                lost=lost,
            )
        )
    steps_um = [abs(after - first) for first, after in pairwise(paths)]
    return OrderSeen(
        order=n,
        error_um=error_um,
        sd_um=part.sd_um[n],
        path_um=path_um,
        shown_um=[each.shown_um for each in shown],
        steps_um=steps_um,
        on_part_um=part.coefficients_um[n],
        began=len(parts) + 1 - len(shown),
        state=state_of(shown, n, job.jaws),
    )


def _read(cut: AppliedPath, part: PartHarmonics, lobes: int, parts: Sequence[OrderSeen]) -> PartReading:
    target = fraction_of(cut.path, cut.fraction).target.harmonics[0]
    return PartReading(
        version=cut.number,
        fraction=cut.fraction,
        target=target,
        lobe=PathHarmonic.from_coefficient(lobes, part.coefficients_um[lobes]),
        lobe_sd_um=part.sd_um[lobes],
        ront_um=part.ront_um(),
        plain=tuple(
            PathHarmonic.from_coefficient(each.order, each.shown_um[-1]) for each in parts if each.order != lobes
        ),
        clamped=cut.clamped,
        tool=PathHarmonic.from_coefficient(lobes, cut.tool_um) if cut.tool_um else None,
    )


def _of_lobe(
    cut: AppliedPath, now: PartReading, job: Job, gain: float, scatter_um: float
) -> dict[int, Contraction]:
    """Return the contraction of the lobe, if there is a previous part, and both had not the same path."""
    before = None if cut.version is None else cut.version.part
    if before is not None:
        path, lobe, sd_um = before.target.coefficient, before.lobe.coefficient, before.lobe_sd_um
    elif found_on_a_part(job):
        path, lobe, sd_um = 0j, free_state_lobe(job).harmonics[0].coefficient, 0.0
    else:
        return {}
    changed = now.target.coefficient - path
    if not changed:
        return {}
    sd_um = math.hypot(sd_um, now.lobe_sd_um, scatter_um, scatter_um)
    return {job.jaws: _contraction(lobe - now.lobe.coefficient, changed, sd_um, gain)}


def _back(cut: AppliedPath, grown: Iterable[int]) -> dict[int, complex]:
    """Return the changes that set harmonics back to the path of the previous part."""
    if cut.parent is None:
        return {}
    return {n: coefficient_of(cut.parent.target, n) - coefficient_of(cut.path.target, n) for n in grown}


def _of_others(cut: AppliedPath, part: PartHarmonics, gains: Mapping[int, float]) -> dict[int, Contraction]:
    """Return the contractions of the harmonics beside the lobe, if the version has them."""
    version, found = cut.version, {}
    if version is None or version.part is None or cut.parent is None:
        return {}
    before, shown = version.part, {each.lobes: each.coefficient for each in version.part.plain}
    for n, gain in gains.items():
        then, now = coefficient_of(cut.parent.target, n), coefficient_of(cut.path.target, n)
        changed = cut.fraction * now - before.fraction * then
        if n == cut.path.target.lobes or min(abs(now - then), abs(changed)) < STEP_UM:
            continue
        # An older version has not recorded what its part showed, and all of it was learned with its one gain.
        left = (now - then) / version.gain + (1.0 - before.fraction) * then
        if n in shown:
            left = shown[n] - before.fraction * then
        # A fit over whole turns is equally sure of every harmonic.
        sd_um = math.hypot(before.lobe_sd_um, part.sd_um[n], REPEATS_SD_UM, REPEATS_SD_UM)
        found[n] = _contraction(left - part.coefficients_um[n], changed, sd_um, gain)
    return found


def _find_grown_harmonics(contractions: Mapping[int, Contraction], lobes: int) -> dict[int, Problem]:
    """Return the harmonics beside the lobe that certainly grow, each with its problem."""
    return {
        n: Problem(
            code="learned.harmonic_frozen",
            key=f"{n}/rev",
            value=f"{c.value:.2f} ± {c.half_width:.2f}",
            limit="< 1",
        )
        for n, c in sorted(contractions.items())
        if n != lobes and c.verdict is ImprovementVerdict.DIVERGES
    }


def _contraction(less: complex, changed: complex, sd_um: float, gain: float) -> Contraction:
    """Return the contraction from the decrease of a harmonic over the change of its path, in um."""
    arrives = less / changed
    return Contraction(
        value=convergence(arrives, 1.0 + 0j, gain),
        half_width=SIGNIFICANT * gain * sd_um / abs(changed),
        arrives=arrives,
    )


def _reasons(
    contractions: Mapping[int, Contraction],
    lobes: int,
    *,
    learns: bool,
    version: LearnedCompensation | None,
) -> tuple[Problem, ...]:
    lobe = contractions.get(lobes)
    if lobe is not None and lobe.verdict is ImprovementVerdict.DIVERGES:
        back = f"--revert {MODEL if version is None else version.parent}"
        value = f"{lobe.value:.2f} ± {lobe.half_width:.2f}"
        return (Problem(code="learned.diverges", key=back, value=value, limit="< 1"),)
    return () if learns else (Problem(code="learned.nothing", limit=f"{SIGNIFICANT:g} sd"),)
