"""Faults asked for in a line of text, as it is typed: `inject late-reply after=1.5 for=0.2 delay_ms=300 seed=3`.

An answer is some lines, the last of which is `ok` or `refused: ...`.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from typing import Protocol

from drivers.errors import RefusedError
from drivers.simulator.control_address import OK, REFUSED
from drivers.simulator.faults.board import FaultBoard, Injected
from drivers.simulator.faults.catalogue import AFTER, CATALOGUE, FOR, SEED, find
from drivers.simulator.faults.parameter import Parameter, Value, refusal

WORDS = ("list", "help NAME", "inject NAME [KEY=VALUE ...]", "active", "clear", "power-cycle")


class Faulty(Protocol):
    """A machine with a card that can be switched off and on."""

    @property
    def faults(self) -> FaultBoard:
        """Its faults."""

    def now_s(self) -> float:
        """Return the simulated time."""

    def power_cycle(self) -> None:
        """Switch the card off and on."""


def answer(lathe: Faulty, line: str) -> str:
    """Do what a line asks for; return all that is to be said about it, lines with an end each."""
    try:
        said = [*_obey(lathe, line), OK]
    except RefusedError as error:
        problem = error.problems[0]
        fault = f"{problem.where}: " if problem.where not in ("", problem.value) else ""
        remedy = f"help {problem.where}" if problem.where in CATALOGUE else "list"
        said = [
            f"{REFUSED}{fault}{problem.key} '{problem.value}' is not possible;"
            f" allowed: {problem.limit}; `{remedy}` tells more"
        ]
    return "".join(f"{item}\n" for item in said)


def _obey(lathe: Faulty, line: str) -> list[str]:
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise _no_command(f"{line} ({error})") from error
    match words:
        case ["list"]:
            return [f"{fault.name}: {fault.does}" for fault in CATALOGUE.values()]
        case ["help", name]:
            return list(_help(name))
        case ["inject", name, *settings]:
            return [_told(_inject(lathe.faults, name, settings), lathe.now_s())]
        case ["active"]:
            return [_told(injected, lathe.now_s()) for injected in lathe.faults.active()]
        case ["clear"]:
            lathe.faults.clear()
        case ["power-cycle"]:
            lathe.power_cycle()
        case _:
            raise _no_command(line)
    return []


def _no_command(line: str) -> RefusedError:
    return refusal("", "command", ascii(line.strip())[1:-1][:80], " | ".join(WORDS))


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
    after_s, for_s, seed = given.pop(AFTER.name, 0.0), given.pop(FOR.name, None), given.pop(SEED.name, 0.0)
    return board.ask(name, given, after_s=after_s, for_s=for_s, seed=seed)


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
