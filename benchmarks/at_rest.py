"""What the screens send to the terminal, and take of a processor, while the machine rests and no key is pressed.

python -m benchmarks.at_rest

The console on a terminal of its own, with an open job, page by page; the simulator is a process of its own, since
a real controller takes nothing of this processor. The baseline is a Textual program that shows one word and has an
empty timer of the console's period. The aims are less than 200 bytes a second, since a slow line then has room for
a key, and 1 % of one processor.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.command_rate import running, said
from benchmarks.first_paint import WORD
from benchmarks.measure import extent, print_table
from console.text.catalogue import load
from console.tui.keymap import PageName
from tests.signed_profile import signed_copy
from tests.terminal import Terminal
from tests.tui.scenes import keys_to

SIZES = ((80, 24), (160, 48))[: extent(2, 1)]
WATCHED_S = extent(10.0, 1.0)
SETTLED_S = extent(4.0, 2.0)  # a page that was just shown still computes
WITHIN_S = 20.0
MOST_BYTES_PER_S = 200.0
PAGES = tuple(PageName)[: extent(len(PageName), 2)]
MACHINE = "lee-2001-lathe"
BARE_APP = """
from textual.app import App
from textual.widgets import Static

class Bare(App):
    def compose(self):
        yield Static("SIM")

    def on_mount(self):
        self.set_interval(0.1, lambda: None)

Bare().run()
"""


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
            found[page] = watched(terminal)
    return found


def bare(columns: int, rows: int) -> Rest:
    """Return the bare program at rest."""
    with Terminal([sys.executable, "-c", BARE_APP], columns=columns, rows=rows) as terminal:
        terminal.wait_for(WORD, WITHIN_S)
        time.sleep(SETTLED_S)
        return watched(terminal)


def watched(terminal: Terminal) -> Rest:
    """Return what a program sends and takes from now on."""
    sent, cpu_s, began_s = terminal.bytes_seen, cpu_s_of(terminal.pid), time.perf_counter()
    time.sleep(WATCHED_S)
    passed_s = time.perf_counter() - began_s
    all_s, drawing_s = (after - before for after, before in zip(cpu_s_of(terminal.pid), cpu_s, strict=True))
    return Rest(
        bytes_per_s=(terminal.bytes_seen - sent) / passed_s,
        cpu_percent=100.0 * all_s / passed_s,
        drawing_percent=100.0 * drawing_s / passed_s,
    )


def cpu_s_of(pid: int) -> tuple[float, float]:
    """Return the processor time of a process so far, s, and that of its first thread, which draws.

    From the scheduler's own count in ns (proc(5), schedstat): that of `stat` comes in steps of 10 ms.
    """
    tasks = Path(f"/proc/{pid}/task")
    times_s = {
        int(task.name): 1e-9 * int((task / "schedstat").read_text(encoding="ascii").split()[0])
        for task in tasks.iterdir()
    }
    return sum(times_s.values()), times_s[pid]


def row(name: str, rest: Rest) -> tuple[str, ...]:
    """Return the texts of a row."""
    share = f"{rest.bytes_per_s / MOST_BYTES_PER_S:.2f}"
    return name, f"{rest.bytes_per_s:.1f}", share, f"{rest.cpu_percent:.2f} %", f"{rest.drawing_percent:.2f} %"


def main() -> int:
    """Measure and print."""
    rows: list[tuple[str, ...]] = []
    for columns, lines in SIZES:
        serving = ("-m", "console", "simulator", "--json", "--machine", MACHINE, "--tcp", "127.0.0.1:0")
        with tempfile.TemporaryDirectory() as folder, running(*serving) as served:
            profile, address = signed_copy(MACHINE, Path(folder)), json.loads(said(served))["listening"]
            words = ("--machine", str(profile), "--link", address, "--data", folder)
            found = at_rest([sys.executable, "-m", "console", *words], columns, lines)
        size = f"{columns} x {lines}"
        rows.append(row(f"{size}, bare Textual (baseline)", bare(columns, lines)))
        rows += [row(f"{size}, {page}", rest) for page, rest in found.items()]
    title = f"Pages at rest, mean of {WATCHED_S:.0f} s each"
    print_table(title, ("", "bytes/s", f"x {MOST_BYTES_PER_S:.0f}", "CPU", "of it the screens"), rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
