"""Prove that a machine is at rest, after a stop and after a jog, from positions with the noise of their scales.

A scale with 0.3 um of noise differs by more than a count of 0.2 um from poll to poll, at rest. So a line is fitted
to the last polls, instead of comparing two. An axis rests if even the fastest drift that their scatter allows is
slow, and the scatter about the line is small: a loop that hunts has no drift. An axis whose polls are within a
count of each other rests, too: no less can be seen. Polls count from where rest was first reported, up to twelve
of them: of windows that begin anywhere, one would sooner or later look quiet by chance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.lathe.polling import Poller
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.base import GONE
from profiles.machine import MachineProfile
from profiles.problem import Problem

REST_TIMEOUT_S = 15.0
COAST_TIMEOUT_S = 60.0
STOP_REPEAT_S = 0.2
POLLS_REPORTING_REST = 3  # in a row, after the last stop
ARRIVED_COUNTS = 2.0  # commanded rest of a jog beside its target; positions are reported in tenths of a count
SETTLE_S = 15.0  # for an axis at rest near its target to come in position: three servo time constants
REST_S = 2.0  # the same where nothing depends on it
STILL_S, STILL_COUNTS = 0.2, 2.0  # allowed difference of two polls this far apart: 0.06 rpm of the spindle
FEWEST_POLLS, MOST_POLLS = 4, 12
REST_COUNTS_PER_S, REST_UM_PER_S = 5.0, 1.0
"""Drift that counts as rest: the larger of the two. A fine scale has as much noise in more counts."""

SCATTER_S = 1.0  # the scatter about the line may be what that drift is in this time, rms
LEAST_SEEN_COUNTS = 1.0
STUDENT_T = (4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228)
"""Quantile 0.975 of Student's t with 2 to 10 degrees of freedom: a line through 4 to 12 polls, or more."""

RestLimits = Mapping[AxisName, float]
"""Drift of each axis that counts as rest, counts/s."""


def rest_limits(machine: MachineProfile) -> RestLimits:
    """Return the limits of a machine."""
    per_um = {
        AxisName.TOOL: machine.tool.counts_per_mm / 1000.0,
        AxisName.CARRIAGE: machine.carriage.counts_per_mm / 1000.0,
    }
    return {axis: max(REST_COUNTS_PER_S, REST_UM_PER_S * per_um.get(axis, 0.0)) for axis in AxisName}


def rest_is_proven(looks: Sequence[Snapshot], limits: RestLimits) -> bool:
    """Whether no driven axis drifts or swings, by the last poll before rest was reported, and all since.

    An axis whose loop was opened may settle during the first ones: all count, or all but the first one or two.
    """
    windows = (looks[head:][-MOST_POLLS:] for head in (0, 1, 2))
    driven = {axis: limits[axis] for axis in looks[-1].driven} if looks else {}
    return any(len(window) >= FEWEST_POLLS and all_rest(window, driven) for window in windows)


def all_rest(looks: Sequence[Snapshot], limits: RestLimits) -> bool:
    """Whether all of these polls, at least 4, leave each axis of the limits neither drift nor swing."""
    times_s = [look.at_s for look in looks]
    return all(_rests(times_s, [look.axis(axis).position for look in looks], limits[axis]) for axis in limits)


def _rests(times_s: Sequence[float], positions: Sequence[float], limit: float) -> bool:
    if times_s[0] < times_s[-1] and max(positions) - min(positions) <= LEAST_SEEN_COUNTS:
        return True
    drift, scatter = drift_and_scatter(times_s, positions)
    return drift <= limit and scatter <= SCATTER_S * limit


def drift_and_scatter(times_s: Sequence[float], positions: Sequence[float]) -> tuple[float, float]:
    """Return the greatest speed of an axis that its positions allow, counts/s, and their scatter, counts rms.

    The speed is the upper bound of the 95 % interval of a fitted line's slope, the scatter that about the line.
    Takes at least 4 positions, counts, and their times. Source: linear regression, interval of the slope.
    """
    count = len(times_s)
    mean_s, mean = sum(times_s) / count, sum(positions) / count
    spread_s2 = sum((at_s - mean_s) ** 2 for at_s in times_s)
    if spread_s2 == 0.0:
        return math.inf, math.inf
    off = [(at_s - mean_s, place - mean) for at_s, place in zip(times_s, positions, strict=True)]
    slope = sum(at_s * place for at_s, place in off) / spread_s2
    scatter = math.sqrt(sum((place - slope * at_s) ** 2 for at_s, place in off) / (count - 2))
    quantile = STUDENT_T[min(count - FEWEST_POLLS, len(STUDENT_T) - 1)]
    return abs(slope) + quantile * scatter / math.sqrt(spread_s2), scatter


def prove_rest(
    poller: Poller, stop: StopPath, clock: Clock, limits: RestLimits, end_watchdog: Callable[[], None]
) -> Snapshot:
    """Poll the machine until it is proven at rest, and repeat the stop while it is not.

    Rest is several polls in a row that report it, and by which no axis drifts, see `rest_is_proven`. After
    control-K every loop must be open as well, and the spindle gets time to coast down. A failed poll proves
    nothing: the stop is sent again, then the next poll is tried. Another stop meanwhile restarts the proof, except
    the same one again: while a key is held, it could never end.
    `end_watchdog` must not raise. When this process has to exit, the wait ends at `leave_by_s` of the stop.
    Raises DriverError: `machine.not_at_rest`, `machine.rest_unknown` where the last poll was not answered;
    LinkError: `link.lost`, the link is gone.
    """
    began_s = clock.now_s()
    polls: list[Snapshot] = []  # those in a row that report rest, behind the one before them
    mark, killed, reporting_rest, heard = stop.mark, stop.killed, 0, False
    while clock.now_s() < min(began_s + _timeout_s(stop), stop.leave_by_s):
        latest = stop.mark
        if stop.killed is not killed or not stop.only_repeated(mark, latest):
            reporting_rest = 0
            del polls[:-1]
        mark, killed = latest, stop.killed
        snapshot = None
        try:
            snapshot = poller.poll_once(poller.quick_timeout_s)
        except DriverError as error:
            if error.problems[0].code in GONE:
                stop.given_up = True
                raise
        heard = snapshot is not None
        if heard:
            end_watchdog()
        if snapshot is not None and snapshot.at_rest and (snapshot.loops_open or not stop.killed):
            polls.append(snapshot)
            reporting_rest += 1
        else:
            stop.repeat()
            polls, reporting_rest = [] if snapshot is None else [snapshot], 0
        proven = reporting_rest >= POLLS_REPORTING_REST and rest_is_proven(polls, limits)
        latest = stop.mark
        same = killed is stop.killed and stop.only_repeated(mark, latest)
        if snapshot is not None and latest is not None and proven and same:
            stop.rest_proven(latest)
            if stop.proven:
                return snapshot
        if snapshot is not None:
            clock.wait(STOP_REPEAT_S)
    raise _not_proven(stop, began_s, clock.now_s(), heard=heard)


def _not_proven(stop: StopPath, began_s: float, now_s: float, *, heard: bool) -> DriverError:
    stop.given_up = stop.killed or now_s >= stop.leave_by_s
    waited_s = min(now_s - began_s, _timeout_s(stop))
    code = "machine.not_at_rest" if heard else "machine.rest_unknown"
    return DriverError(Problem(code=code, value=f"{waited_s:.0f} s"))


def _timeout_s(stop: StopPath) -> float:
    """Return the timeout for rest; a ramp that turned into a kill also gets the time to coast down."""
    return COAST_TIMEOUT_S if stop.killed else REST_TIMEOUT_S


class Settling:
    """Axes coming to rest, judged from poll to poll: in position, or the tool for some time within a band.

    The tool servo is soft: against dry friction only the integrator brings it in position, which may take a
    minute. Any other axis that does not arrive is faulty.
    """

    def __init__(self, axes: Iterable[AxisName], tool_band_counts: float, timeout_s: float = SETTLE_S) -> None:
        """The tool may lag by `tool_band_counts` at rest, once it has done so for `timeout_s`."""
        self._axes, self._tool_band_counts, self._timeout_s = tuple(axes), tool_band_counts, timeout_s
        self._near_since_s: float | None = None

    def is_over(self, snapshot: Snapshot) -> bool:
        """Whether all axes are at rest."""
        away = [axis for axis in self._axes if "in_position" not in snapshot.axis(axis).flags]
        if not away:
            return True
        if away != [AxisName.TOOL] or not nearly_arrived(snapshot, AxisName.TOOL, self._tool_band_counts):
            self._near_since_s = None
            return False
        if self._near_since_s is None:
            self._near_since_s = snapshot.at_s
        return snapshot.at_s - self._near_since_s >= self._timeout_s


class HomeSearch:
    """A homing move, judged from poll to poll.

    On its way back to the zero the axis rests for an instant: only `RESTS` in a row mean an end without a zero.
    """

    RESTS = 3

    def __init__(self, axis: AxisName, tool_band_counts: float, braking_s: float = 0.0) -> None:
        """`tool_band_counts` is how far the tool may lag at its zero, see `Settling`.

        A searching axis needs `braking_s` to come to rest. `sudden` is whether this one was at rest on a zero
        sooner: somebody declared its position home (`HMZ`), and there is no real zero.
        """
        self.sudden = False
        self._axis, self._rests, self._braking_s = axis, 0, braking_s
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
    """Whether an axis is commanded to rest and lags by no more than a band."""
    state = snapshot.axis(axis)
    # A tiny jog never shows a velocity, but until its time is over the controller starts no program.
    resting = "desired_velocity_zero" in state.flags and "move_timer_active" not in state.flags
    return resting and abs(state.following_error) <= band_counts
