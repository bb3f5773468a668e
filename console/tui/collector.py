"""Garbage collection that spares the first picture and the stop."""

from __future__ import annotations

import gc


class Collector:
    """Collect only new objects while something moves: a full collection would delay a key by 0.1 s."""

    def __init__(self) -> None:
        self._spared = False

    def begin(self) -> None:
        """Collect from now on: the first picture is there, up to which `console.__main__` has switched it off."""
        gc.enable()

    def spare(self, may_move: bool) -> None:
        """Take notice of whether something may move."""
        if may_move is not self._spared:
            self._spared = may_move
            (gc.freeze if may_move else gc.unfreeze)()
