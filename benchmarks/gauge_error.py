"""What a gauge that errs twice a turn does to parts in a row, and what two placements of one part change.

The gauge of each lathe errs by 3 um of amplitude at an angle of its own. A row of three parts is learned as the
gauge reads them, and again on the same lathe after a plain part was read in two placements 90 degrees apart, so
that the error is kept and taken off. `read` is RONt (LSC, 50 UPR) of the third part as the gauge reads it, `true`
that of the surface that the simulated part has, mid-cut: median, its 95 % interval by order statistics, and worst.

    python -m benchmarks.gauge_error [--seeds 40] [--first 301] [--job JOB ...]
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import statistics
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from benchmarks.learning import job_file
from benchmarks.measure import extent, print_table
from console.__main__ import main as console
from drivers.simulator.plant.workpiece import ANGLES
from drivers.simulator.plant.workshop import FREE, Gauge
from profiles.traces import Trace

JOBS = ("lee-2001-experiment-1", "two-jaw-tube", "square", "six")
ERROR_UM, TURNED_DEG, NOISE_UM = 3.0, 90.0, 0.05
PARTS, FILTER_UPR = 3, 50.0
OWN = "bench"
GAUGE = f"""\
schema = 1
name = "{OWN}"
probe_noise_um = {NOISE_UM}
probe_gain_percent = 0.0
repeat_um = 0.0
"""


def plant(seed: int) -> str:
    """Return a plant: realistic, with the gauge of this seed."""
    error = f"spindle_error_um = {ERROR_UM}\nspindle_error_deg = {error_deg(seed):.1f}\n"
    return f'schema = 1\nsource = "realistic, with a gauge that errs"\nlike = "realistic"\n[gauge]\n{error}'


def error_deg(seed: int) -> float:
    """Return where the gauge of a lathe is highest, by its own angles: spread evenly over half a turn."""
    return seed * 180.0 * (math.sqrt(5.0) - 1.0) / 2.0 % 180.0


def error_um(seed: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the error of the gauge at its own angles, um, shape (3600,)."""
    angle_deg = np.arange(ANGLES) * 360.0 / ANGLES
    return np.asarray(ERROR_UM * np.cos(2.0 * np.radians(angle_deg - error_deg(seed))), dtype=np.float64)


@contextlib.contextmanager
def surfaces() -> Iterator[list[np.ndarray[Any, np.dtype[np.float64]]]]:
    """Collect the surface of each released part, um, as it is on the simulated lathe before its gauge reads it."""
    seen: list[np.ndarray[Any, np.dtype[np.float64]]] = []
    read = Gauge.trace

    def trace(self: Gauge, deviation_um: Any, radius_mm: float, state: str, turned_deg: float = 0.0) -> Trace:
        if state == FREE:
            seen.append(np.array(deviation_um))
        return read(self, deviation_um, radius_mm, state, turned_deg)

    with mock.patch.object(Gauge, "trace", trace):
        yield seen


def say(*words: str) -> str:
    """Return what a command has written; RuntimeError: it failed."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        code = console(list(words))
    if code:
        raise RuntimeError(f"exit code {code}: console {' '.join(words)}")
    return said.getvalue()


def write(path: Path, deviation_um: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    """Write the reading of a released part."""
    rows = "".join(f"{n * 360.0 / ANGLES:.1f},{um:.4f}\n" for n, um in enumerate(deviation_um))
    path.write_text(f"# state: free\n# units_checked: yes\nangle_deg,deviation_um\n{rows}", encoding="utf-8")
    return str(path)


def ront_um(deviation_um: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Return RONt of a surface by formulas of our own: LSC, and the Gaussian of ISO 16610-21 at 50 UPR."""
    lines = np.fft.rfft(deviation_um)
    lines *= np.exp(-math.pi * (math.sqrt(math.log(2.0) / math.pi) * np.arange(lines.size) / FILTER_UPR) ** 2)
    lines[:2] = 0.0  # size, and how far it is off its centre
    return float(np.ptp(np.fft.irfft(lines, deviation_um.size)))


def rows(job: str, seed: int) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return what was read and what is true of the third part, um, without and with the placements."""
    found = []
    for placements in (False, True):
        with tempfile.TemporaryDirectory() as data, surfaces() as seen:
            folder = Path(data)
            (folder / "plant.toml").write_text(plant(seed), encoding="utf-8")
            (folder / f"{OWN}.toml").write_text(GAUGE, encoding="utf-8")
            on = ("--data", data)
            words = ["run", str(job_file(job, folder)), "--sim", "--plant", str(folder / "plant.toml")]
            words += ["--seed", str(seed), *on, "--json"]
            if placements:
                say(*words, "--strategy", "none")
                noise, own = np.random.default_rng(seed), seen[-1]
                turned = np.roll(own, round(TURNED_DEG * ANGLES / 360.0))
                readings = [
                    write(folder / f"{n}.csv", each + error_um(seed) + noise.normal(0.0, NOISE_UM, ANGLES))
                    for n, each in enumerate((own, turned))
                ]
                say("roundness", *readings, "--separate", f"0,{TURNED_DEG:g}", "--save-gauge-error", OWN, *on)
            gauge = ("--gauge", str(folder / f"{OWN}.toml")) if placements else ()
            try:
                said = json.loads(say(*words, "--strategy", "cam", "--learn", str(PARTS), *gauge))
            except RuntimeError as error:
                print(f"{job}, seed {seed}: {error}", file=sys.stderr, flush=True)
                return None
            found.append((float(said["passes"][-1]["RONt_um"]), ront_um(seen[-1])))
    print(f"{job}, seed {seed}: {found}", file=sys.stderr, flush=True)
    return found[0], found[1]


def spread(values: Sequence[float]) -> str:
    """Return the median, its 95 % interval by order statistics, and the worst."""
    ordered, n = sorted(values), len(values)
    off = 0.98 * math.sqrt(n)
    low, high = max(math.floor(n / 2 - off), 0), min(math.ceil(n / 2 + off), n - 1)
    return f"{statistics.median(ordered):.2f} ({ordered[low]:.2f} to {ordered[high]:.2f}) / {ordered[-1]:.2f}"


def main() -> None:
    """Run and print the table."""
    options = argparse.ArgumentParser()
    options.add_argument("--seeds", type=int, default=extent(40, 1))
    options.add_argument("--first", type=int, default=301, help="the first of the seeds")
    options.add_argument("--job", nargs="+", default=JOBS[: extent(len(JOBS), 1)])
    asked = options.parse_args()
    table = []
    with ProcessPoolExecutor() as pool:
        for job in asked.job:
            seeds = range(asked.first, asked.first + asked.seeds)
            of = [each for each in pool.map(partial(rows, job), seeds) if each is not None]
            for at, name in enumerate(("as read", "two placements")):
                cells = [spread([each[at][which] for each in of]) if of else "-" for which in (0, 1)]
                table.append((job, name, *cells, f"{asked.seeds - len(of)} of {asked.seeds}"))
    print_table(
        "RONt of the third part, um: median (95 %) / worst", ("job", "error", "read", "true", "ended"), table
    )


if __name__ == "__main__":
    main()
