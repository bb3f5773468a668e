"""How the screens look and which keys they know besides the fixed ones: settings of the operator, kept for him.

They change nothing but what is shown. Each is a key of the configuration.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from console.units import UNITS

THEMES = ("dark", "light", "contrast", "16-colour", "colour-blind")
GLYPHS = ("unicode", "ascii")
SWITCH = ("off", "on")
CHOICES = {
    "theme": THEMES,
    "glyphs": GLYPHS,
    "calm": SWITCH,
    "mouse": SWITCH,
    "units": UNITS,
    "bell": ("on", "off"),
}
"""The allowed values of each setting, its built-in one first. `language` has those of the catalogues."""

KEYS_CAP_CHARACTERS = 1000
RESERVED_KEYS = ("f9", "f12")
"""Function keys that stop the machine: no action can have them. Space and Escape are no letters."""

_ENTRY = re.compile(r"([a-z]+(?:[._][a-z]+)*)=([a-z]|f(?:[1-9]|1[0-2]))")

OwnKeys = Mapping[str, str]
"""Keys that the operator has given to actions: the id of an action to a letter or a function key ("q", "f10")."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Appearance:
    """One value of each setting. `calm`: nothing blinks, and live values are drawn once a second.

    `bell`: a new alarm of high priority rings. `units` are those in which lengths are shown.
    """

    language: str = "en"
    units: str = UNITS[0]
    theme: str = THEMES[0]
    glyphs: str = GLYPHS[0]
    calm: str = SWITCH[0]
    mouse: str = SWITCH[0]
    bell: str = "on"
    keys: OwnKeys = field(default_factory=dict)


def appearance_of(values: Mapping[str, str | None], language: str) -> Appearance:
    """Return the appearance of these settings of a configuration, which were judged when it was read."""
    given = {key: value for key in CHOICES if (value := values.get(key)) is not None}
    return Appearance(language=language, keys=own_keys(values.get("keys") or ""), **given)


def own_keys(text: str) -> dict[str, str]:
    """Return the keys in a text such as "alarms.all=q run.arm=f10"; of two for one action the last counts."""
    found = (_ENTRY.fullmatch(each) for each in text.split())
    return {entry[1]: entry[2] for entry in found if entry is not None}


def own_keys_text(keys: OwnKeys) -> str:
    """Return the keys as the configuration keeps them."""
    return " ".join(f"{action}={key}" for action, key in sorted(keys.items()))


def fault_in_keys(text: str) -> str:
    """Return the first entry of a text that gives no action a letter or a function key, "" where all do.

    Whether the actions exist and the keys are free is judged where the keys are known.
    """
    for each in text.split():
        entry = _ENTRY.fullmatch(each)
        if entry is None or entry[2] in RESERVED_KEYS:
            return each
    return ""
