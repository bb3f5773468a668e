"""Learning beside a cut: gather tool positions in batches, and request a trim."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from console.session.errors import SessionError
from drivers.cutting.planning import CutPlan
from drivers.cutting.sampling import LEAST_SAMPLES_A_LOBE, Batch, BatchGather
from drivers.cutting.strategy import Strategy
from drivers.errors import DriverError
from drivers.identification.nominal import nominal_response
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.programs.cam_trim import MOST_TRIM_UM, OVAL, beside_order
from profiles.compensations.learning import Deviation, HarmonicFit, next_trim_um
from profiles.compensations.push import Push, entry_push_um, left_push
from profiles.compensations.trim_response import TrimResponse
from profiles.job import Job
from profiles.problem import Problem, ProfileError

AIR_BATCH_S, CUT_BATCH_S = 1.0, 0.25
FACE_BATCH_TURNS = 2  # of the first batch in the part: what a blank makes is trimmed away close behind its face
TRIM_GAIN = 0.7
ROUNDED = 1e-6  # of a trim at its limit: its number must not be above that

TRIM_LIMIT_UM = MOST_TRIM_UM  # of the program that is trimmed
MOST_NEEDED_UM = 2.0 * TRIM_LIMIT_UM
"""Trim beyond which tool or drive are broken: it ends the cut. Between the two the trim stays at its limit."""

HELD_FOR = ("learning.trim_limit", "learning.few_samples", "gather.failed")
"""Problems that end a cut as a hold does: the machine is sound, only the learning has failed."""


def blank_orders(lobes: int) -> frozenset[int]:
    """Return the orders of the tool's error that a blank makes, which are trimmed and not learned."""
    return frozenset({OVAL, beside_order(lobes)})


class AirWatch:
    """Gather one long batch in air."""

    def __init__(self, lathe: Lathe, lobes: int, samples_a_turn: int | None = None) -> None:
        self._gather: BatchGather = lathe.program.batches()
        self._samples_a_turn = samples_a_turn or LEAST_SAMPLES_A_LOBE * lobes
        self._batches: list[Batch] = []

    def begin(self, plan: CutPlan) -> None:
        """Set up gathering on the controller."""
        self._gather.prepare(plan, self._samples_a_turn, AIR_BATCH_S, self._batches.append)

    def see(self, snapshot: Snapshot) -> None:
        """Continue gathering."""
        self._gather.see(snapshot)

    def last(self) -> Batch:
        """Return the gathered samples; `learning.nothing_gathered` if there are none."""
        self._gather.finish()
        if not self._batches:
            raise SessionError(Problem(code="learning.nothing_gathered"))
        return self._batches[-1]


class CutLearner:
    """Trim a cut by the measured tool error, a batch at a time: the lobe if it `trims`, the blank's `oval`."""

    def __init__(
        self,
        lathe: Lathe,
        job: Job,
        off: Callable[[Batch], HarmonicFit],
        *,
        samples_a_turn: int,
        trims: bool = True,
        oval: bool = True,
    ) -> None:
        self._samples_a_turn = samples_a_turn
        self._lathe, self._job, self._off, self._trims = lathe, job, off, trims
        self._oval, self._beside = oval, beside_order(job.jaws)
        self._gather = lathe.program.batches()
        batch_mm = CUT_BATCH_S * job.feed_mm_per_rev * job.spindle_speed_rpm / 60.0
        # Before the tool is in the part no chip presses it: a trim of that would be wrong in the cut.
        self._face_mm = -0.5 * (job.cut_length_mm + lathe.machine.tool.wiper_land_mm)
        self._in_part_mm = 0.5 * (batch_mm - job.cut_length_mm)
        self._turn_s = 60.0 / job.spindle_speed_rpm
        rate_hz = job.spindle_speed_rpm / 60.0
        self._response, self._oval_response = (
            TrimResponse(nominal=nominal_response(Strategy.PVT, lathe.machine, order * rate_hz))
            for order in (job.jaws, self._beside)
        )
        self._found: list[tuple[float, HarmonicFit, complex, Mapping[int, float]]] = []
        # By how much the trim of an order was at its limit: now, and in the middle.
        self._short_um: Mapping[int, float] = {}
        self.short_um: Mapping[int, float] = {}
        self._over = False
        self._failed: DriverError | ProfileError | None = None
        self.trim_um, self.oval_um = 0j, 0j

    def begin(self, plan: CutPlan) -> None:
        """Set up gathering on the controller: the first batch a turn after the tool's edge is in the part."""
        setup, machine = plan.setup, self._lathe.machine
        land = machine.tool.wiper_land_mm * machine.carriage.counts_per_mm
        self._gather.prepare(
            plan,
            self._samples_a_turn,
            CUT_BATCH_S,
            self._take,
            from_counts=setup.carriage_face - 0.5 * land + setup.carriage_per_turn,
            first_s=FACE_BATCH_TURNS * self._turn_s,
        )

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
        self._found.append((batch.past_middle_mm, found, self.trim_um, self._short_um))
        if self._over or batch.past_middle_mm < self._face_mm:
            return
        self._short_um = {}
        error_um = found.coefficients_um
        if self._trims:
            lobe_um = error_um[self._job.jaws]
            self._response = self._response.add_batch(self.trim_um, lobe_um)
            self.trim_um = self._next(self._job.jaws, self.trim_um, lobe_um, self._response.value)
        if self._oval:
            oval_um = error_um[self._beside]
            self._oval_response = self._oval_response.add_batch(self.oval_um, oval_um)
            self.oval_um = self._next(self._beside, self.oval_um, oval_um, self._oval_response.value)
        if self._trims or self.oval_um:
            self._lathe.program.trim(self.trim_um, self.oval_um)

    def _next(self, order: int, trim_um: complex, error_um: complex, response: complex) -> complex:
        """Return the next trim; one beyond the limit of the program stays there, and is told after the cut."""
        needed_um = next_trim_um(trim_um, error_um, response, TRIM_GAIN, MOST_NEEDED_UM)
        if abs(needed_um) <= MOST_TRIM_UM:
            return needed_um
        self._short_um = {**self._short_um, order: abs(needed_um) - MOST_TRIM_UM}
        return needed_um * (1.0 - ROUNDED) * MOST_TRIM_UM / abs(needed_um)

    def left_push(self) -> Push:
        """Return the push of the cut that the path has not made up for, from the batches in the part."""
        in_part = [each for each in self._found if each[0] >= self._in_part_mm]
        places, errors = [each[0] for each in in_part], [each[1].mean_um for each in in_part]
        return left_push(self._job, self._lathe.machine, places, errors)

    def entry_push_um(self) -> float:
        """Return the push of a cut too short to show its decay."""
        places, errors = [each[0] for each in self._found], [each[1].mean_um for each in self._found]
        return entry_push_um(self._job, self._lathe.machine, places, errors)

    def in_the_middle(self) -> tuple[Deviation, complex]:
        """Return the tool error and the trim where the part is measured, or raise what has ended the cut."""
        if self._failed is not None:  # it has ended the cut
            raise self._failed
        self._over = True
        self._gather.finish()  # fetch what a slow line has not transferred during the cut
        if not self._found:
            raise SessionError(Problem(code="learning.nothing_gathered"))
        _, nearest, trim_um, self.short_um = min(self._found, key=lambda each: abs(each[0]))
        off = Deviation(
            mean_um=nearest.mean_um, coefficients_um=nearest.coefficients_um, sd_um=nearest.amplitude_sd_um
        )
        return off, trim_um
