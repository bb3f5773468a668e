"""The lesson of a session: followed at each tick, and kept with each step, so that it can be left."""

from __future__ import annotations

from console.school.training.attempt import Attempt
from console.school.training.following import followed
from console.school.training.left import keep_left
from console.tui.ui_context import UiContext


def follow_lesson(ui: UiContext) -> None:
    """Take the newest state; keep the try on disk after a step, whatever ends this console."""
    if not isinstance(before := ui.attempt, Attempt):
        return
    ui.attempt = after = followed(before, ui.control)
    if after.step > before.step:
        with ui.answering():
            keep_left(ui.data, after, ui.control.now_s())
