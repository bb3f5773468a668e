"""The fingerprint of a clamping in a cut: what becomes of its path, and what a learning step has to know of it.

Versions are kept with jaw 1 where the file of the job has it, and so is what was felt. How a part was clamped is
one line of text in the record and in the header of its trace.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from console.session.errors import SessionError
from console.session.stages import Stage, nominal_path
from drivers.cutting.strategy import INVERTING, Strategy
from drivers.identification.following import follows_by_order
from profiles.axis.response import ServoResponse
from profiles.compensations.learned import ClampedRead, LearnedCompensation, PartRead
from profiles.compensations.learning import REPEATS_SD_UM
from profiles.compensations.next_version import CutWith
from profiles.compensations.optimal_gain import PRIOR_DEG, PRIOR_FRACTION
from profiles.compensations.part_harmonics import PartHarmonics
from profiles.compensations.path import CutPath, PathHarmonic, free_state_lobe
from profiles.fingerprint.lobe_filter import LobeFilter, Seen
from profiles.fingerprint.readings import ClampReadings
from profiles.fingerprint.this_clamping import (
    Clamped,
    Felt,
    clamped_by,
    clamped_orders,
    clamped_path,
    felt,
    known_lobe,
    ratio_of,
    unexpected,
    with_added,
)
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

_NUMBER = r"-?\d+(?:\.\d+)?"
_MADE = re.compile(
    rf"height=({_NUMBER}) turn=({_NUMBER}) felt=({_NUMBER})@({_NUMBER}) sd=({_NUMBER})"
    rf"((?: \d+={_NUMBER}@{_NUMBER})*)",
    re.ASCII,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fingerprint:
    """A cut with the fingerprint of its clamping: its path, what was found, and the line that says so."""

    path: CutPath
    clamped: Clamped
    felt: Felt
    made: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeClamped:
    """How a part was clamped: `read` is what a version keeps, `added_um` what was added to its path, by order."""

    read: ClampedRead
    added_um: Mapping[int, complex]

    def ratio(self, lobes: int) -> complex:
        """Return by what the lobe was multiplied."""
        return ratio_read(self.read, lobes)


def refuse_unusable(strategy: Strategy, stage: Stage, readings: ClampReadings | None, *, simulated: bool) -> None:
    """Refuse a fingerprint if the strategy has no path for it, or if it is simulated and the cut is not."""
    if not strategy.traits.inverts or stage is Stage.AIR:
        value = strategy.value if stage is not Stage.AIR else stage.value
        raise SessionError(Problem(code="clamping.no_path", value=value, limit=" | ".join(INVERTING)))
    if readings is not None and readings.simulated and not simulated:
        raise SessionError(Problem(code="clamping.simulated"))


def fingerprinted(
    readings: ClampReadings,
    aligned: Job,
    filed: Job,
    machine: MachineProfile,
    strategy: Strategy,
    *,
    path: CutPath | None,
    history: Sequence[LearnedCompensation] = (),
    inverted: ServoResponse | None = None,
) -> Fingerprint:
    """Return a cut by the fingerprint of its clamping; `aligned` is the job with jaw 1 where it was found.

    `path` is what was learned, with jaw 1 as found, None the model's; `history` the versions that led to it.
    Raises `ProfileError`: what the readings or the part do not allow.
    """
    turn_deg, lobes = aligned.lobe_phase_deg - filed.lobe_phase_deg, filed.jaws
    before = path or nominal_path(aligned, machine, strategy, inverted)
    follows = follows_by_order(strategy, machine, aligned.spindle_speed_rpm, inverted)
    found = _turned(felt(readings, aligned), lobes, -turn_deg)
    if not strategy.traits.by_table:  # such a path has no order but the lobe
        found = replace(found, others={})
    known = _replayed(filed, machine, history).clamped(REPEATS_SD_UM)
    _, clamped = clamped_by(known, found, before, lobes)
    added = {n: c * cmath.exp(-1j * n * math.radians(turn_deg)) for n, c in clamped.added_um.items()}

    def response(order: int) -> complex:
        return follows(order).response

    mean = with_added(before, added, response)
    return Fingerprint(
        path=clamped_path(mean, lobes, clamped.ratio, response),
        clamped=clamped,
        felt=found,
        made=_said(clamped, lobes),
    )


def made_clamped(said: str, lobes: int) -> MadeClamped | None:
    """Return how a part was clamped from the line that says so, None for an empty one.

    Raises SessionError: `clamping.made`, the line cannot be read.
    """
    if not said:
        return None
    found = _MADE.fullmatch(said)
    if found is None or not (float(found[1]) > 0.0 and float(found[5]) > 0.0):
        raise SessionError(Problem(code="clamping.made", value=said[:60]))
    height, turn_deg, felt_um, felt_deg, sd_um = (float(found[place]) for place in range(1, 6))
    read = ClampedRead(
        height=height,
        turn_deg=turn_deg,
        felt=PathHarmonic(lobes=lobes, amplitude_um=felt_um, phase_deg=felt_deg),
        felt_sd_um=sd_um,
    )
    added = {}
    for word in found[6].split():
        order, amplitude, phase = re.split("[=@]", word)
        if int(order) < 1:
            raise SessionError(Problem(code="clamping.made", value=said[:60]))
        added[int(order)] = PathHarmonic(
            lobes=int(order), amplitude_um=float(amplitude), phase_deg=float(phase)
        ).coefficient
    return MadeClamped(read=read, added_um=added)


def of_mean_clamping(
    cut: CutWith, part: PartHarmonics, said: str, lobes: int, response: Callable[[int], complex]
) -> tuple[CutWith, PartHarmonics]:
    """Return cut and part as they would have been in the mean clamping; `said` is how the part was clamped."""
    made = made_clamped(said, lobes)
    if made is None:
        return cut, part
    path = with_added(cut.path, made.added_um, response)
    orders, ratio = clamped_orders(path, lobes), made.ratio(lobes)
    left = {n: c / ratio_of(n, lobes, ratio) if n in orders else c for n, c in part.coefficients_um.items()}
    return replace(cut, path=path, clamped=made.read), replace(part, coefficients_um=left)


def expected_of(
    readings: ClampReadings, job: Job, machine: MachineProfile, learned: LearnedCompensation | None = None
) -> tuple[Problem, ...]:
    """Return a warning of readings that are far from what job, chuck and the newest part let expect.

    `job` has jaw 1 where it is. Raises `ProfileError`: what the readings do not show.
    """
    known = _replayed(job, machine, () if learned is None else (learned,)).clamped(REPEATS_SD_UM)
    return unexpected(known, felt(readings, job), job.jaws)


def ratio_read(read: ClampedRead, lobes: int) -> complex:
    """Return by what the lobe was multiplied."""
    return cmath.rect(read.height, -lobes * math.radians(read.turn_deg))


def _replayed(job: Job, machine: MachineProfile, history: Sequence[LearnedCompensation]) -> LobeFilter:
    """Return what the job and its parts so far tell of the lobe."""
    found = known_lobe(free_state_lobe(job).harmonics[0].coefficient, job, machine, PRIOR_FRACTION, PRIOR_DEG)
    for part in (each.part for each in history):
        if part is not None:
            found = _with_part(found.clamped(REPEATS_SD_UM), part, job.jaws)
    return found


def _with_part(known: LobeFilter, part: PartRead, lobes: int) -> LobeFilter:
    ratio = 1.0 + 0j
    if part.clamped is not None:
        ratio = ratio_read(part.clamped, lobes)
        known = known.felt(Seen(value=part.clamped.felt.coefficient, sd_um=part.clamped.felt_sd_um))
    done = ratio * part.target.coefficient
    plain = ratio * part.lobe.coefficient + done
    return known.measured(Seen(value=plain, sd_um=math.hypot(part.lobe_sd_um, REPEATS_SD_UM)), done)


def _turned(found: Felt, lobes: int, by_deg: float) -> Felt:
    def turned(seen: Seen, order: int) -> Seen:
        turn = cmath.exp(-1j * order * math.radians(by_deg))
        return replace(seen, value=seen.value * turn, along=None if seen.along is None else seen.along * turn)

    return replace(
        found, seen=turned(found.seen, lobes), others={n: turned(each, n) for n, each in found.others.items()}
    )


def _said(clamped: Clamped, lobes: int) -> str:
    """Return the line that says how a part was clamped, with the phases in spindle angle as in the job's file."""
    turn_deg = -math.degrees(cmath.phase(clamped.ratio)) / lobes
    shown = PathHarmonic.of(lobes, clamped.felt.value)
    words = [
        f"height={abs(clamped.ratio):.6f}",
        f"turn={turn_deg:.4f}",
        f"felt={shown.amplitude_um:.4f}@{shown.phase_deg:.4f}",
        f"sd={clamped.felt.sd_um:.4f}",
    ]
    for n, coefficient in sorted(clamped.added_um.items()):
        order = PathHarmonic.of(n, coefficient)
        words.append(f"{n}={order.amplitude_um:.4f}@{order.phase_deg:.4f}")
    return " ".join(words)
