"""The modal state of a coordinate system, kept from line to line and from program to program."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.pmac.language.syntax import VECTOR, Feedrate, Positioning

FEEDRATE_AXES = ("X", "Y", "Z")
"""The axes whose distance a feedrate refers to, until a program sets others."""

XY_PLANE = (0.0, 0.0, -1.0)
"""NORMAL K-1: circles in the plane of X and Y, until a program sets another."""

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
