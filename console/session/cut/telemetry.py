"""What is read while the tool is in the part, and the figures that come of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.cutting.planning import CutPlan
from drivers.lathe.snapshot import Snapshot
from profiles.least_squares import fit, harmonic_columns
from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True, kw_only=True)
class CutFigures:
    """Figures of one cut, from the controller's own positions.

    `tool_error_um` is the largest distance of the actual tool from the path that the part wants at the spindle
    angle of that very instant; `following_error_um` is the largest distance of the actual tool from where the
    controller commanded it. A path that is commanded ahead of the servo's lag has a large following error and
    a small tool error.
    """

    spindle_speed_rpm: float
    tool_error_um: float
    tool_error_rms_um: float
    following_error_um: float
    following_error_rms_um: float
    samples: int


class Telemetry:
    """Collects snapshots of the time in which the carriage is over the part and the tool is in it."""

    def __init__(self, plan: CutPlan, machine: MachineProfile, cut_length_mm: float) -> None:
        self._plan = plan
        self._machine = machine
        self._counts_per_mm = machine.carriage.counts_per_mm
        end = plan.carriage_start + plan.setup.carriage_counts
        length = cut_length_mm * machine.carriage.counts_per_mm
        # The last turn is left out: in it the tool may already be on its way out.
        self._first, self._last = end - length, end - plan.setup.carriage_per_turn
        self._over = False
        self._rows: list[tuple[float, float, float, float, float]] = []

    def see(self, snapshot: Snapshot) -> None:
        """Take what belongs to the cut, leave the rest."""
        tool = snapshot.tool
        if self._rows and tool.position < self._plan.setup.surface:
            # A program may go back over the part with the tool out: the cut is over.
            self._over = True
        if self._over or not snapshot.program_running:
            return
        if self._first <= snapshot.carriage.position <= self._last:
            past_mm = (snapshot.carriage.position - self._plan.setup.carriage_middle) / self._counts_per_mm
            place = tool.position, snapshot.spindle.position, past_mm
            self._rows.append((snapshot.at_s, *place, tool.following_error))

    def figures(self) -> CutFigures | None:
        """Return the figures, None when fewer than two looks fell into the cut."""
        if len(self._rows) < 2:
            return None
        at_s, tool, spindle, past_mm, following = np.array(self._rows).T
        count_um = self._machine.tool.count_um
        turns = spindle / self._machine.spindle.counts_per_rev
        infeed_um = (tool - self._plan.setup.surface) * count_um
        error_um = infeed_um - self._plan.wanted.at_um(360.0 * turns, past_mm)
        following_um = following * count_um
        _, turns_per_s = fit(harmonic_columns(at_s, (), at_s - at_s[0]), turns).coefficients
        return CutFigures(
            # The slope through all looks: the times of single ones are known to some milliseconds only.
            spindle_speed_rpm=60.0 * float(turns_per_s),
            tool_error_um=float(np.abs(error_um).max()),
            tool_error_rms_um=float(np.sqrt(np.mean(error_um**2))),
            following_error_um=float(np.abs(following_um).max()),
            following_error_rms_um=float(np.sqrt(np.mean(following_um**2))),
            samples=len(self._rows),
        )
