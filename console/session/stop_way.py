"""Whether stops still have the connection that they were given, told as an alarm."""

from __future__ import annotations

from console.session.workplace import Workplace
from drivers.stop import way_problems


def watch_stop_way(place: Workplace) -> None:
    """Say once that the connection for stops is lost: every stop still goes, but another cut is not begun."""
    problems = way_problems(place.lathe.stop.way)
    if not problems:
        place.end_alarms("stops.connection_lost")
        return
    place.tell(armed=None)
    for problem in problems:
        if not any(alarm.active and alarm.problem == problem for alarm in place.state.alarms):
            place.alarm(problem)
