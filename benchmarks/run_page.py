"""What the page Run costs during a cut: bytes sent to the terminal and processor time, against stock widgets.

python -m benchmarks.run_page
"""

from __future__ import annotations

import pickle
import re
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.measure import extent, print_table
from console.session.station.commands import Start
from console.session.station.progress import CutStage
from console.session.station.state import StationState
from drivers.lathe.snapshot import Snapshot
from tests.console.floor import experiment_1, open_floor
from tests.terminal import Terminal

SIZES = ((80, 24), (160, 48))[: extent(2, 1)]
FRAME_S = 0.1
FRAMES = extent(60, 5)
CUT_MM = extent(6.0, 1.0)
"""As long a cut as the frames take."""

LONGEST_RUN_S = 60.0
BASELINE = "stock widgets (baseline)"
SHOWN_BEFORE_THE_END = 5
"""Frames before the last one from which a run is taken to have shown the cut."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What one frame is: bytes sent to the terminal, and processor time, s."""

    sent_bytes: float
    cpu_s: float


def moments_of_a_cut(frames: int, cut_mm: float = 3.0) -> list[StationState]:
    """Return `frames` + 1 states of a simulated cut as a screen sees them, ten in a second, up to its end.

    The cut is always the same one, and so are the bytes.

    Raises:
        ValueError: the cut is shorter than that.
    """
    looks: list[StationState] = []
    with tempfile.TemporaryDirectory() as folder:
        floor = open_floor(Path(folder))
        job = experiment_1(cut_mm)
        floor.set_up(job)
        floor.arm(job)

        def look(_: Snapshot) -> None:
            if floor.state.cut is not None and floor.state.cut.stage is CutStage.CUT:
                looks.append(_portable(floor.state))

        floor.looks.append(look)
        floor.do(Start())
    seen: list[StationState] = []
    for state in looks:
        if not seen or state.at_s >= looks[0].at_s + len(seen) * FRAME_S:
            seen.append(state)
    if len(seen) <= frames:
        raise ValueError(f"a cut of {len(seen)} frames only")
    return seen[-frames - 1 :]


def _portable(state: StationState) -> StationState:
    """Return the same in a form that another process can be given: a read-only view of a mapping is none."""
    snapshot = state.snapshot
    return state if snapshot is None else replace(state, snapshot=replace(snapshot, inputs=dict(snapshot.inputs)))


def a_frame(app: str, moments: Sequence[StationState], columns: int, rows: int) -> Cost:
    """Show the moments in a terminal of its own and return what one of them costs, apart from the first.

    Raises:
        AssertionError: the moments were not seen on the screen, or the app failed; with the screen.
    """
    with tempfile.NamedTemporaryFile() as file:
        file.write(pickle.dumps(list(moments)))
        file.flush()
        command = [sys.executable, "-m", "benchmarks.run_page_apps", app, file.name]
        with Terminal(command, columns=columns, rows=rows) as terminal:
            late = moments[max(len(moments) - SHOWN_BEFORE_THE_END, 0)]
            terminal.wait_for(lambda screen: _turn(screen) >= _turn_of(late), LONGEST_RUN_S)
            terminal.wait_exit(LONGEST_RUN_S)
            said = re.search(r"^(\d+) bytes, (\S+) s$", terminal.text, re.MULTILINE)
            assert said is not None, terminal.text
    frames = len(moments) - 1
    return Cost(sent_bytes=int(said[1]) / frames, cpu_s=float(said[2]) / frames)


def _turn_of(state: StationState) -> int:
    return -1 if state.cut is None else int(state.cut.turn)


def _turn(screen: str) -> int:
    """Return the turn that stands on the screen, -1 where there is none."""
    found = re.search(r"\bturn (\d+) of \d+", screen)
    return -1 if found is None else int(found[1])


def main() -> None:
    """Measure and print."""
    cut = moments_of_a_cut(FRAMES, CUT_MM)
    runs = {
        BASELINE: ("stock", cut),
        "stock widgets, nothing changes": ("stock", cut[:1] * len(cut)),
        "a single line": ("line", cut),
        "console": ("console", cut),
        "console, nothing changes": ("console", cut[:1] * len(cut)),
    }
    rows = []
    for columns, lines in SIZES:
        costs = {name: a_frame(app, moments, columns, lines) for name, (app, moments) in runs.items()}
        baseline = costs[BASELINE]
        rows += [
            (
                f"{columns} x {lines}, {name}",
                f"{each.sent_bytes:.0f}",
                f"{each.sent_bytes / baseline.sent_bytes:.2f}",
                f"{100.0 * each.cpu_s / FRAME_S:.1f} %",
                f"{each.cpu_s / baseline.cpu_s:.2f}",
            )
            for name, each in costs.items()
        ]
    title = f"The page Run during a cut at {1.0 / FRAME_S:.0f} Hz, mean of {FRAMES} frames"
    print_table(title, ("", "bytes a frame", "x baseline", "CPU", "x baseline"), rows)


if __name__ == "__main__":
    main()
