"""Learning beside a cut: gather tool positions in batches, and request a trim."""

from __future__ import annotations

from collections.abc import Callable

from console.session.errors import SessionError
from drivers.cutting.planning import CutPlan
from drivers.cutting.sampling import Batch, BatchGather
from drivers.cutting.strategy import Strategy
from drivers.errors import DriverError
from drivers.identification.nominal import nominal_response
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.programs.cam_trim import MOST_TRIM_UM, OVAL
from profiles.compensations.learning import Deviation, HarmonicFit, trimmed
from profiles.job import Job
from profiles.problem import Problem, ProfileError

AIR_BATCH_S, CUT_BATCH_S = 1.0, 0.25
TRIM_GAIN = 0.7

HELD_FOR = ("learning.trim_limit", "learning.few_samples", "gather.failed")
"""Problems that end a cut as a hold does: the machine is sound, only the learning has failed."""


class AirWatch:
    """Gather one long batch in air."""

    def __init__(self, lathe: Lathe, lobes: int) -> None:
        self._gather: BatchGather = lathe.program.batches()
        self._lobes = lobes
        self._batches: list[Batch] = []

    def begin(self, plan: CutPlan) -> None:
        """Set up gathering on the controller."""
        self._gather.prepare(plan, self._lobes, AIR_BATCH_S, self._batches.append)

    def see(self, snapshot: Snapshot) -> None:
        """Continue gathering."""
        self._gather.see(snapshot)

    def last(self) -> Batch:
        """Return what was gathered; `learning.nothing_gathered` where that is nothing."""
        self._gather.finish()
        if not self._batches:
            raise SessionError(Problem(code="learning.nothing_gathered"))
        return self._batches[-1]


class CutLearner:
    """Trim a cut by the measured tool error, a batch at a time: the lobe if it `trims`, the blank's `oval`."""

    def __init__(
        self, lathe: Lathe, job: Job, off: Callable[[Batch], HarmonicFit], *, trims: bool = True, oval: bool = True
    ) -> None:
        self._lathe, self._job, self._off, self._trims = lathe, job, off, trims
        self._oval = oval and job.jaws != OVAL
        self._gather = lathe.program.batches()
        self._response, self._oval_response = (
            nominal_response(Strategy.PVT, lathe.machine, order * job.spindle_speed_rpm / 60.0)
            for order in (job.jaws, OVAL)
        )
        self._found: list[tuple[float, HarmonicFit, complex]] = []
        self._over = False
        self._failed: DriverError | ProfileError | None = None
        self.trim_um, self.oval_um = 0j, 0j

    def begin(self, plan: CutPlan) -> None:
        """Set up gathering on the controller."""
        self._gather.prepare(plan, self._job.jaws, CUT_BATCH_S, self._take)

    def see(self, snapshot: Snapshot) -> None:
        """Continue gathering. An error in it ends the cut at the end of its turn, tool out first."""
        if self._failed is not None:
            return
        try:
            self._gather.see(snapshot)
        except (DriverError, ProfileError) as error:
            if error.problems[0].code not in HELD_FOR:
                raise
            self._failed = error
            self._lathe.program.end_after_turn()

    def _take(self, batch: Batch) -> None:
        found = self._off(batch)
        self._found.append((batch.past_middle_mm, found, self.trim_um))
        if self._over:
            return
        error_um = found.coefficients_um
        if self._trims:
            lobe_um = error_um[self._job.jaws]
            self.trim_um = trimmed(self.trim_um, lobe_um, self._response, TRIM_GAIN, MOST_TRIM_UM)
        if self._oval:
            self.oval_um = trimmed(self.oval_um, error_um[OVAL], self._oval_response, TRIM_GAIN, MOST_TRIM_UM)
        if self._trims or self.oval_um:
            self._lathe.program.trim(self.trim_um, self.oval_um)

    def in_the_middle(self) -> tuple[Deviation, complex]:
        """Return the tool error and the trim where the part is measured, or raise what has ended the cut."""
        if self._failed is not None:  # it has ended the cut
            raise self._failed
        self._over = True
        self._gather.finish()  # fetch what a slow line has not transferred during the cut
        if not self._found:
            raise SessionError(Problem(code="learning.nothing_gathered"))
        _, nearest, trim_um = min(self._found, key=lambda each: abs(each[0]))
        off = Deviation(
            mean_um=nearest.mean_um,
            coefficients_um=nearest.coefficients_um,
            sd_um=nearest.amplitude_sd_um,
        )
        return off, trim_um
