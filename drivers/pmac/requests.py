"""What a motion program requests, one request at a time: the interface between execution and motion.

Positions are user units of axes, times ms. `line` counts the lines of the program from 0. `deferred` are the
assignments (`M1==1`) that take effect when the move starts. `absolute` are the axes with a target position in the
line (ABS), which rotary axes may approach either way round (Ix27); all others move by the distance given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from drivers.pmac.language.syntax import VariableKind


@dataclass(frozen=True, slots=True, kw_only=True)
class DeferredValue:
    """A value that is stored when its move starts."""

    kind: VariableKind
    index: int
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _ToTargets:
    """A move to `targets`, every axis of the system."""

    line: int
    targets: Mapping[str, float]
    absolute: frozenset[str] = frozenset()
    deferred: tuple[DeferredValue, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearRequest(_ToTargets):
    """A LINEAR move with the modal times."""

    ta_ms: float
    ts_ms: float
    tm_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CircleRequest(_ToTargets):
    """An arc in the plane normal to `normal` (I, J, K), which also defines clockwise.

    The centre is `center` (a vector by X, Y, Z from the start), or at `radius` (below 0: the longer arc). The time
    is `tm_ms`, or None: then the length of the arc over `speed_per_ms`.
    """

    clockwise: bool
    normal: tuple[float, float, float]
    center: Mapping[str, float] | None
    radius: float | None
    ta_ms: float
    ts_ms: float
    tm_ms: float | None
    speed_per_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RapidRequest(_ToTargets):
    """A RAPID move of the axes in `moving`: a jog of their motors, never blended."""

    moving: frozenset[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class SplineRequest(_ToTargets):
    """A segment of a cubic B-spline; `uniform` is SPLINE1, where a change of the time ends the sequence."""

    duration_ms: float
    uniform: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class PvtRequest(_ToTargets):
    """A PVT segment with `velocities` at its end (user units per ms)."""

    velocities: Mapping[str, float]
    duration_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DwellRequest:
    """Come to rest, then wait in real time; `deferred` take effect when the waiting begins."""

    duration_ms: float
    deferred: tuple[DeferredValue, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class HomeRequest:
    """Come to rest, home these motors (or declare them homed, `zero`), and continue when all are done."""

    line: int
    motors: tuple[int, ...]
    zero: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class TriggerRequest(_ToTargets):
    """Come to rest; the axes in `moving` go to their targets as a jog does, and some end at a trigger on the way.

    `past_trigger` is how far past it they end, in user units, by axis. The program continues when all are done,
    whether there was a trigger or not.
    """

    moving: frozenset[str]
    past_trigger: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class PresetRequest:
    """Come to rest; the axes are then at `positions` without having moved."""

    line: int
    positions: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class BlendBreak:
    """No move to blend with, after two backward jumps or a WAIT: let the previous move stop, then call again."""


@dataclass(frozen=True, slots=True)
class Halt:
    """STOP: come to rest; the program can resume from here."""


@dataclass(frozen=True, slots=True)
class EndOfProgram:
    """The end of the program."""


MoveRequest = LinearRequest | CircleRequest | RapidRequest | SplineRequest | PvtRequest
Request = (
    MoveRequest | DwellRequest | HomeRequest | TriggerRequest | PresetRequest | BlendBreak | Halt | EndOfProgram
)


@dataclass(frozen=True, slots=True)
class DefaultAddress:
    """The motor and the coordinate system of commands that do not name one."""

    motor: int = 1
    system: int = 1


ADDRESS_OF_PROGRAMS = DefaultAddress()  # the addressing of a motion program's commands, whichever system runs it


class ProgramHost(Protocol):
    """Receives the words that are not about motion, of a program when their line is calculated, and of a PLC."""

    def command(self, text: str, port: str, addressed: DefaultAddress = ADDRESS_OF_PROGRAMS) -> None:
        """CMD: an on-line command for the background; without a motor or system it is for those addressed."""
        return

    def send(self, text: str, port: str) -> None:
        """SEND: text for a host."""
        return

    def display(self, text: str) -> None:
        """DISPLAY: text for the display port."""
        return

    def switch_plc(self, enable: bool, numbers: tuple[int, ...], keeping: bool = False) -> None:
        """ENABLE or DISABLE PLC; `keeping` its place, RESUME or PAUSE PLC. A running one ends its scan."""
        return


class NoHost(ProgramHost):
    """A host without effect, for the checker."""
