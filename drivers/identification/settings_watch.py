"""Refuse a measurement during which a setting changes: compared when it begins, every few polls, and at its end.

A response or a health test is kept with the settings that were read before it, and answers for these alone. A
fit cannot tell that another host has changed them: with other gains, held throughout, it is as smooth as before.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import cycle, islice

from drivers.commissioning.amounts import amount
from drivers.commissioning.fingerprint import Fingerprint, fingerprint_problems, ours
from drivers.commissioning.judged import same
from drivers.commissioning.reading import of_motors, read_configuration
from drivers.commissioning.setting_names import named
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.identification.result import Origin
from drivers.identification.rig import Rig
from drivers.lathe.polling import POLLS_A_READING, QUICK_TIMEOUT_S, SLOW_LINE_S
from drivers.link.base import is_gone
from drivers.pmac.settings import servo_cycle_ms
from profiles.problem import Problem

CHANGED = "measurement.changed"
SERVO_TIME = 10
GAINS = range(30, 40)  # Ix30 to Ix35, and the notch filter: what an origin has
SHAPING = frozenset((*range(3, 10), *range(29, 40), *range(60, 70)))
"""Ix03 to Ix09: encoder, scales; Ix29 to Ix39: offset, gains, notch filter; Ix60 to Ix69: servo period, limits."""

SETTINGS_A_READING = 16  # all that shape it within 0.5 s; over a slow line one, since the watchdog comes first


class SettingsWatch:
    """The settings that arming compares, as they were when a measurement began, without programs and PLCs."""

    def __init__(self, rig: Rig, origin: Origin) -> None:
        """Read them. Raises RefusedError: `measurement.changed`, they are no longer those of `origin`."""
        self._rig, self._polls_made = rig, 0
        self._before = self._read()
        self._values = self._before.configuration.standing
        tool, carriage = rig.machine.tool.motor, rig.machine.carriage.motor
        shaping = {rig.dialect.motor_index(motor, number) for motor in (tool, carriage) for number in SHAPING}
        shaping |= {SERVO_TIME, rig.dialect.system_index(1, 93), rig.dialect.system_index(1, 94)}
        self._turn = cycle(sorted(shaping & self._values.keys()))
        self._refuse_other(origin)

    def see(self) -> None:
        """Read the next ones after every few polls; a missing reply is left to the next poll.

        Raises DriverError: `measurement.changed`; LinkError: the link is gone.
        """
        self._polls_made += 1
        if self._polls_made % POLLS_A_READING:
            return
        fast = self._rig.lathe.round_trip_s < SLOW_LINE_S
        turn = tuple(islice(self._turn, SETTINGS_A_READING if fast else 1))
        try:
            found = self._rig.client.numbers(*(f"I{index}" for index in turn), timeout_s=QUICK_TIMEOUT_S)
        except LinkError as error:
            if is_gone(error):
                raise
            return
        _refuse(DriverError, self._differing(self._values, dict(zip(turn, found, strict=True))))

    def refuse_changed(self) -> None:
        """Read all once more. Raises as `see`."""
        left_out = ours(self._rig.machine, self._rig.dialect)
        found = fingerprint_problems(self._before, self._read(), left_out)
        _refuse(DriverError, (replace(problem, code=CHANGED) for problem in found))

    def _read(self) -> Fingerprint:
        rig, machine = self._rig, self._rig.machine
        motors = machine.tool.motor, machine.spindle.motor, machine.carriage.motor
        extent = replace(of_motors(rig.dialect, motors), plcs=(), tables=())
        return Fingerprint(
            machine=machine, configuration=read_configuration(rig.client, rig.dialect, extent), free=""
        )

    def _refuse_other(self, origin: Origin) -> None:
        motor, now = self._rig.machine.tool.motor, self._values
        indices = {number: self._rig.dialect.motor_index(motor, number) for number in GAINS}
        read = {index: origin.gains[f"I{motor}{number}"] for number, index in indices.items()}
        _refuse(RefusedError, self._differing(read, {index: now[index] for index in read}))
        period_ms = servo_cycle_ms(now[SERVO_TIME])
        if period_ms != origin.servo_period_ms:
            value, limit = f"{period_ms:.7g} ms", f"{origin.servo_period_ms:.7g} ms"
            _refuse(RefusedError, [Problem(code=CHANGED, key=f"I{SERVO_TIME}", value=value, limit=limit)])

    def _differing(self, before: Mapping[int, float], now: Mapping[int, float]) -> Iterator[Problem]:
        for index, value in now.items():
            if not same(value, before[index]):
                of = named(index, self._rig.dialect)
                found, was = (amount(each, of, self._rig.machine) for each in (value, before[index]))
                yield Problem(code=CHANGED, key=f"I{index}", value=found, limit=was)


def _refuse(kind: type[DriverError], problems: Iterable[Problem]) -> None:
    if found := tuple(problems):
        raise kind(*found)
