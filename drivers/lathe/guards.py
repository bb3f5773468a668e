"""Judge each poll of a machine in motion: whether it does what was commanded, and only that.

Pure: a snapshot goes in, problems come out. The code that waits for the motion stops the machine.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, replace

from drivers.lathe.lengths import Lengths
from drivers.lathe.safety import device_problems
from drivers.lathe.snapshot import REAL_TIME_PERCENT, AxisName, Snapshot
from drivers.lathe.standstill import FEWEST_POLLS, all_rest, rest_limits
from profiles.problem import Problem

Guard = Callable[[Snapshot], tuple[Problem, ...]]  # returns what is wrong with the one motion that it belongs to

STALLED_S = 1.0
"""A running program that moves nothing for this long is being held: the longest DWELL of a cut is half of it,
and a program that waits for its spindle sees the spindle turn."""

STALLED_NOISY_S = 4.0  # where a second is too short to tell rest from drift, in the noise of a scale
OVERRIDE_BAND_PERCENT = 0.5

OTHERS_COUNTS = 50.0  # of an axis at rest: position and following error are not sampled simultaneously


def accept_any_state(_: Snapshot) -> tuple[Problem, ...]:
    """Find nothing: for a motion of which only its end is checked."""
    return ()


def reset_problem(before: frozenset[AxisName], snapshot: Snapshot) -> Problem | None:
    """Report lost positions: `before` are the axes that were homed and are not being homed now.

    A controller that was reset (`$$$`) has lost all of them, and its loops are open.
    """
    lost = before - snapshot.homed_axes
    if not lost:
        return None
    if lost <= snapshot.shifted.keys():
        shifts = ", ".join(snapshot.shifted[axis] for axis in sorted(lost))
        return Problem(code="controller.zero_shifted", key=", ".join(sorted(lost)), value=shifts)
    if not snapshot.homed_axes and not snapshot.loops_closed:
        return Problem(code="controller.was_reset")
    return Problem(code="controller.home_lost", key=", ".join(sorted(lost)))


def unasked_motion(snapshot: Snapshot) -> Problem | None:
    """Report a motion that is not of this console, at rest as far as it knows: the axes, or a program."""
    if snapshot.at_rest:
        return None
    moving = [axis for axis in AxisName if "desired_velocity_zero" not in snapshot.axis(axis).flags]
    return Problem(code="machine.moves_unasked", key=", ".join(moving) or "program")


def unasked_opening(before: Snapshot, snapshot: Snapshot) -> Problem | None:
    """Report axes whose loop has opened at rest while others hold; a fault or a device has its own report."""
    opened = set(snapshot.open_loops) - set(before.open_loops)
    told = snapshot.axis_faults or snapshot.lost or device_problems(snapshot.inputs)
    if not opened or told or snapshot.loops_open:
        return None
    return Problem(code="machine.opened_unasked", key=", ".join(sorted(opened)))


def open_loop_problem(snapshot: Snapshot) -> Problem | None:
    """Report a loop that has opened during a motion: nothing holds that axis."""
    axes = snapshot.open_loops
    return Problem(code="machine.loop_open", key=", ".join(axes)) if axes else None


class OthersStill:
    """Check that every axis that is not moving stays where it was commanded when the motion began."""

    def __init__(self, moving: Set[AxisName], begun: Snapshot, lengths: Lengths) -> None:
        self._lengths = lengths
        self._ranges = tuple(
            AxisRange(
                axis=axis,
                low=state.commanded_position - OTHERS_COUNTS,
                high=state.commanded_position + OTHERS_COUNTS,
            )
            for axis, state in zip(begun.driven, begun.driven_axes, strict=True)
            if axis not in moving
        )

    def __call__(self, snapshot: Snapshot) -> tuple[Problem, ...]:
        """Judge one poll."""
        return tuple(_outside(self._ranges, snapshot, "machine.unexpected_motion", self._lengths))


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisRange:
    """The range in which an axis may be commanded, counts."""

    axis: AxisName
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class JogGuard:
    """Guard a jog of one axis between two commanded positions, counts; it may overshoot by `beyond_counts`.

    A jog from a corrupted line goes the wrong way, or beyond its target, or moves another axis.
    """

    axis: AxisName
    begin: float
    end: float
    beyond_counts: float
    others: OthersStill
    lengths: Lengths

    def __call__(self, snapshot: Snapshot) -> tuple[Problem, ...]:
        """Judge the commanded position of the axis."""
        at = snapshot.axis(self.axis).commanded_position
        low, high = sorted((self.begin, self.end))
        held = snapshot.axis(self.axis).closed
        if not held or low - self.beyond_counts <= at <= high + self.beyond_counts:
            return self.others(snapshot)
        value, limit = (
            self.lengths.format_position(self.axis, at),
            self.lengths.format_range(self.axis, self.begin, self.end),
        )
        return (Problem(code="machine.jog_astray", key=self.axis, value=value, limit=limit),)


class ProgramGuard:
    """Guard a running program: its axes stay in their planned ranges, in real time, and it advances."""

    def __init__(self, lengths: Lengths, ranges: Iterable[AxisRange] = (), *, real_time: bool = True) -> None:
        """`real_time` is False for a program whose time base is not the feed override."""
        self._lengths, self._ranges, self._real_time = lengths, tuple(ranges), real_time
        self._polls: deque[Snapshot] = deque()  # the last of the running program
        self._limits = rest_limits(lengths.machine)
        self.expected_percent: Callable[[Snapshot], tuple[float, float]] = _real_time
        self.further: Mapping[AxisName, float] = {}  # counts by which a feed hold lets an axis go beyond its range

    def __call__(self, snapshot: Snapshot) -> tuple[Problem, ...]:
        """Judge one poll."""
        ranges = (replace(each, high=each.high + self.further.get(each.axis, 0.0)) for each in self._ranges)
        outside = _outside(ranges, snapshot, "cut.outside_plan", self._lengths)
        problems = (self._override(snapshot), *outside, self._find_stall(snapshot))
        return tuple(problem for problem in problems if problem is not None)

    def _override(self, snapshot: Snapshot) -> Problem | None:
        percent, (low, high) = snapshot.override_percent, self.expected_percent(snapshot)
        judged = self._real_time and snapshot.program_running
        if not judged or low - OVERRIDE_BAND_PERCENT <= percent <= high + OVERRIDE_BAND_PERCENT:
            return None
        limit = f"{high:g} %" if low == high else f"{low:g} to {high:g} %"
        return Problem(code="cut.override", value=f"{percent:g} %", limit=limit)

    def _find_stall(self, snapshot: Snapshot) -> Problem | None:
        polls = self._polls
        if not snapshot.program_running:
            polls.clear()
            return None
        polls.append(snapshot)
        while snapshot.at_s - polls[0].at_s > STALLED_NOISY_S:
            polls.popleft()
        before = sum(snapshot.at_s - poll.at_s >= STALLED_S for poll in polls)
        if not before:
            return None
        kept = tuple(polls)
        for window in (kept[before - 1 :], kept):
            if len(window) >= FEWEST_POLLS and all_rest(window, self._limits):
                still_s = snapshot.at_s - window[0].at_s
                return Problem(code="cut.stalled", value=f"{still_s:.1f} s", limit=f"{STALLED_S:g} s")
        return None


def _real_time(_: Snapshot) -> tuple[float, float]:
    return REAL_TIME_PERCENT, REAL_TIME_PERCENT


def _outside(ranges: Iterable[AxisRange], snapshot: Snapshot, code: str, lengths: Lengths) -> Iterator[Problem]:
    """Report each axis commanded outside its range; an axis in open loop has no command."""
    for planned in ranges:
        axis, state = planned.axis, snapshot.axis(planned.axis)
        if state.closed and not planned.low <= state.commanded_position <= planned.high:
            value, limit = (
                lengths.format_position(axis, state.commanded_position),
                lengths.format_range(axis, planned.low, planned.high),
            )
            yield Problem(code=code, key=axis, value=value, limit=limit)
