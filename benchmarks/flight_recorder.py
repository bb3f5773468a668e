"""What the flight recorder costs: a turn of its thread, the ring on disk, the frozen file, the reading of it.

python -m benchmarks.flight_recorder
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np

from benchmarks.measure import extent, print_table
from console.flight.frozen_recordings import frozen_in
from console.flight.recording import read_recording
from console.session.station.state import Activity, StationState
from console.tui.keymap import PageName
from tests.console.flight.bench import FlightBench
from tests.tui.scenes import cut, machine, scene_of, signed

MINUTES = extent(6.0, 0.2)
POLL = b"M70=677 #1P F ? #2P F ? #3P F ? &1?? % P1000 P1004\r"
REPLY = b"243827\r3\r840000000400\r10351\r-2\r840000000400\r41287\r1\r840000000400\r000001000000\r100\r7\r0\r\x06"


def cutting() -> Callable[[StationState], StationState]:
    """A cut: three polls a turn, and all its samples move on by as many."""
    turn, noise = count(), np.random.default_rng(1)

    def changed(state: StationState) -> StationState:
        before = state.cut or cut()
        angles = np.append(before.angles_deg[3:], 360.0 * noise.random(3))
        errors = np.append(before.errors_um[3:], noise.normal(size=3))
        return replace(state, cut=replace(before, turn=float(next(turn)), angles_deg=angles, errors_um=errors))

    return changed


SCENES: dict[str, tuple[StationState, Callable[[StationState], StationState]]] = {
    "at rest": (machine(Activity.READY), lambda state: state),
    "jogging": (machine(Activity.JOGGING), lambda state: state),
    "a cut": (replace(machine(Activity.CUTTING), cut=cut()), cutting()),
    "at rest, two measured parts": (scene_of(PageName.INSPECT).state, lambda state: state),
}


def row(name: str) -> tuple[str, ...]:
    """Record some minutes, three polls a turn on the link, and freeze them."""
    state, changed = SCENES[name]
    with tempfile.TemporaryDirectory() as folder:
        bench = FlightBench(Path(folder), state=state, work=signed())

        def polls() -> None:
            bench.state = changed(bench.state)
            for _ in range(3):
                bench.inbox.put(">", POLL)
                bench.inbox.put("<", REPLY)

        spent = _timed(bench)
        bench.runs(60.0 * MINUTES, polls)
        ring = sum(path.stat().st_size for path in Path(folder).rglob("*.segment"))
        turn_ms = 1e3 * sum(spent) / len(spent)
        worst_ms = 1e3 * max(spent)
        bench.stops("space")
        bench.runs(5.2)
        (path,) = frozen_in(Path(folder))
        frozen, freeze_ms = path.stat().st_size, 1e3 * max(spent)
        began_s = time.perf_counter()
        recording = read_recording(path)
        read_s = time.perf_counter() - began_s
    return (
        name,
        f"{turn_ms:.2f}",
        f"{worst_ms:.1f}",
        f"{ring / 1e3:.0f}",
        f"{frozen / 1e3:.0f}",
        f"{freeze_ms:.0f}",
        f"{recording.length_s:.0f}",
        f"{read_s:.2f}",
    )


def _timed(bench: FlightBench) -> list[float]:
    """Measure each turn of the recorder, s."""
    turn, spent = bench.recorder.turn, []

    def timed() -> None:
        began_s = time.perf_counter()
        turn()
        spent.append(time.perf_counter() - began_s)

    bench.recorder.turn = timed  # type: ignore[method-assign]
    return spent


def main() -> None:
    """Measure and print."""
    head = ("", "a turn, ms", "longest, ms", "ring, kB", "frozen, kB", "freezing, ms", "length, s", "read, s")
    print_table(f"Flight recorder, {MINUTES:g} minutes, ten turns a second", head, [row(name) for name in SCENES])


if __name__ == "__main__":
    main()
