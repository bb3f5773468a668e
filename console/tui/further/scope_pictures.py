"""What the scope draws and reads off: channels over time or over the angle, and two cursors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from console.text.catalogue import Catalogue
from console.tui.further.scope_setup import short_words
from console.tui.lines import NOTHING, Line, dim, fit_text, line, to_the_right
from console.tui.plot.frame import nice_limits
from console.tui.plot.trace_view import Series, TracePicture
from console.tui.theme import Token
from console.units import METRIC, Units
from drivers.requests.scope_gather import ANGLE, Channel, ScopeRecord, display_of
from profiles.arrays import Floats

DEGREES = 57.29577951308232
_TOKENS = (Token.AFTER, Token.COMMAND, Token.BEFORE, Token.WANTED)
_NUMBER = 10
_DECIMALS = {"mm": 4, "um": 3, "°": 2}
LEAST_TURNS = 2.0
BINS = 120  # of three degrees


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnAverage:
    """Mean and standard deviation in the middle of each part of a turn, deg; (BINS,), NaN without samples."""

    angle_deg: Floats
    mean: Floats
    spread: Floats
    turns: float


def turns_of(angle_deg: Floats) -> float:
    """Return how many turns the spindle made, in the direction in which it ended."""
    return float(abs(angle_deg[-1] - angle_deg[0]) / 360.0) if angle_deg.size else 0.0


def over_turns(angle_deg: Floats, values: Floats) -> TurnAverage | None:
    """Return the average of values over the angle, each turn counting alike; None for less than two turns.

    In a part of the turn each turn counts by the mean of its samples there: the spread is that between turns.
    """
    turns = turns_of(angle_deg)
    if turns < LEAST_TURNS:
        return None
    place = np.floor(np.mod(angle_deg, 360.0) / 360.0 * BINS).astype(int) % BINS
    turn = np.floor(angle_deg / 360.0).astype(int)
    turn -= turn.min()
    cells = turn * BINS + place
    size = (int(turn.max()) + 1) * BINS
    counts = np.bincount(cells, minlength=size).reshape(-1, BINS)
    sums = np.bincount(cells, weights=values, minlength=size).reshape(-1, BINS)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.where(counts > 0, sums / counts, np.nan)
    seen = (counts > 0).sum(axis=0)
    mean = np.where(seen > 0, np.nansum(means, axis=0) / np.maximum(seen, 1), np.nan)
    squares = np.nansum((means - mean) ** 2, axis=0)
    spread = np.where(seen > 1, np.sqrt(squares / np.maximum(seen - 1, 1)), np.nan)
    middles: Floats = (np.arange(BINS, dtype=np.float64) + 0.5) * (360.0 / BINS)
    return TurnAverage(angle_deg=middles, mean=mean, spread=spread, turns=turns)


@dataclass(frozen=True, kw_only=True, eq=False)
class ScopeView:
    """A record as it is looked at: the chosen channel, and all others in its unit; over time, or `averages`."""

    record: ScopeRecord
    chosen: Channel
    averages: dict[Channel, TurnAverage] | None = None

    @property
    def axis(self) -> Floats:
        """What the cursors stand on: s from the trigger, or degrees of the spindle."""
        if self.averages is not None:
            return next(iter(self.averages.values())).angle_deg
        return self.record.times_s

    @property
    def drawn_channels(self) -> tuple[Channel, ...]:
        """The channels of the picture, the chosen one last, on top."""
        unit = display_of(self.chosen)[0]
        alike = [each for each in self.record.values if display_of(each)[0] == unit and each != self.chosen]
        return (*alike[-3:], self.chosen)

    def channel_values(self, channel: Channel) -> Floats:
        """Return the values of a channel over `axis`, in its display unit."""
        if self.averages is not None:
            return self.averages[channel].mean
        return np.asarray(self.record.values[channel] * display_of(channel)[1])


def average_turns(record: ScopeRecord) -> dict[Channel, TurnAverage] | None:
    """Return each channel over the spindle angle, in display units; None without that, or without two turns."""
    angle = record.values.get(ANGLE)
    if angle is None:
        return None
    found: dict[Channel, TurnAverage] = {}
    for channel, values in record.values.items():
        if channel == ANGLE:
            continue
        each = over_turns(angle * DEGREES, values * display_of(channel)[1])
        if each is None:
            return None
        found[channel] = each
    return found or None


def picture(sight: ScopeView, cursors: tuple[int, int], units: Units = METRIC) -> TracePicture:
    """Return the channels with the cursors; over the angle also mean plus and minus two standard deviations."""
    unit = display_of(sight.chosen)[0]
    size = units.size(unit)  # all that is drawn has the unit of the chosen channel
    series: list[Series] = []
    axis = sight.axis
    bounds: list[float] = []
    if sight.averages is not None:
        each = sight.averages[sight.chosen]
        for side in (-2.0, 2.0):
            edge = (each.mean + side * np.nan_to_num(each.spread)) / size
            series.append(Series(x=axis, y=edge, token=Token.DIM, dots=True))
            bounds += [float(np.nanmin(edge)), float(np.nanmax(edge))]
    for place, channel in enumerate(sight.drawn_channels):
        values = sight.channel_values(channel) / size
        token = _TOKENS[0] if channel == sight.chosen else _TOKENS[1 + place % 3]
        series.append(Series(x=axis, y=values, token=token, dashed=channel != sight.chosen))
        bounds += [float(np.nanmin(values)), float(np.nanmax(values))]
    limits = nice_limits(min(bounds), max(bounds))
    for cursor in cursors:
        at = float(axis[cursor])
        series.insert(0, Series(x=(at, at), y=limits, token=Token.MARK))
    ends = (0.0, 360.0) if sight.averages is not None else (float(axis[0]), float(axis[-1]))
    return TracePicture(
        series=tuple(series),
        x_limits=ends,
        y_limits=limits,
        y_unit=units.unit(unit),
        x_unit="°" if sight.averages is not None else "s",
    )


def reading_lines(
    sight: ScopeView, cursors: tuple[int, int], active: int, text: Catalogue, width: int
) -> list[Line]:
    """Return the values at both cursors and their differences; over the angle the spread at the active one too."""
    axis, over_angle = sight.axis, sight.averages is not None
    name = max(width - 3 * _NUMBER, 8)
    heads = [f"{'▶' if active == each else ' '}{'AB'[each]}" for each in (0, 1)]
    rows = [line(dim(" " * name), *(dim(to_the_right(each, _NUMBER)) for each in (*heads, "B - A")))]
    ends = [float(axis[cursor]) for cursor in cursors]
    rows.append(_row(text("scope_page.angle" if over_angle else "scope_page.time"), ends, name, over_angle))
    for channel in sight.record.values:
        if over_angle and channel == ANGLE:
            continue
        values = [float(sight.channel_values(channel)[cursor]) for cursor in cursors]
        unit = display_of(channel)[0]
        label = short_words(channel, text.units.unit(unit), text)
        token = Token.STRONG if channel == sight.chosen else Token.TEXT
        cells = [_format_value(value, unit, text.units) for value in (*values, values[1] - values[0])]
        rows.append(
            line((fit_text(label, name), token), *((to_the_right(cell, _NUMBER), token) for cell in cells))
        )
    if sight.averages is not None:
        each = sight.averages[sight.chosen]
        spread = float(each.spread[cursors[active]])
        unit = display_of(sight.chosen)[0]
        said = NOTHING if np.isnan(spread) else f"{spread / text.units.size(unit):.4g}"
        words = text("scope_page.spread", value=said, unit=text.units.unit(unit), turns=f"{each.turns:.1f}")
        rows.append(line(dim(words)))
    return rows


def _row(label: str, ends: list[float], name: int, over_angle: bool) -> Line:
    form = "{:.1f}" if over_angle else "{:.5f}"
    shown = [form.format(each) for each in (*ends, ends[1] - ends[0])]
    return line(dim(fit_text(label, name)), *(to_the_right(each, _NUMBER) for each in shown))


def _format_value(value: float, unit: str, units: Units) -> str:
    if np.isnan(value):
        return NOTHING
    decimals = _DECIMALS.get(unit)
    return f"{value / units.size(unit):.5g}" if decimals is None else units.figure(value, unit, decimals)
