"""The bundled lathe with a controller of either family: a file that takes `machine` from here runs in both."""

from __future__ import annotations

from dataclasses import replace

import pytest

from profiles.machine import MachineProfile
from profiles.store import load_machine


@pytest.fixture(scope="module", params=["pmac", "turbo"])
def machine(request: pytest.FixtureRequest) -> MachineProfile:
    lathe = load_machine("lee-2001-lathe").machine
    return replace(lathe, controller=replace(lathe.controller, family=request.param))
