"""The set-up of the scope as a list: channels, period, length, trigger, level; a row is changed by keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from console.text.catalogue import Catalogue
from console.tui.lines import Line, dim, fit_text, line
from console.tui.theme import Token
from console.units import METRIC, Units
from drivers.requests.scope_gather import (
    CHANNELS,
    LENGTHS_S,
    MOST_CHANNELS,
    PERIODS_CYCLES,
    Channel,
    ScopeSetup,
    ScopeTrigger,
    display_of,
)

_Value = TypeVar("_Value")

SETTINGS = ("period", "length", "trigger", "level_of", "level")
ROWS = (*CHANNELS, *SETTINGS)
LABEL = 10
_STEP = {"um": 1.0, "mm": 0.1, "mm/s": 0.1, "°": 1.0, "rpm": 10.0, "V": 0.1}
_INCH_STEP = {"um": 50.0, "mm": 0.005, "mm/s": 0.005}
"""Steps of a level, in the unit in which it is shown: round numbers in either system."""


def change_setup(setup: ScopeSetup, row: int, by: int, units: Units = METRIC) -> ScopeSetup | None:
    """Return the set-up after a key on a row; None where it would have no channel, or too many."""
    chosen = ROWS[row]
    if isinstance(chosen, Channel):
        return _toggle_channel(setup, chosen)
    match chosen:
        case "period":
            return replace(setup, period_cycles=_next(PERIODS_CYCLES, setup.period_cycles, by))
        case "length":
            return replace(setup, length_s=_next(LENGTHS_S, setup.length_s, by))
        case "trigger":
            return replace(setup, trigger=_next(tuple(ScopeTrigger), setup.trigger, by, around=True))
        case "level_of":
            return replace(setup, level_of=_next(setup.channels, setup.level_of, by, around=True), level=0.0)
        case _:
            return replace(setup, level=round(setup.level + by * _level_step(setup.level_of, units), 6))


def _level_step(channel: Channel, units: Units) -> float:
    unit = display_of(channel)[0]
    shown = _INCH_STEP.get(unit, _STEP[unit]) if units.is_inch else _STEP[unit]
    return shown * units.size(unit)


def _toggle_channel(setup: ScopeSetup, channel: Channel) -> ScopeSetup | None:
    if channel in setup.channels:
        left = tuple(each for each in setup.channels if each != channel)
    else:
        left = tuple(each for each in CHANNELS if each in setup.channels or each == channel)
    if not 1 <= len(left) <= MOST_CHANNELS:
        return None
    gone = setup.level_of not in left
    return replace(setup, channels=left, level_of=left[0] if gone else setup.level_of)


def _next(choices: Sequence[_Value], now: _Value, by: int, *, around: bool = False) -> _Value:
    place = choices.index(now) if now in choices else 0
    place = (place + by) % len(choices) if around else min(max(place + by, 0), len(choices) - 1)
    return choices[place]


def channel_words(channel: Channel, text: Catalogue) -> str:
    """Return the name of a channel."""
    return f"{text(f'controller_page.subject.{channel.axis}')} {text(f'scope_page.quantity.{channel.quantity}')}"


def short_words(channel: Channel, unit: str, text: Catalogue) -> str:
    """Return a channel with its unit in few characters."""
    subject = text(f"controller_page.subject.{channel.axis}")
    return f"{subject} {text(f'scope_page.short.{channel.quantity}')} {unit}"


def setup_lines(setup: ScopeSetup, chosen: int, cycle_ms: float, text: Catalogue, width: int) -> list[Line]:
    """Return the list, a row for each channel and setting."""
    rows = []
    for place, each in enumerate(ROWS):
        mark = ("▶", Token.ACTION) if place == chosen else dim(" ")
        token = Token.SELECTED if place == chosen else Token.TEXT
        if isinstance(each, Channel):
            on = "●" if each in setup.channels else "○"
            rows.append(line(mark, (fit_text(f"{on} {channel_words(each, text)}", width - 1), token)))
        else:
            label = dim(fit_text(text(f"scope_page.set.{each}"), LABEL))
            rows.append(
                line(mark, label, (fit_text(_words(setup, str(each), cycle_ms, text), width - LABEL - 1), token))
            )
    return rows


def _words(setup: ScopeSetup, setting: str, cycle_ms: float, text: Catalogue) -> str:
    match setting:
        case "period":
            return f"{setup.period_cycles * cycle_ms:.3f} ms"
        case "length":
            return f"{setup.length_s:g} s"
        case "trigger":
            return text(f"scope_page.trigger.{setup.trigger}")
    if setup.trigger not in (ScopeTrigger.RISING, ScopeTrigger.FALLING):
        return "–"
    if setting == "level_of":
        return channel_words(setup.level_of, text)
    unit = display_of(setup.level_of)[0]
    return f"{text.units.format_short(setup.level, unit)} {text.units.unit(unit)}"
