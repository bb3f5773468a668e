"""A file that takes `machine` from here works that lathe, everything close together, in both families."""

from __future__ import annotations

import pytest

from profiles.machine import MachineProfile
from tests.compact import compact_machine
from tests.drivers.families import of_family


@pytest.fixture(scope="module", params=["pmac", "turbo"])
def machine(request: pytest.FixtureRequest) -> MachineProfile:
    return of_family(compact_machine().machine, request.param)
