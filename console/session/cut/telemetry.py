"""Telemetry of a cut while the tool is in the part: its figures, the phase lag of the tool, the speed ripple."""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from console.session.cut.cut_verdict import NO_VERDICT, CutVerdict
from drivers.cutting.planning import CutPlan
from drivers.lathe.snapshot import Snapshot
from profiles.compensations.learned_compensation import PartReading
from profiles.compensations.path import LobedPath, target_path
from profiles.compensations.push import left_push
from profiles.job import Job
from profiles.least_squares import Fit, fit, harmonic_columns, phasors
from profiles.machine import MachineProfile

LEAST_PEAK_UM = 1.0
"""Floor of the peak tool error: below it, twice the error does not mean that the tool is retracting."""

Floats = NDArray[np.float64]

TURNS_TO_FULL_CHIP = 2.0
"""Turns in the part after which the tool is deflected as in the rest of the cut."""

PHASE_SAMPLES = 20  # fewest samples from which a phase is fitted
BLANK_SAMPLES = 45  # fewest from which an eccentric and an oval blank are fitted, too: three a term
MEANS = 7  # places among them at which the mean is free
TOLERANCE_FRACTION = 0.8
"""Fraction of the roundness tolerance that phase alone may use: a servo by its model leaves 0.5 of 5 um of 55."""

MEASURABLE_UM = 2.0  # smallest difference that can be measured on a part, um peak to peak
SURE = 2.0  # coverage factor: the uncertainty of the fit in standard deviations, 95 %

Row = tuple[float, float, float, float, float]
"""Time in s; tool and spindle in counts; distance past the middle of the cut in mm; following error in counts."""


STRETCHES = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class CutStretch:
    """A stretch of a cut, Z in mm in front of the jaws: it begins at its end towards the free end.

    `error_um` is the largest distance of the tool from its target path in it, None before it was polled there.
    """

    from_z_mm: float
    to_z_mm: float
    error_um: float | None = None


def planned_stretches(job: Job) -> tuple[CutStretch, ...]:
    """Return equal stretches of the cut of a job in the order in which they are cut."""
    ends = [job.overhang_mm - job.cut_length_mm * end / STRETCHES for end in range(STRETCHES + 1)]
    return tuple(CutStretch(from_z_mm=first, to_z_mm=last) for first, last in itertools.pairwise(ends))


def with_error(stretches: tuple[CutStretch, ...], past_face_mm: float, error_um: float) -> tuple[CutStretch, ...]:
    """Return the stretches with an error, um, of the tool this far past the face of the part."""
    fraction = past_face_mm / (stretches[0].from_z_mm - stretches[-1].to_z_mm)
    place = min(max(int(STRETCHES * fraction), 0), STRETCHES - 1)
    here = replace(stretches[place], error_um=max(abs(error_um), stretches[place].error_um or 0.0))
    return (*stretches[:place], here, *stretches[place + 1 :])


def stretches_event(stretches: tuple[CutStretch, ...]) -> dict[str, object]:
    """Return the stretches as JSON and the record have them."""
    return {"stretches": [asdict(each) for each in stretches]}


@dataclass(frozen=True, slots=True, kw_only=True)
class CutFigures:
    """Figures of one cut, from the controller's own positions.

    `tool_error_um` is the largest distance of the actual tool from the target path at the spindle angle of that
    instant; `following_error_um` is the largest distance of the actual tool from its commanded position. A path
    commanded ahead of the servo's lag has a large following error and a small tool error. `tool_lobe_um` is the
    harmonic of the tool error at the order of the lobe, once the chip is full: Re(c exp(j N angle)), spindle
    angles, infeed positive; 0 where too few polls fell into the cut. `push_um` is what the cut has pushed the tool
    at its entry, beyond what the path makes up for. `stretches` have the tool error along Z. `verdict` is that on
    the whole cut.
    """

    spindle_speed_rpm: float
    tool_error_um: float
    tool_error_rms_um: float
    following_error_um: float
    following_error_rms_um: float
    samples: int
    tool_lobe_um: complex = 0j
    push_um: float = 0.0
    stretches: tuple[CutStretch, ...] = ()
    verdict: CutVerdict = NO_VERDICT

    def event(self) -> dict[str, object]:
        """Return verdict and stretches as JSON and the record have them."""
        return {**self.verdict.event(), **stretches_event(self.stretches)}


def is_leaving(error_um: float, peak_um: float) -> bool:
    """Whether a tool commanded to end the cut is retracting: no earlier error was as large."""
    return abs(error_um) > 2.0 * max(peak_um, LEAST_PEAK_UM)


class Telemetry:
    """Collect the snapshots taken while the carriage is over the part and the tool is in it."""

    def __init__(self, plan: CutPlan, machine: MachineProfile, job: Job) -> None:
        self._plan, self._machine, self._job = plan, machine, job
        self._counts_per_mm = machine.carriage.counts_per_mm
        end = plan.carriage_start + plan.setup.carriage_counts
        length = job.cut_length_mm * machine.carriage.counts_per_mm
        # The last turn is left out: the tool may already be retracting.
        self._first, self._last = end - length, end - plan.setup.carriage_per_turn
        self._over = False
        self._rows: list[Row] = []

    def see(self, snapshot: Snapshot, *, holding: bool) -> None:
        """Take what belongs to the cut; `holding` means that the program was asked to end after this turn."""
        row = self._row(snapshot)
        if self._rows and (snapshot.tool.position < self._plan.setup.surface or (holding and self._leaves(row))):
            # A program may return over the part with the tool out: the cut is over.
            self._over = True
        if self._over or not snapshot.program_running:
            return
        if self._first <= snapshot.carriage.position <= self._last:
            self._rows.append(row)

    def _row(self, snapshot: Snapshot) -> Row:
        tool, spindle = snapshot.tool, snapshot.spindle
        past_mm = (snapshot.carriage.position - self._plan.setup.carriage_middle) / self._counts_per_mm
        return snapshot.at_s, tool.position, spindle.position, past_mm, tool.following_error

    def _leaves(self, row: Row) -> bool:
        """Whether a hold retracts the tool while the carriage is still over the part."""
        return is_leaving(self._errors_um([row])[0], np.abs(self._errors_um(self._rows)).max())

    def _errors_um(self, rows: list[Row]) -> Floats:
        """Return the tool against the target path at the spindle angle of each row, infeed positive."""
        _, tool, spindle, past_mm, _ = np.array(rows, dtype=np.float64).T
        infeed_um = (tool - self._plan.setup.surface) * self._machine.tool.count_um
        angle_deg = 360.0 * spindle / self._machine.spindle.counts_per_rev
        return np.asarray(infeed_um - self._plan.target.at_um(angle_deg, past_mm))

    def figures(self) -> CutFigures | None:
        """Return the figures, None when fewer than two polls fell into the cut."""
        if len(self._rows) < 2:
            return None
        at_s, _, spindle, _, following = np.array(self._rows).T
        turns = spindle / self._machine.spindle.counts_per_rev
        error_um = self._errors_um(self._rows)
        following_um = following * self._machine.tool.count_um
        lobe_um, push_um = self._lobe_and_push(error_um)
        _, turns_per_s = fit(harmonic_columns(at_s, (), at_s - at_s[0]), turns).coefficients
        return CutFigures(
            # The slope through all polls: the time of a single one is known to some milliseconds only.
            spindle_speed_rpm=60.0 * float(turns_per_s),
            tool_error_um=float(np.abs(error_um).max()),
            tool_error_rms_um=float(np.sqrt(np.mean(error_um**2))),
            following_error_um=float(np.abs(following_um).max()),
            following_error_rms_um=float(np.sqrt(np.mean(following_um**2))),
            samples=len(self._rows),
            tool_lobe_um=lobe_um,
            push_um=push_um,
            stretches=self._stretches(error_um),
        )

    def _stretches(self, error_um: Floats) -> tuple[CutStretch, ...]:
        stretches, half_mm = planned_stretches(self._job), 0.5 * self._job.cut_length_mm
        for (_, _, _, past_mm, _), each_um in zip(self._rows, error_um.tolist(), strict=True):
            stretches = with_error(stretches, past_mm + half_mm, each_um)
        return stretches

    def _lobe_and_push(self, error_um: Floats) -> tuple[complex, float]:
        """Return the error at the order of the lobe, and the push of the cut from what no order makes."""
        turns, past_mm, steady = self._steady()
        if np.count_nonzero(steady) < PHASE_SAMPLES:
            return 0j, 0.0
        lobes = self._plan.target.lobes
        found, columns, orders = _fit_orders(2.0 * np.pi * turns[steady], error_um[steady], lobes)
        lobe = phasors(found.coefficients, orders, trends=MEANS - 1)[lobes]
        if self._plan.in_air:
            return lobe, 0.0
        short_um = columns[:, MEANS:] @ found.coefficients[MEANS:] - error_um[steady]
        return lobe, left_push(self._job, self._machine, past_mm[steady].tolist(), short_um.tolist()).um

    def _steady(self) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Return turns and places of the polls, and in which of them the chip is full."""
        _, _, spindle, past_mm, _ = np.array(self._rows).T
        turns = spindle / self._machine.spindle.counts_per_rev
        return turns, past_mm, np.abs(turns - turns[0]) >= TURNS_TO_FULL_CHIP


Lag = tuple[float, float]
"""Least and most lag of the tool behind its path that spoils nothing, spindle degrees; negative: it leads."""

NO_LAG: Lag = (0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseLag:
    """Phase lag of the tool behind the target path, spindle degrees, and its uncertainty.

    `of_blank` is whether an eccentric and an oval blank are in that uncertainty: too few samples to fit them.
    """

    error_deg: float
    within_deg: float
    of_blank: bool = False


def phase_of(samples: Floats, target: LobedPath) -> PhaseLag | None:
    """Return the phase lag of the tool behind `target`.

    `samples` has rows of spindle angle (deg) and infeed (um), oldest first. The best sine of the lobe's order
    through them (least squares) is compared with the target; None with too few samples, or without a lobe. The
    residual gives the uncertainty of the phase. The mean infeed may change meanwhile, as where the part begins and
    pushes the tool off: 25 um in some turns would otherwise shift the phase by 1.6 degrees of three lobes.
    """
    if len(samples) < PHASE_SAMPLES or target.amplitude_um == 0.0:
        return None
    lobes = target.lobes
    found, columns, orders = _fit_orders(np.radians(samples[:, 0]), samples[:, 1], lobes)
    coefficient = phasors(found.coefficients, orders, trends=MEANS - 1)[lobes]
    amplitude_um = abs(coefficient)
    if amplitude_um < 0.1 * target.amplitude_um:
        return None
    behind_deg = math.degrees(-cmath.phase(coefficient)) / target.lobes - target.phase_deg
    across = np.zeros(columns.shape[1])
    across[MEANS : MEANS + 2] = np.array([coefficient.imag, coefficient.real]) / amplitude_um**2
    return PhaseLag(
        error_deg=math.remainder(behind_deg, 360.0 / target.lobes),
        within_deg=SURE * math.degrees(found.sd_along(across)) / target.lobes,
        of_blank=len(orders) == 1,
    )


def _fit_orders(angle: Floats, values: Floats, lobes: int) -> tuple[Fit, Floats, tuple[int, ...]]:
    """Fit values at spindle angles (rad) by a mean that changes and by orders; return fit, columns and orders.

    The orders are that of the lobe, and those that an eccentric and an oval blank add: left in the residual they
    are uncertainty, and at the angles polled they leak into the lobe. Of few samples it is that of the lobe alone.
    """
    orders = (lobes, *sorted({1, 2, 2 * lobes} - {lobes})) if len(angle) >= BLANK_SAMPLES else (lobes,)
    columns = np.hstack([_slowly(len(angle)), harmonic_columns(angle, orders)[:, 1:]])
    return fit(columns, values), columns, orders


def _slowly(count: int) -> Floats:
    """Return the columns of a mean that changes between samples: hat functions at equal distances, sum 1."""
    at = np.linspace(0.0, MEANS - 1.0, count)[:, None]
    return np.maximum(0.0, 1.0 - np.abs(at - np.arange(MEANS)))


def phase_limit_deg(target: LobedPath, tolerance_um: float) -> float | None:
    """Return the limit of the phase error, spindle degrees either way; None if no phase spoils the part.

    A sine of N lobes and amplitude A that is cut dphi late leaves the difference of the two, a sine of its own, of
    peak-to-peak height 2 * A * 2 * sin(N * dphi / 2): 2.9 um of 55 at 1 degree and three lobes. The limit is
    the dphi at which that is R,

        dphi = 2 / N * asin(R / (4 * A))

    with R = 0.8 of the roundness tolerance, but never tighter than what can be measured (2 um), and never looser
    than the tolerance. Where even the opposite phase, 4 * A, leaves no more than R there is no limit: the lobe is
    nothing to the part.
    """
    residual_um = min(max(TOLERANCE_FRACTION * tolerance_um, MEASURABLE_UM), tolerance_um)
    most_um = 4.0 * target.amplitude_um
    if most_um <= residual_um:
        return None
    return math.degrees(2.0 / target.lobes * math.asin(residual_um / most_um))


def lag_left_um_pp(target: LobedPath, lag_deg: float) -> float:
    """Return what a lag leaves of the lobe on the part, um p-p, see `phase_limit_deg`."""
    return 4.0 * target.amplitude_um * abs(math.sin(0.5 * target.lobes * math.radians(lag_deg)))


def is_in_phase(phase: PhaseLag | None, limit_deg: float | None, expected: Lag = NO_LAG) -> bool | None:
    """Return whether the phase may be within its limit, given its uncertainty; None if it is unknown.

    An uncertainty above the limit that is not of the blank is no noise: such a tool does not follow the lobe, so
    the allowance is capped at the limit once more.

    `expected` is the lag that learning counts on.
    """
    if phase is None:
        return None
    beyond_deg = abs(unexpected_deg(phase.error_deg, expected))
    if limit_deg is None:
        return True
    allowance_deg = 2.0 * phase.within_deg if phase.of_blank else min(phase.within_deg, limit_deg)
    return beyond_deg - allowance_deg <= limit_deg


def unexpected_deg(lag_deg: float, expected: Lag) -> float:
    """Return how much a lag differs from the expected one, spindle degrees, late positive."""
    return lag_deg - min(max(lag_deg, expected[0]), expected[1])


def expected_lag(target: LobedPath, job: Job, part: PartReading | None, fraction: float = 1.0) -> Lag:
    """Return the lag behind `target` that learning counts on; `part` has taught the path, None: nothing learned.

    A part does not tell whether the tool was off its path or the lobe elsewhere. The path learned from it makes
    the next one round if the tool is off by as many um again, at the same place of the lobe; `fraction` is that of
    the compensation that is cut. Where that was not recorded, a good part is made by a tool anywhere between the
    path of the job and the learned one.
    """
    of_job, lobes = target_path(job), target.lobes
    if part is None or of_job.lobes != lobes or 0.0 in (of_job.amplitude_um, target.amplitude_um):
        return NO_LAG
    if part.tool is None:
        lead_deg = math.remainder(of_job.phase_deg - target.phase_deg, 360.0 / lobes)
        return min(lead_deg, 0.0), max(lead_deg, 0.0)
    off_um = part.tool.coefficient * cmath.exp(1j * lobes * math.radians(part.target.phase_deg))
    lag_deg = -math.degrees(cmath.phase(target.amplitude_um + off_um * fraction / part.fraction)) / lobes
    return lag_deg, lag_deg


ORDERS = range(1, 7)
"""Ripple harmonics per revolution that are fitted: belts, jaws, gears, poles. Faster ones are left out."""

RIPPLE_SAMPLES = 40  # nearly three times the number of unknowns in the fit
WITHIN_LIMIT_PERCENT = 1.0  # a ripple with a larger uncertainty than this is not reported
LEAST_SPREAD = 0.05
"""Smallest over largest singular value of the fit; below it the samples are too close together in the turn."""

DEVIATIONS = 7.0
"""Standard errors by which chance may spoil the figure: 3.5 at the fastest place of a turn, which is sought among
all of them, and as many at the slowest."""


@dataclass(frozen=True, slots=True)
class SpindleRipple:
    """Peak to peak of the speed within a turn over its mean, and its uncertainty, both in percent."""

    percent: float
    within_percent: float


def spindle_ripple(samples: Floats, counts_per_rev: float) -> SpindleRipple | None:
    """Return the ripple of the speed over the angle, None where its uncertainty exceeds `WITHIN_LIMIT_PERCENT`.

    `samples` has rows of position and following error, counts, of a spindle that is commanded to turn evenly. Its
    lead is fitted over the angle (least squares), beside a lag that may drift; the slope of that is the
    ripple of the speed. Its standard error comes from the residual; samples at too few angles of a turn are
    rejected. The rounding of the encoder is added (`_rounding_ripple`).

    Not from the times of the samples. A sample was taken somewhere between request and reply: 5 ms are 30 deg at
    1000 rpm, and a speed that swings by 1 % twice a turn moves the angle by 0.29 deg. From 240 samples a ripple
    could be determined to some 90 %. The following error comes with the angle in one reply, and while the
    controller commands an even speed it is the ripple itself, to a count of the encoder. A ms between the two only
    turns the ripple by some degrees. A spindle not driven by the controller has no following error, and no ripple
    is reported.
    """
    if len(samples) < RIPPLE_SAMPLES:
        return None
    count_rad = 2.0 * np.pi / counts_per_rev
    angle, ahead = samples[:, 0] * count_rad, -samples[:, 1] * count_rad
    drift = (angle - angle.mean()) / max(float(np.ptp(angle)), count_rad)
    found = fit(harmonic_columns(angle, ORDERS, drift), ahead)
    if found.condition * LEAST_SPREAD >= 1.0:
        return None
    swing = _SLOPES @ found.coefficients
    error = np.sqrt(np.einsum("ij,jk,ik->i", _SLOPES, found.covariance, _SLOPES).max())
    within_percent = 100.0 * (DEVIATIONS * float(error) + _rounding_ripple(count_rad))
    if within_percent > WITHIN_LIMIT_PERCENT or swing.max() >= 1.0:
        return None
    # The ripple is over the true angle: d(true - even) / d(true), and so the speed is 1 / (1 - ripple) of the
    # mean.
    speed = 1.0 / (1.0 - swing)
    return SpindleRipple(percent=100.0 * float(np.ptp(speed)), within_percent=within_percent)


def _rounding_ripple(count_rad: float) -> float:
    """Return the ripple, peak to peak, that rounding to whole counts can make: 0.45 % for 10 000 counts a turn.

    The rounding error is a saw tooth over the counts. With evenly timed samples it may alias to one over the turn:
    its harmonics, the n-th of 1 / (n pi) counts, are then taken for ripple; at the worst the largest for the
    highest order, and so on.
    """
    worst = sum(order / harmonic for harmonic, order in enumerate(reversed(ORDERS), start=1))
    return 2.0 * worst * count_rad / np.pi


def _slopes(angle: Floats) -> Floats:
    """Return the slopes of the fit's columns over the angle; mean and drift have none."""
    none = np.zeros_like(angle)
    pairs = ((-order * np.sin(order * angle), order * np.cos(order * angle)) for order in ORDERS)
    return np.column_stack([none, none, *itertools.chain.from_iterable(pairs)])


_SLOPES = _slopes(2.0 * np.pi * np.arange(180) / 180)
