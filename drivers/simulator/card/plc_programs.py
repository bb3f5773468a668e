"""The PLCs of the controller: their texts, which of them are enabled, and their scans."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.listing import StoredPlcLine
from drivers.pmac.language.plc_statements import link_plc
from drivers.pmac.plcs.plc import (
    FOREGROUND_PLC,
    PlcFault,
    PlcRun,
    PlcSwitches,
    background_order,
    foreground_runs,
)
from drivers.pmac.requests import DefaultAddress, ProgramHost
from drivers.pmac.variables import VariableStore

PERMISSION = 5  # I5: which PLCs may run
INTERRUPT_PERIOD = 8  # I8: servo cycles of a real-time interrupt, less one


class PlcPrograms:
    """The lines of the stored PLCs, `buffers` by number, and the state of the running ones.

    `faults` are the run-time errors that have disabled PLCs, until those are enabled again.
    """

    def __init__(self, variables: VariableStore, host: ProgramHost) -> None:
        self.buffers: dict[int, list[StoredPlcLine]] = {}
        self.switches = PlcSwitches()
        self.faults: dict[int, PlcFault] = {}
        self._variables = variables
        self._host = host
        self._runs: dict[int, PlcRun] = {}
        self._addressed: dict[int, DefaultAddress] = {}
        self._order: tuple[int, ...] = ()
        self._ordered = PlcSwitches(), 0.0

    @property
    def foreground(self) -> bool:
        """Whether real-time interrupts have anything to do: PLC 0 has text, is enabled, and I5 permits it."""
        enabled = self.switches.enabled
        return FOREGROUND_PLC in enabled and foreground_runs(self._variables.i(PERMISSION), enabled, self._runs)

    def cycles_to_interrupt(self, cycles: int) -> int:
        """Return how many servo cycles after the first `cycles` the next real-time interrupt is, from 1."""
        period = max(1, int(self._variables.i(INTERRUPT_PERIOD)) + 1)
        return period - cycles % period

    def forget(self, number: int) -> None:
        """Disable a PLC whose text is opened or deleted; its addressing stays for the next one of that number."""
        self.disable((number,))
        run = self._runs.pop(number, None)
        if run is not None:
            self._addressed[number] = run.addressed

    def enable(self, numbers: Sequence[int]) -> None:
        """Enable PLCs, all or none. One already enabled continues where it is, one without text does nothing.

        Raises PmacError: 009 or 016, one of them is not well formed.
        """
        new = [number for number in dict.fromkeys(numbers) if number not in self.switches.enabled]
        self._runs.update(
            [
                (number, self._run(number))
                for number in new
                if self.buffers.get(number) and number not in self._runs
            ]
        )
        for number in new:
            self.faults.pop(number, None)
        self.switches = self.switches.enable(new)

    def disable(self, numbers: Sequence[int]) -> None:
        """Disable PLCs."""
        self.switches = self.switches.disable(numbers)

    def disable_all(self) -> None:
        """Control-D."""
        self.switches = PlcSwitches()

    def power_up(self) -> None:
        """Restart: every stored PLC is enabled, except one that is not well formed."""
        self.switches = PlcSwitches()
        self.faults.clear()
        self._runs.clear()
        self._addressed.clear()
        sound = []
        for number, lines in self.buffers.items():
            with suppress(PmacError):
                if lines:
                    self._runs[number] = self._run(number)
                sound.append(number)
        self.switches = self.switches.enable(sound)

    def scan_foreground(self) -> None:
        """Run a scan of PLC 0 at a real-time interrupt."""
        if self.foreground:
            self._scan(FOREGROUND_PLC)

    def scan_background(self) -> None:
        """Run the scan of each of PLC 1 to 31 in this background cycle."""
        if not self.switches.enabled:
            return
        permission = self._variables.i(PERMISSION)
        switches, permitted = self._ordered
        if switches is not self.switches or permitted != permission:
            # The switches are another object whenever anything was enabled, disabled or stored.
            self._order = background_order(permission, self.switches.enabled, self._runs)
            self._ordered = self.switches, permission
        for number in self._order:
            # An earlier one of this cycle may have disabled it.
            if number in self.switches.enabled:
                self._scan(number)

    def _scan(self, number: int) -> None:
        run = self._runs[number]
        if number in self.switches.at_top:
            run.restart()
            # Before the scan: it may disable and enable itself, and then begins at its top again.
            self.switches = self.switches.begin_scan(number)
        fault = run.scan()
        if fault is not None:
            self.faults[number] = fault
            self.disable((number,))

    def _run(self, number: int) -> PlcRun:
        code = link_plc(tuple([line.statements for line in self.buffers[number]]))
        return PlcRun(code, self._variables, self._host, self._addressed.get(number))
