"""Check from the polls that tool and carriage kept to one path from the first turn of a cut to its last.

A change that another host makes and reverts at once does not show when the constants are read, but it is in the
part. Since a cut repeats turn by turn, such a moment stands out from the rest, however the machine follows the
path. A change that lasts for less than the interval of two polls remains undetected.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.cutting.plan import CutPlan
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.programs.cam_trim import MOST_TRIM_UM
from profiles.least_squares import fit, harmonic_columns, harmonic_slice
from profiles.machine import MachineProfile
from profiles.problem import Problem

LEAST_TOOL_UM = 4.0  # deviations below this do not stand out in any real cut
LEAST_CARRIAGE_MM = 0.02
LEAST_SPINDLE_S = 0.1  # in time of the host; a delayed host, or a delayed simulated controller, loses some of it
MOST_OF_LOBE = 0.5  # fraction of the lobe by which a following tool may deviate: half as large, or 29 degrees late
TIMES_USUAL = 12.0  # times the median deviation: stands out even where tool and spindle are read separately
LATE = 1.5  # a poll that took this many times the usual was interrupted: its values are not of one instant
LEAST_POLLS = 16
POLLS_A_TERM = 6
ENTRY_TURNS = (
    3.0,
    12.0,
)  # over which a tool yields that has just met the part: its guides give way, its loop follows
SETTLED_TURNS = 3.0  # in air, from the start of feed: a tool held by dry friction has not reached its path before
LAST_TURN = 0.15  # fraction of the last turn that is left out: after it the tool retracts
SWEEPS = 20

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class CutBefore:
    """How far a blank was cut before: to Z `to_mm` behind its face as last seen, and at most `unseen_mm` on."""

    to_mm: float
    unseen_mm: float


class PathSeen:
    """The polls of one cut, from the start of feed to the tool's retract.

    On a blank that was `before` cut in part, the tool meets the uncut surface where that cut had ended: there its
    path changes as at the face, so both stretches are judged, each by itself.
    """

    def __init__(self, plan: CutPlan, machine: MachineProfile, before: CutBefore | None = None) -> None:
        self._plan, self._machine = plan, machine
        setup = plan.setup
        # Clear of the part nothing deflects the tool: its path differs there, and the first turn is on neither.
        land = machine.tool.wiper_land_mm * machine.carriage.counts_per_mm
        self._clear = setup.carriage_face - 0.5 * land
        self._first = plan.carriage_start + setup.carriage_per_turn
        self._settled = plan.carriage_start + SETTLED_TURNS * setup.carriage_per_turn
        self._in_part = self._clear + setup.carriage_per_turn
        self._recut_end = self._uncut = -math.inf
        if before is not None:
            mark = setup.carriage_face + before.to_mm * machine.carriage.counts_per_mm
            unseen = before.unseen_mm * machine.carriage.counts_per_mm
            self._recut_end = mark - 0.5 * land
            self._uncut = mark + unseen + setup.carriage_per_turn
        self._last = plan.carriage_start + (setup.whole_turns - LAST_TURN) * setup.carriage_per_turn
        self._rows: list[tuple[float, float, float, float, float]] = []
        self._over = False

    def see(self, snapshot: Snapshot) -> None:
        """Process a poll of the cut."""
        at = snapshot.carriage.commanded
        self._over = self._over or at > self._last
        if self._over or at <= self._first or not snapshot.program_running:
            return
        tool, spindle, carriage = snapshot.tool, snapshot.spindle, snapshot.carriage
        took_s = snapshot.at_s - snapshot.asked_s
        middle_s = 0.5 * (snapshot.asked_s + snapshot.at_s)
        self._rows.append((took_s, tool.position, spindle.position, carriage.position, middle_s))

    def problems(self) -> Iterator[Problem]:
        """Report where tool or carriage left the path that they otherwise kept to."""
        rows = np.array(self._rows).reshape(-1, 5)
        if len(rows):
            rows = rows[rows[:, 0] <= LATE * np.median(rows[:, 0]) + 0.001]
        if len(rows) < LEAST_POLLS or self._plan.in_air:  # what is learned in air is not called a part
            return
        turns = rows[:, 2] / self._machine.spindle.counts_per_rev
        yield from self._carriage(turns, rows[:, 3])
        if not self._machine.spindle.followed:
            yield from self._spindle(turns, rows[:, 4])
        at = rows[:, 3]
        clear, in_part = (at > self._settled) & (at < self._clear), at > self._in_part
        recut, uncut = in_part & (at < self._recut_end), in_part & (at > self._uncut)
        # Only a cut that follows the lobe has reached its path when the feed begins.
        for among in (clear, recut, uncut) if self._plan.strategy.traits.inverts else (recut, uncut):
            if among.sum() >= LEAST_POLLS:
                entry = () if among is clear else ENTRY_TURNS
                yield from self._tool(rows[among, 1], turns[among], at[among], entry)

    def _tool(self, tool: Floats, turns: Floats, carriage: Floats, entry: tuple[float, ...]) -> Iterator[Problem]:
        """Model the tool path of a turn: the lobe, which may grow along the cut, and what a blank makes of it.

        An `entry` into the part decays over so many turns.
        """
        plan, target = self._plan, self._plan.target
        past_mm = (carriage - plan.setup.carriage_middle) / self._machine.carriage.counts_per_mm
        infeed_um = (tool - plan.setup.surface) * self._machine.tool.count_um
        off_um = infeed_um - target.at_um(360.0 * turns, past_mm)
        angle_rad, lobes = 2.0 * np.pi * turns, target.lobes
        further = [order for order in dict.fromkeys((2 * lobes, 3 * lobes, 1, 2)) if order != lobes]
        decays = [np.exp((turns[0] - turns) / over) for over in entry]
        # In the order in which they are given up where there are few polls.
        columns = np.column_stack(
            [
                harmonic_columns(angle_rad, (lobes,), past_mm),
                *decays,
                harmonic_columns(angle_rad, further)[:, 1:],
            ]
        )
        left, found = _left(off_um, columns[:, : max(4, len(turns) // POLLS_A_TERM)])
        left_um, lobe_um = np.abs(left), float(np.hypot(*found[harmonic_slice(0, trends=1)]))
        most_um = MOST_OF_LOBE * target.amplitude_um + LEAST_TOOL_UM
        if plan.strategy.traits.inverts and lobe_um > most_um:
            yield from _off_path(AxisName.TOOL, lobe_um, most_um, "{:.1f} um")
            return
        # A trim within the cut goes from none to at most its largest amplitude, and may reverse.
        trim_um = 2.0 * MOST_TRIM_UM if plan.trimmed else 0.0
        limit_um = max(LEAST_TOOL_UM, TIMES_USUAL * float(np.median(left_um))) + trim_um
        yield from _off_path(AxisName.TOOL, left_um.max(), limit_um, "{:.1f} um")

    def _carriage(self, turns: Floats, carriage: Floats) -> Iterator[Problem]:
        """Model the carriage: feed in proportion to turns; an external spindle may turn slower or faster."""
        per_mm = self._machine.carriage.counts_per_mm
        off_mm = (carriage - turns * self._plan.setup.carriage_per_turn) / per_mm
        trends = [turns - turns[0]] if self._machine.spindle.followed else []
        left_mm = np.abs(_left(off_mm, harmonic_columns(turns, (), *trends))[0])
        limit_mm = max(LEAST_CARRIAGE_MM, TIMES_USUAL * float(np.median(left_mm)))
        yield from _off_path(AxisName.CARRIAGE, left_mm.max(), limit_mm, "{:.3f} mm")

    def _spindle(self, turns: Floats, at_s: Floats) -> Iterator[Problem]:
        """Model the spindle: constant speed, unless the program was held or continued elsewhere.

        The time is that of the host: a computer that stands still looks like a spindle that does.
        """
        off, (_, slope) = _left(turns, harmonic_columns(turns, (), at_s - at_s[0]))
        left, turns_a_second = np.abs(off), abs(float(slope))
        limit = max(LEAST_SPINDLE_S * turns_a_second, TIMES_USUAL * float(np.median(left)))
        if left.max() > limit:
            yield Problem(code="cut.off_time", value=f"{left.max():.2f} rev", limit=f"{limit:.2f} rev")


def _off_path(axis: AxisName, value: float, limit: float, form: str) -> Iterator[Problem]:
    if value > limit:
        yield Problem(code="cut.off_path", key=axis, value=form.format(value), limit=form.format(limit))


def _left(values: Floats, columns: Floats) -> tuple[Floats, Floats]:
    """Return residuals and coefficients of a fit that is robust against a few outliers."""
    found = fit(columns, values)
    for _ in range(SWEEPS - 1):
        found = fit(columns, values, 1.0 / np.sqrt(np.maximum(np.abs(found.residuals), 1e-3)))
    return found.residuals, found.coefficients
