"""A shift at a terminal: parts of three jobs on a machine without a gauge, with what comes between.

A stop, a hold and its resume, a cable that is cut and mended, and a second console that looks on. It takes
minutes and a computer of its own, and is run by name, with the number of parts:

SHIFT_PARTS=6 pytest -n 0 tests/system/test_whole_shift.py
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import pytest

from console.session.data.kept_files import jobs_folder
from console.session.data.run_reader import runs
from console.session.data.run_rows import RunOutcome
from console.session.data.stop_records import simulated_record, store
from drivers.pmac.dialect import DIALECTS
from profiles.lobe.lobe_origin import without_lobe
from profiles.store import load_job, save_job
from tests.system.test_own_part import Operator, Shop
from tests.system.test_reconnecting_screens import CuttableLine
from tests.terminal import Terminal

PARTS = int(os.environ.get("SHIFT_PARTS", "0"))
pytestmark = [
    pytest.mark.system,
    pytest.mark.timeout(1800),
    pytest.mark.long,
    pytest.mark.skipif(PARTS == 0, reason="run by name: SHIFT_PARTS=6"),
]
JOBS = ("ring-60", "ring-60-long", "ring-58")
"""The second differs from the first in its length, the third in its diameter: another touch-off.

None has a lobe: the first part of each gives it one."""


def save_jobs(data: Path) -> None:
    """What the process engineer has left in the folder."""
    folder = jobs_folder(data)
    folder.mkdir(parents=True)
    ring = without_lobe(replace(load_job("lee-2001-experiment-1").job, diameter_mm=60.0, cut_length_mm=3.0))
    changes: tuple[dict[str, float], ...] = ({}, {"cut_length_mm": 3.5}, {"diameter_mm": 58.0})
    for name, values in zip(JOBS, changes, strict=True):
        save_job(replace(ring, name=name, **values), folder / f"{name}.toml")  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True)
class Shift:
    """The operator, the line to the machine, and the console of somebody who looks on."""

    operator: Operator
    line: CuttableLine
    onlooker: Operator
    data: Path

    def opens(self, job: str) -> None:
        """Look for a job by its name, and open it."""
        operator = self.operator
        operator.press("1", "/", *job, "enter")
        if not operator.offers("setup.next.plain"):  # a search with a single match opens it
            operator.terminal.wait_for(rf"▸[ ●]*{job}(?!-)", 5.0)
            operator.press("enter")
        operator.sees("setup.next.plain")

    def sets_up(self, job: str) -> None:
        """Clamp a blank, and do what page Align still asks for."""
        operator = self.operator
        operator.press("4")
        operator.clamps_a_blank(job)
        operator.aligns_what_is_left()

    def cuts(self, between: Callable[[Shift], None] | None) -> None:
        """Cut the part; `between` comes in mid-cut."""
        self.operator.starts_the_cut()
        if between is not None:
            self.operator.sees("frame.sync.in_sync", 30.0)
            between(self)
        self.operator.sees("run_page.next.take_out", 60.0)

    def measures(self, part: int) -> None:
        """Have the part measured in the other room, and take the lobe that it gives its job."""
        operator = self.operator
        operator.takes_out_and_brings_the_trace(f"part-{part:02}.csv")
        if operator.offers("inspect_page.next.lobe"):
            operator.press("a")
            operator.sees("inspect_page.next.lobe_taken")


def stops_and_goes_on(shift: Shift) -> None:
    """Space in mid-cut; the blank is cut again from its face."""
    shift.operator.press("space")
    shift.operator.sees("frame.recover", 20.0)
    goes_on(shift)


def holds_and_resumes(shift: Shift) -> None:
    """F4 takes the tool out at the end of a turn, and F6 resumes at the same place."""
    shift.operator.press("f4")
    shift.operator.sees("run_page.next.paused", 20.0)
    shift.operator.press("f6")


def loses_the_cable(shift: Shift) -> None:
    """The controller takes the tool out by itself; the console comes back stopped."""
    shift.line.cut()
    shift.operator.sees("activity.lost", 15.0)
    shift.line.mend()
    shift.operator.sees("activity.stopped", 20.0)
    shift.operator.sees("lost_link.back", 10.0)
    goes_on(shift)


def goes_on(shift: Shift) -> None:
    """Reset, enable what the stop has disabled, retract, and cut the blank anew."""
    operator = shift.operator
    operator.press("f2")
    operator.sees("activity.ready", 10.0)
    if operator.offers("run_page.next.switch_on") or operator.offers("run_page.next.align"):
        operator.press("4")
        operator.does_step("align_page.drives_on")
        operator.press("5")
    if operator.offers("run_page.next.retract"):
        operator.press("f8")
        operator.sees("activity.retracting", 5.0)
        operator.sees("activity.ready", 20.0)
    operator.starts_the_cut("run_page.next.arm_again")


EVENTS = {1: stops_and_goes_on, 3: holds_and_resumes, 5: loses_the_cable}
"""What comes in mid-cut, by the number of the part in the short form."""


@contextmanager
def shift_at(language: str, columns: int, rows: int, data: Path) -> Iterator[Shift]:
    """A machine with a line that can be cut; two consoles at it."""
    shop = Shop(data)
    save_jobs(data)
    with shop.served() as address:
        host, port = address.removeprefix("tcp:").split(":")
        with CuttableLine("tcp", (host, int(port)), data) as line:
            record = simulated_record(shop.machine, DIALECTS["pmac"], date.today())
            store(data, shop.machine, replace(record, address=line.address))
            words = ("--machine", str(shop.profile), "--data", str(data), "--lang", language)
            command = [sys.executable, "-m", "console", *words, "--link"]
            with Terminal([*command, line.address], columns=columns, rows=rows) as terminal:
                operator = Operator(terminal, language, shop)
                operator.sees("activity.ready", 30.0)
                with Terminal([*command, address], columns=80, rows=24) as beside:
                    onlooker = Operator(beside, language, shop)
                    onlooker.sees("frame.observer", 30.0)
                    yield Shift(operator=operator, line=line, onlooker=onlooker, data=data)


@pytest.mark.parametrize(("language", "columns", "rows"), [("ko", 80, 24), ("en", 160, 48)])
def test_a_shift_of_three_jobs(language: str, columns: int, rows: int, tmp_path: Path) -> None:
    each = PARTS // len(JOBS)
    with shift_at(language, columns, rows, tmp_path) as shift:
        for number, job in enumerate(JOBS):
            shift.opens(job)
            for part in range(each):
                shift.sets_up(job)
                in_short = number * 2 + part if part < 2 else -1
                shift.cuts(EVENTS.get(in_short))
                shift.measures(number * each + part)
        shift.onlooker.press("7")
        shift.onlooker.terminal.wait_for(JOBS[-1], 10.0)
        shift.operator.press("ctrl+q")
        assert shift.operator.terminal.wait_exit(20.0) == 0
    found = runs(tmp_path, limit=10 * PARTS)
    assert sum(run.ended.how is RunOutcome.DONE for run in found) == each * len(JOBS)
    assert sum(run.ended.how is RunOutcome.STOPPED for run in found) == 2
