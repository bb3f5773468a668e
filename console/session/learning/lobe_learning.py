"""The lobe of a row of parts: what its parts, and the fingerprints of their clampings, tell of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from profiles.compensations.learning import REPEATS_SD_UM
from profiles.compensations.optimal_gain import PRIOR_DEG, PRIOR_FRACTION
from profiles.compensations.path import CutPath, free_state_lobe
from profiles.compensations.trial_band import BandCorrection, BandFinding, correct_by_band
from profiles.fingerprint.lobe_filter import LobeFilter, MeasuredCoefficient
from profiles.fingerprint.readings import ClampReadings
from profiles.fingerprint.this_clamping import (
    ClampingCorrection,
    clamped_by,
    clamped_orders,
    clamped_path,
    evaluate_readings,
    known_lobe,
    ratio_of,
    with_added,
)
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProfileError


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftLobe:
    """The lobe that a part has left, um p-p, as two of which it is the sum with their angles.

    `own_um_pp` is of this clamping alone, whose force was off that of the mean by `force_deviation`, a fraction:
    it does not repeat. `repeats_um_pp` is the rest. Both are the most likely values after the parts so far.
    """

    left_um_pp: float
    own_um_pp: float
    repeats_um_pp: float
    force_deviation: float


class LobeLearning:
    """The lobe of one row of parts. Where its job has none, or no grip at speed, nothing is known of it."""

    def __init__(self, job: Job, machine: MachineProfile) -> None:
        self._job = job
        self._filter: LobeFilter | None = None
        self.clamped: ClampingCorrection | None = None
        self.left: LeftLobe | None = None
        self.band: BandCorrection | None = None
        if job.lobe_amplitude_um:
            lobe_um = free_state_lobe(job).harmonics[0].coefficient
            try:
                self._filter = known_lobe(lobe_um, job, machine, PRIOR_FRACTION, PRIOR_DEG)
            except ProfileError:  # no grip: such a job is refused before it is cut
                self._filter = None

    @property
    def known(self) -> bool:
        """Whether anything is known of the lobe."""
        return self._filter is not None

    def clamp(
        self, path: CutPath, readings: ClampReadings | None, response: Callable[[int], complex]
    ) -> tuple[CutPath, CutPath]:
        """Return the path of the mean clamping, and that of the part that is clamped: by its fingerprint."""
        self.clamped = self.band = None
        if self._filter is None:
            return path, path
        self._filter = self._filter.predict_clamping(REPEATS_SD_UM)
        if readings is None:
            return path, path
        lobes = self._job.jaws
        self._filter, self.clamped = clamped_by(self._filter, evaluate_readings(readings, self._job), path, lobes)
        mean = with_added(path, self.clamped.added_um, response)
        return mean, clamped_path(mean, lobes, self.clamped.ratio, response)

    def correct(
        self, mean: CutPath, path: CutPath, found: BandFinding, response: Callable[[int], complex]
    ) -> tuple[CutPath, CutPath]:
        """Return the path of the mean clamping, and that of the part whose trial band shows this."""
        assert self._filter is not None
        lobes, clamped = self._job.jaws, self.clamped
        felt = () if clamped is None else tuple(clamped.added_um)
        self._filter, self.band = correct_by_band(self._filter, found, felt, lobes)
        added, ratio = self.band.added_um, 1.0 + 0j if clamped is None else clamped.ratio
        of_mean = {n: c / ratio_of(n, lobes, ratio) for n, c in added.items()}

        def corrected(old: CutPath, factor: complex, further: Mapping[int, complex]) -> CutPath:
            lobe_um = (factor - 1.0) * old.target.harmonics[0].coefficient
            return with_added(old, {**further, lobes: lobe_um}, response).add_push(found.push_um)

        return corrected(mean, self.band.of_mean, of_mean), corrected(path, self.band.of_this, added)

    def of_mean(self, left_um: Mapping[int, complex], path: CutPath) -> dict[int, complex]:
        """Return what a part with the force of the job would have had left of each order."""
        clamped = self.clamped
        if clamped is None:
            return dict(left_um)
        lobes, made = self._job.jaws, clamped_orders(path, self._job.jaws)
        return {n: c / ratio_of(n, lobes, clamped.ratio) if n in made else c for n, c in left_um.items()}

    def known_now(self, path: CutPath) -> Callable[[int], complex]:
        """Return by order what a path of the mean clamping is times, as that is known with this fingerprint.

        The path before was for another height and angle of the lobe; the part was cut for what is known now.
        """
        if self._filter is None or self.clamped is None or not self._filter.lobe_um:
            return lambda _: 1.0 + 0j
        lobes, band, made = self._job.jaws, self.band, clamped_orders(path, self._job.jaws)
        ratio = self.clamped.ratio * (1.0 if band is None else band.of_this / band.of_mean)
        known = ratio * self._filter.lobe_um / self._filter.this_um
        return lambda n: ratio_of(n, lobes, known) if n in made else 1.0 + 0j

    def update_path(self, left_um: complex, done_um: complex, sd_um: float) -> complex:
        """Return the path of the mean lobe, after a part with `left_um` of it where the tool did `done_um`."""
        assert self._filter is not None
        self._filter = self._filter.update_by_part(
            MeasuredCoefficient(value=left_um + done_um, sd_um=sd_um), done_um
        )
        own_um = self._filter.this_um - self._filter.lobe_um
        self.left = LeftLobe(
            left_um_pp=2.0 * abs(left_um),
            own_um_pp=2.0 * abs(own_um),
            repeats_um_pp=2.0 * abs(left_um - own_um),
            force_deviation=self._filter.force_deviation,
        )
        return self._filter.path_um

    def move(self, by_um: complex) -> None:
        """Expect a mean lobe that has moved, so that its path is another one by so much."""
        assert self._filter is not None
        self._filter = self._filter.move(by_um)
