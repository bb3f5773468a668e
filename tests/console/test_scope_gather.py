"""The scope gathers at rest, while an axis is jogged and in a cut, and takes nothing from anybody."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.station import jogging
from console.session.station.commands import EnableDrives, Home, Jog, Start
from console.session.station.state import Activity
from console.tui.further.scope import ScopeWork
from drivers.errors import LinkError
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.requests.scope_gather import ANGLE, Axis, Channel, Quantity, Record, ScopeSetup, Trigger
from drivers.requests.side_line import CancelledError
from profiles.problem import Problem
from tests.compact import compact_machine
from tests.console.floor import Floor, experiment_1, open_floor
from tests.console.with_side import served, with_side
from tests.drivers.families import of_family

CARRIAGE = Channel(Axis.CARRIAGE, Quantity.ACTUAL)
SPEED = Channel(Axis.CARRIAGE, Quantity.VELOCITY)
TOOL = Channel(Axis.TOOL, Quantity.COMMANDED)


@pytest.fixture(params=["pmac", "turbo"])
def floor(request: pytest.FixtureRequest, tmp_path: Path) -> Floor:
    loaded = compact_machine()
    machine = of_family(loaded.machine, request.param)
    return with_side(open_floor(tmp_path, machine=replace(loaded, machine=machine)))


class Control:
    """What the work of the page sees of a station."""

    def __init__(self, floor: Floor) -> None:
        self._floor = floor

    @property
    def state(self) -> Any:
        return self._floor.state

    def now_s(self) -> float:
        return self._floor.sim.now_s()


def work_of(floor: Floor) -> ScopeWork:
    assert floor.context.side is not None
    return ScopeWork(floor.context.side, floor.context.loaded_machine.machine, Control(floor))  # type: ignore[arg-type]


def gathered(floor: Floor, setup: ScopeSetup, act: Callable[[ScopeWork], object] = lambda work: None) -> Any:
    """Gather at rest, and do something when samples are being taken."""
    work, done = work_of(floor), list[object]()

    def look(snapshot: Snapshot) -> None:
        if work.progress.stage in ("gathering", "waiting") and not done:
            done.append(None)
            act(work)

    floor.looks.append(look)
    return served(floor, lambda: work.record(setup, "now"))


def codes(error: object) -> list[str]:
    return [problem.code for problem in getattr(error, "problems", ())]


def status(floor: Floor) -> tuple[str, ...]:
    client: Any = floor.lathe._client
    found: tuple[str, ...] = client.request("SIZE")
    return found


SHORT = ScopeSetup(channels=(CARRIAGE, SPEED), period_cycles=10, length_s=0.2)


def test_at_rest_the_positions_stand_and_the_buffer_is_given_back(floor: Floor) -> None:
    before = status(floor)
    record = gathered(floor, SHORT)
    assert isinstance(record, Record), record
    cycle_s = floor.context.machine.controller.servo_period_ms / 1000.0
    assert np.allclose(np.diff(record.times_s), 10 * cycle_s) and abs(record.times_s[-1] - 0.2) < 0.01
    assert np.ptp(record.values[CARRIAGE]) < 1e-6 and np.allclose(record.values[SPEED], 0.0, atol=1e-4)
    assert status(floor) == before


def jog(floor: Floor, work: ScopeWork, setup: ScopeSetup, distance_mm: float) -> Any:
    """Jog the carriage while a thread gathers."""
    floor.do(EnableDrives())
    floor.do(Home())
    begun: list[bool] = []

    def look(snapshot: Snapshot) -> None:
        if not begun and work.progress.stage == "gathering":
            begun.append(True)
            assert floor.station.post(Jog(axis=AxisName.CARRIAGE, distance=distance_mm))
        time.sleep(0.001)  # the worker has the time between two polls, as it has at a machine

    floor.looks.append(look)
    found = served(floor, lambda: work.record(setup, "now"))
    assert begun
    return found


def test_a_jog_is_seen_with_its_length_and_its_speed(floor: Floor) -> None:
    record = jog(floor, work_of(floor), replace(SHORT, length_s=1.0), 2.0)
    assert isinstance(record, Record), record
    moved_mm = 1000.0 * (record.values[CARRIAGE][-1] - record.values[CARRIAGE][0])
    assert abs(moved_mm) == pytest.approx(2.0, abs=0.02)
    times, speed = record.times_s, record.values[SPEED]
    # Each sample is the whole counts of one servo cycle in ten, 2.26 mm/s apart: 3 sd of some fifty are 0.09 mm.
    assert np.trapezoid(speed, times) == pytest.approx(moved_mm / 1000.0, abs=9e-5)
    assert floor.state.alarms == ()


def test_a_level_is_found_in_the_samples_and_time_counts_from_there(floor: Floor) -> None:
    ahead = jogging.counts_per_unit(floor.context.machine, AxisName.CARRIAGE) > 0.0
    setup = replace(SHORT, length_s=0.5, trigger=Trigger.RISING, level_of=SPEED, level=1.0)
    record = jog(floor, work_of(floor), setup, 2.0 if ahead else -2.0)
    assert isinstance(record, Record), record
    (place,) = np.flatnonzero(record.times_s == 0.0)
    shown_mm_s = record.values[SPEED] * 1e3
    assert shown_mm_s[place] > 1.0 >= shown_mm_s[place - 1] and record.times_s[0] < 0.0


@pytest.mark.first(1)
def test_a_cut_starts_the_record_and_is_not_disturbed_by_it(floor: Floor) -> None:
    job = experiment_1()
    floor.set_up(job)
    floor.arm(job)
    setup = ScopeSetup(channels=(TOOL, ANGLE), period_cycles=5, length_s=1.0, trigger=Trigger.CUT)
    work = work_of(floor)

    def look(snapshot: Snapshot) -> None:
        time.sleep(0.0005)
        if work.progress.stage == "waiting" and floor.state.armed and not started:
            started.append(True)
            assert floor.station.post(Start())

    started: list[bool] = []
    floor.looks.append(look)
    record = served(floor, lambda: work.record(setup, "now"))
    assert isinstance(record, Record), record
    turns = abs(record.values[ANGLE][-1] - record.values[ANGLE][0]) / (2.0 * np.pi)
    assert turns > 1.0 and started
    for _ in range(2000):
        if floor.state.activity is Activity.READY:
            break
        floor.idle()
    assert floor.state.cut_done and floor.state.alarms == ()


def test_another_host_that_gathers_is_left_alone(floor: Floor) -> None:
    other = PmacClient(MemoryLink(floor.sim.connect(), floor.sim), floor.sim)
    other.connect()
    gather = other.dialect.gathering
    other.request(f"I{gather.period}=1 I{gather.masks[0]}=1 I{gather.first_source}=$800028")
    other.request("DEFINE GATHER 20000")
    other.request("GATHER")
    assert codes(gathered(floor, SHORT)) == ["scope.in_use"]
    assert len(other.request("LIST GATHER 0,16")[0].split()) == 16


@pytest.mark.parametrize("what", ["period", "buffer"])
def test_another_host_that_changes_the_set_up_meanwhile_is_noticed(what: str, floor: Floor) -> None:
    other = PmacClient(MemoryLink(floor.sim.connect(), floor.sim), floor.sim)
    other.connect()
    period = other.dialect.gathering.period

    def act(work: ScopeWork) -> None:
        if what == "period":
            other.request(f"I{period}=3")
        else:
            other.request("ENDGATHER")
            other.request("DELETE GATHER")

    assert codes(gathered(floor, SHORT, act)) == ["scope.changed"]
    assert other.numbers(f"I{period}") == ((3.0,) if what == "period" else (10.0,))


def test_a_link_lost_while_gathering_ends_it_with_the_reason(floor: Floor) -> None:
    def lost(data: bytes) -> None:
        raise LinkError(Problem(code="link.lost", where="memory"))

    def act(work: ScopeWork) -> None:
        floor.link.send = lost  # type: ignore[method-assign]

    found = gathered(floor, replace(SHORT, length_s=0.5), act)
    assert codes(found) and codes(found)[0] in ("link.lost", "beside.silent")
    assert floor.state.activity is Activity.LOST


def test_a_record_is_ended_by_its_operator_and_the_buffer_is_given_back(floor: Floor) -> None:
    before = status(floor)
    found = gathered(floor, replace(SHORT, length_s=5.0), lambda work: work.client.cancel())
    assert isinstance(found, CancelledError)
    floor.idle()
    assert status(floor) == before
