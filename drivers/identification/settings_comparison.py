"""Refuse a measurement during which a setting changed: compared when it begins, and at its end.

A response or a health test is kept with the settings that were read before it, and answers for these alone. A
fit cannot tell that another host has changed them: with other gains, held throughout, it is as smooth as before.
While a program runs, what shapes its path is read in turn as in a cut (`drivers.cutting.watch_table`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from drivers.commissioning.amounts import amount
from drivers.commissioning.fingerprint import Fingerprint, fingerprint_problems, ours
from drivers.commissioning.judged import same
from drivers.commissioning.reading import of_motors, read_configuration
from drivers.commissioning.setting_names import named
from drivers.errors import DriverError, RefusedError
from drivers.identification.result import Origin
from drivers.identification.rig import Rig
from drivers.pmac.program_constants import IN_THE_CUT
from drivers.pmac.settings import servo_cycle_ms
from profiles.problem import Problem

CHANGED = "measurement.changed"
SERVO_TIME = 10
GAINS = range(30, 40)  # Ix30 to Ix35, and the notch filter: what an origin has


class SettingsComparison:
    """The settings that arming compares, as they were when a measurement began, without programs and PLCs."""

    def __init__(self, rig: Rig, origin: Origin) -> None:
        """Read them. Raises RefusedError: `measurement.changed`, they are no longer those of `origin`."""
        self._rig = rig
        self._before = self._read()
        if problems := tuple(self._unlike(origin)):
            raise RefusedError(*problems)

    def refuse_changed(self) -> None:
        """Read them once more. Raises DriverError: `measurement.changed`; the link broke."""
        left_out = ours(self._rig.machine, self._rig.dialect)
        found = fingerprint_problems(self._before, self._read(), left_out)
        if found:
            raise DriverError(*(replace(problem, code=CHANGED) for problem in found))

    def _read(self) -> Fingerprint:
        rig, machine = self._rig, self._rig.machine
        motors = machine.tool.motor, machine.spindle.motor, machine.carriage.motor
        extent = replace(of_motors(rig.dialect, motors), plcs=(), tables=())
        read = read_configuration(rig.client, rig.dialect, extent)
        return Fingerprint(machine=machine, configuration=read, free="")

    def _unlike(self, origin: Origin) -> Iterator[Problem]:
        motor, now, dialect = self._rig.machine.tool.motor, self._before.configuration.standing, self._rig.dialect
        for index in (dialect.motor_index(motor, number) for number in GAINS):
            values, of = (now[index], origin.gains[f"I{index}"]), named(index, dialect)
            if not same(*values):
                value, limit = (amount(each, of, self._rig.machine) for each in values)
                yield Problem(code=CHANGED, key=f"I{index}", value=value, limit=limit)
        periods_ms = servo_cycle_ms(now[SERVO_TIME]), origin.servo_period_ms
        if periods_ms[0] != periods_ms[1]:
            value, limit = (f"{each:.7g} ms" for each in periods_ms)
            yield Problem(code=CHANGED, key=f"I{SERVO_TIME}", value=value, limit=limit)


def changes_in(error: DriverError) -> tuple[Problem, ...]:
    """Return the settings that changed while a program ran, in the words of a measurement; else nothing."""
    return tuple(replace(each, code=CHANGED) for each in error.problems if each.code == IN_THE_CUT)
