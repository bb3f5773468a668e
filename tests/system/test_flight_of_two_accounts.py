"""The flight recorder in a data folder that two accounts share: each finds what the other's console has left."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from console.flight.frozen import frozen_in
from console.flight.recording import read_recording
from tests.console.flight.bench import FlightBench, reasons
from tests.system.accounts import GROUP, A, B, as_account, lathe_folder, needs_root

pytestmark = [pytest.mark.system, needs_root]


def is_killed(data: Path) -> None:
    """A console records, and ends without an end."""
    bench = FlightBench(data)
    bench.runs(20.0)
    bench.alarms()
    bench.runs(6.0)


def starts(data: Path) -> None:
    bench = FlightBench(data)
    bench.recorder._freeze_left()
    bench.runs(1.0)
    bench.recorder._finish()


def test_the_ring_of_a_killed_console_of_another_account_is_frozen(tmp_path: Path) -> None:
    is_killed(tmp_path)  # all that is imported on use is there: the accounts may not read the interpreter
    assert len([read_recording(path) for path in frozen_in(tmp_path)]) == 1
    with lathe_folder() as data:
        as_account(A, lambda: is_killed(data), 0o077)
        as_account(B, lambda: starts(data), 0o077)
        files = list((data / "flight").rglob("*"))
        assert list((data / "flight" / "running").iterdir()) == []
        found = [read_recording(path) for path in frozen_in(data)]
        assert sorted(reasons(each)[0] for each in found) == ["cut.spindle_stands", "killed"]
        assert {path.stat().st_gid for path in files} == {GROUP}
        assert {stat.S_IMODE(path.stat().st_mode) for path in files} == {0o660, 0o2770}
