"""When to offer the fingerprint of a clamping: what it costs, and by how much better it knows the lobe."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from console.session.cut.alignment import AlignStep
from console.session.guide.situation import Situation
from console.session.guide.start_checks import is_over
from console.session.learning.fingerprint import lobe_sd_um
from console.session.learning.learning_steps import scatter_um
from console.session.stages import Stage
from console.session.work import Work
from drivers.cutting.strategy import Strategy
from drivers.preview.band import predicted_band
from profiles.compensations.learning import SURE
from profiles.compensations.next_version import half_width_um_pp
from profiles.fingerprint.deflection import places_needed
from profiles.job import NO_LOBE
from profiles.problem import ProblemError
from profiles.same_objects import SameObjects

READING_S, LINE_READING_S = 15.0, 8.0
"""For one reading, typed, or of an indicator on a serial line: turn the part by hand, wait, read; assumed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FingerprintOffer:
    """The lobe of this part is known within `now_um`, or `then_um` by readings at `places`; 95 %, um p-p."""

    places: int
    now_um: float
    then_um: float

    def minutes(self, *, reads_itself: bool) -> float:
        """Return how long the readings take, in both states."""
        return 2 * self.places * (LINE_READING_S if reads_itself else READING_S) / 60.0


def fingerprint_offer(now: Situation) -> FingerprintOffer | None:
    """Return the offer for a blank that is clamped and not read yet, None where it gains little.

    It gains where the scatter of the clamping is most of what is expected to be left, as Preview judges that: by
    its band, or by the part that the path was learned from.
    """
    state, work = now.state, now.work
    if work is None or state.alignment.clamping is None or state.alignment.readings is not None:
        return None
    if now.step in (AlignStep.VERIFY, AlignStep.CLAMP) or state.armed is not None or is_over(state):
        return None
    return _offer(SameObjects(work, work.outlook))


@lru_cache(maxsize=2)
def _offer(key: SameObjects[Work, object]) -> FingerprintOffer | None:
    work, job, machine = key.one, key.one.job, key.one.machine.machine
    strategy = Strategy(work.strategy)
    if not strategy.traits.inverts or work.stage == Stage.AIR or job.lobe_error_source == NO_LOBE:
        return None
    places = places_needed(job.jaws) + 1
    try:
        if not _clamping_is_most(work, strategy):
            return None
        now_um, then_um = (2.0 * SURE * each for each in lobe_sd_um(job, machine, work.compensation, places))
    except ProblemError:  # arming refuses such a job with the reason
        return None
    return FingerprintOffer(places=places, now_um=now_um, then_um=then_um)


def _clamping_is_most(work: Work, strategy: Strategy) -> bool:
    part = None if work.compensation is None else work.compensation.part
    if part is not None:
        of_clamping = half_width_um_pp(0.0, scatter_um(work.job, work.machine.machine))
        return of_clamping > half_width_um_pp(part.lobe_sd_um, 0.0)
    band = None if work.outlook is None else predicted_band(work.outlook, strategy)
    return band is not None and band.clamping_um > max(
        band.servo_um, band.cutting_um or 0.0, band.friction_um, band.spindle_um
    )
