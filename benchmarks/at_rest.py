"""What the screens send to the terminal while the machine rests and nobody presses a key, page by page.

python -m benchmarks.at_rest

The console itself on a terminal of its own, with its simulator and an open job. The aim is less than 200 bytes a
second: a slow line then has room for a key, and a terminal that is recorded stays short.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence

from benchmarks.first_paint import commands
from benchmarks.measure import extent, print_table
from console.text.catalogue import load
from console.tui.keymap import PageName
from tests.terminal import Terminal
from tests.tui.scenes import keys_to

SIZES = ((80, 24), (160, 48))[: extent(2, 1)]
WATCHED_S = extent(10.0, 1.0)
SETTLED_S = extent(4.0, 2.0)  # a page that was just shown still computes
WITHIN_S = 20.0
MOST_BYTES_PER_S = 200.0
PAGES = tuple(PageName)[: extent(len(PageName), 2)]


def bytes_per_s(command: Sequence[str], columns: int, rows: int) -> dict[PageName, float]:
    """Return what each page sends at rest, bytes/s.

    Raises:
        AssertionError: the machine was not at rest in time; with the screen.
    """
    text, found = load("en"), dict[PageName, float]()
    with Terminal(command, columns=columns, rows=rows) as terminal:
        terminal.wait_for(text("frame.at_rest"), WITHIN_S)
        terminal.press("enter")
        for page in PAGES:
            for key in keys_to(page):
                terminal.press(key)
                terminal.wait_until_read(WITHIN_S)
                time.sleep(0.3)  # keys that come together are no keys of a person
            time.sleep(SETTLED_S)
            before, began_s = terminal.bytes_seen, time.perf_counter()
            time.sleep(WATCHED_S)
            found[page] = (terminal.bytes_seen - before) / (time.perf_counter() - began_s)
    return found


def main() -> int:
    """Measure and print."""
    rows = []
    for columns, lines in SIZES:
        with tempfile.TemporaryDirectory() as folder:
            _, (_, command), *_ = commands(folder)
            found = bytes_per_s(command, columns, lines)
        rows += [
            (f"{columns} x {lines}, {page}", f"{rate:.1f}", f"{rate / MOST_BYTES_PER_S:.2f}")
            for page, rate in found.items()
        ]
    title = f"Bytes to the terminal at rest, mean of {WATCHED_S:.0f} s a page"
    print_table(title, ("", "bytes/s", f"x {MOST_BYTES_PER_S:.0f}"), rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
