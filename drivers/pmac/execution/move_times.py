"""The times of a program's moves: TA, TS, TM, F and PVT as the controller uses them, ms.

TA, TS, TM and F are kept in Ix87, Ix88 and Ix89, where they can be read back; only the time of PVT is a mode.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.syntax import VECTOR, Feedrate, Positioning, VariableKind
from drivers.pmac.trajectory.linear import MOVE_TIME_MAX_MS
from drivers.pmac.variables import VariableStore

FEEDRATE_AXES = ("X", "Y", "Z")  # The axes whose distance a feedrate refers to, until a program sets others
XY_PLANE = (0.0, 0.0, -1.0)  # NORMAL K-1: circles in the plane of X and Y, until a program sets another

_RADIUS = "R"


@dataclass(slots=True)
class Modes:
    """The modes as last set.

    `incremental` holds axis letters; the vectors to the centres of circles have an incremental mode of their own.
    `pvt_ms` is the time of PVT segments, 0 before any PVT. `normal` is a vector by I, J and K.
    """

    mode: str = "LINEAR"
    incremental: set[str] = field(default_factory=set)
    by_move_time: bool = False
    pvt_ms: float = 0.0
    feedrate_axes: tuple[str, ...] = FEEDRATE_AXES
    normal: tuple[float, float, float] = XY_PLANE
    radius_incremental: bool = True

    def position(self, statement: Positioning, axes: set[str]) -> None:
        """ABS or INC; without a list it applies to all `axes`, but not to the vectors."""
        named = set(statement.axes)
        if _RADIUS in named:
            self.radius_incremental = statement.incremental
            named.discard(_RADIUS)
        elif not named:
            named = axes
        if statement.incremental:
            self.incremental |= named
        else:
            self.incremental -= named

    def feed(self, statement: Feedrate, axes: set[str]) -> None:
        """FRAX or NOFRAX; without a list it applies to all `axes`."""
        self.feedrate_axes = () if statement.none else tuple(sorted(statement.axes or axes))

    def turn(self, normal: dict[str, float]) -> None:
        """NORMAL: components that are not named are 0."""
        i, j, k = (normal.get(letter, 0.0) for letter in VECTOR)
        self.normal = (i, j, k)


class MoveTimes:
    """The times of one coordinate system."""

    def __init__(self, variables: VariableStore, modes: Modes, system: int) -> None:
        self._variables = variables
        self._modes = modes
        self._system = system

    @property
    def ta_ms(self) -> float:
        """The modal acceleration time."""
        return self._variables.blend_ms(self._system, 87)

    @property
    def ts_ms(self) -> float:
        """The modal S-curve time."""
        return self._variables.blend_ms(self._system, 88)

    @property
    def unit_ms(self) -> float:
        """The time unit of F and of the velocities of PVT."""
        return self._setting(90) or 1000.0

    def keep(self, word: str, value: float) -> None:
        """Execute TA, TS, TM, F or PVT. Raises PmacError: 003, a time that the controller cannot hold."""
        if word in ("TA", "TS"):
            whole = float(_whole_ms(word, value))
            self._store(87 if word == "TA" else 88, whole)
            if word == "TA" and not self._by_move_time:
                self._modes.pvt_ms = self._modes.pvt_ms and whole
        elif word == "PVT":
            self._modes.mode = "PVT"
            self._modes.pvt_ms = self._segment_ms(word, value)
            _check_segment(word, self._modes.pvt_ms)
        else:
            self._modes.by_move_time = word == "TM"
            self._store(89, value)
            if word == "TM" and self._modes.pvt_ms and self._by_move_time:
                self._modes.pvt_ms = self._segment_ms(word, value)

    def linear_ms(self, start: Mapping[str, float], targets: Mapping[str, float]) -> float:
        """TM itself, or the distance of the feedrate axes over F (the last of the two words wins)."""
        return self._setting(89) if self._modes.by_move_time else self._move_time_ms(start, targets)

    def arc(self) -> tuple[float | None, float]:
        """Return TM and no speed, or None and the speed along an arc, user units per ms."""
        if self._modes.by_move_time:
            return self._setting(89), 0.0
        return None, self._feedrate() / self.unit_ms

    def pvt_ms(self) -> float:
        """Return the time of a PVT segment. Raises PmacError: 003, none was set."""
        _check_segment("PVT", self._modes.pvt_ms)
        return self._modes.pvt_ms

    def spline_ms(self) -> float:
        """Return the time of a spline segment.

        Raises PmacError: 003, none was set, or more than the controller can hold.
        """
        if not self._by_move_time:
            duration_ms = self.ta_ms
        elif self._modes.by_move_time:
            duration_ms = self._segment_ms("TM", self._setting(89))
        else:
            raise PmacError(ErrorCode.DATA_ERROR, "SPLINE moves take their time from TM, and F is in force")
        _check_segment("SPLINE", duration_ms)
        return duration_ms

    def _move_time_ms(self, start: Mapping[str, float], targets: Mapping[str, float]) -> float:
        axes = self._modes.feedrate_axes
        distance = math.hypot(*[targets[a] - start[a] for a in axes if a in targets])
        time_ms = distance / self._feedrate() * self.unit_ms if distance else 0.0
        place = self._variables.dialect.other_axes_speed
        if place is not None:
            other = max([abs(targets[a] - start[a]) for a in targets if a not in axes], default=0.0)
            if other:
                time_ms = max(time_ms, self._other_axes_ms(other, self._setting(place), alone=not distance))
        return min(time_ms, MOVE_TIME_MAX_MS)

    def _other_axes_ms(self, distance: float, speed: float, alone: bool) -> float:
        """Return the time of the longest distance of an axis that F does not cover."""
        if speed > 0.0:
            return distance / speed * self.unit_ms
        return distance / self._feedrate() * self.unit_ms if alone else 0.0

    def _feedrate(self) -> float:
        value = self._setting(89)
        if value <= 0.0:
            raise PmacError(ErrorCode.DATA_ERROR, f"feedrate F{value:g}; above 0")
        return value

    @property
    def _by_move_time(self) -> bool:
        """Whether TM, not TA, gives SPLINE and PVT moves their time."""
        switch = self._variables.dialect.segment_time_switch
        return switch is not None and self._variables.i(switch) == 0.0

    def _segment_ms(self, word: str, value: float) -> float:
        """Return the time of a SPLINE or PVT segment in the controller's resolution."""
        if not self._by_move_time:
            return float(_whole_ms(word, value))
        dialect = self._variables.dialect
        step = dialect.segment_step_ms
        rounded = math.floor(value / step + 0.5) * step
        if not 0.0 <= rounded <= dialect.longest_segment_ms:
            raise PmacError(ErrorCode.DATA_ERROR, f"{word} {value} ms, 0 to {dialect.longest_segment_ms:.0f}")
        return rounded

    def _setting(self, number: int) -> float:
        return self._variables.system(self._system, number)

    def _store(self, number: int, value: float) -> None:
        self._variables.set(VariableKind.I, self._variables.dialect.system_index(self._system, number), value)


def _check_segment(word: str, duration_ms: float) -> None:
    if duration_ms <= 0.0:
        raise PmacError(ErrorCode.DATA_ERROR, f"a {word} segment of no time")


def _whole_ms(word: str, value: float) -> int:
    """Round to the nearest whole millisecond, as the controller does when the word is executed."""
    rounded = math.floor(value + 0.5)
    if not 0 <= rounded <= MOVE_TIME_MAX_MS:
        raise PmacError(ErrorCode.DATA_ERROR, f"{word} {value} ms, 0 to {MOVE_TIME_MAX_MS:.0f}")
    return rounded
