"""`pvt`: the inverted sinusoid in PVT segments, the spindle turned by the program."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cutting.strategies.traits import Made, Planning, Traits

if TYPE_CHECKING:
    from profiles.compensations.path import LobedPath


def by_pvt(planning: Planning, command: LobedPath) -> Made:
    """Return the program that commands this path."""
    from drivers.pmac.programs.pvt import pvt_program

    return Made(
        text=pvt_program(planning.job, planning.setup, command),
        tool_start=planning.setup.retracted,
        definitions=planning.machine.controller.axis_definitions,
    )


def _made(planning: Planning) -> Made:
    return by_pvt(planning, planning.command)


TRAITS = Traits(make=_made, inverts=True)
