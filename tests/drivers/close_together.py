"""A file that takes `machine` from here works the lathe of the paper with everything close together."""

from __future__ import annotations

import pytest

from profiles.machine import MachineProfile
from tests.compact import compact_machine


@pytest.fixture(scope="session")
def machine() -> MachineProfile:
    return compact_machine().machine
