"""How long the first homing takes at most: nobody knows where the zeros are, but how far they can be."""

from __future__ import annotations

from pathlib import Path

from console.session.station.commands import EnableDrives, Home
from tests.console.floor import open_floor


def test_the_first_homing_ends_within_the_time_that_was_told(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    told: list[float | None] = []
    floor.do(EnableDrives())
    floor.looks.append(lambda _: told.append(floor.state.ends_s if floor.state.ends_at_most else None))
    floor.do(Home())
    latest_s = told[len(told) // 2]
    assert latest_s is not None and floor.context.clock.now_s() <= latest_s
