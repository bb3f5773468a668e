"""What the screens send to the terminal, and take of a processor, while the machine rests and no key is pressed.

python -m benchmarks.at_rest

The console itself on a terminal of its own, with its simulator and an open job, page by page. The aims are less
than 200 bytes a second, since a slow line then has room for a key, and 1 % of one processor, the simulator apart.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """A page at rest: what it sends, its share of one processor, and the part of it of the thread that draws."""

    bytes_per_s: float
    cpu_percent: float
    drawing_percent: float


def at_rest(command: Sequence[str], columns: int, rows: int) -> dict[PageName, Rest]:
    """Return each page at rest.

    Raises:
        AssertionError: the machine was not at rest in time; with the screen.
    """
    text, found = load("en"), dict[PageName, Rest]()
    with Terminal(command, columns=columns, rows=rows) as terminal:
        terminal.wait_for(text("frame.at_rest"), WITHIN_S)
        terminal.press("enter")
        for page in PAGES:
            for key in keys_to(page):
                terminal.press(key)
                terminal.wait_until_read(WITHIN_S)
                time.sleep(0.3)  # keys that come together are no keys of a person
            time.sleep(SETTLED_S)
            sent, cpu_s, began_s = terminal.bytes_seen, cpu_s_of(terminal.pid), time.perf_counter()
            drawing_s = cpu_s_of(terminal.pid, task=True)
            time.sleep(WATCHED_S)
            passed_s = time.perf_counter() - began_s
            found[page] = Rest(
                bytes_per_s=(terminal.bytes_seen - sent) / passed_s,
                cpu_percent=100.0 * (cpu_s_of(terminal.pid) - cpu_s) / passed_s,
                drawing_percent=100.0 * (cpu_s_of(terminal.pid, task=True) - drawing_s) / passed_s,
            )
    return found


def cpu_s_of(pid: int, *, task: bool = False) -> float:
    """Return the processor time of a process so far, without its children, s (proc(5), stat).

    That of a `task` is of the first thread alone, which draws.
    """
    place = Path(f"/proc/{pid}/task/{pid}/stat" if task else f"/proc/{pid}/stat")
    fields = place.read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> int:
    """Measure and print."""
    rows = []
    for columns, lines in SIZES:
        with tempfile.TemporaryDirectory() as folder:
            _, (_, command), *_ = commands(folder)
            found = at_rest(command, columns, lines)
        rows += [
            (
                f"{columns} x {lines}, {page}",
                f"{rest.bytes_per_s:.1f}",
                f"{rest.bytes_per_s / MOST_BYTES_PER_S:.2f}",
                f"{rest.cpu_percent:.1f} %",
                f"{rest.drawing_percent:.1f} %",
            )
            for page, rest in found.items()
        ]
    title = f"Pages at rest, mean of {WATCHED_S:.0f} s each"
    print_table(title, ("", "bytes/s", f"x {MOST_BYTES_PER_S:.0f}", "CPU", "of it the screens"), rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
