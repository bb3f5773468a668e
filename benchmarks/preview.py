"""What follows a key in the fields of a job: something on the page, the chosen program, and all that is known.

Processor time of the thread that does it, and of the first look the time by the clock as well: alone, and while
the programs of the job before are still being made. The page is drawn as the console does it, without a terminal.

python -m benchmarks.preview
"""

from __future__ import annotations

import asyncio
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from textual.pilot import Pilot

from benchmarks.measure import extent, print_table
from console.session.station.state import Activity
from console.session.work import edit_field
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName
from drivers.cutting.strategy import Strategy
from drivers.preview.outlook import outlook
from drivers.preview.preview import all_asked, preview, program_of
from profiles.axis.envelope import envelope
from profiles.axis.servo import eq9_summary
from profiles.store import load_job, load_machine
from tests.tui.scenes import Scene, application, rows_of, settle
from tests.tui.scenes import machine as state_of
from tests.tui.stage import experiment

RUNS = extent(7, 1)
JOB, MACHINE = "lee-2001-experiment-1", "lee-2001-lathe"
BASELINE = "lobe, command, drive, rules (baseline)"
SIZES = ((80, 24), (160, 48))[: extent(2, 1)]
FIRST_RPM = 900
FRAME_S = 0.05
"""One refresh of the screen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Poller:
    """First looks at the page after a key: processor time of the screen's thread, and time by the clock, s."""

    cpu_s: list[float] = field(default_factory=list)
    wall_s: list[float] = field(default_factory=list)


def calculations() -> list[tuple[str, Callable[[], object]]]:
    """Return what is calculated with its names; the first is the baseline."""
    job, machine = load_job(JOB).job, load_machine(MACHINE).machine
    asked = all_asked(job, machine, Strategy.PVT, None, None)

    def made(place: int) -> Callable[[], object]:
        return lambda: program_of(asked[place])

    return [
        (BASELINE, lambda: outlook(job, machine)),
        ("highest speeds", lambda: envelope(job, machine)),
        ("bandwidth and margins of Eq 9", lambda: eq9_summary(machine)),
        *((f"program and prediction, {each.strategy}", made(place)) for place, each in enumerate(asked)),
        ("the whole preview", lambda: preview(job, machine)),
    ]


def calculated() -> dict[str, list[float]]:
    """Return the processor times of the calculations, s; the first round warms the caches."""
    works = calculations()
    times_s: dict[str, list[float]] = {name: [] for name, _ in works}
    for turn in range(RUNS + 1):
        for name, work in works:
            start_s = time.process_time()
            work()
            if turn:
                times_s[name].append(time.process_time() - start_s)
    return times_s


async def first_look(app: ConsoleApp, pilot: Pilot[None], rpm: int, looks: Poller) -> None:
    """Change the speed of the job, and draw what the page then says of it.

    Raises:
        AssertionError: the new number is not on the page.
    """
    assert app.ui.work is not None
    wall_s, cpu_s = time.perf_counter(), time.thread_time()
    app.ui.work = edit_field(app.ui.work, "spindle_speed_rpm", str(rpm))
    app.tick()
    rows = rows_of(app)
    looks.wall_s.append(time.perf_counter() - wall_s)
    looks.cpu_s.append(time.thread_time() - cpu_s)
    assert any(f"{rpm / 20.0:.1f} / " in row for row in rows), "\n".join(rows)
    await pilot.pause()


async def shown(size: tuple[int, int], *, busy: bool) -> Poller:
    """Return first looks; `busy`, while the other thread is at a program of the job before."""
    looks, wasted = Poller(), Poller()
    with tempfile.TemporaryDirectory() as folder:
        app, _ = application(Scene(page=PageName.PREVIEW, state=state_of(Activity.READY)), Path(folder))
        async with app.run_test(size=size) as pilot:
            app.ui.work = experiment()
            await pilot.press("3")
            await settle(app, pilot)
            for turn in range(RUNS + 1):
                while not busy and app.ui.work.preview is None:
                    await asyncio.sleep(FRAME_S)
                    app.tick()
                await pilot.pause()
                await first_look(app, pilot, FIRST_RPM + turn, looks if turn else wasted)
                app.tick()  # the other thread begins
                await asyncio.sleep(FRAME_S)
    return looks


def main() -> None:
    """Measure and print."""
    times_s = calculated()
    looks = {
        f"first view, {columns} x {rows}{', programs under way' * busy}": asyncio.run(
            shown((columns, rows), busy=busy)
        )
        for columns, rows in SIZES
        for busy in (False, True)
    }
    baseline_s = statistics.median(times_s[BASELINE])
    table = []
    for name, found_s in {**times_s, **{name: look.cpu_s for name, look in looks.items()}}.items():
        median_s = statistics.median(found_s)
        clock = f"{1000 * statistics.median(looks[name].wall_s):.1f} ms" if name in looks else ""
        table.append(
            (
                name,
                f"{1000 * median_s:.1f} ms",
                f"{median_s / baseline_s:.0f}",
                f"{1000 * max(found_s):.1f} ms",
                clock,
            )
        )
    title = f"After a key, processor time, median of {RUNS}; a refresh of the screen is {1000 * FRAME_S:.0f} ms"
    print_table(title, ("", "median", "x baseline", "slowest", "by the clock"), table)


if __name__ == "__main__":
    main()
