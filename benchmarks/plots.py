"""What live plots cost: bytes sent to the terminal and processor time, ours against the stock widget.

python -m benchmarks.plots
"""

from __future__ import annotations

import fcntl
import os
import pty
import struct
import sys
import termios
from dataclasses import dataclass

from benchmarks.measure import extent, print_table
from benchmarks.plot_apps import FRAME_S, PAGES

FRAMES = extent(60, 5)
SIZES = ((80, 24), (160, 48))[: extent(2, 1)]
CHUNK = 65536


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What an app sent to its terminal, bytes, and the processor time that it took, s."""

    sent_bytes: int
    cpu_s: float


def cost(page: str, frames: int, columns: int, rows: int) -> Cost:
    """Run an app in a terminal of its own and read all that it writes.

    Raises:
        RuntimeError: the app failed, so that its numbers mean nothing.
    """
    command = [sys.executable, "-m", "benchmarks.plot_apps", page, str(frames)]
    child, terminal = pty.fork()
    if child == 0:
        os.environ.update(TERM="xterm-256color", COLORTERM="truecolor", COLUMNS=str(columns), LINES=str(rows))
        os.execv(command[0], command)
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
    sent_bytes = 0
    while chunk := read(terminal):
        sent_bytes += len(chunk)
    _, status, usage = os.wait4(child, 0)
    os.close(terminal)
    if os.waitstatus_to_exitcode(status) != 0:
        raise RuntimeError(f"failed: {' '.join(command)}")
    return Cost(sent_bytes=sent_bytes, cpu_s=usage.ru_utime + usage.ru_stime)


def read(terminal: int) -> bytes:
    """Return what the app wrote next, nothing once it has left."""
    try:
        return os.read(terminal, CHUNK)
    except OSError:
        # Linux says so when the other side of a terminal is closed.
        return b""


def a_frame(page: str, columns: int, rows: int) -> Cost:
    """Return what one frame costs: a run with frames less one that stands still."""
    still, moving = cost(page, 0, columns, rows), cost(page, FRAMES, columns, rows)
    return Cost(
        sent_bytes=round((moving.sent_bytes - still.sent_bytes) / FRAMES),
        cpu_s=(moving.cpu_s - still.cpu_s) / FRAMES,
    )


def main() -> None:
    """Measure and print."""
    rows = []
    for columns, lines in SIZES:
        costs = {page: a_frame(page, columns, lines) for page in PAGES}
        stock = costs["stock"]
        for page, each in costs.items():
            rows.append(
                (
                    f"{columns} x {lines}, {page}" + (" (baseline)" if page == "stock" else ""),
                    f"{each.sent_bytes}",
                    f"{each.sent_bytes / stock.sent_bytes:.2f}",
                    f"{100.0 * each.cpu_s / FRAME_S:.1f} %",
                    f"{each.cpu_s / stock.cpu_s:.2f}",
                )
            )
    title = f"A trace and a roundness plot at {1.0 / FRAME_S:.0f} Hz, mean of {FRAMES} frames"
    print_table(title, ("", "bytes a frame", "x baseline", "CPU", "x baseline"), rows)


if __name__ == "__main__":
    main()
