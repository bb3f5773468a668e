"""The effect of each fault on the simulated machine, and how it is undone."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from typing import TYPE_CHECKING, Protocol, TypeVar, cast

from drivers.simulator.faults.carrying import CARRIERS
from drivers.simulator.faults.lines import Carrier, Chance, Garbling, Lines, Spoiler
from drivers.simulator.faults.parameter import Value
from drivers.simulator.faults.spoiling import SPOILERS
from drivers.simulator.faults.stranger import Card, Stranger

if TYPE_CHECKING:
    from drivers.simulator.card.controller import Controller
    from drivers.simulator.card.motor import Motor
    from drivers.simulator.card.watchdog import Background

GAIN = 30
"""Ix30, the proportional gain."""


_Item = TypeVar("_Item")


class Rippling(Protocol):
    """An axis whose true speed can oscillate."""

    speed_ripple: float
    ripple_per_turn: int

    def swing_as_built(self) -> None:
        """Oscillate as this spindle does without a fault."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultTarget:
    """The target of faults.

    `motors` are the numbers by axis name, `cut` cuts every open connection, `card` is the controller as another
    host sees it.
    """

    controller: Controller
    motors: Mapping[str, int]
    lines: Lines
    background: Background
    cut: Callable[[], None]
    card: Card

    def motor(self, values: Mapping[str, Value]) -> Motor:
        """Return the addressed motor."""
        return self.controller.motors[self.motors[str(values["motor"])]]


def _nothing() -> None:
    pass


def _never() -> bool:
    return False


def untold() -> str:
    """Report nothing."""
    return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """The effect of a fault. `begin` may be called again while it lasts, unless it is a moment.

    `over` is whether it has ended by itself, `outcome` its result.
    """

    begin: Callable[[], None]
    end: Callable[[], None] = _nothing
    over: Callable[[], bool] = _never
    outcome: Callable[[], str] = untold


def effect_of(name: str, values: Mapping[str, Value], random: Random, site: FaultTarget) -> Effect:
    """Return the effect of the named fault, with a value for each of its parameters."""
    if name in SPOILERS or name in CARRIERS:
        return _on_lines(name, values, random, site.lines)
    return _EFFECTS[name](values, site)


def _on_lines(name: str, values: Mapping[str, Value], random: Random, lines: Lines) -> Effect:
    share, left = float(values.get("share", 1.0)), float(values.get("replies", math.inf))
    chance = Chance(random=random, share=share, left=left)
    if name in SPOILERS:
        return _listed(Spoiler(spoil=SPOILERS[name], chance=chance), lines.spoilers, chance)
    carry = CARRIERS[name](values)
    # The line itself works both ways; the other faults affect the controller's output.
    return _listed(Carrier(carry=carry, chance=chance, both_ways="baud" in values), lines.carriers, chance)


def _listed(item: _Item, listed: list[_Item], chance: Chance) -> Effect:
    def begin() -> None:
        if item not in listed:
            listed.append(item)

    return Effect(begin=begin, end=lambda: listed.remove(item), over=lambda: chance.left <= 0)


def _cut_cable(_: Mapping[str, Value], site: FaultTarget) -> Effect:
    def begin() -> None:
        site.lines.cut = True
        site.cut()

    def end() -> None:
        site.lines.cut = False

    return Effect(begin=begin, end=end)


def _garbled_line(values: Mapping[str, Value], site: FaultTarget) -> Effect:
    find, replace = (str(values[name]).encode("ascii") for name in ("find", "replace"))
    garbling, listed = Garbling(find=find, replace=replace), site.lines.garblings

    def begin() -> None:
        if garbling not in listed:
            listed.append(garbling)

    return Effect(begin=begin, end=lambda: listed.remove(garbling), over=lambda: garbling.over)


def _hang(_: Mapping[str, Value], site: FaultTarget) -> Effect:
    def switch(hung: bool) -> None:
        site.lines.hung = hung

    return Effect(begin=lambda: switch(True), end=lambda: switch(False))


def _encoder_loss(values: Mapping[str, Value], site: FaultTarget) -> Effect:
    axis = site.motor(values).axis

    def switch(lost: bool) -> None:
        axis.encoder_lost = lost

    return Effect(begin=lambda: switch(True), end=lambda: switch(False))


def _index_lost(values: Mapping[str, Value], site: FaultTarget) -> Effect:
    def switch(lost: bool) -> None:
        site.motor(values).index_lost = lost

    return Effect(begin=lambda: switch(True), end=lambda: switch(False))


def _amplifier_fault(values: Mapping[str, Value], site: FaultTarget) -> Effect:
    def switch(faulty: bool) -> None:
        site.motor(values).fault_input = faulty

    return Effect(begin=lambda: switch(True), end=lambda: switch(False))


def _limit(values: Mapping[str, Value], site: FaultTarget) -> Effect:
    def switch(opened: bool) -> None:
        travel = site.motor(values).travel
        if values["direction"] == "positive":
            travel.minus_pin = opened  # this is the pin that blocks the positive direction
        else:
            travel.plus_pin = opened

    return Effect(begin=lambda: switch(True), end=lambda: switch(False))


def _jam(values: Mapping[str, Value], site: FaultTarget) -> Effect:
    motor = site.motor(values)
    axis = motor.axis
    seen_sound = False

    def switch(jammed: bool) -> None:
        axis.jammed = jammed

    def tripped() -> bool:
        """Ignore an earlier trip."""
        nonlocal seen_sound
        seen_sound = seen_sound or not motor.fatal_error
        return seen_sound and motor.fatal_error

    return Effect(begin=lambda: switch(True), end=lambda: switch(False), over=tripped)


def _ripple(values: Mapping[str, Value], site: FaultTarget) -> Effect:
    axis = cast(Rippling, site.motor({"motor": "spindle"}).axis)

    def swing() -> None:
        axis.ripple_per_turn = int(values["per_turn"])
        axis.speed_ripple = float(values["ripple_percent"]) / 100.0

    return Effect(begin=swing, end=axis.swing_as_built)


def _watchdog(_: Mapping[str, Value], site: FaultTarget) -> Effect:
    return Effect(begin=site.background.trip, over=lambda: not site.background.tripped)


def _slow_background(values: Mapping[str, Value], site: FaultTarget) -> Effect:
    slow_down = site.background.slow_down
    return Effect(begin=lambda: slow_down(float(values["cycle_ms"])), end=lambda: slow_down(0.0))


def _stranger(values: Mapping[str, Value], site: FaultTarget) -> Effect:
    stranger = Stranger(site.card)
    return Effect(
        begin=lambda: stranger.write(_line_of_stranger(values, site)),
        end=stranger.leave,
        over=stranger.answered,
        outcome=lambda: stranger.told,
    )


def _line_of_stranger(values: Mapping[str, Value], site: FaultTarget) -> str:
    if "line" in values:
        return str(values["line"])
    variables, tool = site.controller.variables, site.motors["tool"]
    index = variables.dialect.motor_index(tool, GAIN)
    return f"I{index}={0.9 * variables.i(index):g}"


_EFFECTS: Mapping[str, Callable[[Mapping[str, Value], FaultTarget], Effect]] = {
    "garbled-line": _garbled_line,
    "cut-cable": _cut_cable,
    "hang": _hang,
    "encoder-loss": _encoder_loss,
    "index-lost": _index_lost,
    "amplifier-fault": _amplifier_fault,
    "limit": _limit,
    "following-error-trip": _jam,
    "spindle-ripple": _ripple,
    "watchdog": _watchdog,
    "slow-background": _slow_background,
    "stranger-writes": _stranger,
}
