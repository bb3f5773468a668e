"""Refuse a measurement during which a setting changes: compared when it begins, every few polls, and at its end.

A response or a health test is kept with the settings that were read before it, and answers for these alone. A
fit cannot tell that another host has changed them: with other gains, held throughout, it is as smooth as before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import cycle, islice

from drivers.commissioning.amounts import amount
from drivers.commissioning.judged import same
from drivers.commissioning.reading import read_ranges
from drivers.commissioning.setting_names import named
from drivers.errors import DriverError, RefusedError
from drivers.identification.result import Origin
from drivers.identification.rig import Rig
from drivers.lathe.polling import POLLS_A_READING, SLOW_LINE_S
from drivers.pmac.settings import servo_cycle_ms
from profiles.problem import Problem

MOTOR_SETTINGS = range(3, 10), range(29, 40), range(60, 70)
"""Ix03 to Ix09: encoder, scales; Ix29 to Ix39: offset, gains, notch filter; Ix60 to Ix69: servo period, limits."""

TIME_BASE = range(93, 95)  # of the coordinate system: source and slew
SERVO_TIME = "I10"
SETTINGS_A_READING = 16  # all of them within 0.5 s; over a slow line one, since the watchdog comes first

Values = Mapping[str, float | str]


class SettingsWatch:
    """The settings that shape a measurement, as they were when it began."""

    def __init__(self, rig: Rig, origin: Origin) -> None:
        """Read them. Raises RefusedError: `measurement.changed`, they are no longer those of `origin`."""
        self._rig = rig
        self._before = self._read()
        self._turn = cycle([name for name in self._before if name.isalnum()])
        self._polls_made = 0
        if problems := tuple(self._differing(origin.gains, {name: self._before[name] for name in origin.gains})):
            raise RefusedError(*problems)
        period_ms = servo_cycle_ms(float(self._before[SERVO_TIME]))
        if period_ms != origin.servo_period_ms:
            value, limit = f"{period_ms:.7g} ms", f"{origin.servo_period_ms:.7g} ms"
            raise RefusedError(Problem(code="measurement.changed", key=SERVO_TIME, value=value, limit=limit))

    def see(self) -> None:
        """Read the next ones after every few polls. Raises DriverError: `measurement.changed`; the link broke."""
        self._polls_made += 1
        if self._polls_made % POLLS_A_READING:
            return
        fast = self._rig.lathe.round_trip_s < SLOW_LINE_S
        names = tuple(islice(self._turn, SETTINGS_A_READING if fast else 1))
        self._refuse(dict(zip(names, self._rig.client.numbers(*names, again=True), strict=True)))

    def refuse_changed(self) -> None:
        """Read all once more. Raises as `see`."""
        self._refuse(self._read())

    def _refuse(self, now: Values) -> None:
        if problems := tuple(self._differing(self._before, now)):
            raise DriverError(*problems)

    def _read(self) -> Values:
        client, dialect, machine = self._rig.client, self._rig.dialect, self._rig.machine
        motors = machine.tool.motor, machine.carriage.motor
        firsts = [(dialect.motor_index(motor, 0), part) for motor in motors for part in MOTOR_SETTINGS]
        firsts += [(0, range(10, 11)), (dialect.system_index(1, 0), TIME_BASE)]
        ranges = [range(first + part.start, first + part.stop) for first, part in firsts]
        numbers = read_ranges(client, dialect, ranges)
        texts = ("%", *(f"#{motor}->" for motor in motors))
        return {
            **{f"I{index}": value for index, value in numbers.items()},
            **{name: client.query(f"&1{name}", again=True)[0].strip() for name in texts},
        }

    def _differing(self, before: Values, now: Values) -> Iterator[Problem]:
        """Yield the problem of each value that is no longer as before."""
        for name, value in now.items():
            was = before[name]
            if value != was and not (isinstance(value, float) and isinstance(was, float) and same(value, was)):
                found, limit = (self._amount(name, each) for each in (value, was))
                yield Problem(code="measurement.changed", key=name, value=found, limit=limit)

    def _amount(self, name: str, value: float | str) -> str:
        if isinstance(value, str):
            return value
        return amount(value, named(int(name[1:]), self._rig.dialect), self._rig.machine)
