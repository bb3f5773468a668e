"""When a feed hold has the tool off its path, and how long its program still waits."""

from __future__ import annotations

from drivers.cutting.feed_hold import MOST_HELD_S, HoldReport, HoldState
from drivers.lathe.snapshot import Snapshot


class Away:
    """When a feed hold has the tool off its path, by the reports of the program: such polls are not judged.

    The program reports its moves before they are made, so a turn is left out after it has come back. `at_mm` is
    where the cut was held, `left_s` how long the program still waits.
    """

    def __init__(self, counts_per_rev: float) -> None:
        self.at_mm: tuple[float, ...] = ()
        self.left_s: float | None = None
        self._per_rev = counts_per_rev
        self._back_at: float | None = None
        self._held_s: float | None = None

    def see(self, snapshot: Snapshot, hold: HoldReport, reached_mm: float, pace: float) -> bool:
        """Take a poll, with how far the part is cut; return whether the tool may be off its path.

        The program waits by its own time, of which `pace` passes in a second.
        """
        if hold.state is HoldState.HELD:
            if self._held_s is None:
                self._held_s, self.at_mm = snapshot.at_s, (*self.at_mm, reached_mm)
            self.left_s = max(MOST_HELD_S / pace - (snapshot.at_s - self._held_s), 0.0)
        else:
            self._held_s = self.left_s = None
        if hold.active:
            self._back_at = abs(snapshot.spindle.position) + self._per_rev
        return self._back_at is not None and abs(snapshot.spindle.position) < self._back_at
