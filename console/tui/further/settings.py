"""Page Settings: how the screens look, in which language, and own keys; changed while they run."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum

from textual.containers import Horizontal, Vertical
from textual.widget import Widget
from textual.widgets import Input

from console.tui.gate import FieldKind
from console.tui.keymap import Action, PageName
from console.tui.lines import Line, Sheet, clipped, line
from console.tui.page import Page
from console.tui.settings import setting_lines
from console.tui.settings.changing import SETTINGS, change, stepped, why_not_change
from console.tui.settings.own_keys import REMAPPABLE, key_typed, why_not_key
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.files import printable
from profiles.problem import Problem

STEPS = {"settings.up": -1, "settings.down": 1}
JUMPS = {"settings.page_up": -1, "settings.page_down": 1}
ENDS = {"settings.first": 0, "settings.last": -1}
CHANGES = {"settings.next": 1, "settings.previous": -1}
LONGEST_KEY = 8
_ABOUT_ROWS = 9


class Mode(StrEnum):
    """What the keys choose: a setting, an action, or they type the key of an action."""

    SETTINGS = "settings"
    KEYS = "keys"
    TYPING = "typing"


class SettingsPage(Page):
    """Nothing on it moves anything. A change counts at once and is kept in the file of the account."""

    name_ = PageName.SETTINGS

    DEFAULT_CSS = f"""
    SettingsPage {{
        layers: base entry;
        Sheet {{ border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground; }}
        #settings-list {{ height: {len(SETTINGS) + 2}; }}
        #settings-about {{ height: 1fr; }}
        #settings-keys {{ height: 1fr; }}
        #settings-key {{ height: {_ABOUT_ROWS - 3}; }}
        #settings-right {{ display: none; }}
        #settings-entry {{
            layer: entry; position: absolute; display: none; width: {LONGEST_KEY + 1}; height: 1; offset: 3 0;
            background: $background; color: $foreground;
        }}
    }}
    SettingsPage.-keys #settings-left {{ display: none; }}
    SettingsPage.-keys #settings-right {{ display: block; }}
    SettingsPage.-both #settings-left {{ display: block; }}
    SettingsPage.-both #settings-right {{ display: block; }}
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._list, self._about, self._keys, self._key = (
            Sheet(ui.palette, id=f"settings-{name}") for name in ("list", "about", "keys", "key")
        )
        self._entry = Input(id="settings-entry", compact=True, select_on_focus=False, max_length=LONGEST_KEY)
        self._entry.cursor_blink = False
        left = Vertical(self._list, self._about, id="settings-left")
        right = Vertical(self._keys, self._key, id="settings-right")
        self.panels = (Horizontal(left, right), self._entry)
        self._mode = Mode.SETTINGS
        self._setting = self._action = 0
        self._above = 0
        self._shown_for: tuple[object, ...] = ()

    def act(self, action: str) -> None:
        """Select a setting or an action, change it, type a key."""
        if self._mode is Mode.TYPING:
            if action == "settings.change":
                self._take_key()
        elif action in (*STEPS, *JUMPS, *ENDS):
            self._select(action)
        elif action == "settings.previous" and self._mode is Mode.KEYS:
            self._mode = Mode.SETTINGS
        elif self.ui.answers(self.why_not(action, self.ui.view)):
            return
        elif self._mode is Mode.KEYS:
            self._change_key(action)
        elif self._shown_setting == "keys":
            self._mode = Mode.KEYS
        elif action != "settings.remove":
            change(self.ui, self._shown_setting, stepped(self.ui, self._shown_setting, CHANGES.get(action, 1)))

    def point(self, panel: Widget, row: int) -> None:
        """Choose the setting, or the action, in a row that was clicked."""
        if panel is self._list and self._mode is Mode.SETTINGS and 0 <= row < len(SETTINGS):
            self._setting = row
        elif panel is self._keys and self._mode is Mode.KEYS and 0 < row <= len(REMAPPABLE) - self._above:
            self._action = self._above + row - 1  # below the head

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why a setting cannot be changed, or a key not removed."""
        if action in (*STEPS, *JUMPS, *ENDS) or (self._mode is Mode.KEYS and action == "settings.previous"):
            return ()
        if self._mode is Mode.SETTINGS and self._shown_setting == "keys" and action not in ("settings.remove",):
            return ()  # the list of the actions can always be read
        if action == "settings.remove":
            if self._mode is Mode.SETTINGS:
                return (Problem(code="screen.own_keys_closed"),)
            if self._chosen.id not in self.ui.appearance.keys:
                return (Problem(code="screen.own_key_none"),)
        return why_not_change(self.ui, "keys" if self._mode is not Mode.SETTINGS else self._shown_setting)

    def show(self, view: View) -> None:
        """Show the settings, or the actions; both where there is room."""
        self.set_class(self._mode is not Mode.SETTINGS, "-keys")
        if self._mode is Mode.TYPING and self.screen.focused is not self._entry:
            self.screen.set_focus(self._entry, scroll_visible=False)
        ui, sizes = self.ui, (self._list.size, self._about.size, self._keys.size, self._key.size)
        chosen = (self._mode, self._setting, self._action)
        before, self._shown_for = self._shown_for, (*chosen, ui.text, ui.appearance, ui.configuration, *sizes)
        if before != self._shown_for:
            self._show_settings()
            self._show_keys()
        if self._mode is Mode.TYPING:
            left = self._keys.region.x - self.region.x
            self._entry.styles.offset = (left + 3, 2 + self._action - self._above)

    def fit(self) -> None:
        """Show the actions beside the settings on a wide terminal."""
        self.set_class(self.size.width >= 140, "-both")

    def next_step(self, view: View) -> Line:
        """Return what the keys do."""
        name = str(self._mode)
        if self._mode is Mode.SETTINGS and self._shown_setting == "keys":
            name = "open_keys"
        return line((self.ui.text(f"settings.next.{name}"), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what the selected setting or action is, uncut."""
        if self._mode is Mode.SETTINGS:
            return setting_lines.about_lines(self.ui, self._shown_setting, width)
        return setting_lines.key_about(self.ui.text, self._chosen, self.ui.appearance.keys, width)

    @property
    def field(self) -> FieldKind:
        """Free text while a key is typed: its name, not the key itself."""
        return FieldKind.TEXT if self._mode is Mode.TYPING else FieldKind.NONE

    def leave(self) -> None:
        """End an entry."""
        self._end_typing()

    @property
    def _shown_setting(self) -> str:
        return SETTINGS[self._setting]

    @property
    def _chosen(self) -> Action:
        return REMAPPABLE[self._action]

    def _select(self, action: str) -> None:
        keys = self._mode is Mode.KEYS
        count, place = (len(REMAPPABLE), self._action) if keys else (len(SETTINGS), self._setting)
        page = max(self._keys.size.height - 2, 1) if keys else count
        place = ENDS[action] % count if action in ENDS else place + STEPS.get(action, page * JUMPS.get(action, 0))
        place = min(max(place, 0), count - 1)
        if keys:
            self._action = place
        else:
            self._setting = place

    def _change_key(self, action: str) -> None:
        keys = self.ui.appearance.keys
        if action == "settings.remove":
            self._keep({name: key for name, key in keys.items() if name != self._chosen.id})
            return
        self._entry.value = keys.get(self._chosen.id, "")
        self._entry.cursor_position = len(self._entry.value)
        self._mode, self._entry.display = Mode.TYPING, True
        self.screen.set_focus(self._entry, scroll_visible=False)

    def _take_key(self) -> None:
        key, keys = key_typed(self._entry.value), self.ui.appearance.keys
        others = {name: each for name, each in keys.items() if name != self._chosen.id}
        if key and self.ui.answers(why_not_key(self._chosen, key, others, self.ui.text)):
            return
        self._end_typing()
        self._keep({**others, self._chosen.id: key} if key else others)

    def _keep(self, keys: dict[str, str]) -> None:
        if not self.ui.answers(why_not_change(self.ui, "keys")):
            change(self.ui, "keys", replace(self.ui.appearance, keys=keys))

    def _end_typing(self) -> None:
        if self._mode is Mode.TYPING:
            self._mode, self._entry.display = Mode.KEYS, False
            self.screen.set_focus(None)

    def _show_settings(self) -> None:
        text, width = self.ui.text, max(self._list.size.width, 1)
        machine = printable(self.ui.machine.machine.name)
        self._list.show(setting_lines.setting_rows(self.ui, self._setting, width), text("page.settings"), machine)
        about = setting_lines.about_lines(self.ui, self._shown_setting, max(self._about.size.width, 1))
        shown = clipped(about, self._about.size.height, text("panel.more"))
        self._about.show(shown, text(f"settings.{self._shown_setting}"))

    def _show_keys(self) -> None:
        text, own, (width, height) = self.ui.text, self.ui.appearance.keys, self._keys.size
        chosen = None if self._mode is Mode.SETTINGS else self._action
        rows = setting_lines.key_rows(text, own, chosen, width)
        self._above, shown = setting_lines.window(rows, self._action, max(height - 1, 1))
        place = text("settings.place", place=self._action + 1, all=len(rows))
        self._keys.show([setting_lines.key_head(text), *shown], text("settings.keys"), place)
        about = setting_lines.key_about(text, self._chosen, own, max(self._key.size.width, 1))
        self._key.show(clipped(about, self._key.size.height, text("panel.more")), text("settings.action"))
