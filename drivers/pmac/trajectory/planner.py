"""From requests of a program to pieces of motion: the one place where a move mode becomes a trajectory.

The simulator plays the pieces, the checker draws them. Motors are taken in the order of the axis definitions;
positions are counts, times ms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from drivers.pmac.axes import AxisDefinition
from drivers.pmac.dialect import Setting
from drivers.pmac.execution import (
    BlendBreak,
    DwellRequest,
    Finished,
    LinearRequest,
    ProgramRun,
    PvtRequest,
)
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.settings import servo_cycle_ms
from drivers.pmac.trajectory.linear import (
    Blend,
    Limits,
    LinearMove,
    NoAccelerationTimeError,
    Timing,
    at_rest,
    lay,
    stop,
)
from drivers.pmac.trajectory.pieces import Piece, Vector, constant, hermite, ramp
from drivers.pmac.variables import VariableStore

FARTHEST_COUNTS = 2.0**47 / (96 * 32)
"""Positions are 48 bits wide, in units of 1/(32 Ix08) count; the factory's Ix08 is 96."""

SHORTEST_RAMP_MS = 1.0
"""How a motion comes to rest when TA and TS, both zero, leave it no time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveRecord:
    """What was asked and what is done with it; `timing` is None for PVT, which is done as asked."""

    line: int
    target: Vector
    asked: Timing
    timing: Timing | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """The pieces that one look at the program gave; `finished` when nothing follows them."""

    pieces: tuple[Piece, ...]
    record: MoveRecord | None = None
    finished: bool = False


class MotionPlanner:
    """Lays the trajectory of one program run, one request at a time."""

    def __init__(
        self,
        run: ProgramRun,
        definitions: tuple[AxisDefinition, ...],
        variables: VariableStore,
        position: Vector,
        system: int = 1,
    ) -> None:
        """`position` are the commanded motor positions in counts, in the order of `definitions`."""
        self.run = run
        self._definitions = definitions
        self._variables = variables
        self._system = system
        self._blend: Blend = at_rest(position)
        self._pvt_velocity: Vector | None = None

    def plan(self) -> Planned:
        """Calculate the next request and lay it.

        Raises:
            PmacError: a run-time error of the program.
        """
        request = self.run.advance()
        try:
            match request:
                case LinearRequest():
                    return self._linear(request)
                case PvtRequest():
                    return self._pvt(request)
                case DwellRequest():
                    return self._dwell(request.duration_ms)
                case BlendBreak():
                    return self._dwell(0.0)
                case Finished():
                    return Planned(pieces=self._stop(), finished=True)
        except NoAccelerationTimeError as error:
            raise PmacError(ErrorCode.DATA_ERROR, "TA and TS are both zero") from error

    def halt(self, rates: Vector) -> tuple[Piece, ...]:
        """Give up the program: a blended move ends at its target, a PVT motion ramps down.

        `rates` are Ix15 of the motors, counts/ms^2; the slowest motor sets the time, so that they stop together.
        """
        velocity = self._pvt_velocity
        self._pvt_velocity = None
        if velocity is None or not any(velocity):
            return self._stop(SHORTEST_RAMP_MS)
        times = [abs(v) / rate if rate > 0.0 else 0.0 for v, rate in zip(velocity, rates, strict=True)]
        still = tuple(0.0 for _ in velocity)
        return ramp(self._blend.target, velocity, still, max(times) or 1.0, 0.0, calculates=False)

    def _linear(self, request: LinearRequest) -> Planned:
        if self._pvt_velocity is not None:
            self._end_pvt()
        target = self._counts(request.targets)
        distance = tuple(t - p for t, p in zip(target, self._blend.target, strict=True))
        move = LinearMove(distance=distance, ta_ms=request.ta_ms, ts_ms=request.ts_ms, tm_ms=request.tm_ms)
        pieces, self._blend, timing = lay(self._blend, move, self._limits())
        asked = Timing(ta_ms=request.ta_ms, ts_ms=request.ts_ms, tm_ms=request.tm_ms)
        record = MoveRecord(line=request.line, target=target, asked=asked, timing=timing)
        return Planned(pieces=pieces, record=record)

    def _pvt(self, request: PvtRequest) -> Planned:
        target = self._counts(request.targets)
        after = tuple([d.scale * request.velocities.get(d.axis, 0.0) for d in self._definitions])
        _check_range("velocity", after)
        stopping = self._stop() if self._pvt_velocity is None else ()
        before = self._pvt_velocity or tuple(0.0 for _ in self._definitions)
        segment = hermite(self._blend.target, before, target, after, request.duration_ms)
        self._blend, self._pvt_velocity = at_rest(target), after
        asked = Timing(ta_ms=0.0, ts_ms=0.0, tm_ms=request.duration_ms)
        record = MoveRecord(line=request.line, target=target, asked=asked, timing=None)
        return Planned(pieces=(*stopping, segment), record=record)

    def _dwell(self, duration_ms: float) -> Planned:
        pieces = self._stop()
        # Never less than one real-time interrupt, or a loop without moves would never let go of the time.
        wait_ms = max(duration_ms, 0.0 if pieces else self._interrupt_ms())
        if wait_ms > 0.0:
            still = tuple(0.0 for _ in self._definitions)
            pieces = (*pieces, constant(self._blend.target, still, wait_ms))
        return Planned(pieces=pieces)

    def _stop(self, least_ms: float = 0.0) -> tuple[Piece, ...]:
        """Come to rest with the TA and TS now in force; a PVT sequence ends as it was told to."""
        if self._pvt_velocity is not None:
            self._end_pvt()
            return ()
        ta_ms = max(self._variables.blend_ms(self._system, 87), least_ms)
        ts_ms = self._variables.blend_ms(self._system, 88)
        pieces = stop(self._blend, ta_ms, ts_ms, self._limits())
        self._blend = at_rest(self._blend.target)
        return pieces

    def _end_pvt(self) -> None:
        if any(self._pvt_velocity or ()):
            raise PmacError(ErrorCode.DATA_ERROR, "a PVT sequence that does not end at rest")
        self._pvt_velocity = None

    def _counts(self, targets: Mapping[str, float]) -> Vector:
        counts = tuple([d.counts(targets[d.axis]) for d in self._definitions])
        _check_range("position", counts)
        return counts

    def _limits(self) -> Limits:
        """Ix16 and Ix17 count only while moves are not segmented (I13 = 0)."""
        if self._variables.setting(Setting.SEGMENT_MS, self._system) != 0.0:
            none = tuple(0.0 for _ in self._definitions)
            return Limits(velocity=none, acceleration=none)
        return Limits(
            velocity=tuple(self._variables.motor(d.motor, 16) for d in self._definitions),
            acceleration=tuple(self._variables.motor(d.motor, 17) for d in self._definitions),
        )

    def _interrupt_ms(self) -> float:
        return (self._variables.i(8) + 1.0) * servo_cycle_ms(self._variables.i(10))


def _check_range(what: str, values: Vector) -> None:
    """Refuse what the registers of the card cannot hold; a nan is beyond them too."""
    for value in values:
        if not abs(value) <= FARTHEST_COUNTS:
            raise PmacError(ErrorCode.DATA_ERROR, f"{what} {value:g}, up to {FARTHEST_COUNTS:g} counts")
