"""Presses of the keys that change a running cut: every press of a finger is one step, a held key is one."""

from __future__ import annotations

from console.tui.align.jog_presses import JogPresses
from console.tui.align.reported_strokes import ReportedStrokes
from console.tui.terminal.key_releases import Stroke


class AdjustKeys:
    """Which presses of + and - are steps. Times are of any monotonic clock."""

    def __init__(self) -> None:
        self._presses, self._strokes = JogPresses(), ReportedStrokes()
        self.held = False

    def forget(self) -> None:
        """Drop a press that waits for its decision: another key was pressed, or the cut is over."""
        self._presses.forget()
        self.held = False

    def press(self, action: str, stroke: Stroke | None, now_s: float) -> list[str]:
        """Note a press; return the actions that are known by now to be steps, in the order of their presses."""
        before = self.due(now_s)
        if stroke is not None:
            self._presses.forget()
            finger = self._strokes.is_finger(stroke, now_s)
            self.held = not finger
        else:
            finger = self._presses.press(action, now_s)
            self.held = self._presses.held
        return [*before, action] if finger else before

    def due(self, now_s: float) -> list[str]:
        """Return the action of a press that no repeat followed, once."""
        action = self._presses.due(now_s)
        return [] if action is None else [action]
