"""Derive the next compensation from a measured part, and judge whether the parts improve.

Order n of the path W and of the part r, with the fraction s of the path in the cut, should leave (1 - s) W; a
significant deviation e = r - (1 - s) W is cut deeper: W <- W + gain e. The first part is learned in full,
because its error is large. Later parts add their own noise (clamping, gauge), and the learned path carries the
fraction gain / (2 - gain) of its variance: 0.54 at a gain of 0.7, all of it at 1.

Two consecutive parts give the actual response of the tool to the path: T'/T = (r1 - r2) / (W2 - W1). An error
shrinks by |1 - gain T'/T| with each part; from 1 on it does not. This is judged for every learned harmonic: an
axis may follow well at the lobe and not at three times its frequency. Before the first part comes the plain cut
of the job, where its lobe was measured: W = 0, r = the lobe. For the other harmonics of the previous part only
the learned step is recorded: their e is the step of the path over the gain.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from profiles.compensations.learned import MODEL, HoldsFor, LearnedCompensation, PartRead
from profiles.compensations.learning import (
    REPEATS_SD_UM,
    SIGNIFICANT,
    Deviation,
    coefficient_of,
    convergence,
    learned_part,
)
from profiles.compensations.part_harmonics import PartHarmonics
from profiles.compensations.path import CutPath, PathHarmonic, fraction_of, free_state_lobe
from profiles.job import Job
from profiles.lobe.lobe_conditions import found_on_a_part
from profiles.problem import Problem, refused

# Gain of the first part, where errors are large, and of later ones, where a part of them is noise.
FIRST_GAIN, LATER_GAIN = 1.0, 0.7
ROUNDING_UM = 1e-6  # a path step below this is only the rounding of its file
IN_PLACE_DEG = 30.0
"""Tolerance of its position in degrees of lobe: a choice. That is half of what makes a
part worse than none, 10 degrees of spindle with three jaws; dry friction of 3 N makes 12 of it at 50 Hz."""

_NONE = Deviation(coefficients_um={})


class Verdict(StrEnum):
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
    def verdict(self) -> Verdict:
        """Whether the factor is below 1, or above."""
        if self.value - self.half_width >= 1.0:
            return Verdict.DIVERGES
        return Verdict.CONVERGES if self.value + self.half_width < 1.0 else Verdict.UNCLEAR


@dataclass(frozen=True, slots=True, kw_only=True)
class CutWith:
    """What the part was cut with: the whole path, the fraction of it, and the version, None the model.

    `parent` is the path of the previous part, from which the version was learned: without it only the
    convergence of the lobe can be judged.
    """

    path: CutPath
    fraction: float
    version: LearnedCompensation | None
    parent: CutPath | None = None

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

    `lobe_sd_um` is the standard error of the lobe read from the part, `scatter_um` that of one of two clampings.
    """
    return 2.0 * SIGNIFICANT * math.hypot(lobe_sd_um, scatter_um, scatter_um)


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningStep:
    """What was learned from a part: the next version, the changed harmonics, and the expected next part.

    The expected lobe has a 95 % half-width from the noise of the trace and the scatter of two clampings.
    `contractions` are those of the harmonics, by order, that two parts determine. `reasons` are why it must not
    be kept, `warnings` do not forbid it.
    """

    next: LearnedCompensation
    learned: tuple[int, ...]
    contractions: Mapping[int, Contraction]
    expected_lobe_um_pp: float
    expected_half_width_um_pp: float
    reasons: tuple[Problem, ...]
    warnings: tuple[Problem, ...] = ()

    @property
    def expected_ront_um(self) -> float:
        """The roundness of the trace without what was learned."""
        found = self.next.expected_ront_um
        assert found is not None
        return found

    @property
    def contraction(self) -> Contraction | None:
        """The contraction of the lobe."""
        return self.contractions.get(self.next.path.target.lobes)


def next_version(
    cut: CutWith,
    part: PartHarmonics,
    holds_for: HoldsFor,
    job: Job,
    *,
    number: int,
    gain: float | None,
    orders: Sequence[int],
    response: Callable[[int], complex],
    scatter_um: float,
    date: str,
) -> LearningStep:
    """Learn from a measured part.

    `number` is that of the new version, `gain` None the usual one, `orders` the harmonics that can be commanded.
    `response` is the nominal one from command to tool, by order. `scatter_um` is the standard deviation of the
    lobe's amplitude from clamping to clamping. Raises `ProfileError` (`learned.gain`).
    """
    used_gain = _gain(gain, cut.version)
    off = {n: part.coefficients_um[n] - cut.spared_um.get(n, 0j) for n in orders}
    learned = {n: e for n, e in off.items() if abs(e) > SIGNIFICANT * part.sd_um[n]}
    path = learned_part(cut.path, Deviation(coefficients_um=learned), _NONE, response, used_gain)
    read, path_um = _read(cut, part, job.jaws), cut.path.target.harmonics[0].coefficient
    plain = uncompensated(read.lobe.coefficient, read.lobe_sd_um, path_um, cut.fraction, job)
    contractions = _of_lobe(cut, read, job, used_gain, scatter_um) | _of_others(cut, part, orders, used_gain)
    # The next part is lower by the additional depth of the tool.
    deeper = {n: cut.spared_um.get(n, 0j) + used_gain * learned.get(n, 0j) for n in {*cut.spared_um, *learned}}
    return LearningStep(
        next=LearnedCompensation(
            holds_for=holds_for,
            version=number,
            parent=cut.number,
            gain=used_gain,
            path=path,
            part=read,
            date=date,
            expected_ront_um=part.ront_um(deeper),
        ),
        learned=tuple(sorted(learned)),
        contractions=contractions,
        expected_lobe_um_pp=2.0 * abs(part.coefficients_um[job.jaws] - deeper[job.jaws]),
        expected_half_width_um_pp=half_width_um_pp(read.lobe_sd_um, scatter_um),
        reasons=(*part.reasons, *(plain.reasons() or _reasons(contractions, job.jaws, learned, cut.version))),
        warnings=plain.warnings(),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncompensated:
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


def uncompensated(left_um: complex, sd_um: float, path_um: complex, fraction: float, job: Job) -> Uncompensated:
    """Compare a part that has `left_um` of its lobe, cut with `fraction` of `path_um`."""
    without_um = left_um + fraction * path_um
    return Uncompensated(
        whole_um=without_um - path_um,
        without_um=without_um,
        expected_um=free_state_lobe(job).harmonics[0].coefficient,
        sd_um=sd_um,
        lobes=job.jaws,
        found=found_on_a_part(job),
    )


def _gain(gain: float | None, version: LearnedCompensation | None) -> float:
    if gain is None:
        return FIRST_GAIN if version is None else LATER_GAIN
    if not 0.0 < gain <= 1.0:
        raise refused("learned.gain", key="--gain", value=f"{gain:g}", limit="> 0, <= 1")
    return gain


def _read(cut: CutWith, part: PartHarmonics, lobes: int) -> PartRead:
    target = fraction_of(cut.path, cut.fraction).target.harmonics[0]
    return PartRead(
        version=cut.number,
        fraction=cut.fraction,
        target=target,
        lobe=PathHarmonic.of(lobes, part.coefficients_um[lobes]),
        lobe_sd_um=part.sd_um[lobes],
        ront_um=part.ront_um(),
    )


def _of_lobe(cut: CutWith, now: PartRead, job: Job, gain: float, scatter_um: float) -> dict[int, Contraction]:
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


def _of_others(cut: CutWith, part: PartHarmonics, orders: Sequence[int], gain: float) -> dict[int, Contraction]:
    """Return the contractions of the harmonics beside the lobe, if the version has them."""
    version, found = cut.version, {}
    if version is None or version.part is None or cut.parent is None:
        return {}
    before = version.part
    for n in orders:
        then, now = coefficient_of(cut.parent.target, n), coefficient_of(cut.path.target, n)
        changed = cut.fraction * now - before.fraction * then
        if n == cut.path.target.lobes or min(abs(now - then), abs(changed)) < ROUNDING_UM:
            continue
        left = (now - then) / version.gain + (1.0 - before.fraction) * then
        # A fit over whole turns is equally sure of every harmonic.
        sd_um = math.hypot(before.lobe_sd_um, part.sd_um[n], REPEATS_SD_UM, REPEATS_SD_UM)
        found[n] = _contraction(left - part.coefficients_um[n], changed, sd_um, gain)
    return found


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
    learned: Mapping[int, complex],
    version: LearnedCompensation | None,
) -> tuple[Problem, ...]:
    back = f"--revert {MODEL if version is None else version.parent}"
    grows = {
        n: f"{c.value:.2f} ± {c.half_width:.2f}" for n, c in contractions.items() if c.verdict is Verdict.DIVERGES
    }
    if lobes in grows:
        return (Problem(code="learned.diverges", key=back, value=grows[lobes], limit="< 1"),)
    if not learned:
        return (Problem(code="learned.nothing", limit=f"{SIGNIFICANT:g} sd"),)
    return tuple(
        Problem(code="learned.harmonic_diverges", key=back, value=f"{n}/rev: {factor}", limit="< 1")
        for n, factor in sorted(grows.items())
        if n in learned
    )
