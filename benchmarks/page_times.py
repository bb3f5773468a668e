"""Time a page of the screens alone, from a key until the cells are painted, with few and many things on it."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence

from benchmarks.measure import print_table
from tests.tui.page_stage import PageScene

SIZE = (80, 18)  # the room that the frame leaves a page
LONGEST_S = 60.0


async def until(scene: PageScene, shown: Callable[[str], bool], *actions: str) -> float:
    """Press keys, and return after what time the page shows something, s. AssertionError: it never does."""
    begun = time.perf_counter()
    for action in actions:
        scene.page.act(action)
    while time.perf_counter() - begun < LONGEST_S:
        scene.page.show(scene.view)
        await scene.pilot.pause()
        if shown(scene.text):
            return time.perf_counter() - begun
    raise AssertionError(scene.text)


def print_times(
    title: str, things: str, names: Sequence[str], found: Mapping[int, Sequence[Sequence[float]]]
) -> None:
    """Print the median of each time with few and many things: `found` is by their number, few first."""
    few, many = found
    rows = []
    for place, name in enumerate(names):
        short, long = (statistics.median(each[place] for each in found[count]) for count in (few, many))
        rows.append((name, f"{1000.0 * short:.0f} ms", f"{1000.0 * long:.0f} ms", f"{long / short:.1f}"))
    print_table(title, ("", f"{few} {things} (baseline)", f"{many} {things}", "x baseline"), rows)
