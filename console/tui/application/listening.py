"""An application that judges what comes from the terminal before any widget sees it: keys, pastes, the mouse.

It appears as the operator has set it: theme, language, glyphs, changed while it runs.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Sequence

from rich.style import Style
from textual import events
from textual.app import App
from textual.driver import Driver
from textual.filter import LineFilter
from textual.theme import Theme

from console.session.appearance import Appearance
from console.session.dated_input import SLOW_S, InputAge
from console.session.errors import fault_problem
from console.session.passing_control import record
from console.text.catalogue import LiveCatalogue
from console.tui.application.key_releases import KeyReleases
from console.tui.application.scans import Scans
from console.tui.driver import KeyFault, Late, Scanned, StopSent, TooFast, WideSigns, Written
from console.tui.gate import UNCLEAR, FieldKind, KeyDecision, KeySituation, is_page, judge
from console.tui.keymap import Action
from console.tui.page import is_small
from console.tui.theme import COLOUR, DARK_THEME, MONO, MONO_THEME, Palette, Token
from console.tui.ui_context import UiContext
from drivers.clock import OLD_S
from profiles.problem import Problem


class LiveLook:
    """Texts, palette and filters of an application; `mono` is a terminal without colour, whatever the theme.

    `wide` is one that shows the signs of frames and plots in two cells each: it gets ASCII, whatever the setting.
    """

    def __init__(self, palette: Palette, appearance: Appearance) -> None:
        self.mono, self.wide = palette is MONO, False
        self.text = LiveCatalogue(appearance.language)
        self.text.measure(appearance.units)
        self.palette: dict[Token, Style] = dict(palette)
        self.filters: tuple[LineFilter, ...] = ()
        self._paint(appearance)

    def theme(self, appearance: Appearance) -> Theme:
        """Return the theme of the frames."""
        if self.mono:
            return MONO_THEME
        if appearance.theme == "dark":
            return DARK_THEME
        from console.tui.application.themes import theme_named  # not for the first paint in the dark one

        return theme_named(appearance.theme)

    def change(self, appearance: Appearance) -> None:
        """Take over another appearance."""
        if appearance.language != self.text.language:
            self.text.speak(appearance.language)
        self.text.measure(appearance.units)
        self._paint(appearance)

    def _paint(self, appearance: Appearance) -> None:
        if not self.mono:
            self.palette.update(_palette(appearance.theme))
        if (self.wide or appearance.glyphs == "ascii") is not bool(self.filters):
            from console.tui.application.glyphs import AsciiGlyphs  # not for the first paint with Unicode

            self.filters = () if self.filters else (AsciiGlyphs(),)


def _palette(theme: str) -> Palette:
    if theme == "dark":
        return COLOUR
    from console.tui.application.themes import palette_named

    return palette_named(theme)


class DressedApp(App[None]):
    """`look` has the texts and colours that every panel is given."""

    def __init__(self, palette: Palette, appearance: Appearance, driver_class: type[Driver] | None) -> None:
        self.look = LiveLook(palette, appearance)
        # Without colour, Textual must know before it chooses its filters to use the terminal's own colours.
        super().__init__(driver_class=driver_class, ansi_color=True if self.look.mono else None)
        theme = self._register_theme(appearance)
        if theme is DARK_THEME:  # the style sheet is not read yet: like this it is read once, not once more
            self.set_reactive(App.theme, theme.name)
            self.stylesheet.set_variables(self.get_css_variables())
        else:
            self.theme = theme.name

    def dress(self, appearance: Appearance) -> None:
        """Draw everything anew in another appearance."""
        self.look.change(appearance)
        self.theme = self._register_theme(appearance).name
        for widget in (self.screen, *self.screen.query()):
            widget.notify_style_update()
            widget.refresh()

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return Textual's filters, and that of the glyphs."""
        return (*super().get_line_filters(), *self.look.filters)

    def offer_mouse(self, on: bool) -> None:
        """Have the terminal report clicks and the wheel, or not; a driver without a terminal has none."""
        report = getattr(self._driver, "report_mouse", None)
        if report is not None:
            report(on)

    def offer_releases(self, on: bool) -> KeyReleases | None:
        """Have the terminal report releases of keys, or not; return what is known of them, None without any."""
        report = getattr(self._driver, "report_releases", None)
        if report is not None:
            report(on)
        releases: KeyReleases | None = getattr(self._driver, "releases", None)
        return releases

    def _register_theme(self, appearance: Appearance) -> Theme:
        theme = self.look.theme(appearance)
        if theme.name not in self.available_themes:
            self.register_theme(theme)
        return theme


class LeavingApp(DressedApp):
    """`fault` is the error that ended it, reported in one line afterwards."""

    def __init__(self, palette: Palette, appearance: Appearance, driver_class: type[Driver] | None) -> None:
        super().__init__(palette, appearance, driver_class)
        self.fault: Exception | None = None
        self._ui_loop: asyncio.AbstractEventLoop | None = None
        self._leaving = False

    def on_mount(self) -> None:
        """Leave at once where that was asked for before there was a loop."""
        self._ui_loop = asyncio.get_running_loop()
        if self._leaving:
            self.exit()

    def leave_soon(self) -> None:
        """Leave the screen; may be called from a signal handler, at any moment."""
        self._leaving = True
        if self._ui_loop is not None:
            self._ui_loop.call_soon_threadsafe(self.exit)

    def _handle_exception(self, error: Exception) -> None:
        """Leave without a traceback (Textual has no public hook)."""
        self.fault = self.fault or error
        self.exit(return_code=1)


class ListeningApp(LeavingApp):
    """`heard` is called with the name of each key; what they do is that of the class below."""

    ui: UiContext
    heard: Callable[[str], object]
    scans: Scans

    def tick(self) -> None:
        """Show the newest state."""
        raise NotImplementedError

    def situation(self) -> KeySituation:
        """Return what a key is judged by now."""
        raise NotImplementedError

    def safely(self, work: Callable[[], None]) -> None:
        """Run an operation of one page. Its faults stay its own."""
        raise NotImplementedError

    def perform_key(self, event: events.Key) -> bool:
        """Perform the action of a key; False when the key belongs to the focused field."""
        raise NotImplementedError

    def put_down(self) -> None:
        """Take back what the page in front was enabled or armed for."""
        raise NotImplementedError

    def perform_click(self, event: events.MouseEvent) -> None:
        """Do what a click or the wheel asks for."""
        raise NotImplementedError

    async def on_event(self, event: events.Event) -> None:
        """Judge every key before any widget sees it."""
        if isinstance(event, events.Key) and not event.is_forwarded:
            written = self._takes_text and event.is_printable
            record(
                (self.heard,), "…" if written else event.key
            )  # what is written in free text is nobody's business
            age_s = time.monotonic() - event.time
            if age_s > OLD_S and self._obeys(event):  # it waited for a screen that was held up
                self.on_late(Late(age_s))
                return
            if self.perform_key(event):
                if event.key in UNCLEAR:
                    self.ui.say(UNCLEAR[event.key])
                return
        elif isinstance(event, events.Paste) and not (event.is_forwarded or self._takes_text):
            self.scans.refuse_paste(moving=self.situation().moving)
            self.call_after_refresh(self.tick)
            return
        elif isinstance(event, events.MouseEvent):
            self.perform_click(event)
            self.call_after_refresh(self.tick)
            return
        await super().on_event(event)

    def _obeys(self, event: events.Key) -> bool:
        """Whether a key is an order that is no stop."""
        verdict = judge(event.key, event.character, self.situation())[0]
        return verdict is KeyDecision.ACTION and not isinstance(event, Written)

    @property
    def _takes_text(self) -> bool:
        return self.situation().field is FieldKind.TEXT

    def stop_now(self, reason: str) -> None:
        """Stop the machine. Also called from the thread that reads the terminal."""
        self.ui.stop(reason)

    def kill_now(self, reason: str) -> None:
        """Open every loop of the machine. Also called from the thread that reads the terminal."""
        self.ui.kill(reason)

    def on_late(self, late: Late) -> None:
        """Say that input waited too long; what was armed is disarmed, for it was read before."""
        from console.session.station.commands import Disarm  # not for the first paint

        self.put_down()
        armed = self.ui.control.state.armed is not None and self.ui.control.post(Disarm())
        code, value = "screen.keys_undated", ""
        if math.isfinite(late.age_s):
            code, value = "screen.keys_late_armed" if armed else "screen.keys_late", f"{late.age_s:.1f} s"
        self.ui.say_until_key(Problem(code=code, value=value, limit=f"{OLD_S:g} s"))
        self.tick()

    def say_slow_line(self, age: InputAge | None) -> None:
        """Say that the terminal answers slowly, while there is nothing else to say."""
        if age is not None and age.is_slow and not self.ui.key_answer:
            value, limit = f"{age.round_trip_s:.1f} s", f"{SLOW_S:g} s"
            self.ui.say_until_key(Problem(code="screen.line_slow", value=value, limit=limit))

    def on_stop_sent(self, sent: StopSent) -> None:
        """Show a stop at once after it was sent."""
        if sent.action is not None:
            self.say_changed(sent.action)
        self.tick()

    def on_key_fault(self, fault: KeyFault) -> None:
        """Say that the reading of a key has failed; if it was a stop, that was sent before anything else."""
        self.ui.say_until_key(fault_problem(fault.error))
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

    def say_changed(self, action: Action) -> None:
        """Report that a key which asks for something else has stopped the machine."""
        if not is_page(action):
            self.ui.say_until_key(Problem(code="screen.key_in_motion", key=action.shown))
