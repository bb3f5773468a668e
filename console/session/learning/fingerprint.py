"""The fingerprint of a clamping in a cut: its effect on the path and on the learning step.

Versions and readings are kept with jaw 1 as in the file of the job. The clamping of a part is one line of text in
the record and in the header of its trace.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from console.session.errors import SessionError
from console.session.stages import Stage, nominal_path
from drivers.cutting.strategy import INVERTING, Strategy
from drivers.identification.nominal import follows_by_order
from profiles.axis.response import ServoResponse
from profiles.compensations.learned_compensation import ClampingReading, LearnedCompensation, PartReading
from profiles.compensations.learning import REPEATS_SD_UM
from profiles.compensations.next_version import AppliedPath
from profiles.compensations.optimal_gain import PRIOR_DEG, PRIOR_FRACTION
from profiles.compensations.part_harmonics import PartHarmonics
from profiles.compensations.path import CutPath, PathHarmonic, free_state_lobe
from profiles.fingerprint.blank_form import BlankOval, blank_oval
from profiles.fingerprint.lobe_filter import LobeFilter, MeasuredCoefficient
from profiles.fingerprint.readings import ClampReadings
from profiles.fingerprint.this_clamping import (
    ClampingCorrection,
    ClampingFingerprint,
    clamped_by,
    clamped_orders,
    clamped_path,
    evaluate_readings,
    expected_reading,
    known_lobe,
    ratio_of,
    warn_of_surprise,
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
class FingerprintedCut:
    """A cut with the fingerprint of its clamping: its path, what was found, and the line that says so.

    `blank` is the oval of the blank itself, which no path has: the readings alone show it.
    """

    path: CutPath
    clamped: ClampingCorrection
    felt: ClampingFingerprint
    made: str
    blank: BlankOval | None = None


def refuse_unusable(strategy: Strategy, stage: Stage, readings: ClampReadings | None, *, simulated: bool) -> None:
    """Refuse a fingerprint without a path for it, or of another lathe than the one that cuts."""
    if not strategy.traits.inverts or stage is Stage.AIR:
        value = strategy.value if stage is not Stage.AIR else stage.value
        raise SessionError(Problem(code="clamping.no_path", value=value, limit=" | ".join(INVERTING)))
    if readings is not None and readings.simulated and not simulated:
        raise SessionError(Problem(code="clamping.simulated"))


def fingerprint_cut(
    readings: ClampReadings,
    aligned: Job,
    filed: Job,
    machine: MachineProfile,
    strategy: Strategy,
    *,
    path: CutPath | None = None,
    history: Sequence[LearnedCompensation] = (),
    inverted: ServoResponse | None = None,
) -> FingerprintedCut:
    """Return a cut by the fingerprint of its clamping; `aligned` is the job with jaw 1 where it was found.

    `path` is the learned one, with jaw 1 as found, None for the model's; `history` the versions that led to it.
    Raises `ProfileError`: readings or part do not allow it.
    """
    turn_deg, lobes = aligned.lobe_phase_deg - filed.lobe_phase_deg, filed.jaws
    before = path or nominal_path(aligned, machine, strategy, inverted)
    follows = follows_by_order(strategy, machine, aligned.spindle_speed_rpm, inverted)
    found = _turn_fingerprint(evaluate_readings(readings, aligned), lobes, -turn_deg)
    if not strategy.traits.by_table:  # such a path has no order but the lobe
        found = replace(found, others={})
    known = _replay_history(filed, machine, history).predict_clamping(REPEATS_SD_UM)
    _, clamped = clamped_by(known, found, before, lobes)
    added = {n: c * cmath.exp(-1j * n * math.radians(turn_deg)) for n, c in clamped.added_um.items()}

    def response(order: int) -> complex:
        return follows(order).response

    mean = with_added(before, added, response)
    return FingerprintedCut(
        path=clamped_path(mean, lobes, clamped.ratio, response),
        clamped=clamped,
        felt=found,
        made=_format_clamping(clamped, lobes),
        blank=blank_oval(readings, aligned, machine),
    )


def read_clamping(said: str, lobes: int) -> tuple[ClampingReading, dict[int, complex]] | None:
    """Parse the line of a clamping: its reading as versions keep it, and the additions to the path, um by order.

    None for an empty line.

    Raises SessionError: `clamping.made`, the line cannot be read.
    """
    if not said:
        return None
    found = _MADE.fullmatch(said)
    if found is None or not (float(found[1]) > 0.0 and float(found[5]) > 0.0):
        raise SessionError(Problem(code="clamping.made", value=said[:60]))
    height, turn_deg, felt_um, felt_deg, sd_um = (float(found[place]) for place in range(1, 6))
    read = ClampingReading(
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
    return read, added


def of_mean_clamping(
    cut: AppliedPath, part: PartHarmonics, said: str, lobes: int, response: Callable[[int], complex]
) -> tuple[AppliedPath, PartHarmonics]:
    """Return cut and part as they would have been in the mean clamping; `said` is how the part was clamped."""
    clamping = read_clamping(said, lobes)
    if clamping is None:
        return cut, part
    read, added_um = clamping
    path = with_added(cut.path, added_um, response)
    orders, ratio = clamped_orders(path, lobes), ratio_read(read, lobes)
    left = {n: c / ratio_of(n, lobes, ratio) if n in orders else c for n, c in part.coefficients_um.items()}
    return replace(cut, path=path, clamped=read), replace(part, coefficients_um=left)


def expected_of(
    readings: ClampReadings, job: Job, machine: MachineProfile, learned: LearnedCompensation | None = None
) -> tuple[Problem, ...]:
    """Return warnings of readings far from those expected by job, chuck and the newest part.

    `job` has jaw 1 as found. Raises `ProfileError`: the readings do not suffice.
    """
    known = _replay_history(job, machine, () if learned is None else (learned,)).predict_clamping(REPEATS_SD_UM)
    return warn_of_surprise(known, evaluate_readings(readings, job), job.jaws)


def lobe_sd_um(
    job: Job, machine: MachineProfile, learned: LearnedCompensation | None, places: int
) -> tuple[float, float]:
    """Return how well the lobe of the next part is known, without and with a fingerprint of so many places.

    Both are standard deviations of its amplitude, um.
    """
    history = () if learned is None else (learned,)
    known = _replay_history(job, machine, history).predict_clamping(REPEATS_SD_UM)
    return known.sd_um, known.update_by_fingerprint(expected_reading(known, job, places)).sd_um


def ratio_read(read: ClampingReading, lobes: int) -> complex:
    """Return the factor of the lobe."""
    return cmath.rect(read.height, -lobes * math.radians(read.turn_deg))


def _replay_history(job: Job, machine: MachineProfile, history: Sequence[LearnedCompensation]) -> LobeFilter:
    """Return the estimate of the lobe by the job and its parts so far."""
    found = known_lobe(free_state_lobe(job).harmonics[0].coefficient, job, machine, PRIOR_FRACTION, PRIOR_DEG)
    for part in (each.part for each in history):
        if part is not None:
            found = _with_part(found.predict_clamping(REPEATS_SD_UM), part, job.jaws)
    return found


def _with_part(known: LobeFilter, part: PartReading, lobes: int) -> LobeFilter:
    ratio = 1.0 + 0j
    if part.clamped is not None:
        ratio = ratio_read(part.clamped, lobes)
        known = known.update_by_fingerprint(
            MeasuredCoefficient(value=part.clamped.felt.coefficient, sd_um=part.clamped.felt_sd_um)
        )
    done = ratio * part.target.coefficient
    plain = ratio * part.lobe.coefficient + done
    return known.update_by_part(
        MeasuredCoefficient(value=plain, sd_um=math.hypot(part.lobe_sd_um, REPEATS_SD_UM)), done
    )


def _turn_fingerprint(found: ClampingFingerprint, lobes: int, by_deg: float) -> ClampingFingerprint:
    def turned(seen: MeasuredCoefficient, order: int) -> MeasuredCoefficient:
        turn = cmath.exp(-1j * order * math.radians(by_deg))
        return replace(seen, value=seen.value * turn, along=None if seen.along is None else seen.along * turn)

    return replace(
        found, seen=turned(found.seen, lobes), others={n: turned(each, n) for n, each in found.others.items()}
    )


def _format_clamping(clamped: ClampingCorrection, lobes: int) -> str:
    """Return the line that says how a part was clamped, with the phases in spindle angle as in the job's file."""
    turn_deg = -math.degrees(cmath.phase(clamped.ratio)) / lobes
    shown = PathHarmonic.from_coefficient(lobes, clamped.felt.value)
    words = [
        f"height={abs(clamped.ratio):.6f}",
        f"turn={turn_deg:.4f}",
        f"felt={shown.amplitude_um:.4f}@{shown.phase_deg:.4f}",
        f"sd={clamped.felt.sd_um:.4f}",
    ]
    for n, coefficient in sorted(clamped.added_um.items()):
        order = PathHarmonic.from_coefficient(n, coefficient)
        words.append(f"{n}={order.amplitude_um:.4f}@{order.phase_deg:.4f}")
    return " ".join(words)
