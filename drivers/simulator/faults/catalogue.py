"""The catalogue of faults, each with its effect and its parameters: units, defaults, ranges, parsed from text."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import TypeAlias

from drivers.errors import RefusedError
from profiles.problem import Problem

Value: TypeAlias = float | str
AXES = ("tool", "spindle", "carriage")
MOST_SHOWN = 80  # maximum characters of a refused value that are reported
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number, `default` or else from `least` to `most`; one of `choices`; or with neither a text.

    Without a `default` it is optional; `meaning` describes the effect of omitting it. With `above_least`, `least`
    itself is not allowed.
    """

    name: str
    meaning: str
    unit: str = ""
    default: Value | None = None
    least: float = -math.inf
    most: float = math.inf
    _: KW_ONLY
    above_least: bool = False
    whole: bool = False
    choices: tuple[str, ...] = ()
    text: bool = False

    @property
    def range_text(self) -> str:
        """The range in words."""
        if self.choices:
            return " | ".join(self.choices)
        if self.text:
            return "a line of printable characters"
        bounds = f"{self.least:g} {'<' if self.above_least else '<='} {self.name}"
        bounds += f" <= {self.most:g}" if math.isfinite(self.most) else ""
        return f"{bounds}, whole" if self.whole else bounds

    def check(self, value: Value, fault: str) -> Value:
        """Return an allowed value, a number as `float`. Raises RefusedError: `simulator.fault`, it is not."""
        fits = self._word(value) if self.text or self.choices else self._number(value)
        if fits is None:
            raise refusal(fault, self.name, _shorten_value(value), self.range_text)
        return fits

    def _word(self, value: Value) -> str | None:
        if not isinstance(value, str) or (self.choices and value not in self.choices):
            return None
        return value if value and value.isascii() and value.isprintable() else None

    def _number(self, value: object) -> float | None:
        """Parse a number, or ASCII digits; a caller may pass anything."""
        if isinstance(value, str):
            if _NUMBER.fullmatch(value) is None:
                return None
        elif isinstance(value, bool) or not isinstance(value, int | float):
            return None
        try:
            number = float(value)
        except OverflowError:
            return None
        low_enough = number > self.least if self.above_least else number >= self.least
        fits = math.isfinite(number) and low_enough and number <= self.most
        return number if fits and not (self.whole and number != int(number)) else None


def refusal(fault: str, key: str, value: str, limit: str) -> RefusedError:
    """Return the refusal of a fault: the requested and the allowed values."""
    return RefusedError(Problem(code="simulator.fault", where=fault, key=key, value=value, limit=limit))


def _shorten_value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, int) and abs(value) >= 10**MOST_SHOWN:
        return "an integer that is too large"  # Python formats none of more than 4300 digits
    shown = ascii(str(value))[1:-1]
    return shown if len(shown) <= MOST_SHOWN else f"{shown[:MOST_SHOWN]}..."


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault. `moment` is whether it is over as soon as it has happened, so that it has no duration."""

    name: str
    does: str
    _: KW_ONLY
    concerns: str
    parameters: tuple[Parameter, ...] = ()
    moment: bool = False

    def settle(self, given: Mapping[str, Value]) -> tuple[dict[str, Value], dict[str, float]]:
        """Return the value of each parameter, as given or by default, and the given times and seed.

        Raises RefusedError: `simulator.fault`, one is not known or out of range.
        """
        known = {parameter.name: parameter for parameter in (*self.parameters, *self.times)}
        for name in given:
            if name not in known:
                raise refusal(self.name, "parameter", name, ", ".join(known))
        values = {each.name: each.default for each in self.parameters if each.default is not None}
        values |= {name: known[name].check(value, self.name) for name, value in given.items()}
        return values, {time.name: float(values.pop(time.name)) for time in self.times if time.name in values}

    @property
    def times(self) -> tuple[Parameter, ...]:
        """When it happens, for how long, and its random seed."""
        return (AFTER, SEED) if self.moment else (AFTER, FOR, SEED)


AFTER = Parameter("after", "simulated time until it begins", "s", 0.0, 0.0, 86_400.0)
_FOR_MEANS = "simulated time until it is over; without it, it lasts until `clear`"
FOR = Parameter("for", _FOR_MEANS, "s", None, 0.0, 86_400.0, above_least=True)
SEED = Parameter("seed", "seed of its random numbers", "", 0.0, 0.0, 1e9, whole=True)

_ENOUGH = "the fault is over after this many affected replies; without it, there is no such end"
_HIT = (
    Parameter("share", "fraction of the replies that is affected", "", 1.0, 0.0, 1.0, above_least=True),
    Parameter("replies", _ENOUGH, "", None, 1.0, 1e6, whole=True),
)


def _motor(default: str) -> Parameter:
    return Parameter("motor", "the axis whose motor it is", default=default, choices=AXES)


def _fault(concerns: str, name: str, does: str, *parameters: Parameter, moment: bool = False) -> Fault:
    return Fault(name, does, concerns=concerns, parameters=parameters, moment=moment)


_on_line = partial(_fault, "every host")
_on_motor = partial(_fault, "a motor")
_on_controller = partial(_fault, "the controller")

_LINES = (
    _on_line(
        "split-segments",
        "A reply arrives in pieces, with gaps between them.",
        Parameter("pieces", "pieces of a reply", "", 2.0, 2.0, 100.0, whole=True),
        Parameter("gap_ms", "time between two", "ms", 20.0, 1.0, 10_000.0),
        *_HIT,
    ),
    _on_line("dropped-ack", "The acknowledgement at the end of a reply is lost.", *_HIT),
    _on_line(
        "late-reply",
        "A reply comes late, and so does everything after it.",
        Parameter("delay_ms", "how late", "ms", 500.0, 1.0, 60_000.0),
        *_HIT,
    ),
    _on_line("extra-line", "An empty line (CR) comes before a reply.", *_HIT),
    _on_line("nul", "One NUL replaces a reply.", *_HIT),
    _on_line(
        "wrong-checksum",
        "The checksums of a reply are wrong, each by one; a reply has some only with I4 = 1.",
        *_HIT,
    ),
    _on_line("bare-bel", "A BEL without a text replaces a reply.", *_HIT),
    _on_line(
        "garbled-line",
        "The next line of a host that contains a certain text arrives with another text in its place, once.",
        Parameter("find", "the text; its first occurrence in the line", default="1", text=True),
        Parameter("replace", "what arrives in its place", default="5", text=True),
    ),
    _on_line("cut-cable", "Every connection is cut, and no new one can be made until the fault is over."),
    _on_line(
        "hang",
        "The controller neither reads nor answers; its motors continue. Afterwards it reads what came, stops too.",
    ),
    _on_line(
        "9600-baud",
        "The line carries 960 characters a second each way.",
        Parameter("baud", "bits a second, 10 a character", "", 9600.0, 110.0, 115_200.0),
    ),
)

_DIRECTIONS = ("positive", "negative")
_MOTORS = (
    _on_motor("encoder-loss", "The encoder stops counting: the loop sees its last reading.", _motor("tool")),
    _on_motor("index-lost", "The home flag or index never comes.", _motor("spindle")),
    _on_motor("amplifier-fault", "The amplifier reports a fault.", _motor("tool")),
    _on_motor(
        "limit",
        "The limit switch at one end of travel is open.",
        _motor("tool"),
        Parameter("direction", "the direction of travel that it blocks", default="positive", choices=_DIRECTIONS),
    ),
    _on_motor(
        "following-error-trip",
        "The slide is jammed until the following error has tripped the motor.",
        _motor("tool"),
    ),
    _on_motor(
        "spindle-ripple",
        "The true speed of the spindle varies about its mean; no servo removes that.",
        Parameter("ripple_percent", "amplitude, of the mean speed", "%", 5.0, 0.0, 50.0, above_least=True),
        Parameter("per_turn", "periods in a turn", "", 2.0, 1.0, 100.0, whole=True),
    ),
)

_STRANGERS_LINE = "what it sends, `^A` is control-A; without it, nine tenths of Ix30, the gain of the tool"
_CONTROLLER = (
    _on_controller("watchdog", "The watchdog trips: outputs off, no answer until `power-cycle`.", moment=True),
    _on_controller(
        "slow-background",
        "The background cycle (limits, stops, PLCs, replies) comes late; too late, and the watchdog trips.",
        Parameter("cycle_ms", "background cycle", "ms", 50.0, 10.0, 10_000.0),
    ),
    _on_controller(
        "stranger-writes",
        "Another host sends a line or a control character, reads the answer, and disconnects."
        " No other host sees it.",
        Parameter("line", _STRANGERS_LINE, text=True),
        moment=True,
    ),
)

CATALOGUE: Mapping[str, Fault] = {fault.name: fault for fault in (*_LINES, *_MOTORS, *_CONTROLLER)}


def find(name: str) -> Fault:
    """Return the fault with a name. Raises RefusedError: `simulator.fault`, there is none."""
    if not isinstance(name, str) or name not in CATALOGUE:
        shown = ascii(str(name))[1:-1][:40]
        raise refusal(shown, "fault", shown, ", ".join(CATALOGUE))
    return CATALOGUE[name]
