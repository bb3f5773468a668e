"""The bundled lathe with a controller of either family: a file that takes `machine` from here runs in both."""

from __future__ import annotations

from dataclasses import replace

import pytest

from profiles.machine import MachineProfile
from profiles.store import load_machine

ON_ONE = pytest.mark.parametrize("machine", ["pmac"], indirect=True)
"""For what is decided by the host, whatever the controller: in such a file, others work both families."""


def of_family(machine: MachineProfile, family: str) -> MachineProfile:
    """The same lathe with a controller of a family."""
    return replace(machine, controller=replace(machine.controller, family=family))


@pytest.fixture(scope="module", params=["pmac", "turbo"])
def machine(request: pytest.FixtureRequest) -> MachineProfile:
    return of_family(load_machine("lee-2001-lathe").machine, request.param)
