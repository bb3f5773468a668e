"""An application that judges what comes from the terminal before any widget sees it: keys, pastes, the mouse."""

from __future__ import annotations

from collections.abc import Callable

from textual import events

from console.tui.application.leaving import LeavingApp
from console.tui.driver import StopSent, TooFast
from console.tui.gate import PASTED, FieldKind, Situation, is_page
from console.tui.keymap import Action
from console.tui.ui_context import UiContext
from profiles.problem import Problem


class ListeningApp(LeavingApp):
    """`heard` is called with the name of each key; what they do is that of the class below."""

    ui: UiContext
    heard: Callable[[str], object]

    def tick(self) -> None:
        """Show the newest state."""
        raise NotImplementedError

    def situation(self) -> Situation:
        """Return what a key is judged by now."""
        raise NotImplementedError

    def stop_now(self, reason: str) -> None:
        """Stop the machine."""
        raise NotImplementedError

    def took(self, event: events.Key) -> bool:
        """Perform the action of a key; False when the key belongs to the focused field."""
        raise NotImplementedError

    def pointed(self, event: events.MouseEvent) -> None:
        """Do what a click or the wheel asks for."""
        raise NotImplementedError

    async def on_event(self, event: events.Event) -> None:
        """Judge every key before any widget sees it."""
        if isinstance(event, events.Key) and not event.is_forwarded:
            written = self._takes_text and event.is_printable
            self.heard("…" if written else event.key)  # what is written in free text is nobody's business
            if self.took(event):
                return
        elif (
            isinstance(event, events.Paste)
            and not event.is_forwarded
            and self.situation().field is not FieldKind.TEXT
        ):
            # It was not typed, does nothing, and stops any motion.
            moving = self.ui.control.state.may_move
            self.ui.say_until_key(Problem(code="screen.pasted_stopped" if moving else "screen.pasted"))
            if moving:
                self.stop_now(PASTED)
            self.call_after_refresh(self.tick)
            return
        elif isinstance(event, events.MouseEvent):
            self.pointed(event)
            self.call_after_refresh(self.tick)
            return
        await super().on_event(event)

    @property
    def _takes_text(self) -> bool:
        return self.situation().field is FieldKind.TEXT

    def on_stop_sent(self, sent: StopSent) -> None:
        """Show a stop at once after it was sent."""
        if sent.action is not None:
            self.say_changed(sent.action)
        self.tick()

    def on_too_fast(self, keys: TooFast) -> None:
        """Handle keys that came too fast to be typed."""
        if keys.written:
            code = "screen.too_fast_entry"
        else:
            code = "screen.too_fast_stopped" if keys.stopped else "screen.too_fast"
        self.ui.say_until_key(Problem(code=code))
        self.tick()

    def say_changed(self, action: Action) -> None:
        """Report that a key which asks for something else has stopped the machine."""
        if not is_page(action):
            self.ui.say_until_key(Problem(code="screen.key_in_motion", key=action.shown))
