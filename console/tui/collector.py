"""Garbage collection that spares the first picture and the stop."""

from __future__ import annotations

import gc

NEVER = 1_000_000_000


class Collector:
    """Collect only young objects while something moves: a full collection would delay a key by 0.1 s.

    What is there when the motion begins is set aside; what outlives the young ones is collected when it has ended.
    """

    def __init__(self) -> None:
        self._spared = False
        self._thresholds = gc.get_threshold()

    def begin(self) -> None:
        """Collect from now on: the first picture is there, up to which `console.__main__` has switched it off."""
        gc.enable()

    def spare(self, may_move: bool) -> None:
        """Take notice of whether something may move."""
        if may_move is self._spared:
            return
        self._spared = may_move
        if may_move:
            gc.freeze()
            gc.set_threshold(*self._thresholds[:2], NEVER)
        else:
            gc.unfreeze()
            gc.set_threshold(*self._thresholds)
