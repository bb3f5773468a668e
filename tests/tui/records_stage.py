"""Recorded runs, written by the functions that record a cut, and the page Records on its stage."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.cut.recording import part_record
from console.session.cut.run import roundness_of
from console.session.data import run_log
from console.session.data.records import RunRecord
from console.session.stages import Stage
from console.tui.pages.records import RecordsPage
from profiles.job import Job
from profiles.store import job_text
from profiles.traces import Trace
from tests.record_clock import set_dates
from tests.tui.page_stage import PageScene
from tests.tui.stage import MACHINE, experiment, lathe

BEGUN = datetime(2026, 1, 2, 6, 0, tzinfo=UTC)
PROGRAM = "CLOSE\nOPEN PROG 10 CLEAR\nX1 Y2 Z3\nCLOSE"
ANGLES_DEG = np.arange(360.0)
META = {"state": "free", "direction": "spindle", "start_mark": "spindle index", "simulated": "yes"}


class RecordsScene(PageScene):
    """The page, in the room that a frame leaves it."""

    page_class = RecordsPage


def trace(lobe_um: float, *, radius_mm: float | None = None, off_um: float = 0.0) -> Trace:
    """A part with three lobes of this amplitude, and with size where the radius is stated."""
    deviation_um = off_um + lobe_um * np.cos(np.radians(3.0 * (ANGLES_DEG - 12.0)))
    deviation_um = deviation_um + 0.05 * np.cos(np.radians(7.0 * ANGLES_DEG))
    size = {} if radius_mm is None else {"radius_mm": str(radius_mm)}
    return Trace(angle_deg=ANGLES_DEG, deviation_um=deviation_um, meta={**META, **size})


def described(job: Job, **changes: Any) -> dict[str, object]:
    """The columns of a run of a job, as `begin_record` writes them."""
    return {
        "software": "trilobe 1.0",
        "job": job.name,
        "job_sha256": experiment().loaded.sha256,
        "machine": MACHINE,
        "machine_sha256": lathe().sha256,
        "simulated": 1,
        "strategy": "pvt",
        "program": PROGRAM,
        "job_text_sha256": job_text(job),
        "machine_text_sha256": lathe().text,
        "python": "3.11",
        "controller": "Turbo PMAC",
        "family": "turbo",
        "stage": "full",
        "compensation": None,
        "operator": "kim",
        "tolerance_um": job.roundness_tolerance_um,
        "setup": run_log.shown(
            {"force_n": 1314.0, "jaw_1_deg": 12.63, "jaw_1_at": "2 Jan 08:45", "zero_radius_mm": 76.013}
        ),
        **changes,
    }


def run(
    folder: Path,
    lobe_um: float | None,
    *,
    job: Job | None = None,
    off_um: float = 0.0,
    end: tuple[str, Mapping[str, object]] = ("cut", {"turn": 160.0}),
    kind: str = "measured",
    **changes: Any,
) -> str:
    """Record a run of a minute, with telemetry; with a measured part where it has a lobe."""
    job = job or experiment().job
    written = RunRecord(folder, described(job, **changes))
    written.add("armed", {"force_n": 1314.0})
    written.add("started", {"strategy": "pvt"})
    written.log.begin_cut("", lambda polls: telemetry())
    written.log.poll((0.0,))
    written.log.end_cut()
    for command in ("Arm", "Start", "Measure"):
        written.log.event("command", {"command": command, "by": "kim"})
    written.add(*end)
    if lobe_um is not None:
        measured = trace(lobe_um, radius_mm=job.finished_radius_mm, off_um=off_um)
        stage = Stage(changes.get("stage", "full"))
        more = {"jaw_1_deg": 12.63, "phase_known": True}
        part = part_record(job, roundness_of(measured), measured, stage, more=more)
        written.add(kind, {"ront_um": part.ront_um}, part)
    written.close()
    return written.run_id


def telemetry() -> Any:
    """Ten rows of a cut: tool error 1 um at most, 1000 rpm."""
    time_s = np.arange(10.0) / 10.0
    columns = (time_s, time_s * 16.0, time_s * 0.8, np.full(10, 1000.0), np.sin(6.0 * time_s))
    return np.column_stack([*columns, np.full(10, 0.1), np.full(10, 12.0)])


def clocked(patch: pytest.MonkeyPatch, step: timedelta = timedelta(minutes=7)) -> None:
    """Have each event of the record come some minutes after the last one."""
    now = [BEGUN]

    def utc_now() -> str:
        now[0] += step
        return now[0].isoformat(timespec="milliseconds").replace("+00:00", "Z")

    set_dates(patch, utc_now)
