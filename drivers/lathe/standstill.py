"""The proof that a machine rests: after a stop, and where an axis was sent."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.lathe.polling import Poller
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.base import GONE
from profiles.problem import Problem

REST_TIMEOUT_S = 15.0
COAST_TIMEOUT_S = 60.0
STOP_REPEAT_S = 0.2
POLLS_AT_REST = 3
REST_BAND_COUNTS = 1.0
"""Rest is so many looks in a row, between which no axis has gone further than this."""

ARRIVED_COUNTS = 2.0
"""How far from its target a jog may be commanded to rest; positions are told in tenths of a count."""

SETTLE_S = 15.0
"""How long an axis that rests near its target is given to be in position: thrice the servo's time constant."""

REST_S = 2.0
"""The same where nothing depends on it."""


def prove_rest(looks: Poller, stop: StopPath, clock: Clock, end_guard: Callable[[], None]) -> Snapshot:
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
    mark, polls_at_rest = stop.mark, 0
    while clock.now_s() < min(began_s + _timeout_s(stop), stop.leave_by_s):
        if stop.mark != mark:
            mark, polls_at_rest = stop.mark, 0
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
        polls_at_rest = polls_at_rest + 1 if proven and still else 0
        if snapshot is not None and mark is not None and polls_at_rest >= POLLS_AT_REST:
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


def _look(looks: Poller) -> Snapshot | None:
    try:
        return looks.poll_once(looks.patience_s)
    except DriverError as error:
        if error.problems[0].code in GONE:
            raise
        return None


class Settling:
    """Axes that come to rest, seen from look to look: in position, or the tool for some time within a band.

    Its servo is soft: what dry friction holds off is brought in position by the integrator alone, which may take a
    minute. Any other axis that does not arrive has a fault.
    """

    def __init__(self, axes: Iterable[AxisName], tool_band_counts: float, patience_s: float = SETTLE_S) -> None:
        """The tool may lag by `tool_band_counts` where it rests, once it did so for `patience_s`."""
        self._axes, self._tool_band_counts, self._patience_s = tuple(axes), tool_band_counts, patience_s
        self._near_since_s: float | None = None

    def is_over(self, snapshot: Snapshot) -> bool:
        """Whether they rest."""
        away = [axis for axis in self._axes if "in_position" not in snapshot.axis(axis).flags]
        if not away:
            return True
        if away != [AxisName.TOOL] or not nearly_arrived(snapshot, AxisName.TOOL, self._tool_band_counts):
            self._near_since_s = None
            return False
        if self._near_since_s is None:
            self._near_since_s = snapshot.at_s
        return snapshot.at_s - self._near_since_s >= self._patience_s


class HomeSearch:
    """A search for the zero of an axis, seen from look to look.

    On its way back to the zero the axis rests for an instant: only `RESTS` in a row are an end without one.
    """

    RESTS = 3

    def __init__(self, axis: AxisName, tool_band_counts: float, braking_s: float = 0.0) -> None:
        """`tool_band_counts` is by how much the tool may lag at its zero, see `Settling`.

        An axis that searches needs `braking_s` to come to rest. `sudden` is whether this one rested on a zero
        sooner: somebody has called the place home at which it was (`HMZ`), and there is no zero there.
        """
        self.sudden = False
        self._axis, self._rests = axis, 0
        self._braking_s = braking_s
        self._searching: Snapshot | None = None
        self._settling = Settling((axis,), tool_band_counts, REST_S)

    def is_over(self, snapshot: Snapshot) -> bool:
        """Whether the zero was found, or the search has ended without one."""
        flags = snapshot.axis(self._axis).flags
        self._see_sudden(snapshot, flags)
        resting = "desired_velocity_zero" in flags and not {"home_search", "home_complete"} & flags
        self._rests = self._rests + 1 if resting else 0
        found = "home_complete" in flags and "home_search" not in flags
        return (found and self._settling.is_over(snapshot)) or self._rests >= self.RESTS

    def _see_sudden(self, snapshot: Snapshot, flags: frozenset[str]) -> None:
        before = self._searching
        self._searching = None
        if "home_search" in flags:
            self._searching = snapshot
        elif before is not None and {"home_complete", "desired_velocity_zero"} <= flags:
            self.sudden = snapshot.at_s - before.asked_s < self._braking_s


def nearly_arrived(snapshot: Snapshot, axis: AxisName, band_counts: float) -> bool:
    """Whether an axis is commanded to rest, and lags by no more than a band."""
    state = snapshot.axis(axis)
    # A jog of next to nothing never has a velocity, but until its time is over the controller starts no program.
    resting = "desired_velocity_zero" in state.flags and "move_timer_active" not in state.flags
    return resting and abs(state.following_error) <= band_counts
