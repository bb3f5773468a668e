"""Whoever shows the machine sees every look, in whatever wait it was taken, and how long the last one took."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from drivers.errors import LinkTimeoutError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.program_text import read_program

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

SHORT = "OPEN PROG 3\nCLEAR\nINC\nTA100 TS0 TM1000\nZ1000\nCLOSE\n"


class LateLink(MemoryLink):
    """A link whose answers are late, or do not come at all."""

    late_s = 0.0
    deaf = False

    def receive(self, timeout_s: float) -> bytes:
        data = super().receive(timeout_s)
        if data:
            self._clock.wait(self.late_s)
        return b"" if self.deaf else data


def observed(bench: Bench) -> tuple[LateLink, Lathe, list[Snapshot]]:
    seen: list[Snapshot] = []
    link = LateLink(bench.port, bench.sim)
    lathe = Lathe(PmacClient(link, bench.sim), bench.lathe.machine, bench.sim, StopPath(link), seen.append)
    lathe.connect()
    lathe.verify()
    return link, lathe, seen


def test_every_wait_shows_the_machine_on_its_way(bench: Bench) -> None:
    _, lathe, seen = observed(bench)
    lathe.enable()
    lathe.home()
    assert any("home_search" in s.tool.flags for s in seen)
    assert any("home_search" in s.spindle.flags for s in seen)
    seen.clear()
    lathe.jog_to(AxisName.CARRIAGE, 10_000.0)
    assert [s.carriage.position for s in seen] == sorted(s.carriage.position for s in seen)
    assert any(100 < s.carriage.position < 9_900 and s.moving for s in seen)
    lathe.program.load(read_program(SHORT))
    seen.clear()
    watched: list[Snapshot] = []
    lathe.program.start(3, 0.0)
    last = lathe.program.follow(watched.append, timeout_s=10.0)
    assert seen == watched
    assert seen[-1] is last
    assert not last.moving
    lathe.stop.stop("operator")
    seen.clear()
    assert lathe.wait_for_rest() is seen[-1]
    assert len(seen) >= 3


def test_a_look_that_is_seen_is_the_one_that_is_returned(bench: Bench) -> None:
    _, lathe, seen = observed(bench)
    assert [lathe.snapshot()] == seen


def test_the_round_trip_is_that_of_the_last_look(bench: Bench) -> None:
    link, lathe, _ = observed(bench)
    assert lathe.round_trip_s == 0.0
    lathe.snapshot()
    quick_s = lathe.round_trip_s
    assert 0.0 < quick_s < 0.02, "the card answers in its next background cycle, of 5 ms"
    link.late_s = 0.2
    lathe.snapshot()
    assert lathe.round_trip_s == pytest.approx(quick_s + 0.2, abs=0.02)


def test_a_look_that_fails_shows_nothing_and_keeps_the_last_round_trip(bench: Bench) -> None:
    link, lathe, seen = observed(bench)
    lathe.snapshot()
    before_s = lathe.round_trip_s
    link.deaf = True
    with pytest.raises(LinkTimeoutError):
        lathe.snapshot()
    assert len(seen) == 1
    assert lathe.round_trip_s == before_s
