"""How long a stop takes from its call to its byte on the wire, while the console has other things to do.

The console's side is a process of its own (`benchmarks.stop_latency_host`) with the real links, the real stop path
and the real screen. This process is everything around it: the operator at the terminal, who presses the space bar,
and the line to a simulated card, on which it sees every byte. All times are of one clock.

The baseline writes one byte with `os.write` and has nothing else to do.

    python -m benchmarks.stop_latency [STOPS]
"""

from __future__ import annotations

import os
import pickle
import statistics
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from benchmarks.command_rate import running
from benchmarks.measure import extent, print_table
from benchmarks.run_page import CUT_MM, FRAMES, moments_of_a_cut
from benchmarks.stop_latency_line import CHARACTER_BITS, Card, Stopped, UiContext, bench, card_of
from console.session.feed.place import connect_feed, feeds
from console.session.feed.request import MOST_HZ, request_line

STOPS = extent(300, 2)
AIM_S = 0.020
STALL_S = 6.0  # longer than a feed waits for a reader
SLOW_BAUD, FAST_BAUD = 9600, 115_200
BASELINE = "one os.write (baseline)"
STALLED_READERS = 10
FEED, STALLED = "serial, polls, display, feed", f"serial, polls, display, feed, {STALLED_READERS} stalled readers"


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """What the link is, what its thread does, what the screen does. `paced`: bytes go at the `baud`.

    `readers` of the state feed do not read what they get; None where there is no feed.
    """

    link: str = "serial"
    work: str = "looks"
    screen: str = "none"
    baud: int = FAST_BAUD
    paced: bool = False
    recorded: bool = False
    readers: int | None = None

    @property
    def byte_s(self) -> float:
        """The time of a character on the line, 0 for one that has no speed."""
        return CHARACTER_BITS / self.baud if self.paced else 0.0


SITUATIONS = {
    BASELINE: Situation(work="bare"),
    "serial, nothing to do": Situation(work="nothing"),
    "serial, polls": Situation(),
    "serial, gathered data": Situation(work="gather"),
    "serial, polls, display": Situation(screen="console"),
    "serial, polls, display, recorder": Situation(screen="console", recorded=True),
    FEED: Situation(screen="console", readers=0),
    STALLED: Situation(screen="console", readers=STALLED_READERS),
    "serial, gathered data, display": Situation(work="gather", screen="console"),
    "serial, gathered data, terminal stalled": Situation(work="gather", screen="stalled"),
    "TCP, gathered data, display": Situation(link="tcp", work="gather", screen="console"),
    "TCP, gathered data, terminal stalled": Situation(link="tcp", work="gather", screen="stalled"),
    "Ethernet board, gathered data, display": Situation(link="ethernet", work="gather", screen="console"),
    "Ethernet board, gathered data, terminal stalled": Situation(link="ethernet", work="gather", screen="stalled"),
    "9600 baud, one os.write": Situation(work="bare", baud=SLOW_BAUD, paced=True),
    "9600 baud, polls, display": Situation(screen="console", baud=SLOW_BAUD, paced=True),
    "9600 baud, gathered data, display": Situation(work="gather", screen="console", baud=SLOW_BAUD, paced=True),
    "9600 baud, polls, terminal stalled": Situation(screen="stalled", baud=SLOW_BAUD, paced=True),
}


def like_hardware() -> bool:
    """Let this process, but not the console's, go before all others, as the electronics of a line do."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    except OSError:
        return False
    return True


def measured(situation: Situation, card: Card, moments: Path, stops: int) -> list[Stopped]:
    """Stop so often in one situation, at moments that know nothing of it."""
    with ExitStack() as stack:
        at = bench(stack, situation.link, situation.baud, situation.byte_s, card)
        command = [sys.executable, "-m", "benchmarks.stop_latency_host", at.address, situation.work]
        command += [str(at.pipe), *([] if situation.screen == "none" else [str(moments)])]
        data = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        if situation.recorded or situation.readers is not None:
            command += [str(data), "recorder" if situation.recorded else "feed"]
        process = subprocess.Popen(
            command,
            stdin=at.terminal,
            stdout=at.terminal,
            stderr=at.terminal,
            pass_fds=[at.pipe],
            start_new_session=True,
        )
        stack.callback(process.wait)
        stack.callback(process.kill)
        ui: UiContext = at.ui
        ui.wait_until_ready()
        ui.stalled = situation.screen == "stalled"
        stack.enter_context(stalling(data, situation.readers or 0))
        return ui.stops(stops)


@contextmanager
def stalling(data: Path, count: int) -> Iterator[None]:
    """Have so many readers that ask for all a state feed gives, read nothing, and come again when dropped."""
    over = threading.Event()

    def stall() -> None:
        while not over.is_set():
            with suppress(OSError), connect_feed(feeds(data)[0], STALL_S) as link:
                link.sendall(request_line(MOST_HZ))
                over.wait(STALL_S)

    threads = [threading.Thread(target=stall, daemon=True) for _ in range(count)]
    for thread in threads:
        thread.start()
    yield
    over.set()
    for thread in threads:
        thread.join()


def row(name: str, found: Sequence[Stopped], baseline_s: float) -> tuple[str, ...]:
    """Return a line of the table."""
    called = sorted(stop.wire_s - stop.called_s for stop in found)
    pressed = sorted(stop.wire_s - stop.pressed_s for stop in found)
    shares = [_share(called, share) for share in (0.5, 0.9, 0.99, 1.0)]
    return (
        name,
        *(f"{1e3 * each:.2f}" for each in shares),
        f"{shares[0] / baseline_s:.1f}",
        f"{1e3 * _share(pressed, 0.99):.2f}",
        f"{max(stop.in_front for stop in found)}",
    )


def _ratios(found: Sequence[Stopped], beside: Sequence[Stopped]) -> str:
    """Return how many times as long a stop takes, from its call and from its key."""
    called, pressed = (
        [sorted(stop.wire_s - since(stop) for stop in each) for each in (found, beside)]
        for since in (_call, _press)
    )
    parts = (("median", called, 0.5), ("99 %", called, 0.99), ("from the key, median", pressed, 0.5))
    return ", ".join(f"{name} x {_share(a, share) / _share(b, share):.2f}" for name, (a, b), share in parts)


def _call(stop: Stopped) -> float:
    return stop.called_s


def _press(stop: Stopped) -> float:
    return stop.pressed_s


def _share(ordered: Sequence[float], share: float) -> float:
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]


def main() -> None:
    """Measure and print."""
    stops = int(sys.argv[1]) if len(sys.argv) > 1 else STOPS
    rows, baseline_s = [], 0.0
    with tempfile.NamedTemporaryFile() as file, ExitStack() as stack:
        file.write(pickle.dumps(moments_of_a_cut(FRAMES, CUT_MM)))
        file.flush()
        listeners = ("--tcp", "127.0.0.1:0", "--ethernet", "127.0.0.1:0")
        card = card_of(stack.enter_context(running("-m", "console", "simulator", "--json", *listeners)))
        before_all, all_found = like_hardware(), {}
        for name, situation in list(SITUATIONS.items())[:: extent(1, 5)]:
            found = measured(situation, card, Path(file.name), stops)
            baseline_s = baseline_s or statistics.median(stop.wire_s - stop.called_s for stop in found)
            rows.append(row(name, found, baseline_s))
            all_found[name] = found
    aim = f"the aim is {1e3 * AIM_S:.0f} ms at 99 %"
    title = f"From the call of a stop to its byte on the wire, ms, {stops} stops in each situation; {aim}"
    head = ("", "median", "90 %", "99 %", "max", "x baseline", "from the key, 99 %", "bytes in front")
    print_table(title, head, rows)
    if FEED in all_found and STALLED in all_found:
        print(f"{STALLED_READERS} stalled readers beside none: {_ratios(all_found[STALLED], all_found[FEED])}")
    if not before_all:
        print("The far end had no real-time priority: what it saw late is in these times, too.")


if __name__ == "__main__":
    main()
