"""Conditions of the commands; what does not hold is a refusal, and the machine is left alone."""

from __future__ import annotations

from console.session.cut.alignment import table_problems
from console.session.errors import SessionError, refuse
from console.session.station.context import StationContext
from profiles.problem import Problem


def require(holds: bool, code: str) -> None:
    """Refuse with a code unless something holds. Raises SessionError."""
    if not holds:
        raise SessionError(Problem(code=code))


def refuse_unless_homed(context: StationContext) -> None:
    """Refuse unless the drives are enabled and the zeros known: `alignment.drives_off`, `alignment.not_homed`.

    Also while a table is left on (`cut.table_on`): it would move the tool with the carriage and the spindle.
    """
    require(context.lathe.snapshot().loops_closed, "alignment.drives_off")
    refuse(table_problems(context.state.alignment))
    require(context.lathe.snapshot().homed, "alignment.not_homed")
