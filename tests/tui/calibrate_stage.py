"""Calibrations of the paper's lathe as the command keeps them, with the file that the newest rests on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from console.session.data.calibrations import FOLDER, Calibration, store
from console.session.learning.chuck_calibrating import chuck_calibration, fitted, keep_chuck
from profiles.calibration.table import parse_table
from tests.tui.stage import EXPERIMENT, MACHINE, lathe

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
    made = chuck_calibration(lathe(), measured, fitted(measured, lathe().machine), file)
    return keep_chuck(data, replace(made, date=date, chuck=chuck or made.chuck), lathe())


def fill(data: Path) -> None:
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
    assert (data / FOLDER / MACHINE / TABLE).exists()
