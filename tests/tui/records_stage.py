"""Recorded runs, written by the functions that record a cut, and the page Records on its stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.cut.recording import part_record
from console.session.cut.run import roundness_of
from console.session.data import run_log
from console.session.data.calibrations import FOLDER as CALIBRATIONS
from console.session.data.calibrations import Calibration, store
from console.session.data.records import RunRecord
from console.session.learning.chuck_calibrating import chuck_calibration, fit_chuck_table, keep_chuck
from console.session.stages import Stage
from console.tui.further.scope import FOLDER as SCOPE_RECORDS
from console.tui.further.scope import record_text
from console.tui.pages.records import RecordsPage
from drivers.lathe.snapshot import AxisName
from drivers.requests.scope_gather import ANGLE, Channel, MotorRegister, ScopeRecord, ScopeTrigger
from profiles.calibration.table import parse_table
from profiles.job import Job
from profiles.store import job_text
from profiles.traces import Trace
from tests.record_clock import set_dates
from tests.tui.page_stage import PageScene
from tests.tui.stage import EXPERIMENT, MACHINE, experiment, lathe

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
        "setup": run_log.event_json(
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
    more: Mapping[str, object] | None = None,
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
        kept = {"jaw_1_deg": 12.63, "phase_known": True, **(more or {})}
        part = part_record(job, roundness_of(measured), measured, stage, more=kept)
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


# Calibrations of the lathe as the command keeps them, with the file that the newest rests on.

TABLE = "wrench.csv"
WRENCH = """torque_n_m;force_n
10;3741
10;3902
20;7488
20;7610
30;11252
30;11420
40;15177
40;14903
50;18801
50;19020
"""
DEFLECTION = """# youngs_modulus_gpa: 206
chucking_force_n;load_n;angle_deg;diameter_mm;overhang_mm;deflection_um
"""


def keep_wrench(data: Path, table: str = WRENCH, *, date: str, file: str = TABLE, chuck: str = "") -> Path:
    """Keep a calibration of the wrench with a date."""
    measured = parse_table(table.encode())
    made = chuck_calibration(lathe(), measured, fit_chuck_table(measured, lathe().machine), file)
    return keep_chuck(data, replace(made, date=date, chuck=chuck or made.chuck), lathe())


def fill_calibrations(data: Path) -> None:
    """Two calibrations of the wrench, the points of the newest beside it, and the lobe of a job."""
    keep_wrench(data, WRENCH.replace("19020", "20400"), date="2025-11-03T08:00:00.000Z", file="first.csv")
    keep_wrench(data, date="2025-12-20T14:30:00.000Z").with_name(TABLE).write_text(WRENCH, encoding="utf-8")
    found = {
        "error_um_pp": 54.21,
        "error_ci_um_pp": 0.62,
        "crest_deg": 12.9,
        "crest_ci_deg": 0.31,
        "simulated": True,
    }
    store(
        data,
        Calibration(
            kind="lobe",
            subject=EXPERIMENT,
            subject_sha256="0" * 64,
            date="2025-12-21T09:00:00.000Z",
            file="part.csv",
            file_sha256="0" * 64,
            found=found,
        ),
    )
    assert (data / CALIBRATIONS / MACHINE / TABLE).exists()


# A record of the scope whose numbers are known: the tool follows a lobe of three at 600 rpm.

SCOPE_NAME = "lee-2001-lathe-20260102T085000.000Z.csv"
COMMANDED, ACTUAL, ERROR = (
    Channel(AxisName.TOOL, quantity)
    for quantity in (MotorRegister.COMMANDED, MotorRegister.ACTUAL, MotorRegister.FOLLOWING_ERROR)
)
AMPLITUDE_M, ERROR_M, OMEGA = 27.5e-6, 3e-6, 2.0 * np.pi * 10.0


def scope_record(seconds: float = 0.5, step_s: float = 0.001) -> ScopeRecord:
    """Ten turns a second; the error is a third of its size in every other turn."""
    times = np.arange(0.0, seconds, step_s)
    angle = OMEGA * times
    turn = np.floor(angle / (2.0 * np.pi))
    error = ERROR_M * np.sin(3.0 * angle) * np.where(turn % 2 == 0, 1.0, 1.0 / 3.0)
    commanded = 0.02 + AMPLITUDE_M * np.cos(3.0 * angle)
    values = {COMMANDED: commanded, ACTUAL: commanded - error, ERROR: error, ANGLE: angle}
    return ScopeRecord(
        machine="lee-2001-lathe",
        taken="2026-01-02T08:50:00+00:00",
        trigger=ScopeTrigger.NOW,
        times_s=times,
        values=values,
    )


def keep_scope_record(data: Path) -> None:
    """Keep it in a data folder."""
    folder = data / SCOPE_RECORDS
    folder.mkdir(parents=True, exist_ok=True)
    (folder / SCOPE_NAME).write_text(record_text(scope_record()), encoding="utf-8")
