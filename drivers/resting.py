"""The proof that a machine rests after a stop: the stop goes out again until the controller says so."""

from __future__ import annotations

from collections.abc import Callable

from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.link.base import GONE
from drivers.looks import Looks
from drivers.snapshot import Snapshot
from drivers.stop import StopPath
from profiles.problem import Problem

REST_TIMEOUT_S = 15.0
COAST_TIMEOUT_S = 60.0
STOP_REPEAT_S = 0.2
LOOKS_AT_REST = 3
REST_BAND_COUNTS = 1.0
"""Rest is so many looks in a row, between which no axis has gone further than this."""


def prove_rest(looks: Looks, stop: StopPath, clock: Clock, end_guard: Callable[[], None]) -> Snapshot:
    """Look at the machine until it is proven to rest, and repeat the stop while it is not.

    After control-K every loop must be open as well, and a spindle may take its time to run out. A look that fails
    is no proof: the stop goes out again, and the next look is tried. So is a stop that somebody sends meanwhile:
    the proof begins anew. `end_guard` tells the card that nothing is guarded any more; it must not raise. Who has
    to end this process waits no longer than until `leave_by_s` of the stop.

    Raises:
        DriverError: `machine.not_at_rest`.
        LinkError: `link.lost`, there is nobody to ask any more.
    """
    began_s = clock.now_s()
    before: Snapshot | None = None
    mark, looks_at_rest = stop.mark, 0
    while clock.now_s() < min(began_s + _timeout_s(stop), stop.leave_by_s):
        if stop.mark != mark:
            mark, looks_at_rest = stop.mark, 0
        try:
            snapshot = _look(looks)
        except DriverError:
            stop.given_up = True
            raise
        if snapshot is not None:
            end_guard()
        proven = snapshot is not None and snapshot.at_rest and (snapshot.loops_open or not stop.killed)
        if not proven:
            stop.repeat()
        still = snapshot is not None and before is not None and snapshot.near(before, REST_BAND_COUNTS)
        looks_at_rest = looks_at_rest + 1 if proven and still else 0
        if snapshot is not None and mark is not None and looks_at_rest >= LOOKS_AT_REST:
            stop.rest_proven(mark)
            if stop.proven:
                return snapshot
        before = snapshot
        if snapshot is not None:
            clock.wait(STOP_REPEAT_S)
    now_s = clock.now_s()
    stop.given_up = stop.killed or now_s >= stop.leave_by_s
    waited_s = min(now_s - began_s, _timeout_s(stop))
    raise DriverError(Problem(code="machine.not_at_rest", value=f"{waited_s:.0f} s"))


def _timeout_s(stop: StopPath) -> float:
    """Return how long rest may take; a ramp that had to become a kill on the way has the time to run out, too."""
    return COAST_TIMEOUT_S if stop.killed else REST_TIMEOUT_S


def _look(looks: Looks) -> Snapshot | None:
    try:
        return looks.look_once(looks.patience_s)
    except DriverError as error:
        if error.problems[0].code in GONE:
            raise
        return None
