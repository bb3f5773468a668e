"""Fault commands as typed: `inject late-reply after=1.5 for=0.2 delay_ms=300 seed=3`."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from typing import Protocol

from drivers.simulator.faults.board import FaultBoard, Injected
from drivers.simulator.faults.catalogue import CATALOGUE, find
from drivers.simulator.faults.parameter import Parameter, Value, refusal

WORDS = ("list", "help NAME", "inject NAME [KEY=VALUE ...]", "active", "clear")


class Faulty(Protocol):
    """A machine that supports fault injection."""

    @property
    def faults(self) -> FaultBoard:
        """Its faults."""

    def now_s(self) -> float:
        """Return the simulated time."""


def obey(lathe: Faulty, words: Sequence[str]) -> list[str] | None:
    """Execute a fault command; return the text to report, None where the words are not about faults.

    Raises:
        RefusedError: `simulator.fault`.
    """
    match words:
        case ["list"]:
            return [f"{fault.name}: {fault.does}" for fault in CATALOGUE.values()]
        case ["help", name]:
            return list(_help(name))
        case ["inject", name, *settings]:
            injected = _inject(lathe.faults, name, settings)
            return [line for line in (_told(injected, lathe.now_s()), injected.outcome()) if line]
        case ["active"]:
            told = [_told(injected, lathe.now_s()) for injected in lathe.faults.active()]
            return [*told, *_shut_down(lathe.faults)]
        case ["clear"]:
            lathe.faults.clear()
            return _shut_down(lathe.faults)
        case _:
            return None


def _help(name: str) -> Iterator[str]:
    fault = find(name)
    yield f"{fault.name}: {fault.does} It concerns {fault.concerns}."
    for parameter in (*fault.parameters, *fault.times):
        default = "" if parameter.default is None else f"; default {_plain(parameter.default)}"
        yield f"  {parameter.name}{_unit(parameter)}: {parameter.meaning}; {parameter.allowed}{default}"


def _inject(board: FaultBoard, name: str, settings: list[str]) -> Injected:
    find(name)
    given: dict[str, Value] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key or key in given:
            raise refusal(name, "setting", ascii(setting)[1:-1], "KEY=VALUE, each key once")
        given[key] = value
    return board.ask(name, given)


def _shut_down(board: FaultBoard) -> list[str]:
    """State that the end of the fault does not repair its effect."""
    if board.shut_down_s is None:
        return []
    return [f"card shut down by its watchdog at {board.shut_down_s:.3f} s; power-cycle"]


def _told(injected: Injected, now_s: float) -> str:
    state = " (waits)" if injected.begins_s > now_s else ""
    values = "".join(f" {key}={shlex.quote(_plain(value))}" for key, value in injected.values.items())
    end = "until it is cleared" if math.isinf(injected.ends_s) else f"to {injected.ends_s:.3f} s"
    when = f"at {injected.begins_s:.3f} s" if injected.fault.moment else f"from {injected.begins_s:.3f} s {end}"
    return f"{injected.name}{values} seed={injected.seed}, {when}{state}"


def _unit(parameter: Parameter) -> str:
    return f" ({parameter.unit})" if parameter.unit else ""


def _plain(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else value
