"""Conditions of the commands; what does not hold is a refusal, and the machine is left alone."""

from __future__ import annotations

from console.session.errors import SessionError
from console.session.station.context import StationContext
from profiles.problem import Problem


def require(holds: bool, code: str) -> None:
    """Refuse with a code unless something holds. Raises SessionError."""
    if not holds:
        raise SessionError(Problem(code=code))


def refuse_unless_homed(context: StationContext) -> None:
    """Refuse unless the drives are enabled and the zeros known: `alignment.drives_off`, `alignment.not_homed`."""
    require(context.lathe.snapshot().loops_closed, "alignment.drives_off")
    require(context.lathe.snapshot().homed, "alignment.not_homed")
