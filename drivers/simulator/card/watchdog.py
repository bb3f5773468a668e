"""The schedule of the background cycle, and the watchdog that shuts the controller down if it is late.

The controller is dead then: its motors are killed, and it neither reads nor sends, until it is power-cycled. A
background cycle that nothing slows down is never late, however little I40 allows.
"""

from __future__ import annotations

from drivers.pmac.families.family import Watchdog
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.card.plc_programs import INTERRUPT_PERIOD
from drivers.simulator.faults.lines import Lines


def most_cycles(watchdog: Watchdog, variables: VariableStore) -> int:
    """Return the maximum servo cycles between two background cycles. The count goes to 0, and trips below."""
    count = int(variables.i(watchdog.number)) if watchdog.number is not None else 0
    interrupt = int(variables.i(INTERRUPT_PERIOD)) + 1 if watchdog.of_interrupts else 1
    return (count or watchdog.count) * interrupt + interrupt - 1


class Background:
    """Called after each block of servo cycles. `cycle_ms` is the shortest time between two background cycles."""

    def __init__(self, controller: SimulatedController, lines: Lines) -> None:
        self._controller = controller
        self._lines = lines
        self._last = controller.cycles
        self._cycle_ms = 0.0
        self.tripped_s: float | None = None

    @property
    def tripped(self) -> bool:
        """Whether the watchdog has tripped; `tripped_s` is when."""
        return self._lines.dead

    def slow_down(self, cycle_ms: float) -> None:
        """Set the minimum time between background cycles; 0: as soon as possible."""
        self._cycle_ms = cycle_ms
        self._lines.slow = cycle_ms > 0.0

    def comes(self) -> bool:
        """Return whether a background cycle is due; the caller then runs it."""
        if self.tripped:
            return False
        controller = self._controller
        if controller.saving:
            self._last = controller.cycles  # SAVE keeps the watchdog content
            return False
        if self._cycle_ms:
            passed = controller.cycles - self._last
            if passed > most_cycles(controller.dialect.watchdog, controller.variables):
                self.trip()
                return False
            if passed * controller.servo_period_ms < self._cycle_ms:
                return False
        self._last = controller.cycles
        return True

    def trip(self) -> None:
        """Shut the controller down."""
        if self.tripped:
            return
        self.tripped_s = self._lines.now_s()
        self._lines.dead = self._controller.watchdog_tripped = True
        self._controller.kill_all()
        self._controller.plcs.disable_all()
        self._controller.gather.running = False

    def power_cycle(self) -> None:
        """Reset the controller, and restart. It reports a tripped watchdog until its next reset."""
        tripped = self.tripped
        self._controller.reset()
        self._controller.watchdog_tripped = tripped
        self._lines.dead, self.tripped_s = False, None
        self._last = self._controller.cycles
