"""What the record of cuts costs: a list by how many runs there are, opening it for a cut, and bytes for a run.

python -m benchmarks.records
"""

from __future__ import annotations

import sqlite3
import statistics
import tempfile
import time
from contextlib import closing
from pathlib import Path

import numpy as np

from benchmarks.measure import extent, print_table, seconds
from console.cli.measured.roundness_report import roundness_fields
from console.session.cut.run import roundness_of
from console.session.data.measured_part import RecordedPart
from console.session.data.record_file import FILE_NAME, open_records
from console.session.data.records import RunRecord
from console.session.data.run_reader import RunFilters, measured_parts, runs, story
from profiles.store import load_machine
from profiles.traces import Trace, trace_content

RUNS, FEW = extent(5000, 40), extent(50, 10)
CUT_S = 60.0
PERIOD_S = 0.1
REPEATS = extent(15, 2)
SCREENFUL = 20
JOBS = ("ring", "bar", "cup", "tube")
LISTS = ("list, newest screenful", "list, of one job", "list, failed ones")
MEASURED = (*LISTS, "one run in full", "chart of a job", "begin a run", "check at the start")


def a_part(number: int) -> RecordedPart:
    """Return a part with 3600 points; each has another trace."""
    random = np.random.default_rng(number)
    angle_deg = np.linspace(0.0, 360.0, 3600, endpoint=False)
    deviation_um = np.asarray(np.cos(np.radians(3.0 * angle_deg)) + 0.1 * random.normal(size=3600))
    trace = Trace(angle_deg=angle_deg, deviation_um=deviation_um, meta={"state": "free", "radius_mm": "25.9"})
    result = roundness_of(trace)
    um = result.ront_um + (5.0 if number % 100 == 0 else 0.0)
    return RecordedPart(
        ront_um=um,
        trace=trace_content(trace),
        data=roundness_fields(result),
        tolerance_um=5.0,
        passed=um <= 5.0,
        diameter_mm=51.8,
        nominal_diameter_mm=51.8,
        lobe_um_pp=2.0,
    )


def begun(folder: Path, job: str = "ring", **more: object) -> RunRecord:
    """Begin a run as a cut does."""
    described = {
        **dict.fromkeys(("software", "job_sha256", "machine_sha256", "strategy", "program"), "0" * 64),
        **{"job": job, "machine": "lathe", "simulated": 0, "stage": "full"},
        **more,
    }
    return RunRecord(folder, described, open_timeout_s=60.0, timeout_s=60.0, checked=False)


def write(folder: Path, count: int) -> float:
    """Write a record of runs of a minute each, with the functions that a cut uses; return the bytes of one."""
    parts = [a_part(number) for number in range(min(count, 25))]
    machine = load_machine("lee-2001-lathe").text
    telemetry = np.random.default_rng(1).normal(size=(round(CUT_S / PERIOD_S), 7))
    program = "X1 Y2 Z3\n" * 270
    for number in range(count):
        run = begun(folder, JOBS[number % len(JOBS)], program=program, machine_text_sha256=machine)
        run.add("armed", {"force_n": 1314.0})
        run.add("started", {"strategy": "pvt"})
        run.log.begin_cut("", lambda polls: telemetry)
        run.log.poll((0.0,))
        run.log.end_cut()
        for command in ("Arm", "Start", "Measure"):
            run.log.event("command", {"command": command, "by": "operator"})
        run.add("cut", {"turn": 1000.0})
        run.add("measured", {"ront_um": 1.0}, parts[number % len(parts)])
        run.close()
    with closing(sqlite3.connect(folder / FILE_NAME)) as database:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return (folder / FILE_NAME).stat().st_size / count


def read(folder: Path) -> list[float]:
    """Return the median time of each thing that is read."""
    newest = runs(folder, limit=1)[0].run_id
    works = (
        lambda: runs(folder, limit=SCREENFUL),
        lambda: runs(folder, RunFilters(job=JOBS[0]), limit=SCREENFUL),
        lambda: runs(folder, RunFilters(failed=True), limit=SCREENFUL),
        lambda: story(folder, newest),
        lambda: measured_parts(folder, JOBS[0], "lathe", simulated=False),
        lambda: begun(folder).close(),
        lambda: open_records(folder, time.monotonic() + 60.0).close(),
    )
    return [statistics.median(seconds(work) for _ in range(REPEATS)) for work in works]


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as few, tempfile.TemporaryDirectory() as many:
        bytes_few, bytes_many = write(Path(few), FEW), write(Path(many), RUNS)
        times = zip(MEASURED, read(Path(few)), read(Path(many)), strict=True)
        rows = [
            (name, f"{1000.0 * short:.1f} ms", f"{1000.0 * long:.1f} ms", f"{long / short:.1f}")
            for name, short, long in times
        ]
    rows.append(
        (
            "a run on disk",
            f"{bytes_few / 1000:.0f} kB",
            f"{bytes_many / 1000:.0f} kB",
            f"{bytes_many / bytes_few:.1f}",
        )
    )
    heads = ("", f"{FEW} runs (baseline)", f"{RUNS} runs", "x baseline")
    print_table(
        f"Runs of {CUT_S:.0f} s, {1.0 / PERIOD_S:.0f} samples a second, a trace of 3600 points", heads, rows
    )


if __name__ == "__main__":
    main()
