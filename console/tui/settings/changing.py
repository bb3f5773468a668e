"""A setting is changed: at rest, not against a later place of the configuration, and kept for the account."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

from console.session.appearance import CHOICES, Appearance, own_keys_text
from console.session.configuration import Origin, Setting, account_file
from console.session.kept_settings import keep_settings
from console.text.catalogue import LANGUAGES
from console.tui.theme import COLOUR_VARIABLE, MONO, Palette, Token
from console.tui.ui_context import UiContext, locked
from profiles.problem import Problem, ProblemError

SETTINGS = ("language", *CHOICES, "keys")
"""The settings of the page, in order."""

FIXED = (Origin.VARIABLE, Origin.OPTION)
"""Places that come after the file of the account: what they say cannot be changed in it."""


def choices_of(setting: str) -> tuple[str, ...]:
    """Return the values of a setting; none for the own keys."""
    return LANGUAGES if setting == "language" else CHOICES.get(setting, ())


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
        return Setting(value=None, origin=Origin.VARIABLE, place=COLOUR_VARIABLE)
    return None if ui.configuration is None else ui.configuration.settings.get(setting)


def why_not_change(ui: UiContext, setting: str) -> tuple[Problem, ...]:
    """Return why a setting cannot be changed now: something moves, a cut is armed, a later place has it."""
    if problem := locked(ui.control.state, "screen.settings_moving", "screen.settings_armed"):
        return (problem,)
    place = place_of(ui, setting)
    if place is not None and place.origin in FIXED:
        return (Problem(code="screen.setting_fixed", key=ui.text(f"settings.{setting}"), value=place.place),)
    return ()


def stepped(ui: UiContext, setting: str, by: int) -> Appearance:
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
        ui.said = (Problem(code="data.no_home", value=str(os.getuid())), Problem(code="screen.setting_not_kept"))
        return
    value = value_of(appearance, setting)
    try:
        keep_settings(path, {setting: value or None})
    except ProblemError as error:
        ui.said = (*error.problems, Problem(code="screen.setting_not_kept"))
        return
    settings = {**ui.configuration.settings, setting: Setting(value=value, origin=Origin.FILE, place=str(path))}
    if not value:
        del settings[setting]
    ui.configuration = replace(ui.configuration, settings=settings)
