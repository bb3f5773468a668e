"""Check from the polls that tool and carriage kept to one path from the first turn of a cut to its last.

A change that another host makes and reverts at once does not show when the constants are read, but it is in the
part. Since a cut repeats turn by turn, such a moment stands out from the rest, however the machine follows the
path. A change that lasts for less than the interval of two polls remains undetected.

A poll has the following error, too: it shows whether the command left the path, or whether the axis did not follow
a command that kept to it. The first is somebody's deed; the second is most likely the axis itself. The command
is in the plan: none of its mean is given away. How far the tool lags behind it is compared with the other turns.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.cutting.planning import CutPlan
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.programs.cam_trim import MOST_TRIM_UM
from drivers.pmac.programs.push import blend_turns
from profiles.least_squares import fit, harmonic_columns, harmonic_slice
from profiles.machine import MachineProfile
from profiles.problem import Problem

LEAST_TOOL_UM = 4.0  # deviations below this do not stand out in any real cut
LEAST_CARRIAGE_MM = 0.02
LEAST_SPINDLE_S = 0.1  # in time of the host; a delayed host, or a delayed simulated controller, loses some of it
MOST_OF_LOBE = 0.5  # fraction of the lobe by which a following tool may deviate: half as large, or 29 degrees late
STUCK_UM, LEAST_STUCK_UM = 5.0, 1.0
"""Amplitude up to which dry friction holds a tool altogether; above that it takes as much of any lobe. Assumed. A
path on which the amplitude becomes as small as that changes its error along the cut with it, and its mean: a tool
at rest keeps the place where it was."""

TIMES_USUAL = 12.0  # times the median deviation: stands out even where tool and spindle are read separately
MOST_OF_LAG = 0.5  # fraction of a deviation up to which the command had no part in it, and the axis lagged
MOMENTS = ("cut.off_path", "cut.lagged")
LATE = 1.5  # a poll that took this many times the usual was interrupted: its values are not of one instant
LEAST_POLLS = 16
POLLS_A_TERM = 6
OF_MEAN = 2  # columns of mean and course along the cut, before those of the lobe
ENTRY_TURNS = (1.0, 3.0, 12.0)
"""Over which a tool yields that has just met the part: its loop takes the force up, its guides give way, and its
loop follows."""

STRETCH_TURNS = 200.0  # judged apart: what force and dry friction make of a path changes slowly along a long cut
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
        # A path that makes up for the push of the cut does so within some turns more.
        blended = blend_turns(setup) if plan.command.push_um else 0.0
        self._in_part = self._clear + (1.0 + blended) * setup.carriage_per_turn
        self._recut_end = self._uncut = -math.inf
        if before is not None:
            mark = setup.carriage_face + before.to_mm * machine.carriage.counts_per_mm
            unseen = before.unseen_mm * machine.carriage.counts_per_mm
            self._recut_end = mark - 0.5 * land
            self._uncut = mark + unseen + setup.carriage_per_turn
        self._last = plan.carriage_start + (setup.whole_turns - LAST_TURN) * setup.carriage_per_turn
        self._rows: list[tuple[float, ...]] = []
        self._over = False

    def see(self, snapshot: Snapshot) -> None:
        """Process a poll of the cut."""
        at = snapshot.carriage.commanded_position
        self._over = self._over or at > self._last
        if self._over or at <= self._first or not snapshot.program_running:
            return
        tool, spindle, carriage = snapshot.tool, snapshot.spindle, snapshot.carriage
        took_s = snapshot.at_s - snapshot.asked_s
        middle_s = 0.5 * (snapshot.asked_s + snapshot.at_s)
        at_places = (tool.position, spindle.position, carriage.position, middle_s)
        self._rows.append((took_s, *at_places, tool.commanded_position, carriage.commanded_position))

    def problems(self, held_s: float = 0.0) -> Iterator[Problem]:
        """Report where tool or carriage left the path that they otherwise kept to.

        `held_s` is for how long a simulated lathe held its time in the cut: nobody is accused of that.
        """
        rows = np.array(self._rows).reshape(-1, 7)
        if len(rows):
            rows = rows[rows[:, 0] <= LATE * np.median(rows[:, 0]) + 0.001]
        if len(rows) < LEAST_POLLS or self._plan.in_air:  # what is learned in air is not called a part
            return
        turns = rows[:, 2] / self._machine.spindle.counts_per_rev
        yield from self._carriage(turns, rows[:, 3], rows[:, 6])
        if not self._machine.spindle.followed:
            yield from self._spindle(turns, rows[:, 4], held_s)
        at = rows[:, 3]
        clear, in_part = (at > self._settled) & (at < self._clear), at > self._in_part
        recut, uncut = in_part & (at < self._recut_end), in_part & (at > self._uncut)
        # Only a cut that follows the lobe has reached its path when the feed begins.
        told: dict[str, Problem] = {}  # what is off in every turn in air and in the part is told of the part
        for among in (clear, recut, uncut) if self._plan.strategy.traits.inverts else (recut, uncut):
            entry = () if among is clear else ENTRY_TURNS
            for stretch in self._stretches(among, turns):
                for problem in self._tool(rows[stretch][:, (1, 5)], turns[stretch], at[stretch], entry):
                    told[f"{problem.code} {problem.where if problem.code in MOMENTS else ''}"] = problem
                entry = ()
        yield from told.values()

    @staticmethod
    def _stretches(among: NDArray[np.bool_], turns: Floats) -> list[NDArray[np.intp]]:
        """Return the polls among all that are judged together, as far as there are enough of them."""
        polls = np.flatnonzero(among)
        length = float(np.ptp(turns[polls])) if polls.size else 0.0
        parts = np.array_split(polls, max(math.ceil(length / STRETCH_TURNS), 1))
        return [each for each in parts if each.size >= LEAST_POLLS]

    def _tool(self, tool: Floats, turns: Floats, carriage: Floats, entry: tuple[float, ...]) -> Iterator[Problem]:
        """Judge positions and commands of the `tool`, shape (M, 2), of a stretch of the cut."""
        plan, target, lobes = self._plan, self._plan.target, self._plan.target.lobes
        past_mm = (carriage - plan.setup.carriage_middle) / self._machine.carriage.counts_per_mm
        infeed_um = (tool - plan.setup.surface) * self._machine.tool.count_um
        off_um = infeed_um[:, 0] - target.at_um(360.0 * turns, past_mm)
        command_off_um = infeed_um[:, 1] - plan.command.at_um(360.0 * turns, past_mm)
        smooth = _columns(turns, past_mm, lobes, entry)
        stuck = _stuck(turns, target.amplitude_um * target.along.factor(lobes, past_mm), lobes)
        columns = np.column_stack([smooth, *stuck])
        known = plan.strategy.traits.inverts and not plan.command.push_um
        command_columns = _columns(turns, past_mm, lobes, ()) if known else columns
        left, found = _robust_residuals(off_um, columns)
        if stuck:  # the lobe is the sum of two that are nearly alike: how large it is tells the fit without them
            _, found = _robust_residuals(off_um, smooth)
        command_left, command_found = _robust_residuals(command_off_um, command_columns)
        if known:
            command_left += command_columns[:, :OF_MEAN] @ command_found[:OF_MEAN]
            off_plan_um = abs(float(np.median(command_left)))
            if off_plan_um > LEAST_TOOL_UM:
                value, limit = f"{off_plan_um:.1f} um", f"{LEAST_TOOL_UM:g} um"
                yield Problem(code="cut.command_off_plan", key=AxisName.TOOL, where="Ø", value=value, limit=limit)
                return
            left = command_left + _robust_residuals(off_um - command_left, columns)[0]
        of_lobe = harmonic_slice(0, trends=1)
        lobe_um, command_um = (float(np.hypot(*each[of_lobe])) for each in (found, command_found))
        most_um = MOST_OF_LOBE * target.amplitude_um + LEAST_TOOL_UM
        if plan.strategy.traits.inverts and lobe_um > most_um:
            first_mm, last_mm = (self._behind_face_mm(at) for at in (carriage.min(), carriage.max()))
            code = "cut.lobe_lagged" if command_um <= MOST_OF_LAG * lobe_um else "cut.lobe_off_path"
            value, limit = (f"{um:.1f} um" for um in (lobe_um, most_um))
            where = f"{first_mm:.1f} … {last_mm:.1f} mm"
            yield Problem(code=code, where=where, key=AxisName.TOOL, value=value, limit=limit)
            return
        # A trim within the cut goes from none to at most its largest amplitude, and may reverse.
        trim_um = 2.0 * MOST_TRIM_UM if plan.trimmed else 0.0
        limit_um = max(LEAST_TOOL_UM, TIMES_USUAL * float(np.median(np.abs(left)))) + trim_um
        yield from self._off_path(AxisName.TOOL, left, command_left, limit_um, carriage, "{:.1f} um")

    def _carriage(self, turns: Floats, carriage: Floats, commanded: Floats) -> Iterator[Problem]:
        """Model the carriage: feed in proportion to turns; an external spindle may turn slower or faster."""
        per_mm, feed = self._machine.carriage.counts_per_mm, turns * self._plan.setup.carriage_per_turn
        trends = [turns - turns[0]] if self._machine.spindle.followed else []
        columns = harmonic_columns(turns, (), *trends)
        left, command_left = (
            _robust_residuals((places - feed) / per_mm, columns)[0] for places in (carriage, commanded)
        )
        limit_mm = max(LEAST_CARRIAGE_MM, TIMES_USUAL * float(np.median(np.abs(left))))
        yield from self._off_path(AxisName.CARRIAGE, left, command_left, limit_mm, carriage, "{:.3f} mm")

    def _off_path(
        self, axis: AxisName, left: Floats, command_left: Floats, limit: float, carriage: Floats, form: str
    ) -> Iterator[Problem]:
        """Report the moment in which an axis was furthest off the path of the other turns; its command, too?"""
        worst = int(np.abs(left).argmax())
        off = abs(float(left[worst]))
        if off <= limit:
            return
        lagged = abs(float(command_left[worst])) <= MOST_OF_LAG * off
        yield Problem(
            code="cut.lagged" if lagged else "cut.off_path",
            where=f"{self._behind_face_mm(carriage[worst]):.1f} mm",
            key=axis,
            value=form.format(off),
            limit=form.format(limit),
        )

    def _behind_face_mm(self, carriage: float) -> float:
        """Return a carriage position as Z past the face of the part, negative before it."""
        return float(carriage - self._plan.setup.carriage_face) / self._machine.carriage.counts_per_mm

    def _spindle(self, turns: Floats, at_s: Floats, held_s: float) -> Iterator[Problem]:
        """Model the spindle: constant speed, unless the program was held or continued elsewhere.

        The time is that of the host: a computer that stands still looks like a spindle that does. It is named
        first where polls came late.
        """
        off, (_, slope) = _robust_residuals(turns, harmonic_columns(turns, (), at_s - at_s[0]))
        left, turns_a_second = np.abs(off), abs(float(slope))
        limit = max(LEAST_SPINDLE_S * turns_a_second, TIMES_USUAL * float(np.median(left)))
        if left.max() <= limit + held_s * turns_a_second:
            return
        apart_s = np.diff(at_s)
        late_s = float(apart_s.max() - np.median(apart_s))
        late, code = ("", "cut.off_time") if late_s <= LEAST_SPINDLE_S else (f"{late_s:.1f} s", "cut.polls_late")
        yield Problem(code=code, key=late, value=f"{left.max():.2f} rev", limit=f"{limit:.2f} rev")


def _columns(turns: Floats, past_mm: Floats, lobes: int, entry: tuple[float, ...]) -> Floats:
    """Model the tool path of a turn: the lobe, which may grow along the cut, and what a blank makes of it.

    An `entry` into the part decays over so many turns.
    """
    angle_rad = 2.0 * np.pi * turns
    further = [order for order in dict.fromkeys((1, 2, 2 * lobes, 3 * lobes)) if order != lobes]
    decays = [np.exp((turns[0] - turns) / over) for over in entry]
    # Where there are few polls, the last are given up: what an eccentric or oval blank leaves is the larger.
    columns = np.column_stack(
        [harmonic_columns(angle_rad, (lobes,), past_mm), *decays, harmonic_columns(angle_rad, further)[:, 1:]]
    )
    return columns[:, : max(4, len(turns) // POLLS_A_TERM)]


def _stuck(turns: Floats, amplitude_um: Floats, lobes: int) -> list[Floats]:
    """Model what dry friction makes of a lobe of such amplitudes, where they become small along the cut."""
    stuck_um = np.clip(amplitude_um, -STUCK_UM, STUCK_UM)
    if np.abs(stuck_um).min() > LEAST_STUCK_UM or np.ptp(stuck_um) <= LEAST_STUCK_UM:
        return []
    angle_rad = 2.0 * np.pi * lobes * turns
    return [stuck_um * np.cos(angle_rad), stuck_um * np.sin(angle_rad), 1.0 - np.abs(stuck_um) / STUCK_UM]


def _robust_residuals(values: Floats, columns: Floats) -> tuple[Floats, Floats]:
    """Return residuals and coefficients of a fit that is robust against a few outliers."""
    found = fit(columns, values)
    for _ in range(SWEEPS - 1):
        found = fit(columns, values, 1.0 / np.sqrt(np.maximum(np.abs(found.residuals), 1e-3)))
    return found.residuals, found.coefficients
