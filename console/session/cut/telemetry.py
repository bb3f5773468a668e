"""Telemetry of a cut while the tool is in the part, and the figures derived from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.cutting.planning import CutPlan
from drivers.lathe.snapshot import Snapshot
from profiles.least_squares import fit, harmonic_columns
from profiles.machine import MachineProfile

LEAST_PEAK_UM = 1.0
"""Floor of the peak tool error: below it, twice the error does not mean that the tool is retracting."""

Row = tuple[float, float, float, float, float]
"""Time in s; tool and spindle in counts; distance past the middle of the cut in mm; following error in counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CutFigures:
    """Figures of one cut, from the controller's own positions.

    `tool_error_um` is the largest distance of the actual tool from the target path at the spindle angle of that
    instant; `following_error_um` is the largest distance of the actual tool from its commanded position. A path
    commanded ahead of the servo's lag has a large following error and a small tool error.
    """

    spindle_speed_rpm: float
    tool_error_um: float
    tool_error_rms_um: float
    following_error_um: float
    following_error_rms_um: float
    samples: int


def is_leaving(error_um: float, peak_um: float) -> bool:
    """Whether a tool commanded to end the cut is retracting: no earlier error was as large."""
    return abs(error_um) > 2.0 * max(peak_um, LEAST_PEAK_UM)


class Telemetry:
    """Collect the snapshots taken while the carriage is over the part and the tool is in it."""

    def __init__(self, plan: CutPlan, machine: MachineProfile, cut_length_mm: float) -> None:
        self._plan = plan
        self._machine = machine
        self._counts_per_mm = machine.carriage.counts_per_mm
        end = plan.carriage_start + plan.setup.carriage_counts
        length = cut_length_mm * machine.carriage.counts_per_mm
        # The last turn is left out: the tool may already be retracting.
        self._first, self._last = end - length, end - plan.setup.carriage_per_turn
        self._over = False
        self._rows: list[Row] = []

    def see(self, snapshot: Snapshot, *, holding: bool) -> None:
        """Take what belongs to the cut; `holding` means that the program was asked to end after this turn."""
        row = self._row(snapshot)
        if self._rows and (snapshot.tool.position < self._plan.setup.surface or (holding and self._leaves(row))):
            # A program may return over the part with the tool out: the cut is over.
            self._over = True
        if self._over or not snapshot.program_running:
            return
        if self._first <= snapshot.carriage.position <= self._last:
            self._rows.append(row)

    def _row(self, snapshot: Snapshot) -> Row:
        tool, spindle = snapshot.tool, snapshot.spindle
        past_mm = (snapshot.carriage.position - self._plan.setup.carriage_middle) / self._counts_per_mm
        return snapshot.at_s, tool.position, spindle.position, past_mm, tool.following_error

    def _leaves(self, row: Row) -> bool:
        """Whether a hold retracts the tool while the carriage is still over the part."""
        return is_leaving(self._errors_um([row])[0], np.abs(self._errors_um(self._rows)).max())

    def _errors_um(self, rows: list[Row]) -> NDArray[np.float64]:
        """Return the tool against the target path at the spindle angle of each row, infeed positive."""
        _, tool, spindle, past_mm, _ = np.array(rows, dtype=np.float64).T
        infeed_um = (tool - self._plan.setup.surface) * self._machine.tool.count_um
        angle_deg = 360.0 * spindle / self._machine.spindle.counts_per_rev
        return np.asarray(infeed_um - self._plan.target.at_um(angle_deg, past_mm))

    def figures(self) -> CutFigures | None:
        """Return the figures, None when fewer than two polls fell into the cut."""
        if len(self._rows) < 2:
            return None
        at_s, _, spindle, _, following = np.array(self._rows).T
        turns = spindle / self._machine.spindle.counts_per_rev
        error_um = self._errors_um(self._rows)
        following_um = following * self._machine.tool.count_um
        _, turns_per_s = fit(harmonic_columns(at_s, (), at_s - at_s[0]), turns).coefficients
        return CutFigures(
            # The slope through all polls: the time of a single one is known to some milliseconds only.
            spindle_speed_rpm=60.0 * float(turns_per_s),
            tool_error_um=float(np.abs(error_um).max()),
            tool_error_rms_um=float(np.sqrt(np.mean(error_um**2))),
            following_error_um=float(np.abs(following_um).max()),
            following_error_rms_um=float(np.sqrt(np.mean(following_um**2))),
            samples=len(self._rows),
        )
