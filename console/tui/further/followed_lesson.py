"""The lesson of a session: followed at each tick, and kept with each step, so that it can be left."""

from __future__ import annotations

from console.session.training.attempt import Attempt
from console.session.training.following import followed
from console.session.training.left import keep_left
from console.tui.ui_context import UiContext


def follow_lesson(ui: UiContext, attempt: Attempt) -> None:
    """Take the newest state; keep the try on disk after a step, whatever ends this console."""
    ui.attempt = followed(attempt, ui.control)
    if ui.attempt.step > attempt.step:
        with ui.answering():
            keep_left(ui.data, ui.attempt, ui.control.now_s())
