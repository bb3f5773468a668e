"""View of the chuck of a simulated workshop: for the screens, with an alarm for each collision."""

from __future__ import annotations

from console.session.station.alarms import COLLISION_CODES, Priority, collision_problems
from console.session.station.context import StationContext
from console.session.station.state import MOVING
from drivers.errors import LinkError

SIGHT_PERIOD_S = 0.15
"""Sampling period of the chuck view."""

SIGHT_PERIOD_IN_MOTION_S = 1.0
"""The same in motion, when polls and the watchdog come first; collisions must still be reported."""


class ChuckSight:
    """Sample the chuck view periodically."""

    def __init__(self, place: StationContext) -> None:
        self._place, self._seen_s = place, float("-inf")
        self._met: tuple[str, ...] = ()

    def look_now(self) -> None:
        """Sample at once: what is seen belongs to the end of a command, not to a moment before."""
        self._seen_s = float("-inf")
        self.look()

    def look(self) -> None:
        """Sample, unless that was done a moment ago."""
        place = self._place
        now_s = place.clock.now_s()
        period_s = SIGHT_PERIOD_IN_MOTION_S if place.state.activity in MOVING else SIGHT_PERIOD_S
        if place.shop is None or now_s - self._seen_s < period_s:
            return
        self._seen_s = now_s
        try:
            view = place.shop.look()
        except LinkError as error:
            # The chuck view is no part of the machine: a failure is reported, and nothing else depends on it.
            place.tell(seen=None)
            if not place.alarmed(error.problems[0].code):
                place.alarm(error.problems[0], Priority.MEDIUM)
        else:
            place.tell(seen=view)
            place.end_alarms("simulator.gone", "simulator.refused")
            self._tell_collisions(view.collisions)

    def _tell_collisions(self, met: tuple[str, ...]) -> None:
        """Raise an alarm once for each collision; a new blank starts without any."""
        place, known = self._place, self._met
        self._met = met
        if known and not met:
            place.end_alarms(*COLLISION_CODES)
        fresh = [kind for kind in met if kind not in known]
        for kind, problem in zip(fresh, collision_problems(fresh), strict=True):
            place.alarm(problem)
            place.note_anyway("collision", met=kind)
