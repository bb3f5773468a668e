"""Execute text commands to a served simulator: faults, and an operator's actions at the lathe.

A reply is some lines, the last of which is `ok` or `refused: ...`. A fault is injected by a line such as
`inject late-reply after=1.5 for=0.2 delay_ms=300 seed=3`.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator

from drivers.errors import RefusedError
from drivers.simulator.faults.board import FaultBoard, Injected, inject_words
from drivers.simulator.faults.catalogue import CATALOGUE, Parameter, Value, find, refusal
from drivers.simulator.hosts.control_address import LONGEST_LINE, OK, REFUSED
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.collision import Collision

_FAULT_WORDS = ("list", "help NAME", "inject NAME [KEY=VALUE ...]", "active", "clear")
WORDS = (*_FAULT_WORDS, "power-cycle", "spindle RPM", "spindle off", "collisions")


def answer(lathe: SimulatedLathe, line: str) -> str:
    """Execute a line; return the text to report, lines with an end each."""
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
    except _CannotBeDoneError as error:
        said = [f"{REFUSED}{error}"]
    return "".join(f"{item}\n" for item in said)


class _CannotBeDoneError(Exception):
    """The lathe has no such thing, whatever the value."""


def _obey(lathe: SimulatedLathe, line: str) -> list[str]:  # noqa: C901 - one branch a case
    if len(line.encode("utf-8", "replace")) > LONGEST_LINE:
        raise _CannotBeDoneError(f"a line has at most {LONGEST_LINE} bytes")
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
            injected = inject_words(lathe.faults, name, settings)
            return [said for said in (_described(injected, lathe.now_s()), injected.effect.outcome()) if said]
        case ["active"]:
            active = [_described(injected, lathe.now_s()) for injected in lathe.faults.active()]
            return [*active, *_shut_down(lathe.faults)]
        case ["clear"]:
            lathe.faults.clear()
            return _shut_down(lathe.faults)
        case ["power-cycle"]:
            lathe.power_cycle()
        case ["spindle", value]:
            _turn_spindle(lathe, value)
        case ["collisions"]:
            return [_seen(collision) for collision in lathe.collisions]
        case _:
            raise _no_command(line)
    return []


def _no_command(line: str) -> RefusedError:
    return refusal("", "command", _shown(line.strip())[:80], " | ".join(WORDS))


def _help(name: str) -> Iterator[str]:
    fault = find(name)
    yield f"{fault.name}: {fault.does} It concerns {fault.concerns}."
    for parameter in (*fault.parameters, *fault.times):
        default = "" if parameter.default is None else f"; default {_plain(parameter.default)}"
        yield f"  {parameter.name}{_unit(parameter)}: {parameter.meaning}; {parameter.allowed}{default}"


def _shut_down(board: FaultBoard) -> list[str]:
    """State that the end of the fault does not repair its effect."""
    if board.shut_down_s is None:
        return []
    return [f"card shut down by its watchdog at {board.shut_down_s:.3f} s; power-cycle"]


def _described(injected: Injected, now_s: float) -> str:
    state = " (waits)" if injected.begins_s > now_s else ""
    values = "".join(f" {key}={shlex.quote(_plain(value))}" for key, value in injected.values.items())
    end = "until it is cleared" if math.isinf(injected.ends_s) else f"to {injected.ends_s:.3f} s"
    when = f"at {injected.begins_s:.3f} s" if injected.fault.moment else f"from {injected.begins_s:.3f} s {end}"
    return f"{injected.fault.name}{values} seed={injected.seed}, {when}{state}"


def _unit(parameter: Parameter) -> str:
    return f" ({parameter.unit})" if parameter.unit else ""


def _plain(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else value


def _turn_spindle(lathe: SimulatedLathe, value: str) -> None:
    """Set the spindle as at its inverter: a speed, positive in the direction of the cut, or off."""
    try:
        lathe.set_spindle(None if value == "off" else float(value))
    except ValueError as error:
        raise _CannotBeDoneError(f"spindle '{_shown(value)}' is not possible; allowed: RPM | off") from error
    except RuntimeError as error:
        raise _CannotBeDoneError(f"spindle '{_shown(value)}' is not possible; {error}") from error


def _seen(collision: Collision) -> str:
    angle_deg = round(collision.angle_deg, 2) % 360.0
    where = f"radius {collision.radius_mm:.3f} mm, Z {collision.z_mm:.3f} mm, {angle_deg:.2f} deg"
    return f"{collision.kind}: {where}, at {collision.time_ms:.1f} ms"


def _shown(text: str) -> str:
    return ascii(text)[1:-1]
