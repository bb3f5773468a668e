"""Page Settings: how the screens look, in which language, and own keys; changed while they run."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Any

from textual.containers import Horizontal, Vertical
from textual.widget import Widget

from console.session.appearance import CHOICES, Appearance, OwnKeys, own_keys_text
from console.session.configuration import Setting, SettingOrigin, account_file
from console.session.kept_settings import keep_settings
from console.text.catalogue import LANGUAGES, Catalogue
from console.tui.application.own_keys import REMAPPABLE, why_not_key
from console.tui.entry import EntryLine
from console.tui.gate import FieldKind
from console.tui.key_help import words_of, written_key
from console.tui.keymap import Action, PageName
from console.tui.lines import BLANK, Line, Sheet, clip_lines, dim, fit_text, justify_line, line, name_in, wrap_line
from console.tui.page import Page, move_selection, rows_moved
from console.tui.theme import COLOUR_VARIABLE, MONO, Palette, Token
from console.tui.ui_context import UiContext, View, find_job_lock
from profiles.files import printable
from profiles.problem import Problem, ProblemError

CHANGES = {"settings.next": 1, "settings.previous": -1}
LONGEST_KEY = 8
_ABOUT_ROWS = 9
LABEL_WIDTH = 14
LEAST_VALUE = 18
KEY_WIDTH, PAGE_WIDTH = 7, 12
SAMPLES = (Token.TEXT, Token.DIM, Token.ACTION, Token.WARNING, Token.ALARM, Token.BEFORE, Token.AFTER, Token.SIM)
SETTINGS = ("language", *CHOICES, "keys")
"""The settings of the page, in order."""

FIXED = (SettingOrigin.VARIABLE, SettingOrigin.OPTION)
"""Places that come after the file of the account: what they say cannot be changed in it."""


def choices_of(setting: str) -> tuple[str, ...]:
    """Return the values of a setting; none for the own keys."""
    return tuple(LANGUAGES) if setting == "language" else CHOICES.get(setting, ())


def value_of(appearance: Appearance, setting: str) -> str:
    """Return the value of a setting as the configuration has it."""
    if setting == "keys":
        return own_keys_text(appearance.keys)
    value: str = getattr(appearance, setting)
    return value


def is_without_colour(palette: Palette) -> bool:
    """Whether the terminal has no colour, so that no theme is seen."""
    return palette[Token.TEXT] == MONO[Token.TEXT] and palette[Token.WARNING] == MONO[Token.WARNING]


def place_of(ui: UiContext, setting: str) -> Setting | None:
    """Return where the value of a setting comes from; None for one that is built in."""
    if setting == "theme" and is_without_colour(ui.palette):
        return Setting(value=None, origin=SettingOrigin.VARIABLE, place=COLOUR_VARIABLE)
    return None if ui.configuration is None else ui.configuration.settings.get(setting)


def why_not_change(ui: UiContext, setting: str) -> tuple[Problem, ...]:
    """Return why a setting cannot be changed now: something moves, a cut is armed, a later place has it."""
    if problem := find_job_lock(ui.control.state, "screen.settings_moving", "screen.settings_armed"):
        return (problem,)
    place = place_of(ui, setting)
    if place is not None and place.origin in FIXED:
        return (Problem(code="screen.setting_fixed", key=ui.text(f"settings.{setting}"), value=place.place),)
    return ()


def step_setting(ui: UiContext, setting: str, by: int) -> Appearance:
    """Return the appearance with the next or previous value of a setting."""
    values = choices_of(setting)
    place = values.index(value_of(ui.appearance, setting)) + by
    chosen: dict[str, Any] = {setting: values[place % len(values)]}
    return replace(ui.appearance, **chosen)


def change(ui: UiContext, setting: str, appearance: Appearance) -> None:
    """Show another appearance at once, and keep the setting; what cannot be kept is said, and stays shown."""
    ui.appear(appearance)
    if ui.configuration is None:  # a page without a console around it
        return
    path = account_file(os.environ)
    if path is None:
        ui.key_answer = (
            Problem(code="data.no_home", value=str(os.getuid())),
            Problem(code="screen.setting_not_kept"),
        )
        return
    value = value_of(appearance, setting)
    try:
        keep_settings(path, {setting: value or None})
    except ProblemError as error:
        ui.key_answer = (*error.problems, Problem(code="screen.setting_not_kept"))
        return
    settings = {
        **ui.configuration.settings,
        setting: Setting(value=value, origin=SettingOrigin.FILE, place=str(path)),
    }
    if not value:
        del settings[setting]
    ui.configuration = replace(ui.configuration, settings=settings)


def setting_rows(ui: UiContext, selected: int, width: int) -> list[Line]:
    """Return a row for each setting: its name, its value, and where that comes from."""
    text, rows = ui.text, list[Line]()
    for number, setting in enumerate(SETTINGS):
        chosen = number == selected
        mark = ("▸ ", Token.ACTION) if chosen else dim("  ")
        place = place_words(ui, setting, max(width - LABEL_WIDTH - LEAST_VALUE - 6, 8))
        value = value_words(ui, setting)
        head: Line = (
            mark,
            (fit_text(text(f"settings.{setting}"), LABEL_WIDTH), Token.STRONG if chosen else Token.DIM),
            (f" {value} ", Token.SELECTED if chosen else Token.TEXT),
        )
        rows.append(justify_line(head, line(dim(f" {place}")), width))
    return rows


def value_words(ui: UiContext, setting: str) -> str:
    """Return the value of a setting in words."""
    if setting == "keys":
        count = len(ui.appearance.keys)
        return ui.text("settings.keys_count", count=count) if count else ui.text("settings.no_keys")
    place = place_of(ui, setting)
    if place is not None and place.value is None:  # without colour
        return ui.text("settings.value.theme.mono")
    return ui.text(f"settings.value.{setting}.{value_of(ui.appearance, setting)}")


def place_words(ui: UiContext, setting: str, width: int) -> str:
    """Return where a value comes from, in this many cells; a fixed one is called so."""
    place = place_of(ui, setting)
    if place is None or place.origin is SettingOrigin.BUILT_IN:
        return ui.text("settings.built_in")
    if place.origin in FIXED:
        return ui.text("settings.fixed", place=place.place)
    return name_in(printable(place.place), width, tail_fraction=0.7)


def about_lines(ui: UiContext, setting: str, width: int) -> list[Line]:
    """Return what a setting does, and its values; the themes with the colours that mean something."""
    text = ui.text
    rows = wrap_line(text(f"settings.about.{setting}"), width)
    if setting == "theme":
        rows += [BLANK, *_samples(text, width)]
    present = value_of(ui.appearance, setting)
    values = [
        (f" {text(f'settings.value.{setting}.{each}')} ", Token.SELECTED if each == present else Token.DIM)
        for each in choices_of(setting)
    ]
    return [*rows, *([BLANK, tuple(values)] if values else [])]


def _samples(text: Catalogue, width: int) -> list[Line]:
    pieces: list[Line] = [((f" {text(f'settings.sample.{token.name.lower()}')} ", token),) for token in SAMPLES]
    rows: list[Line] = [BLANK]
    for piece in pieces:
        if sum(len(words) for words, _ in (*rows[-1], *piece)) > width:
            rows.append(BLANK)
        rows[-1] = (*rows[-1], *piece)
    return rows


def key_rows(text: Catalogue, own: OwnKeys, selected: int | None, width: int) -> list[Line]:
    """Return a row for each action: its own key, its key, its page, and what it does."""
    rows = []
    for number, action in enumerate(REMAPPABLE):
        chosen = number == selected
        mine = own.get(action.id)
        mark = ("▸ ", Token.ACTION) if chosen else dim("  ")
        page = text("settings.every_page") if action.page is None else text(f"page.{action.page}")
        head: Line = (
            mark,
            (fit_text("" if mine is None else written_key(mine), KEY_WIDTH), Token.KEY),
            (fit_text(action.shown, KEY_WIDTH), Token.DIM),
            (fit_text(page, PAGE_WIDTH), Token.DIM),
        )
        token = Token.SELECTED if chosen else Token.TEXT
        room = max(width - 2 - 2 * KEY_WIDTH - PAGE_WIDTH, 8)
        rows.append((*head, (fit_text(words_of(text, action), room), token)))
    return rows


def key_head(text: Catalogue) -> Line:
    """Return the head of the columns."""
    return (
        dim("  "),
        dim(fit_text(text("settings.own_key"), KEY_WIDTH)),
        dim(fit_text(text("settings.our_key"), KEY_WIDTH)),
        dim(fit_text(text("settings.page"), PAGE_WIDTH)),
        dim(text("settings.action")),
    )


def key_about(text: Catalogue, action: Action, own: OwnKeys, width: int) -> list[Line]:
    """Return what the selected action does in full, and its keys."""
    mine = own.get(action.id)
    key = "settings.has_key" if mine else "settings.has_none"
    told = text(key, key=written_key(mine or ""), ours=action.shown)
    return [*wrap_line(words_of(text, action), width), BLANK, *wrap_line(told, width, Token.DIM)]


def window(rows: Sequence[Line], selected: int, height: int) -> tuple[int, list[Line]]:
    """Return the rows around the selected one that fit, and how many are above them."""
    first = min(max(selected - height // 2, 0), max(len(rows) - height, 0))
    return first, list(rows[first : first + max(height, 0)])


class SettingsMode(StrEnum):
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
        #settings-entry {{ width: {LONGEST_KEY + 1}; offset: 3 0; }}
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
        self._entry = EntryLine(id="settings-entry", cap_characters=LONGEST_KEY)
        left = Vertical(self._list, self._about, id="settings-left")
        right = Vertical(self._keys, self._key, id="settings-right")
        self.panels = (Horizontal(left, right), self._entry)
        self._mode = SettingsMode.SETTINGS
        self._setting = self._action = 0
        self._above = 0
        self._shown_for: tuple[object, ...] = ()

    def act(self, action: str) -> None:
        """Select a setting or an action, change it, type a key."""
        if self._mode is SettingsMode.TYPING:
            if action == "settings.change":
                self._take_key()
        elif rows_moved(action) is not None:
            self._select(action)
        elif action == "settings.previous" and self._mode is SettingsMode.KEYS:
            self._mode = SettingsMode.SETTINGS
        elif self.ui.answers(self.why_not(action, self.ui.view)):
            return
        elif self._mode is SettingsMode.KEYS:
            self._change_key(action)
        elif self._shown_setting == "keys":
            self._mode = SettingsMode.KEYS
        elif action != "settings.remove":
            change(
                self.ui, self._shown_setting, step_setting(self.ui, self._shown_setting, CHANGES.get(action, 1))
            )

    def point(self, panel: Widget, row: int) -> None:
        """Choose the setting, or the action, in a row that was clicked."""
        if panel is self._list and self._mode is SettingsMode.SETTINGS and 0 <= row < len(SETTINGS):
            self._setting = row
        elif panel is self._keys and self._mode is SettingsMode.KEYS and 0 < row <= len(REMAPPABLE) - self._above:
            self._action = self._above + row - 1  # below the head

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why a setting cannot be changed, or a key not removed."""
        if rows_moved(action) is not None or (self._mode is SettingsMode.KEYS and action == "settings.previous"):
            return ()
        if (
            self._mode is SettingsMode.SETTINGS
            and self._shown_setting == "keys"
            and action not in ("settings.remove",)
        ):
            return ()  # the list of the actions can always be read
        if action == "settings.remove":
            if self._mode is SettingsMode.SETTINGS:
                return (Problem(code="screen.own_keys_closed"),)
            if self._chosen_action.id not in self.ui.appearance.keys:
                return (Problem(code="screen.own_key_none"),)
        return why_not_change(self.ui, "keys" if self._mode is not SettingsMode.SETTINGS else self._shown_setting)

    def show(self, view: View) -> None:
        """Show the settings, or the actions; both where there is room."""
        self.set_class(self._mode is not SettingsMode.SETTINGS, "-keys")
        self._entry.keep_focus()
        ui, sizes = self.ui, (self._list.size, self._about.size, self._keys.size, self._key.size)
        chosen = (self._mode, self._setting, self._action)
        before, self._shown_for = self._shown_for, (*chosen, ui.text, ui.appearance, ui.configuration, *sizes)
        if before != self._shown_for:
            self._show_settings()
            self._show_keys()
        if self._mode is SettingsMode.TYPING:
            left = self._keys.region.x - self.region.x
            self._entry.styles.offset = (left + 3, 2 + self._action - self._above)

    def fit(self) -> None:
        """Show the actions beside the settings on a wide terminal."""
        self.set_class(self.size.width >= 140, "-both")

    def next_step(self, view: View) -> Line:
        """Return what the keys do."""
        name = str(self._mode)
        if self._mode is SettingsMode.SETTINGS and self._shown_setting == "keys":
            name = "open_keys"
        return line((self.ui.text(f"settings.next.{name}"), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what the selected setting or action is, uncut."""
        if self._mode is SettingsMode.SETTINGS:
            return about_lines(self.ui, self._shown_setting, width)
        return key_about(self.ui.text, self._chosen_action, self.ui.appearance.keys, width)

    @property
    def field(self) -> FieldKind:
        """Free text while a key is typed: its name, not the key itself."""
        return FieldKind.TEXT if self._mode is SettingsMode.TYPING else FieldKind.NONE

    def leave(self) -> None:
        """End an entry."""
        self._end_typing()

    @property
    def _shown_setting(self) -> str:
        return SETTINGS[self._setting]

    @property
    def _chosen_action(self) -> Action:
        return REMAPPABLE[self._action]

    def _select(self, action: str) -> None:
        keys = self._mode is SettingsMode.KEYS
        count, place = (len(REMAPPABLE), self._action) if keys else (len(SETTINGS), self._setting)
        page = max(self._keys.size.height - 2, 1) if keys else count
        place = move_selection(place, rows_moved(action, page) or 0, count)
        if keys:
            self._action = place
        else:
            self._setting = place

    def _change_key(self, action: str) -> None:
        keys = self.ui.appearance.keys
        if action == "settings.remove":
            self._keep({name: key for name, key in keys.items() if name != self._chosen_action.id})
            return
        self._mode = SettingsMode.TYPING
        self._entry.begin(keys.get(self._chosen_action.id, ""))

    def _take_key(self) -> None:
        key, keys = self._entry.value.strip().lower(), self.ui.appearance.keys
        others = {name: each for name, each in keys.items() if name != self._chosen_action.id}
        if key and self.ui.answers(why_not_key(self._chosen_action, key, others, self.ui.text)):
            return
        self._end_typing()
        self._keep({**others, self._chosen_action.id: key} if key else others)

    def _keep(self, keys: dict[str, str]) -> None:
        if not self.ui.answers(why_not_change(self.ui, "keys")):
            change(self.ui, "keys", replace(self.ui.appearance, keys=keys))

    def _end_typing(self) -> None:
        if self._mode is SettingsMode.TYPING:
            self._mode = SettingsMode.KEYS
            self._entry.close()

    def _show_settings(self) -> None:
        text, width = self.ui.text, max(self._list.size.width, 1)
        machine = printable(self.ui.machine.machine.name)
        self._list.show(setting_rows(self.ui, self._setting, width), text("page.settings"), machine)
        about = about_lines(self.ui, self._shown_setting, max(self._about.size.width, 1))
        shown = clip_lines(about, self._about.size.height, text("panel.more"))
        self._about.show(shown, text(f"settings.{self._shown_setting}"))

    def _show_keys(self) -> None:
        text, own, (width, height) = self.ui.text, self.ui.appearance.keys, self._keys.size
        chosen = None if self._mode is SettingsMode.SETTINGS else self._action
        rows = key_rows(text, own, chosen, width)
        self._above, shown = window(rows, self._action, max(height - 1, 1))
        place = text("settings.place", place=self._action + 1, all=len(rows))
        self._keys.show([key_head(text), *shown], text("settings.keys"), place)
        about = key_about(text, self._chosen_action, own, max(self._key.size.width, 1))
        self._key.show(clip_lines(about, self._key.size.height, text("panel.more")), text("settings.action"))
