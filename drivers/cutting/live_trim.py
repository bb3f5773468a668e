"""The trim of a running cut: gain and phase of its compensation, within bounds that were judged before arming."""

from __future__ import annotations

import math
from dataclasses import replace

from drivers.controller import Controller
from drivers.cutting.bounds import UNTRIMMED, Trim
from drivers.cutting.planning import CutPlan
from drivers.cutting.program_reports import REPORT_TIMEOUT_S
from drivers.errors import ControllerError, LinkError, LinkTimeoutError
from drivers.lathe.commands import CommandPath
from drivers.lathe.polling import POLL_TIMEOUT_S
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.base import is_gone
from drivers.pmac.program_constants import find_assigned_variables
from drivers.pmac.program_text import ProgramText
from drivers.pmac.programs.pvt import (
    ANGLE_IN_PATH,
    GAIN,
    GAIN_IN_PATH,
    LOBE_ANGLE,
    MOST_GAIN_PERCENT,
    MOST_PHASE_DEG,
    ROUNDING,
    live_trim_line,
)
from profiles.axis.envelope import envelope_row
from profiles.compensations.path import LobedPath, scale_path
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

CHECKED_POLLS = 12  # a trim in the path is read back some three times a second, one that changes at every poll
BLENDING = 1.03  # a phase that is blended over a turn changes the frequency of the lobe, 5 degrees of 360 twice


def trim_bounds(plan: CutPlan, job: Job, machine: MachineProfile, high_percent: int) -> tuple[int, float]:
    """Return the trim that a cut allows either way, percent and degrees of spindle, also at its highest override.

    Every limit of the tool is judged at the trimmed amplitude: thrust, heat, current, encoder, voltage, following
    error, the speed of its programs, its travel; and that the tool stays in the part at every angle.
    """
    if not plan.strategy.traits.live_trim or plan.target.amplitude_um == 0.0:
        return 0, 0.0
    speed_rpm = job.spindle_speed_rpm * high_percent / 100.0
    gains = range(1, MOST_GAIN_PERCENT + 1)
    gain = next((each - 1 for each in gains if not _bears(plan, job, machine, each, speed_rpm)), MOST_GAIN_PERCENT)
    turned = _bears(plan, job, machine, 0, BLENDING * speed_rpm)
    return gain, MOST_PHASE_DEG if turned else 0.0


def _bears(plan: CutPlan, job: Job, machine: MachineProfile, gain_percent: int, speed_rpm: float) -> bool:
    factor, tool = 1.0 + gain_percent / 100.0, machine.tool
    amplitude_um = factor * plan.target.largest_um
    if 1000.0 * job.depth_of_cut_mm <= amplitude_um:
        return False
    limits = envelope_row(machine, amplitude_um, job.jaws).rpm
    variables = machine.controller.variables
    faster = factor * speed_rpm / job.spindle_speed_rpm
    if faster * plan.checked.peak_velocity[tool.motor] > variables[f"I{tool.motor}16"]:
        return False
    highest, end = plan.checked.highest[tool.motor], variables[f"I{tool.motor}13"]
    beyond = highest + (factor - 1.0) * commanded_amplitude(plan, machine)
    return speed_rpm <= min(limits.values()) and not (end and beyond > end)


def commanded_amplitude(plan: CutPlan, machine: MachineProfile) -> float:
    """Return how far the planned program commands the tool beyond its mean depth, counts."""
    return max(plan.checked.highest[machine.tool.motor] - plan.setup.surface - plan.setup.depth, 0.0)


def trimmed_path(path: LobedPath, trim: Trim) -> LobedPath:
    """Return a path with a trim: an axis is linear, so a factor of its command is one of its motion."""
    factor = 1.0 + trim.gain_percent / 100.0
    return scale_path(path, factor).turn_by(trim.phase_deg)


def has_trim(program: ProgramText) -> bool:
    """Whether the path of a program follows a trim."""
    return GAIN_IN_PATH in find_assigned_variables(program)


def trim_um(plan: CutPlan, trim: Trim, angle_deg: float, past_middle_mm: float = 0.0) -> float:
    """Return how much further in a trim has the tool at an angle and past the middle of the cut, um."""
    if trim == UNTRIMMED:
        return 0.0
    there = angle_deg, past_middle_mm
    return float(trimmed_path(plan.target, trim).at_um(*there) - plan.target.at_um(*there))


def subtract_trim(snapshot: Snapshot, plan: CutPlan, machine: MachineProfile, trim: Trim) -> Snapshot:
    """Return a poll as it would have been without the trim: what judges the path then judges the same one."""
    if trim == UNTRIMMED:
        return snapshot
    angle_deg = 360.0 * snapshot.spindle.position / machine.spindle.counts_per_rev
    past = (snapshot.carriage.position - plan.setup.carriage_middle) / machine.carriage.counts_per_mm
    counts = trim_um(plan, trim, angle_deg, past) / machine.tool.count_um
    tool = snapshot.tool
    return replace(snapshot, tool=replace(tool, position=tool.position - counts))


class LiveTrim:
    """The trim of one program: `asked`, and `applied`, which is what the controller reports to be in the path."""

    def __init__(
        self, client: Controller, sending: CommandPath, stop: StopPath, lobes: int = 1, *, running: bool = False
    ) -> None:
        """Take whether its program `running` has set the trim to none; before that it is of an earlier program."""
        self._running = running
        self.asked = self.applied = UNTRIMMED
        self.problem: Problem | None = None
        self._lobes, self._polls, self._used = lobes, 0, False
        self._client, self._sending, self._stop = client, sending, stop

    def ask(self, trim: Trim) -> None:
        """Ask the running program for a trim; sent again where unanswered, since it is the same value.

        Raises StoppedError: nothing was sent. RefusedError: another console controls the machine. LinkError: the
        link broke.
        """
        self._stop.check()
        self._sending.refuse_unless_owner()
        line = live_trim_line(trim.gain_percent, trim.phase_deg, self._lobes)
        self.asked, self._used = trim, True
        try:
            self._client.request(line, POLL_TIMEOUT_S)
        except LinkTimeoutError:
            self._client.request(line, POLL_TIMEOUT_S)

    def read(self) -> None:
        """Read back, between two polls, once a trim was asked for; a missing reply is left to the next round.

        Raises LinkError: the link is gone.
        """
        self._polls += 1
        if not self._used or (self.applied == self.asked and self._polls % CHECKED_POLLS):
            return
        try:
            found = self._client.numbers(GAIN, LOBE_ANGLE, GAIN_IN_PATH, ANGLE_IN_PATH, timeout_s=REPORT_TIMEOUT_S)
        except ControllerError:
            return
        except LinkError as error:
            if is_gone(error):
                raise
            return
        wanted, path = self._trim_of(*found[:2]), self._trim_of(*found[2:])
        self.applied = self.asked if _is_same_trim(path, self.asked, self._lobes) else path
        differs = not _is_same_trim(wanted, self.asked, self._lobes)
        self.problem = _differs(wanted, self.asked) if differs else None

    def astray(self) -> tuple[Problem, ...]:
        """Return the current trim if it is not on the way to the requested one, else None.

        Nothing is written. Raises LinkError: the link broke.
        """
        if not self._running:
            return ()
        path = self._trim_of(*self._client.numbers(GAIN_IN_PATH, ANGLE_IN_PATH, again=True))
        ways = (
            (path.gain_percent, self.applied.gain_percent, self.asked.gain_percent, 300.0 * ROUNDING),
            (path.phase_deg, self.applied.phase_deg, self.asked.phase_deg, 0.03 / self._lobes),
        )
        on_its_way = all(min(one, two) - near <= at <= max(one, two) + near for at, one, two, near in ways)
        return () if on_its_way else (_differs(path, self.asked),)

    def _trim_of(self, gain: float, angle_deg: float) -> Trim:
        return Trim(gain_percent=100.0 * (gain - 1.0), phase_deg=-angle_deg / self._lobes)


def _is_same_trim(one: Trim, other: Trim, lobes: int) -> bool:
    close = math.isclose(one.gain_percent, other.gain_percent, abs_tol=300.0 * ROUNDING)
    return close and math.isclose(lobes * one.phase_deg, lobes * other.phase_deg, abs_tol=0.03)


def _differs(found: Trim, asked: Trim) -> Problem:
    value, limit = (f"{each.gain_percent:+.1f} %, {each.phase_deg:+.2f} deg" for each in (found, asked))
    return Problem(code="cut.trim_differs", value=value, limit=limit)
