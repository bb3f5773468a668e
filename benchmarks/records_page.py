"""What the page Records costs with many runs: its first paint, a key, a search, all runs, one run, a chart.

python -m benchmarks.records_page
"""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path

from benchmarks.measure import extent
from benchmarks.page_times import SIZE, print_times, until
from benchmarks.records import FEW, RUNS, write
from console.session.station.state import Activity, StationState
from console.tui.pages.records import RecordsPage
from tests.tui.page_stage import PageScene

REPEATS = extent(9, 2)
READY = StationState(activity=Activity.READY, simulated=False)


class Scene(PageScene):
    """The page alone, in the room that the frame leaves it."""

    page_class = RecordsPage


async def times(folder: Path, count: int) -> list[float]:
    """Return the time of each thing, s; what is read is shown when it is there."""
    scene = Scene(folder, None, "en", READY)
    # The benchmark's runs are of another lathe: the page lists those of all of them.
    async with scene.app.run_test(size=SIZE) as pilot:
        scene.pilot = pilot
        scene.page.act("records.machines")
        paint = await until(scene, lambda text: "complete" in text)
        key = await until(scene, lambda text: "▸" in text, "records.down")
        run = await until(scene, lambda text: "RONt" in text and "div" in text, "records.first", "records.open")
        chart = await until(scene, lambda text: "parts, " in text, "records.back", "records.chart")
        everything = await until(scene, lambda text: f"Runs ({count})" in text, "records.back", "records.last")
    return [paint, key, run, chart, everything]


def main() -> None:
    """Measure and print."""
    names = ("first paint of the list", "down", "a run opened", "its run chart", "End: all runs listed")
    with tempfile.TemporaryDirectory() as few, tempfile.TemporaryDirectory() as many:
        write(Path(few), FEW)
        write(Path(many), RUNS)
        found = {
            count: [asyncio.run(times(Path(folder), count)) for _ in range(REPEATS)]
            for folder, count in ((few, FEW), (many, RUNS))
        }
    print_times("The page Records at 80 x 24, from a key until the cells are painted", "runs", names, found)


if __name__ == "__main__":
    main()
