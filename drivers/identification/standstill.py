"""Detect a tool that does not respond: its encoder has failed, or it is jammed. Nothing else would detect it.

The swing is smaller than the following-error limit. So a frozen reading never trips it, while the loop drives
the tool away by the apparent error. Two values of each poll show it: the reading is frozen, and the command is
not.
"""

from __future__ import annotations

import math
from collections import deque

from drivers.errors import DriverError
from drivers.identification.request import clearance_mm
from drivers.identification.rig import Rig
from drivers.lathe.motion import CUT_POLL_S
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.master.time_base import COUNT_PARTS
from drivers.pmac.memory import WORD_BITS
from profiles.axis.servo_gains import gains_from_variables
from profiles.machine import MachineProfile
from profiles.problem import Problem

PROVING_POLLS, MOST_POLLS = 4, 6
STANDS_COUNTS = 2.0
MOVES_COUNTS_A_CYCLE = 0.5
COMMANDED_FRACTION, COMMANDED_COUNTS = 0.25, 12.0
"""Fraction of the amplitude, and minimum, by which the command must change before a reading counts as frozen."""

CONFIRMING_PERIODS = (0.25, 0.125)
"""Two polls half a period apart may see a swing, or a command, at the same position: these follow a fraction of
a period later. And they follow at once: a tool that is driven away keeps moving."""

LONGEST_WAIT_S = 0.02  # well within the watchdog timeout


def confirming_wait_s(periods: float, frequency_hz: float, background_s: float) -> float:
    """Return how long to wait for a poll that many periods later.

    A controller answers once per background cycle: whole periods are added until the poll sees another one. Where
    that would take too long it waits no whole period, for a wait that is cut short has lost its phase: a poll in
    the same cycle then proves nothing, and the next ones do.
    """
    more = max(0, math.ceil(background_s * frequency_hz - periods))
    whole_s = (periods + more) / frequency_hz
    return whole_s if whole_s <= LONGEST_WAIT_S else min(periods / frequency_hz, LONGEST_WAIT_S)


def detected_within_s(round_trip_s: float) -> float:
    """Return the time in which a frozen reading is detected over such a link.

    Two polls of the watch, two to confirm each, and one more, since an answer may be that of the poll before. The
    exception is a swing of which every poll sees the same phase, at a multiple of half the rate of the background.
    """
    pairs = PROVING_POLLS / 2
    return (pairs + 1) * CUT_POLL_S + pairs * LONGEST_WAIT_S + (PROVING_POLLS + 2) * round_trip_s


def pushed_mm(machine: MachineProfile, amplitude_um: float, round_trip_s: float) -> float:
    """Return how far the tool may have moved, mm, by the time a frozen reading is detected over such a link.

    The command swings about the frozen reading, by the amplitude at most: that is the mean error that drives
    the tool until the stop; then it coasts.
    """
    tool = machine.tool
    force_n = gains_from_variables(machine).at_rest.kp_v_per_m * tool.loop_gain_n_per_v * amplitude_um * 1e-6
    late_s = detected_within_s(round_trip_s)
    pushed_m = 0.5 * force_n / tool.moving_mass_kg * late_s**2
    if tool.damping_n_s_per_m > 0.0:
        settled_m_s = force_n / tool.damping_n_s_per_m
        pushed_m = min(pushed_m, settled_m_s * (late_s + tool.moving_mass_kg / tool.damping_n_s_per_m))
    return 1000.0 * pushed_m


def link_problems(rig: Rig, amplitude_um: float) -> tuple[Problem, ...]:
    """Return why a swing over the link at its last speed is refused: detected too late, the tool would collide."""
    value_mm = pushed_mm(rig.machine, amplitude_um, rig.lathe.round_trip_s)
    limit_mm = clearance_mm(rig.machine, amplitude_um)
    if value_mm < limit_mm:
        return ()
    value, limit = f"{value_mm:.1f} mm", f"< {limit_mm:.1f} mm"
    return (Problem(code="identify.link_slow", where=rig.where, key="amplitude", value=value, limit=limit),)


class Standstill:
    """Monitors the tool while it swings, and opens the loops when it does not respond."""

    def __init__(self, rig: Rig, frequency_hz: float, amplitude_um: float) -> None:
        self._rig, self._frequency_hz = rig, frequency_hz
        self._commanded_counts = max(
            COMMANDED_COUNTS, COMMANDED_FRACTION * amplitude_um / rig.machine.tool.count_um
        )
        self._polls: deque[tuple[float, float]] = deque(maxlen=MOST_POLLS)

    def see(self, snapshot: Snapshot) -> None:
        """Process a poll. Raises DriverError: `identify.no_motion`, every loop is open then; or the link broke."""
        tool = snapshot.tool
        self._polls.append((tool.position, tool.position + tool.following_error))
        if len(self._polls) > 1 and abs(self._polls[-1][0] - self._polls[-2][0]) > STANDS_COUNTS:
            return
        fastest = 0.0
        background_s = 1e-3 * self._rig.machine.controller.background_ms
        for periods in CONFIRMING_PERIODS:
            self._rig.clock.wait(confirming_wait_s(periods, self._frequency_hz, background_s))
            fastest = max(fastest, abs(self._confirm_velocity()))
        if self._stands() and fastest < MOVES_COUNTS_A_CYCLE:
            self._rig.lathe.stop.kill("identify.no_motion")
            value = f"{self._polls[-1][0]:.1f} counts"
            raise DriverError(Problem(code="identify.no_motion", key="tool", where=self._rig.where, value=value))

    def _confirm_velocity(self) -> float:
        """Poll the tool alone, and return its velocity in that servo cycle, counts.

        Where a background cycle is half a period, every poll sees the same; and an answer of the same cycle as the
        one before proves nothing anew.
        """
        motor, dialect = self._rig.machine.tool.motor, self._rig.dialect
        register = dialect.registers["velocity"]
        address = register.address + (motor - 1) * register.stride
        items = (f"#{motor}P", "F", f"R{register.space}${address:X}")
        position, error, word = self._rig.client.numbers(*items, again=True)
        if (poll := (position, position + error)) != self._polls[-1]:
            self._polls.append(poll)
        signed = word - (1 << WORD_BITS) if word >= 1 << (WORD_BITS - 1) else word
        return signed / (self._rig.machine.controller.variables[f"I{motor}09"] * COUNT_PARTS)

    def _stands(self) -> bool:
        """Whether the reading was frozen over the last polls, however many, while the command changed."""
        for count in range(PROVING_POLLS, len(self._polls) + 1):
            readings, commands = zip(*list(self._polls)[-count:], strict=True)
            if max(readings) - min(readings) > STANDS_COUNTS:
                return False
            if max(commands) - min(commands) >= self._commanded_counts:
                return True
        return False
