"""A machine that is not free to be written: its drives, another console, gathering, a password."""

from __future__ import annotations

from drivers.lathe.ownership import Ownership
from tests.drivers.commissioned import Commissioned


def occupied(card: Commissioned, why: str, program: int) -> bool:
    """Keep the machine from being written for this reason, or return False where it is another one."""
    if why == "drives":
        card.tell("#1J/")
    elif why == "owner":
        Ownership(card.client).claim()
    elif why == "gathering":
        card.tell("I20=1", "I21=$800028", "I19=1000", "DEFINE GATHER 10000", "GATHER")
    elif why == "password":
        card.tell(f"OPEN PROG {program} CLEAR", "X1", "CLOSE", "PASSWORD=Turn")
        card.sim.controller.password.locked = True
    else:
        return False
    return True
