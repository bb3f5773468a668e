"""What another host changes for the whole feed, and puts back before its end, is never called good.

`console simulator` is a process with a port, `console run` cuts over it as another one, and another host has a
connection of its own: it sees by the carriage how far the cut is.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import cache
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

import pytest

from benchmarks.held_deeds import OTHER, Change, changes_of
from drivers.clock import RealClock
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.link.address import TcpAddress
from drivers.link.opening import open_link
from drivers.pmac.client import PmacClient
from tests.system.run_over_link import Order, order

if TYPE_CHECKING:
    from tests.system.conftest import Serve

pytestmark = pytest.mark.system

CUT_MM = 1.5
DEEDS = 20
LEAST_CHANGE = 0.2  # of the value: what is hardly another one is for the benchmark
TIMEOUT_S = 60.0
BEGUN_MM = 0.1  # behind the start, where the axes were checked last
LEFT_MM = 0.2  # before the end of the feed: 0.24 s


@pytest.fixture
def made(tmp_path: Path) -> Order:
    return order(tmp_path, CUT_MM)


@cache
def drawn(made: Order) -> tuple[CutPlan, list[Change]]:
    """The cut, and so many of the settings that the profile states and of the constants of its program."""
    plan = plan_cut(made.job, made.machine, Strategy.PVT)
    named = [
        each for each in changes_of(made.machine, plan).single if each.name[0] in "IP" and each.weight > OTHER
    ]
    stated = [each for each in named if abs(each.other - each.there) > LEAST_CHANGE * abs(each.there)]
    of_each = {each.name: each for each in Random(2001).sample(stated, len(stated))}
    return plan, list(of_each.values())[:DEEDS]


@contextmanager
def another_host(host: str, port: int) -> Iterator[PmacClient]:
    with closing(open_link(TcpAddress(host=host, port=port))) as link:
        client = PmacClient(link, RealClock())
        client.connect()
        yield client


def sees(client: PmacClient, reached: Callable[[float], bool], process: subprocess.Popen[str]) -> bool:
    """Look at the carriage until it is somewhere; False where the console has ended before."""
    end_s = time.monotonic() + TIMEOUT_S
    while process.poll() is None and time.monotonic() < end_s:
        if reached(client.numbers("#3P")[0]):
            return True
        time.sleep(0.01)
    return False


@pytest.mark.first(2)
@pytest.mark.parametrize("number", range(DEEDS))
def test_what_was_changed_for_the_whole_feed_is_not_called_good(number: int, made: Order, serve: Serve) -> None:
    plan, changes = drawn(made)
    change, per_mm = changes[number], made.machine.carriage.counts_per_mm
    begun = plan.carriage_start + BEGUN_MM * per_mm
    end = plan.carriage_start + plan.setup.whole_turns * plan.setup.carriage_per_turn - LEFT_MM * per_mm
    with serve("--tcp", "127.0.0.1:0", "--machine", str(made.machine_file)) as served:
        host, port = served.tcp
        with another_host(host, port) as client, made.proven(f"tcp:{host}:{port}") as process:
            assert sees(client, lambda z: z > begun, process), process.communicate(timeout=TIMEOUT_S)
            client.request(change.line(0.0, 1.0), TIMEOUT_S)
            sees(client, lambda z: z > end, process)
            client.request(change.line(1.0, 0.0), TIMEOUT_S)
            out, err = process.communicate(timeout=TIMEOUT_S)
        assert process.returncode == 1, (change, out, err)
        codes = [each["code"] for each in json.loads(out)["errors"]]
        assert any(code.startswith("cut.") for code in codes), (change, codes)  # and no line or lease was lost
