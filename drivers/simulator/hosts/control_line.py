"""Execute text commands to a served simulator: faults, and an operator's actions at the lathe.

A reply is some lines, the last of which is `ok` or `refused: ...`.
"""

from __future__ import annotations

import shlex
from typing import Protocol

from drivers.errors import RefusedError
from drivers.simulator.faults import command
from drivers.simulator.faults.catalogue import CATALOGUE
from drivers.simulator.faults.parameter import refusal
from drivers.simulator.hosts.control_address import LONGEST_LINE, OK, REFUSED
from drivers.simulator.plant.collision import Collision

WORDS = (*command.WORDS, "power-cycle", "spindle RPM", "spindle off", "collisions")


class Attended(command.Faulty, Protocol):
    """A lathe with an operator: its switches, and what can be seen there."""

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """The collisions since the last blank was clamped."""

    def power_cycle(self) -> None:
        """Power-cycle the controller."""

    def set_spindle(self, rpm: float | None) -> None:
        """Set a spindle on an inverter; None disables it."""


def answer(lathe: Attended, line: str) -> str:
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


def _obey(lathe: Attended, line: str) -> list[str]:
    if len(line.encode("utf-8", "replace")) > LONGEST_LINE:
        raise _CannotBeDoneError(f"a line has at most {LONGEST_LINE} bytes")
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise _no_command(f"{line} ({error})") from error
    match words:
        case ["power-cycle"]:
            lathe.power_cycle()
        case ["spindle", value]:
            _turn_spindle(lathe, value)
        case ["collisions"]:
            return [_told(collision) for collision in lathe.collisions]
        case _:
            said = command.obey(lathe, words)
            if said is None:
                raise _no_command(line)
            return said
    return []


def _no_command(line: str) -> RefusedError:
    return refusal("", "command", _shown(line.strip())[:80], " | ".join(WORDS))


def _turn_spindle(lathe: Attended, value: str) -> None:
    """Set the spindle as at its inverter: a speed, positive in the direction of the cut, or off."""
    try:
        lathe.set_spindle(None if value == "off" else float(value))
    except ValueError as error:
        raise _CannotBeDoneError(f"spindle '{_shown(value)}' is not possible; allowed: RPM | off") from error
    except RuntimeError as error:
        raise _CannotBeDoneError(f"spindle '{_shown(value)}' is not possible; {error}") from error


def _told(collision: Collision) -> str:
    angle_deg = round(collision.angle_deg, 2) % 360.0
    where = f"radius {collision.radius_mm:.3f} mm, Z {collision.z_mm:.3f} mm, {angle_deg:.2f} deg"
    return f"{collision.kind}: {where}, at {collision.time_ms:.1f} ms"


def _shown(text: str) -> str:
    """Return the refused value, shortened to one line."""
    return ascii(text)[1:-1]
