"""Waiting for the end of what moves: looks in a row, the lease kept, and every way in which it may end."""

from __future__ import annotations

from collections.abc import Callable

from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.heartbeat import LAPSED, Heartbeat
from drivers.looks import Looks
from drivers.ownership import Ownership, Standing
from drivers.snapshot import Snapshot
from drivers.stop import StopPath
from profiles.problem import Problem

CUT_POLL_S = 0.023
"""Time between two looks during a cut: no whole part of any usual turn, so that every angle is met."""

JOG_POLL_S = 0.1
"""Time between two looks at an axis on its way."""


class Motion:
    """Waits of one machine. Travel limits on which an axis stands when it begins to move off are no fault."""

    def __init__(
        self, looks: Looks, stop: StopPath, clock: Clock, heartbeat: Heartbeat | None, ownership: Ownership | None
    ) -> None:
        self._looks, self._stop, self._clock = looks, stop, clock
        self._heartbeat, self._ownership = heartbeat, ownership

    def _pause(self, seconds: float) -> None:
        if self._heartbeat is None:
            self._clock.wait(seconds)
        else:
            self._heartbeat.pause(seconds, self._looks.patience_s)

    def until(
        self,
        done: Callable[[Snapshot], bool],
        timeout_s: float,
        what: str,
        watch: Callable[[Snapshot], None] | None = None,
    ) -> Snapshot:
        """Look on until it is over; `watch` is told each look of a cut. `what` names it where it goes wrong.

        Raises:
            DriverError: `machine.fault`, `machine.timeout`, the machine was stopped before; and what ends it from
                outside, see `_next_look`.
        """
        deadline = self._clock.now_s() + timeout_s
        standing_on: frozenset[str] = (
            frozenset() if watch is not None or self._looks.last is None else self._looks.last.limits
        )
        while True:
            snapshot = self._next_look(JOG_POLL_S if watch is None else CUT_POLL_S, deadline)
            met = snapshot.axis_faults if watch is None else snapshot.faults
            faults = [fault for fault in met if fault not in standing_on]
            if faults:
                self._stop.stop(faults[0])
                raise DriverError(Problem(code="machine.fault", key=what, value=", ".join(faults)))
            if watch is not None:
                watch(snapshot)
            if done(snapshot):
                if self._heartbeat is not None:
                    self._heartbeat.ended()
                return snapshot
            if self._clock.now_s() > deadline:
                self._stop.stop(f"{what}: {timeout_s:g} s")
                raise DriverError(Problem(code="machine.timeout", key=what, value=f"{timeout_s:g} s"))

    def _next_look(self, pause_s: float, deadline: float) -> Snapshot:
        """Let time pass with the lease kept, and look.

        Raises:
            DriverError: `heartbeat.lapsed`, what moved was ended by the card; `owner.ousted`, the machine is no
                longer ours.
            StoppedError: somebody stopped the machine.
        """
        try:
            self._pause(pause_s)
            self._stop.check()
            snapshot = self._looks.look()
            if snapshot.lost and self._heartbeat is not None and self._heartbeat.guarding:
                raise self._heartbeat.lapse()
        except DriverError as error:
            if error.problems[0].code == LAPSED:
                self._see_it_end(deadline)
            raise
        if self._ownership is not None:
            self._ownership.refuse_ousted()
        return snapshot

    def _see_it_end(self, deadline: float) -> None:
        """Look on while the card ends what has lost its host: a stop of ours would leave the tool in the part."""
        heartbeat = self._heartbeat
        assert heartbeat is not None  # it is what has told so
        deadline = min(deadline, self._clock.now_s() + heartbeat.ends_within_s)
        while self._clock.now_s() < deadline:
            self._stop.check()
            if self._looks.look().at_rest and not heartbeat.is_ending():
                return
            if self._ownership is not None and self._ownership.standing is Standing.OUSTED:
                return  # what moves now is another's
            self._clock.wait(CUT_POLL_S)
