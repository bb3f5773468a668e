"""The bundled lathe in both families, or with everything close together.

A file that takes `machine` from here runs in both families; `machine = families.close_machine` is the lathe of the
paper with everything close together, `machine = families.close_families` that in both families.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.simulator.plant.true_parameters import as_simulated
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.compact import compact_machine

ON_ONE = pytest.mark.parametrize("machine", ["pmac"], indirect=True)
"""For what is decided by the host, whatever the controller: in such a file, others work both families."""


def of_family(machine: MachineProfile, family: str) -> MachineProfile:
    """The same lathe with a controller of a family."""
    return replace(machine, controller=replace(machine.controller, family=family))


@pytest.fixture(scope="module", params=["pmac", "turbo"])
def machine(request: pytest.FixtureRequest) -> MachineProfile:
    return of_family(as_simulated(load_machine("lee-2001-lathe").machine, None), request.param)


@pytest.fixture(scope="session")
def close_machine() -> MachineProfile:
    return compact_machine().machine


@pytest.fixture(scope="module", params=["pmac", "turbo"])
def close_families(request: pytest.FixtureRequest) -> MachineProfile:
    return of_family(compact_machine().machine, request.param)
