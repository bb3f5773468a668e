"""Whether axes stay where this console has left them: a zero that another host sets keeps the flag of a found one.

HMZ, or a jog, of another host leaves an axis "homed" at a position that means nothing any more. So the commanded
positions of closed axes at rest are followed from poll to poll while this console commands nothing. An axis that
is found elsewhere has no home, whatever its flag says, until it is homed again.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from drivers.lathe.lengths import Lengths, settings_of
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot, driven_axes
from profiles.machine import MachineProfile

HOMED, AT_REST = "home_complete", "desired_velocity_zero"
BAND_MM, BAND_DEG = 0.01, 0.5
"""Beyond what a poll reads askew (position and following error are not sampled at once); harmless in a part."""

LEAST_JUMP_MM, LEAST_JUMP_DEG = 1.0, 90.0
"""A hand may move an axis in open loop, but not from rest by so much, to its zero, from one poll to the next."""


class HeldPositions:
    """The positions of one machine. `shifted` are the axes whose home is in doubt, each with its shift as text."""

    def __init__(self, machine: MachineProfile) -> None:
        self.shifted: dict[AxisName, str] = {}
        self._lengths = Lengths(machine)
        axes = driven_axes(machine)
        units = {axis: settings_of(machine, axis).counts_per_unit for axis in axes}
        self._bands = {axis: units[axis] * _choose_position(axis, BAND_MM, BAND_DEG) for axis in axes}
        self._jumps = {axis: units[axis] * _choose_position(axis, LEAST_JUMP_MM, LEAST_JUMP_DEG) for axis in axes}
        self._held: dict[AxisName, float] = {}
        self._seen: dict[AxisName, float] = {}
        self._closed: dict[AxisName, bool] = {}
        self._commanding = 0

    def forget(self) -> None:
        """Take the positions anew: something of this console may move an axis, or close a loop."""
        self._held.clear()
        self._seen.clear()

    @contextmanager
    def commanding(self) -> Iterator[None]:
        """Judge nothing while a motion of this console lasts: it has guards of its own."""
        self._commanding += 1
        try:
            yield
        finally:
            self._commanding -= 1
            self.forget()

    def hold(self, snapshot: Snapshot) -> None:
        """Take the positions in which a motion of this console has left the axes."""
        for axis in snapshot.driven:
            state = snapshot.axis(axis)
            if state.closed and {HOMED, AT_REST} <= state.flags:
                self._held[axis], self._closed[axis] = state.commanded_position, True

    def trust(self, axis: AxisName) -> None:
        """Judge an axis by its own flag again, which a home search has just cleared."""
        self.shifted.pop(axis, None)

    def judge_poll(self, snapshot: Snapshot, *, ours: bool) -> Snapshot:
        """Return a poll without the home of axes that are not where they were left.

        `ours` is whether this console has control: what another one moves is no shift.
        """
        if not ours:
            self.forget()
            return snapshot
        if self._commanding or snapshot.lost:
            self.forget()
        else:
            for axis in snapshot.driven:
                self._judge(axis, snapshot.axis(axis), program=snapshot.program_running)
        if not self.shifted:
            return snapshot
        unhomed: dict[str, AxisState] = {
            axis: replace(state, flags=state.flags - {HOMED})
            for axis, state in ((axis, snapshot.axis(axis)) for axis in self.shifted)
        }
        return replace(snapshot, shifted=dict(self.shifted), **unhomed)  # type: ignore[arg-type]

    def _judge(self, axis: AxisName, state: AxisState, *, program: bool) -> None:
        if HOMED not in state.flags or state.closed is not self._closed.get(axis):
            self._closed[axis] = state.closed
            self._held.pop(axis, None)
            self._seen.pop(axis, None)
        elif not state.closed:
            self._judge_open(axis, state.position)
        elif program or AT_REST not in state.flags:
            self._seen.pop(axis, None)  # somebody moves it: where it comes to rest is judged
        else:
            self._judge_closed(axis, state.commanded_position)

    def _judge_closed(self, axis: AxisName, at: float) -> None:
        held, seen = self._held.get(axis), self._seen.get(axis)
        if held is not None and abs(at - held) > self._bands[axis]:
            self._shift(axis, at - held)
        if held is None and seen is not None and abs(at - seen) <= self._bands[axis]:
            self._held[axis] = seen  # twice the same: nothing is about to begin
        self._seen[axis] = at

    def _judge_open(self, axis: AxisName, at: float) -> None:
        """Judge an axis that nothing holds: `_held` is where it stood still, by two polls."""
        held, seen = self._held.get(axis), self._seen.get(axis)
        if held is not None and abs(at) <= self._bands[axis] and abs(at - held) > self._jumps[axis]:
            self._shift(axis, at - held)
        still = seen is not None and abs(at - seen) <= self._bands[axis]
        if still:
            self._held[axis] = at
        else:
            self._held.pop(axis, None)
        self._seen[axis] = at

    def _shift(self, axis: AxisName, counts: float) -> None:
        self.shifted[axis] = self._lengths.format_position(axis, counts)
        self._held.pop(axis, None)


def _choose_position(axis: AxisName, length_mm: float, angle_deg: float) -> float:
    return angle_deg if axis is AxisName.SPINDLE else length_mm
