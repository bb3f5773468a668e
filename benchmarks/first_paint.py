"""What the operator waits for: from exec to the first picture in a real terminal, against a bare Textual program.

python -m benchmarks.first_paint
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.measure import extent, print_table
from tests.terminal import Terminal

RUNS = extent(7, 1)
COLUMNS, ROWS = 100, 30
LONGEST_WAIT_S = 20.0
WORD = r"\bSIM\b"
BARE_APP = """
from textual.app import App
from textual.widgets import Static

class Bare(App):
    def compose(self):
        yield Static("SIM")

Bare().run()
"""


def commands(data_folder: str) -> list[tuple[str, list[str]]]:
    """Return the measured commands with their names; the first is the baseline."""
    script = Path(sys.executable).with_name("console")
    console = [str(script)] if script.exists() else [sys.executable, "-m", "console"]
    simulated = [*console, "--sim", "--data", data_folder]
    return [
        ("bare Textual app (baseline)", [sys.executable, "-c", BARE_APP]),
        ("console --sim", simulated),
        ("console --sim --lang ko", [*simulated, "--lang", "ko"]),
    ]


def first_paint_s(command: Sequence[str]) -> float:
    """Start a program in a new terminal and return when its first picture arrived, s after the start.

    Raises:
        AssertionError: the word that the picture has never came; with the screen.
    """
    with Terminal(command, columns=COLUMNS, rows=ROWS) as terminal:
        return terminal.wait_for(WORD, LONGEST_WAIT_S)


def measure(measured: Sequence[tuple[str, Sequence[str]]]) -> dict[str, list[float]]:
    """Return the times of each command, s; the commands take turns, and a first round warms the caches.

    A command that fails is told on stderr and left out.
    """
    times_s: dict[str, list[float]] = {name: [] for name, _ in measured}
    for turn in range(RUNS + 1):
        for name, command in measured:
            if name not in times_s:
                continue
            try:
                time_s = first_paint_s(command)
            except AssertionError as missing:
                print(f"{name}: {missing}", file=sys.stderr)
                del times_s[name]
                continue
            if turn:
                times_s[name].append(time_s)
    return times_s


def cells(times_s: Sequence[float], baseline_s: float) -> tuple[str, str, str]:
    """Return median, ratio to the baseline and slowest, as they are printed."""
    if not times_s:
        return "no picture", "-", "-"
    median_s = statistics.median(times_s)
    return f"{1000.0 * median_s:.0f} ms", f"{median_s / baseline_s:.2f}", f"{1000.0 * max(times_s):.0f} ms"


def main() -> int:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        measured = commands(folder)
        times_s = measure(measured)
    baseline_s = statistics.median(times_s.get(measured[0][0], [float("nan")]))
    rows = [(name, *cells(times_s.get(name, []), baseline_s)) for name, _ in measured]
    print_table(
        f"First paint at {COLUMNS}x{ROWS}, median of {RUNS}", ("", "median", "x baseline", "slowest"), rows
    )
    return 0 if len(times_s) == len(measured) else 1


if __name__ == "__main__":
    sys.exit(main())
