"""What can be seen at the chuck of a simulated workshop: for the screens, with an alarm for each collision."""

from __future__ import annotations

from console.session.station.alarms import COLLISION_CODES, Priority, collision_problems
from console.session.station.context import StationContext
from console.session.station.state import MOVING
from drivers.errors import LinkError

SIGHT_PERIOD_S = 0.15
"""Between two looks at the chuck."""

SIGHT_PERIOD_IN_MOTION_S = 1.0
"""The same while something moves, when polls and leases come first; what the tool runs into is to be told."""


class ChuckSight:
    """Looks at the chuck now and then."""

    def __init__(self, place: StationContext) -> None:
        self._place, self._seen_s = place, float("-inf")
        self._met: tuple[str, ...] = ()

    def look_now(self) -> None:
        """Look whenever the last time was: what is seen belongs to the end of an order, not to a moment before."""
        self._seen_s = float("-inf")
        self.look()

    def look(self) -> None:
        """Look, unless that was done a moment ago."""
        place = self._place
        now_s = place.clock.now_s()
        period_s = SIGHT_PERIOD_IN_MOTION_S if place.state.activity in MOVING else SIGHT_PERIOD_S
        if place.shop is None or now_s - self._seen_s < period_s:
            return
        self._seen_s = now_s
        try:
            view = place.shop.look()
        except LinkError as error:
            # Eyes on the chuck are no part of the machine: it is told, and nothing else depends on it.
            place.tell(seen=None)
            if not place.alarmed(error.problems[0].code):
                place.alarm(error.problems[0], Priority.MEDIUM)
        else:
            place.tell(seen=view)
            place.end_alarms("simulator.gone", "simulator.refused")
            self._tell_collisions(view.collisions)

    def _tell_collisions(self, met: tuple[str, ...]) -> None:
        """Raise an alarm for each collision once; a new blank has met nothing."""
        place, known = self._place, self._met
        self._met = met
        if known and not met:
            place.end_alarms(*COLLISION_CODES)
        fresh = [kind for kind in met if kind not in known]
        for kind, problem in zip(fresh, collision_problems(fresh), strict=True):
            place.alarm(problem)
            place.note_anyway("collision", met=kind)
