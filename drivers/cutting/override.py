"""The override of a running cut: spindle, tool and feed together, by the time base of their coordinate system.

All three are axes of one program, so that a slower time leaves the path by the angle of the spindle as it is. The
lobe then has another frequency than the one at which the servo was inverted: how far the tool follows it otherwise
bounds the override, beside everything that bounds the speed of the job. Both ends are computed before the cut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from drivers.controller import Controller
from drivers.cutting.bounds import REAL_TIME, UNCHANGEABLE, Bounds
from drivers.cutting.live_trim import trim_bounds
from drivers.cutting.planning import CutPlan
from drivers.errors import LinkTimeoutError
from drivers.lathe.commands import CommandPath
from drivers.lathe.guards import OVERRIDE_BAND_PERCENT
from drivers.lathe.polling import POLL_TIMEOUT_S
from drivers.lathe.snapshot import REAL_TIME_PERCENT, Snapshot
from drivers.lathe.stop import StopPath
from drivers.pmac.programs.setup import SERVO
from profiles.axis.envelope import highest_safe_speed
from profiles.axis.response import ServoResponse
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProfileError

LEAST_PERCENT, MOST_PERCENT = 80, 120
"""The widest band: at the lower end a program takes 1.25 times its time, and its timeout is 1.5 times that."""

MOST_LEFT = 0.5  # fraction of the roundness tolerance that the inverse for another speed may leave

ARRIVES_S = 2.0  # a time base slews by 100 % a second by default; one that has not arrived by then is not ours


def bounds_of(plan: CutPlan, job: Job, machine: MachineProfile, response: ServoResponse) -> Bounds:
    """Return what a cut allows to be changed while it runs; `response` is the one that it inverts.

    No override where the spindle is no axis of the program: then it keeps its speed, or is the clock itself. Nor
    where the host corrects the cut while it runs, by samples that are timed by the speed of the job.
    """
    if plan.clock is not None or machine.spindle.drive != SERVO or plan.trimmed:
        gain, phase_deg = trim_bounds(plan, job, machine, REAL_TIME)
        return replace(UNCHANGEABLE, gain_percent=gain, phase_deg=phase_deg)
    rpm, _ = highest_safe_speed(job, machine, response)

    def limited_by(percent: int) -> str:
        return next(_limits(percent / REAL_TIME, plan, job, machine, response, rpm), "")

    low, low_by = _last(limited_by, range(REAL_TIME - 1, LEAST_PERCENT - 1, -1))
    high, high_by = _last(limited_by, range(REAL_TIME + 1, MOST_PERCENT + 1))
    gain, phase_deg = trim_bounds(plan, job, machine, high)
    return Bounds(
        low_percent=low, high_percent=high, low_by=low_by, high_by=high_by, gain_percent=gain, phase_deg=phase_deg
    )


def _last(limited_by: Callable[[int], str], steps: range) -> tuple[int, str]:
    """Return the last percentage on the way that nothing limits, and what limits the next one."""
    last = REAL_TIME
    for percent in steps:
        if name := limited_by(percent):
            return last, name
        last = percent
    return last, "widest"


def _limits(
    factor: float, plan: CutPlan, job: Job, machine: MachineProfile, response: ServoResponse, rpm: dict[str, float]
) -> Iterator[str]:
    """Name what does not allow this factor of the speed."""
    if factor > 1.0:
        yield from (name for name, limit in rpm.items() if factor * job.spindle_speed_rpm > limit)
        variables = machine.controller.variables
        if any(factor * peak > variables[f"I{motor}16"] for motor, peak in plan.checked.peak_velocity.items()):
            yield "program_speed"
    if plan.strategy.traits.inverts:
        try:
            left_um = inverse_left_um(plan, job, response, factor)
        except ProfileError:  # nobody has measured there
            yield "response"
            return
        if left_um > MOST_LEFT * job.roundness_tolerance_um:
            yield "inverse"


def inverse_left_um(plan: CutPlan, job: Job, response: ServoResponse, factor: float) -> float:
    """Return what the inverse for the speed of the job leaves at this factor of it, um peak to peak.

    A command C = R / T(f) makes T(kf) C of it: off by |T(kf) / T(f) - 1| of each harmonic. Raises ProfileError:
    a frequency at which the response is not known.
    """
    turns_hz = job.spindle_speed_rpm / 60.0
    return sum(
        2.0
        * wave.amplitude_um
        * abs(
            response.response_at(factor * wave.lobes * turns_hz) / response.response_at(wave.lobes * turns_hz)
            - 1.0
        )
        for wave in plan.target.harmonics
        if wave.amplitude_um
    )


class FeedOverride:
    """The override of one program: the commanded value, and the values that a poll may show until then."""

    def __init__(self, client: Controller, sending: CommandPath, stop: StopPath) -> None:
        self.commanded = REAL_TIME
        self._from = float(REAL_TIME)
        self._until_s: float | None = None
        self._last: Snapshot | None = None
        self._client, self._sending, self._stop = client, sending, stop

    def command(self, percent: int) -> None:
        """Set the override of the running program; sent again where unanswered, since it is the same value.

        Raises StoppedError: nothing was sent. RefusedError: another console controls the machine. LinkError: the
        link broke; what the controller does of it is shown by the polls.
        """
        self._stop.check()
        self._sending.refuse_unless_owner()
        self._from = float(self.commanded) if self._last is None else self._last.override_percent
        self.commanded = percent
        self._until_s = None if self._last is None else self._last.at_s + ARRIVES_S
        self._send()

    def restore(self) -> None:
        """Return to real time, at rest, where this console has left it. Raises LinkError: the link broke."""
        if self.commanded != REAL_TIME:
            self.commanded = REAL_TIME
            self._send()

    def expected_range(self, snapshot: Snapshot) -> tuple[float, float]:
        """Take a poll; return the permitted range of its override, percent: on the way to the commanded value."""
        self._last = snapshot
        goal = float(self.commanded)
        arrived = abs(snapshot.override_percent - goal) <= OVERRIDE_BAND_PERCENT
        if arrived or self._until_s is None or snapshot.at_s > self._until_s:
            self._from, self._until_s = goal, None
        return min(self._from, goal), max(self._from, goal)

    def _send(self) -> None:
        line = f"&1%{self.commanded}"
        try:
            self._client.request(line, POLL_TIMEOUT_S)
        except LinkTimeoutError:
            self._client.request(line, POLL_TIMEOUT_S)


class PaceLedger:
    """The polls of a cut by the time of its program, as if the override had been 100 % throughout.

    What judges a cut by its time then judges the same cut. `mean` is the mean override in the part, 1 for 100 %.
    """

    def __init__(self, face_counts: float) -> None:
        """`face_counts` is the position of the carriage from which on it is at the part."""
        self._face = face_counts
        self._shift_s = self._lost_s = self._passed_s = 0.0
        self._before: Snapshot | None = None

    @property
    def mean(self) -> float:
        """Time of the program by the time that has passed."""
        return 1.0 - self._lost_s / self._passed_s if self._passed_s else 1.0

    def see(self, snapshot: Snapshot) -> Snapshot:
        """Return a poll at the time of the program."""
        before, self._before = self._before, snapshot
        if before is not None:
            passed_s = snapshot.at_s - before.at_s
            percent = 0.5 * (snapshot.override_percent + before.override_percent)
            lost_s = passed_s * (1.0 - percent / REAL_TIME_PERCENT)
            self._shift_s += lost_s
            if snapshot.carriage.position >= self._face:
                self._passed_s += passed_s
                self._lost_s += lost_s
        if not self._shift_s:
            return snapshot
        return replace(snapshot, asked_s=snapshot.asked_s - self._shift_s, at_s=snapshot.at_s - self._shift_s)
