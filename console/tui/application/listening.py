"""An application that judges what comes from the terminal before any widget sees it: keys, pastes, the mouse."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from textual import events

from console.tui.application.leaving import LeavingApp
from console.tui.driver import Scanned, StopSent, TooFast, WideSigns
from console.tui.gate import UNCLEAR, FieldKind, Situation, is_page
from console.tui.keymap import Action
from console.tui.layout import is_small
from console.tui.scanning.scans import Scans
from console.tui.ui_context import UiContext
from profiles.problem import Problem

if TYPE_CHECKING:
    from console.session.instructing.mailbox import Mailbox
    from console.tui.alarms.logged_control import LoggedControl


class ListeningApp(LeavingApp):
    """`heard` is called with the name of each key; what they do is that of the class below."""

    ui: UiContext
    heard: Callable[[str], object]
    scans: Scans

    def tick(self) -> None:
        """Show the newest state."""
        raise NotImplementedError

    def situation(self) -> Situation:
        """Return what a key is judged by now."""
        raise NotImplementedError

    def safely(self, work: Callable[[], None]) -> None:
        """Run an operation of one page. Its faults stay its own."""
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
                if event.key in UNCLEAR:
                    self.ui.say(UNCLEAR[event.key])
                return
        elif isinstance(event, events.Paste) and not (event.is_forwarded or self._takes_text):
            self.scans.pasted(moving=self.situation().moving)
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
        self.scans.too_fast(written=keys.written, stopped=keys.stopped)
        self.tick()

    def on_scanned(self, scanned: Scanned) -> None:
        """Handle what such keys were."""
        self.safely(lambda: self.scans.take(scanned.scan, small=is_small(self.size)))
        self.tick()

    def on_wide_signs(self, _: WideSigns) -> None:
        """Draw everything with signs that this terminal shows in as many cells as the pages count."""
        self.look.wide = True
        self.dress(self.ui.appearance)
        self.ui.say("screen.wide_signs")
        self.tick()

    def instructed(self, mailbox: Mailbox, control: LoggedControl) -> None:
        """Let the instructor see this screen, and note what he has done."""
        from console.tui.application.instructed import report  # not for the first page

        self.safely(lambda: report(mailbox, self.screen, self.ui, control))

    def say_changed(self, action: Action) -> None:
        """Report that a key which asks for something else has stopped the machine."""
        if not is_page(action):
            self.ui.say_until_key(Problem(code="screen.key_in_motion", key=action.shown))
