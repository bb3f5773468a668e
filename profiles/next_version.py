"""From a measured part to the compensation of the next: what is learned, and whether the parts get better.

A wave n of the path W and of the part r, with the share s of the path in the cut, should leave (1 - s) W; what is
off by more than noise alone shows, e = r - (1 - s) W, is wanted deeper: W <- W + gain e. The first part is learned
in full, because what is wrong there is large. Later each part brings noise of its own (clamping, gauge), and the
learned path carries the share gain / (2 - gain) of its variance: 0.54 at a gain of 0.7, all of it at 1.

Two parts in a row tell what the tool really makes of the path: T'/T = (r1 - r2) / (W2 - W1). An error shrinks by
|1 - gain T'/T| with each part; from 1 on it does not. In front of the first part stands the plain cut of the job,
where its lobe was measured: W = 0, r = the lobe.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from profiles.compensation import CutPath, Wave, free_state_lobe
from profiles.graduated import share_of
from profiles.job import Job
from profiles.learned import MODEL, HoldsFor, LearnedCompensation, PartRead
from profiles.learning import SIGNIFICANT, Deviation, convergence, learned_part
from profiles.lobe_conditions import found_on_a_part
from profiles.part_waves import PartWaves
from profiles.problem import Problem, ProfileError

FIRST_GAIN, LATER_GAIN = 1.0, 0.7
"""Of the first part, where what is wrong is large, and of later ones, where a part of it is noise."""


class Verdict(StrEnum):
    """Whether the parts get better, as far as two of them can tell."""

    CONVERGES = "converges"
    UNCLEAR = "unclear"
    DIVERGES = "diverges"


@dataclass(frozen=True, slots=True, kw_only=True)
class Contraction:
    """By how much an error shrinks with each part, 95 % sure within `half_width`.

    `arrives` is T'/T: the share of the path's lobe that reaches the part, its phase that of N waves a turn.
    """

    value: float
    half_width: float
    arrives: complex

    @property
    def verdict(self) -> Verdict:
        """Whether it is below 1, or above."""
        if self.value - self.half_width >= 1.0:
            return Verdict.DIVERGES
        return Verdict.CONVERGES if self.value + self.half_width < 1.0 else Verdict.UNCLEAR


@dataclass(frozen=True, slots=True, kw_only=True)
class CutWith:
    """What the part was cut with: the whole path, the share of it, and the version, None the model."""

    path: CutPath
    share: float
    version: LearnedCompensation | None

    @property
    def number(self) -> int:
        """The number of the version."""
        return MODEL if self.version is None else self.version.version

    @property
    def spared_um(self) -> dict[int, complex]:
        """The waves of the path that the tool was not told to make, which are to be left on the part."""
        return {wave.lobes: (1.0 - self.share) * wave.coefficient for wave in self.path.wanted.waves}


@dataclass(frozen=True, slots=True, kw_only=True)
class Lesson:
    """What a part teaches: the version for the next, which waves it changes, and what the next should be like.

    The expected lobe is 95 % sure within the half-width, by the noise of the trace and the scatter of two
    clampings; `expected_ront_um` is the trace without what was learned. `reasons` are why it must not be kept.
    """

    next: LearnedCompensation
    learned: tuple[int, ...]
    contraction: Contraction | None
    expected_lobe_um_pp: float
    expected_half_width_um_pp: float
    expected_ront_um: float
    reasons: tuple[Problem, ...]


def next_version(
    cut: CutWith,
    part: PartWaves,
    holds_for: HoldsFor,
    job: Job,
    *,
    number: int,
    gain: float | None,
    orders: Sequence[int],
    response: Callable[[int], complex],
    scatter_um: float,
    date: str,
) -> Lesson:
    """Return what a part teaches.

    `number` is that of the version to make, `gain` None the usual one, `orders` the waves that can be commanded.
    `response` is the nominal one from command to tool, by waves in a turn. `scatter_um` is the standard deviation
    of the lobe's amplitude from clamping to clamping.

    Raises:
        ProfileError: `learned.gain`.
    """
    used_gain = _gain(gain, cut.version)
    spared = cut.spared_um
    off = {n: part.coefficients_um[n] - spared.get(n, 0j) for n in orders}
    learned = {n: e for n, e in off.items() if abs(e) > SIGNIFICANT * part.sd_um[n]}
    wrong, tool = Deviation(coefficients_um=learned), Deviation(coefficients_um={})
    path = learned_part(cut.path, wrong, tool, response, used_gain)
    read = _read(cut, part, job.jaws)
    contraction = _contraction(cut, read, job, used_gain, scatter_um)
    # The next part is lower by what the tool goes deeper.
    deeper = {n: spared.get(n, 0j) + used_gain * learned.get(n, 0j) for n in {*spared, *learned}}
    return Lesson(
        next=LearnedCompensation(
            holds_for=holds_for,
            version=number,
            parent=cut.number,
            gain=used_gain,
            path=path,
            part=read,
            date=date,
        ),
        learned=tuple(sorted(learned)),
        contraction=contraction,
        expected_lobe_um_pp=2.0 * abs(part.coefficients_um[job.jaws] - deeper[job.jaws]),
        expected_half_width_um_pp=2.0 * SIGNIFICANT * math.hypot(read.lobe_sd_um, scatter_um, scatter_um),
        expected_ront_um=part.ront_um(deeper),
        reasons=(*part.reasons, *_reasons(contraction, learned, cut.version)),
    )


def _gain(gain: float | None, version: LearnedCompensation | None) -> float:
    if gain is None:
        return FIRST_GAIN if version is None else LATER_GAIN
    if not 0.0 < gain <= 1.0:
        raise ProfileError(Problem(code="learned.gain", key="--gain", value=f"{gain:g}", limit="> 0, <= 1"))
    return gain


def _read(cut: CutWith, part: PartWaves, lobes: int) -> PartRead:
    wanted = share_of(cut.path, cut.share).wanted.waves[0]
    return PartRead(
        version=cut.number,
        share=cut.share,
        wanted=wanted,
        lobe=Wave.of(lobes, part.coefficients_um[lobes]),
        lobe_sd_um=part.sd_um[lobes],
        ront_um=part.ront_um(),
    )


def _contraction(cut: CutWith, now: PartRead, job: Job, gain: float, scatter_um: float) -> Contraction | None:
    """Return what the part and the one before it tell; None where there was none, or where both had one path."""
    before = None if cut.version is None else cut.version.part
    if before is not None:
        path, lobe, sd_um = before.wanted.coefficient, before.lobe.coefficient, before.lobe_sd_um
    elif found_on_a_part(job):
        path, lobe, sd_um = 0j, free_state_lobe(job).waves[0].coefficient, 0.0
    else:
        return None
    changed = now.wanted.coefficient - path
    if not changed:
        return None
    arrives = (lobe - now.lobe.coefficient) / changed
    sd = math.hypot(sd_um, now.lobe_sd_um, scatter_um, scatter_um) / abs(changed)
    return Contraction(
        value=convergence(arrives, 1.0 + 0j, gain), half_width=SIGNIFICANT * gain * sd, arrives=arrives
    )


def _reasons(
    contraction: Contraction | None, learned: dict[int, complex], version: LearnedCompensation | None
) -> tuple[Problem, ...]:
    if contraction is not None and contraction.verdict is Verdict.DIVERGES:
        back = MODEL if version is None else version.parent
        value = f"{contraction.value:.2f} ± {contraction.half_width:.2f}"
        return (Problem(code="learned.diverges", key=f"--revert {back}", value=value, limit="< 1"),)
    if not learned:
        return (Problem(code="learned.nothing", limit=f"{SIGNIFICANT:g} sd"),)
    return ()
