"""A record of the scope whose numbers are known: the tool follows a lobe of three at 600 rpm."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from console.tui.further.scope import FOLDER, record_text
from drivers.requests.scope_gather import ANGLE, Axis, Channel, Quantity, Record, Trigger

NAME = "lee-2001-lathe-20260102T085000.000Z.csv"
COMMANDED, ACTUAL, ERROR = (
    Channel(Axis.TOOL, quantity) for quantity in (Quantity.COMMANDED, Quantity.ACTUAL, Quantity.FOLLOWING_ERROR)
)
AMPLITUDE_M, ERROR_M, OMEGA = 27.5e-6, 3e-6, 2.0 * np.pi * 10.0


def record(seconds: float = 0.5, step_s: float = 0.001) -> Record:
    """Ten turns a second; the error is a third of its size in every other turn."""
    times = np.arange(0.0, seconds, step_s)
    angle = OMEGA * times
    turn = np.floor(angle / (2.0 * np.pi))
    error = ERROR_M * np.sin(3.0 * angle) * np.where(turn % 2 == 0, 1.0, 1.0 / 3.0)
    commanded = 0.02 + AMPLITUDE_M * np.cos(3.0 * angle)
    values = {COMMANDED: commanded, ACTUAL: commanded - error, ERROR: error, ANGLE: angle}
    return Record(
        machine="lee-2001-lathe",
        taken="2026-01-02T08:50:00+00:00",
        trigger=Trigger.NOW,
        times_s=times,
        values=values,
    )


def keep(data: Path) -> None:
    """Keep it in a data folder."""
    folder = data / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    (folder / NAME).write_text(record_text(record()), encoding="utf-8")
