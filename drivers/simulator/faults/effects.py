"""The effect of each fault on the simulated machine, and how it is undone."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from random import Random
from typing import TYPE_CHECKING, Protocol, TypeVar, cast

from drivers.errors import LinkError
from drivers.simulator.faults.catalogue import Value
from drivers.simulator.faults.lines import CARRIERS, SPOILERS, Carrier, Garbling, Lines, Spoiler

if TYPE_CHECKING:
    from drivers.simulator.card.controller import SimulatedController
    from drivers.simulator.card.motor import Motor
    from drivers.simulator.card.watchdog import Background
    from drivers.simulator.hosts.port import Port
    from drivers.simulator.plant.spindle import SimulatedSpindle

GAIN = 30  # Ix30, the proportional gain
_CONTROL = re.compile(r"\^[A-Z]")  # a control character in caret notation: no line begins like that
_NAMES = {0x00: "NUL", 0x02: "STX", 0x06: "ACK", 0x07: "BEL", 0x0A: "LF", 0x0D: "CR"}
_Item = TypeVar("_Item")
_Values = Mapping[str, Value]


class FaultedController(Protocol):
    """The controller as a host sees it."""

    def connect(self) -> Port:
        """Plug a host in."""

    def attend(self, port: Port) -> None:
        """Let the controller serve it now."""

    def forget(self, port: Port) -> None:
        """Unplug it without notifying the controller."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultTarget:
    """The target of faults: `motors` by axis name, `cut` for all connections, `card` as another host sees it."""

    controller: SimulatedController
    motors: Mapping[str, Motor]
    lines: Lines
    background: Background
    cut: Callable[[], None]
    card: FaultedController

    def motor(self, name: Value) -> Motor:
        """Return the motor of an axis."""
        return self.motors[str(name)]


def _do_nothing() -> None:
    pass


@dataclass(frozen=True, slots=True)
class Effect:
    """The effect of a fault. `begin` may be called again while it lasts, unless it is a moment.

    `over` is whether it has ended by itself, `outcome` its result.
    """

    begin: Callable[[], None]
    end: Callable[[], None] = _do_nothing
    over: Callable[[], bool] = bool  # never
    outcome: Callable[[], str] = str  # nothing to report


def effect_of(name: str, values: _Values, random: Random, site: FaultTarget) -> Effect:
    """Return the effect of the named fault, with a value for each of its parameters."""
    lines = site.lines
    fraction, left = float(values.get("share", 1.0)), float(values.get("replies", math.inf))
    if name in SPOILERS:
        spoiler = Spoiler(spoil=SPOILERS[name], random=random, fraction=fraction, left=left)
        return _list_effect(spoiler, lines.spoilers, lambda: spoiler.left <= 0)
    if name in CARRIERS:
        # The line itself works both ways; the other faults affect the controller's output.
        both_ways, carry = "baud" in values, CARRIERS[name](values)
        carrier = Carrier(carry=carry, both_ways=both_ways, random=random, fraction=fraction, left=left)
        return _list_effect(carrier, lines.carriers, lambda: carrier.left <= 0)
    return _EFFECTS[name](values, site)


def _list_effect(item: _Item, listed: list[_Item], over: Callable[[], bool]) -> Effect:
    def begin() -> None:
        if item not in listed:
            listed.append(item)

    return Effect(begin, lambda: listed.remove(item), over)


def _flag(owner: object, name: str, over: Callable[[], bool] = bool) -> Effect:
    return Effect(partial(setattr, owner, name, True), partial(setattr, owner, name, False), over)


def _cut_cable(_: _Values, site: FaultTarget) -> Effect:
    def begin() -> None:
        site.lines.cut = True
        site.cut()

    return Effect(begin=begin, end=partial(setattr, site.lines, "cut", False))


def _garbled_line(values: _Values, site: FaultTarget) -> Effect:
    find, replace = (str(values[name]).encode("ascii") for name in ("find", "replace"))
    garbling = Garbling(find=find, replace=replace)
    return _list_effect(garbling, site.lines.garblings, lambda: garbling.over)


def _limit(values: _Values, site: FaultTarget) -> Effect:
    # The pin -LIM blocks the positive direction.
    pin = "minus_pin" if values["direction"] == "positive" else "plus_pin"
    return _flag(site.motor(values["motor"]).travel, pin)


def _jam(values: _Values, site: FaultTarget) -> Effect:
    motor = site.motor(values["motor"])
    seen_sound = False

    def tripped() -> bool:
        """Ignore an earlier trip."""
        nonlocal seen_sound
        seen_sound = seen_sound or not motor.fatal_error
        return seen_sound and motor.fatal_error

    return _flag(motor.axis, "jammed", tripped)


def _ripple(values: _Values, site: FaultTarget) -> Effect:
    spindle = cast("SimulatedSpindle", site.motor("spindle").axis)

    def swing() -> None:
        spindle.ripple_per_turn = int(values["per_turn"])
        spindle.speed_ripple = float(values["ripple_percent"]) / 100.0

    return Effect(begin=swing, end=spindle.swing_as_built)


def _slow_background(values: _Values, site: FaultTarget) -> Effect:
    slow_down = site.background.slow_down
    return Effect(begin=lambda: slow_down(float(values["cycle_ms"])), end=lambda: slow_down(0.0))


def _stranger(values: _Values, site: FaultTarget) -> Effect:
    stranger, variables = _Stranger(site.card), site.controller.variables

    def begin() -> None:
        index = variables.dialect.motor_index(site.motors["tool"].number, GAIN)
        stranger.write(str(values.get("line", f"I{index}={0.9 * variables.i(index):g}")))

    return Effect(begin, stranger.leave, stranger.is_answered, lambda: stranger.outcome)


class _Stranger:
    """Another host, unknown to the others: it sends one line, reads the reply, and disconnects.

    It is a host like any other: faults of the controller, or of its lines, affect it, too.
    """

    def __init__(self, card: FaultedController) -> None:
        self.outcome = ""
        self._card = card
        self._port: Port | None = None
        self._heard = b""

    def write(self, line: str) -> None:
        """Send a line; `^A` sends control-A, and likewise for each other letter."""
        try:
            self._port = self._card.connect()
        except LinkError:
            self.outcome = "the stranger cannot be connected: the cable is cut"
            return
        control = _CONTROL.fullmatch(line)
        self._port.receive(bytes((ord(line[1]) - ord("@"),)) if control else line.encode("ascii") + b"\r")
        self._card.attend(self._port)

    def is_answered(self) -> bool:
        """Whether it has finished."""
        if self._port is None:
            return True
        if self._port.lost:
            self.outcome = "the stranger is cut off"
            return True
        self._heard += self._port.take_said()
        if not self._port.idle:
            return False
        self.outcome = _in_words(self._heard)
        return True

    def leave(self) -> None:
        """Disconnect; a buffer that it has opened stays open, and an unread line is lost."""
        if self._port is not None:
            self._card.forget(self._port)
            self._port = None


def _in_words(heard: bytes) -> str:
    """Return the reply as one line of text: `25<CR><ACK>`."""
    text = "".join(chr(code) if 0x20 <= code < 0x7F else f"<{_NAMES.get(code, f'{code:02X}')}>" for code in heard)
    number = re.search(rb"\x07(ERR\d+)?", heard)
    if number is None:
        return f"the stranger was told: {text or 'nothing'}"
    return f"the stranger was refused: {number[1].decode() if number[1] else text}"


_EFFECTS: Mapping[str, Callable[[_Values, FaultTarget], Effect]] = {
    "garbled-line": _garbled_line,
    "cut-cable": _cut_cable,
    "hang": lambda _, site: _flag(site.lines, "hung"),
    "encoder-loss": lambda values, site: _flag(site.motor(values["motor"]).axis, "encoder_lost"),
    "index-lost": lambda values, site: _flag(site.motor(values["motor"]), "index_lost"),
    "amplifier-fault": lambda values, site: _flag(site.motor(values["motor"]), "fault_input"),
    "limit": _limit,
    "following-error-trip": _jam,
    "spindle-ripple": _ripple,
    "watchdog": lambda _, site: Effect(begin=site.background.trip, over=lambda: not site.background.tripped),
    "slow-background": _slow_background,
    "stranger-writes": _stranger,
}
