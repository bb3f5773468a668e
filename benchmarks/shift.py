"""Memory of the console over a shift of eight hours: parts are cut and measured, pages looked at, time goes by.

python -m benchmarks.shift

Everything is in one process: the lathe is simulated, its clock is advanced, the screen is Textual's headless one.
A console that keeps something of every poll, every part or every frame would grow with the hours.
"""

from __future__ import annotations

import asyncio
import gc
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.measure import KIB_PER_MIB, extent, print_table
from console.session.station.commands import (
    Acknowledge,
    Command,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Measure,
    Start,
)
from console.session.station.state import StationState
from console.session.work import open_work
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName
from console.tui.theme import COLOUR
from drivers.cutting.planning import Strategy
from profiles.store import load_job
from tests.console.floor import Floor, experiment_1, open_floor

HOURS = extent(8, 2)
PARTS_AN_HOUR = extent(12, 1)
POLLS_A_PART = extent(3000, 50)
"""At rest between two parts, 0.1 s each: five minutes."""

POLL_S = 0.1
FRAME_EVERY = 5
"""Polls between two frames of the screen at rest; in a cut every poll is one."""


@dataclass(kw_only=True)
class InProcess:
    """The control of a screen in the process of its station."""

    floor: Floor

    @property
    def state(self) -> StationState:
        """The newest state."""
        return self.floor.state

    @property
    def side(self) -> None:
        """Nobody asks beside the polls."""
        return None

    def now_s(self) -> float:
        """Return machine time, s."""
        return self.floor.sim.now_s()

    def post(self, intent: Command) -> bool:
        """Post a command."""
        return self.floor.station.post(intent)

    def stop(self, reason: str) -> None:
        """Stop nothing: nobody presses a key."""

    def kill(self, reason: str) -> None:
        """Open no loop."""

    def beat(self) -> None:
        """Tell the station that the screen is alive."""


def resident_mib() -> float:
    """Return the resident memory of this process after a collection, MiB."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / KIB_PER_MIB / KIB_PER_MIB


async def a_shift(folder: Path) -> list[float]:
    """Return the resident memory at the begin and after each hour, MiB."""
    floor = open_floor(folder)
    job = experiment_1(0.5)
    control = InProcess(floor=floor)
    machine = floor.context.loaded_machine
    app = ConsoleApp(text=load("en"), palette=COLOUR, control=control, machine=machine, data=folder, ticking=False)
    floor.looks.append(lambda _: app.tick() if app.is_running and control.state.cut is not None else None)
    async with app.run_test(size=(100, 30)) as pilot:
        app.ui.work = open_work(load_job("lee-2001-experiment-1"), machine)
        floor.set_up(job)
        kept = []
        for _ in range(HOURS):
            for _ in range(PARTS_AN_HOUR):
                floor.arm(job, Strategy.CAM)
                floor.do(Start())
                floor.do(Measure())
                floor.do(Acknowledge())
                for page in PageName:
                    app.go(page)
                    app.tick()
                    await pilot.pause()
                for poll in range(POLLS_A_PART):
                    floor.idle(POLL_S)
                    if poll % FRAME_EVERY == 0:
                        app.tick()
                        await asyncio.sleep(0)
                for command in (DisableDrives(), ConfirmClamping(job=job), EnableDrives()):
                    floor.do(command)
            kept.append(resident_mib())
    return kept


def main() -> None:
    """Print the memory after each hour."""
    with tempfile.TemporaryDirectory() as folder:
        kept = asyncio.run(a_shift(Path(folder)))
    rows = [(f"{hour}", f"{mib:.1f}", f"{mib - kept[0]:+.1f}") for hour, mib in enumerate(kept, start=1)]
    parts = HOURS * PARTS_AN_HOUR
    print_table(
        f"Resident memory, {parts} parts and {parts * POLLS_A_PART} polls at rest",
        ("hour", "MiB", "against the first"),
        rows,
    )


if __name__ == "__main__":
    main()
