"""What the page Jobs costs with many jobs: its first paint, a key, the index for searching, a search, a sort.

python -m benchmarks.jobs_page
"""

from __future__ import annotations

import asyncio
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.measure import extent
from benchmarks.page_times import SIZE, print_times, until
from console.session.data.kept_files import jobs_folder
from console.session.station.state import Activity, StationState
from console.tui.pages.jobs import JobsPage
from profiles.store import BUNDLED_JOBS
from tests.tui.page_stage import PageScene

FEW, MANY = 20, extent(2000, 100)
REPEATS = extent(9, 2)
READY = StationState(activity=Activity.READY)


class Scene(PageScene):
    """The page alone, in the room that the frame leaves it."""

    page_class = JobsPage


def fill(data: Path, count: int) -> None:
    """Write own jobs of four materials."""
    text = (BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8")
    jobs_folder(data).mkdir(parents=True)
    for number in range(count):
        material = ("Al", "S45C", "C3604", "AZ31")[number % 4]
        content = text.replace('material = "Al"', f'material = "{material}"', 1)
        (jobs_folder(data) / f"part-{number:04d}.toml").write_text(content, encoding="utf-8")


async def written(scene: Scene, letter: str, shown: Callable[[str], bool]) -> float:
    """Write a character into the search, and return after what time its finds are shown, s."""
    begun = time.perf_counter()
    await scene.pilot.press(letter)
    await until(scene, shown)
    return time.perf_counter() - begun


async def times(data: Path, count: int) -> list[float]:
    """Return the time of each thing, s."""
    begun = time.perf_counter()
    scene = Scene(data, None, "en", READY)
    async with scene.app.run_test(size=SIZE) as pilot:
        scene.pilot = pilot
        await until(scene, lambda text: "▸" in text)
        paint = time.perf_counter() - begun
        down = await until(scene, lambda text: "▸" in text, "jobs.down")
        page = await until(scene, lambda text: "▸" in text, "jobs.page_down")
        index = await until(
            scene, lambda text: "by material" in text and "reading" not in text, *["jobs.sort"] * 3
        )
        last = await until(scene, lambda text: "▸" in text, "jobs.last")
        scene.page.act("jobs.search")
        await scene.pilot.pause()
        search = await written(scene, "z", lambda text: f"({count // 4} of" in text)
    return [paint, down, page, index, last, search]


def main() -> None:
    """Measure and print."""
    names = (
        "start of the page until painted",
        "down",
        "PgDn",
        "s until all files are indexed",
        "End, sorted by material",
        "a character of a search",
    )
    found: dict[int, list[list[float]]] = {}
    for count in (FEW, MANY):
        with tempfile.TemporaryDirectory() as folder:
            fill(Path(folder), count)
            found[count] = [asyncio.run(times(Path(folder), count)) for _ in range(REPEATS)]
    print_times("The page Jobs at 80 x 24, from a key until the cells are painted", "jobs", names, found)


if __name__ == "__main__":
    main()
