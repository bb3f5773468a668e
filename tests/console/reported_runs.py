"""Recorded runs for tests of the report: written by the recorder itself, with parts whose shape is known."""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from console.session.cut.recording import part_record
from console.session.cut.run import roundness_of
from console.session.data.record_file import FILE_NAME
from console.session.data.record_schema import TELEMETRY_COLUMNS
from console.session.data.records import RunRecord
from console.session.stages import Stage
from profiles.job import Job
from profiles.metrology.cylindricity import CylinderResult
from profiles.store import job_text, load_job
from profiles.traces import Trace

JAW_1_DEG = 90.0
PROGRAM = "OPEN PROG 2\nX(P11)Y(1000) ; a < b & c > d\nCLOSE\n"
COMPLETE: tuple[str, dict[str, object]] = ("result", {"tool_error_um": 1.5, "tool_error_rms_um": 0.5})
HEADER = {
    "state": "free",
    "simulated": "yes",
    "radius_mm": "25.9",
    "direction": "spindle",
    "start_mark": "spindle index",
}


def lobed(amplitude_um: float, offset_um: float = 0.0, **meta: str) -> Trace:
    """A part with three lobes, the first of them at jaw 1; its mean radius is off by an offset."""
    angle_deg = np.arange(360.0)
    lobe_um = amplitude_um * np.cos(3.0 * np.radians(angle_deg - JAW_1_DEG))
    return Trace(angle_deg=angle_deg, deviation_um=offset_um + lobe_um, meta={**HEADER, **meta})


def job_named(name: str = "ring", **changes: Any) -> Job:
    return replace(load_job("lee-2001-experiment-1").job, name=name, **changes)


def recorded(
    folder: Path,
    parts: Mapping[str, Trace],
    *,
    job: Job | None = None,
    end: tuple[str, dict[str, object]] | None = COMPLETE,
    stage: Stage = Stage.FULL,
    proven: bool = True,
    whole: CylinderResult | None = None,
    more: Mapping[str, object] | None = None,
    **changes: Any,
) -> str:
    """A run with measured parts by their names; that of the name "before" is for comparison. Return its id.

    `whole` is the form over the length of each, `more` what else the record has of it.
    """
    job = job or job_named()
    row = {
        "software": "trilobe 0.1.0",
        "python": "3.11.7",
        "job": job.name,
        "job_sha256": "1" * 64,
        "job_text_sha256": job_text(job),
        "machine": "lathe",
        "machine_sha256": "2" * 64,
        "machine_text_sha256": "name = 'lathe'",
        "simulated": 1,
        "strategy": "pvt",
        "stage": stage.value,
        "program": PROGRAM,
        "controller": "PMAC1, X1 1.17",
        "family": "pmac",
        "operator": "kim",
        "tolerance_um": job.roundness_tolerance_um,
        "setup": f'{{"force_n": 1314.0, "jaw_1_deg": {JAW_1_DEG}, "aligned": true, "address": ""}}',
    }
    run = RunRecord(folder, {**row, **changes})
    run.add("step", {"part": "after", "step": "cut", "detail": "13.5 s"})
    for name, trace in parts.items():
        of: dict[str, Any] = {"part": name, "product": name != "before", "proven": proven}
        of["more"] = more or ({} if whole is None else whole.event())
        kept = part_record(job, roundness_of(trace), trace, stage, **of)
        run.add("part", {"part": name, "ront_um": kept.ront_um}, kept)
    add_telemetry(folder, run)
    if end is not None:
        run.add(*end)
    run.close()
    return run.run_id


def add_telemetry(folder: Path, run: RunRecord) -> None:
    """Add a cut: on its way to the part, ten turns along it, and back with the tool out."""
    z_mm = np.array([-0.5, *np.linspace(0.0, 7.9, 60), 7.9, 7.9])
    rows = np.zeros((z_mm.size, len(TELEMETRY_COLUMNS)), dtype="<f4")
    value = {name: place for place, name in enumerate(TELEMETRY_COLUMNS)}
    rows[:, value["turn"]] = np.arange(z_mm.size)
    rows[:, value["time_s"]] = 0.1 * np.arange(z_mm.size)
    rows[:, value["z_mm"]] = z_mm
    rows[:, value["speed_rpm"]] = 1000.0
    rows[:, value["tool_error_um"]] = [-2000.0, *np.linspace(-3.0, 4.0, 60), -2000.0, -2000.0]
    block = "INSERT INTO telemetry VALUES (?, 1, 'after', 'poll', '2026-11-21T10:00:00.000Z', ?)"
    execute(folder, block, (run.run_id, rows.tobytes()))
    run.add("telemetry", {"part": "after", "rows": z_mm.size, "lost": 0, "reason": ""})


def execute(folder: Path, line: str, keys: tuple[object, ...] = ()) -> None:
    with closing(sqlite3.connect(folder / FILE_NAME, isolation_level=None)) as database:
        database.execute(line, keys)


def change_trace(folder: Path, run_id: str, old: bytes, new: bytes) -> None:
    """Change the trace of a run's last part in the file, as somebody might who knows SQLite."""
    with closing(sqlite3.connect(folder / FILE_NAME, isolation_level=None)) as database:
        query = "SELECT content, rowid FROM traces WHERE run_id = ? ORDER BY number DESC"
        content, row = database.execute(query, (run_id,)).fetchone()
        changed = zlib.decompress(content).replace(old, new, 1)
        assert changed != zlib.decompress(content)
        database.execute("DROP TRIGGER traces_stay")
        database.execute("UPDATE traces SET content = ? WHERE rowid = ?", (zlib.compress(changed), row))
