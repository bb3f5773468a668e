"""The parts of a learning series, how each was cut and what it left, and the warnings of the series."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from console.session.cut.run import RunResult
from console.session.cut.telemetry import CutFigures
from console.session.learning.learning_beside import TRIM_LIMIT_UM, blank_orders
from console.session.learning.lobe_learning import LeftLobe
from profiles.compensations.certificate import CertifiedOrder, OrderStatus
from profiles.compensations.change import OrderChange, change_warnings
from profiles.compensations.learning import REPEATS_SD_UM, Deviation, GrownHarmonic
from profiles.compensations.path import CutPath
from profiles.compensations.trial_band import BandCorrection
from profiles.fingerprint.this_clamping import ClampingCorrection
from profiles.metrology.cylindricity import CylinderResult
from profiles.metrology.uncertainty import UncertaintyBudget
from profiles.problem import Problem
from profiles.roundness import RoundnessResult

LARGE_UM_PP = 1.0
"""Error of the tool, p-p, from which the report says in words whence it came; a choice."""

OF_TOOL = 0.5
"""Fraction of an order by which the tool has to be off its path for the tool to be named; a choice."""

FEWEST_WORSE = 2
ONE_SIDED = 1.645  # standard deviations, 95 %
CERTAIN_GAIN_UM = 2.0 * ONE_SIDED * math.sqrt(2.0) * REPEATS_SD_UM
"""Gain in RONt of one part over another that is more than what a harmonic does not repeat, peak to peak."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedPart:
    """One part: its roundness, its form over the length, the tool error, and the path and trim of its cut.

    `tool_off` is the tool error in the middle of the cut, `air_um` the lobe error in each air pass before this
    part, peak to peak. `learned` are the harmonics that the part has changed for the next one, `grown` those no
    longer learned. `left` is what of its lobe repeats. `clamped` is its fingerprint, `trim_short` how much more
    trim than there is it needed, um by order. `changes` are steps and drifts that it has shown, `band` is
    what its trial band has.
    """

    roundness: RoundnessResult
    whole: CylinderResult | None
    budget: UncertaintyBudget | None
    figures: CutFigures
    path: CutPath
    trim_um: complex
    tool_off: Deviation
    air_um: tuple[float, ...]
    part_gain: float
    learned: tuple[int, ...]
    grown: tuple[GrownHarmonic, ...]
    collisions: tuple[str, ...]
    certificate: tuple[CertifiedOrder, ...] = ()
    clamped: ClampingCorrection | None = None
    trim_short: Mapping[int, float] = field(default_factory=dict)
    left: LeftLobe | None = None
    changes: tuple[OrderChange, ...] = ()
    band: BandCorrection | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnResult(RunResult):
    """A run of several parts, whose last is that of `after`; `floor` is a part without a lobe.

    `floor_whole` is the form of that over its length. `ended` is why the path of a further part was refused, and
    the series ended before it.
    """

    before: RoundnessResult
    floor: RoundnessResult
    parts: tuple[LearnedPart, ...]
    ended: tuple[Problem, ...] = ()
    floor_whole: CylinderResult | None = None

    @property
    def own_orders(self) -> tuple[CertifiedOrder, ...]:
        """The orders of the last part whose tool error is mostly of its own blank, or varies."""
        blank = blank_orders(self.plan.job.jaws)
        return tuple(
            each
            for each in self.parts[-1].certificate
            if (each.order in blank or each.standing is OrderStatus.VARIES)
            and 2.0 * (each.tool_off_um or 0.0) >= max(LARGE_UM_PP, each.on_part_um or 0.0)
        )

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Return why the series has `ended`, implausible readings, changes, and orders that were not learned.

        Steps, and what drifts at last: `change_warnings`. Fingerprints that chance hardly explains:
        `learning.surprise`; harmonics: `learning.grew`, or `learning.grew_beside` where it was not the tool; parts
        that needed more trim: `learning.trim_short`; a last part that is not certainly rounder than the first:
        `learning.no_gain`; parts that are all less round than the one without compensation: `learning.worse`.
        """
        grown = (_grew(each, self.parts) for each in self.parts[-1].grown)
        return (
            *self.ended,
            *_find_doubtful_fingerprints(self.parts),
            *change_warnings(change for part in self.parts for change in part.changes if change.step),
            *change_warnings(change for change in self.parts[-1].changes if not change.step),
            *grown,
            *_short_of_trim(self.parts),
            *_no_gain(self.parts),
            *worse_than_plain([self.before.ront_um], [each.roundness.ront_um for each in self.parts]),
        )


def _find_doubtful_fingerprints(parts: tuple[LearnedPart, ...]) -> Iterator[Problem]:
    """Yield the parts with an implausible fingerprint."""
    for n, part in enumerate(parts, start=1):
        for each in () if part.clamped is None else part.clamped.warnings:
            yield Problem(code="learning.surprise", key=str(n), value=each.value, limit=each.limit)


def _no_gain(parts: tuple[LearnedPart, ...]) -> tuple[Problem, ...]:
    """Return `learning.no_gain` if two parts cut with the same path might differ by as much."""
    first_um, last_um = parts[0].roundness.ront_um, parts[-1].roundness.ront_um
    if len(parts) == 1 or first_um - last_um > CERTAIN_GAIN_UM:
        return ()
    return (
        Problem(
            code="learning.no_gain", key=str(len(parts)), value=f"{last_um:.1f} um", limit=f"{first_um:.1f} um"
        ),
    )


def _grew(each: GrownHarmonic, parts: tuple[LearnedPart, ...]) -> Problem:
    """Return why a harmonic is learned no more: the tool is named only if it was seen to be off by as much.

    What has grown before the second part has grown in air, where the tool is all there is.
    """
    grown, best = f"{each.grown_um:.2f} um", f"{each.best_um:.2f} um"
    off_um = max(abs(part.tool_off.coefficients_um.get(each.order, 0j)) for part in parts)
    of_tool = each in parts[0].grown or off_um >= OF_TOOL * each.grown_um
    code = "learning.grew" if of_tool else "learning.grew_beside"
    return Problem(code=code, key=f"{each.order}/rev", value=grown, limit=best)


def worse_than_plain(plain_um: Sequence[float], compensated_um: Sequence[float]) -> tuple[Problem, ...]:
    """Return `learning.worse` if each compensated part is certainly less round than all without compensation.

    RONt, um, of parts of one job on one machine; nothing of a single compensated part, which may be the first.
    """
    if not plain_um or len(compensated_um) < FEWEST_WORSE:
        return ()
    plain, best = max(plain_um), min(compensated_um)
    if best - plain <= CERTAIN_GAIN_UM:
        return ()
    limit = f"{plain:.1f} um"
    return (Problem(code="learning.worse", key=str(len(compensated_um)), value=f"{best:.1f} um", limit=limit),)


def _short_of_trim(parts: tuple[LearnedPart, ...]) -> tuple[Problem, ...]:
    needed = {
        n: TRIM_LIMIT_UM + max(each.trim_short.values())
        for n, each in enumerate(parts, start=1)
        if each.trim_short
    }
    return tuple(
        Problem(code="learning.trim_short", key=str(n), value=f"{um:.1f} um", limit=f"{TRIM_LIMIT_UM:g} um")
        for n, um in needed.items()
    )
