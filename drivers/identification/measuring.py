"""Measure one sine on the machine: run the program under the watchdog, gather in the middle, fit.

A measurement during which a setting changed is refused: settings are compared when it begins and when it ends. A
response or a health test is stored with the settings that were read before it, and is valid for these alone. A fit
cannot tell that another host has changed them: with other gains throughout, it is as smooth as before. While a
program runs, the settings that shape its path are read in turn as in a cut (`drivers.cutting.watch_table`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from drivers.commissioning.checked_configuration import amount, is_same_number
from drivers.commissioning.fingerprint import ControllerFingerprint, console_facts, fingerprint_problems
from drivers.commissioning.reading import of_motors, read_configuration
from drivers.commissioning.setting_names import name_setting
from drivers.errors import DriverError, RefusedError
from drivers.identification.excitation import CARRIER_UM, PROGRAM, Excitation, Sweep, carrier_hz
from drivers.identification.request import IdentificationRequest
from drivers.identification.result import IdentifiedPoint, ResponseOrigin
from drivers.identification.rig import Rig
from drivers.identification.standstill import Standstill
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.gathering.gather import GatherError
from drivers.pmac.gathering.gather_client import DataGathering, GatheredData, GatherPlan
from drivers.pmac.program_constants import IN_THE_CUT
from drivers.pmac.program_text import read_program
from drivers.pmac.settings import servo_cycle_ms
from profiles.axis.identification import frequency_response, reference_swing
from profiles.problem import Problem

SPARE_SAMPLES = 2  # samples beyond the whole periods
GATHER_MARGIN_S = 0.05  # how much longer than its samples the gathering is waited for
END_S = 5.0  # how long after its program the tool may take to be in position
STEADY_FRACTION = 0.02  # relative variation of the reference amplitude above which it is no steady sine
CHANGED = "measurement.changed"
SERVO_TIME = 10
GAINS = range(30, 40)  # Ix30 to Ix35, and the notch filter: what an origin has


@dataclass(kw_only=True)
class MeasurementWatch:
    """Sends commands while the program runs: GATHER once it is steady, its end when all samples are there."""

    rig: Rig
    plan: GatherPlan
    standstill: Standstill
    steady_at_s: float
    enough_at_s: float = math.inf
    ended: bool = False

    def see(self, snapshot: Snapshot) -> None:
        """Process a poll of the machine. Raises DriverError: `identify.no_motion`; the link broke."""
        self.standstill.see(snapshot)
        if math.isinf(self.enough_at_s):
            if snapshot.at_s >= self.steady_at_s and snapshot.program_running:
                # The buffer was reserved at rest: it is empty and keeps its place.
                self.rig.client.request("GATHER")
                now_s = self.rig.clock.now_s()
                self.enough_at_s = now_s + self.plan.duration_ms / 1000.0 + GATHER_MARGIN_S
        elif not self.ended and self.rig.clock.now_s() >= self.enough_at_s:
            self.ended = True
            self.rig.client.request("ENDGATHER")
            self.rig.lathe.program.end_after_turn()


def measure(
    rig: Rig, excitation: Excitation, frequency_hz: float, request: IdentificationRequest
) -> IdentifiedPoint:
    """Swing the tool at one frequency, and return its response.

    Raises:
        DriverError: `identify.gather`, nothing is gathered; `identify.ended_early`; `identify.not_steady`;
            `measurement.changed`; what ended the motion, as for `Lathe.follow`.
        ProfileError: `identification.*`, the gathered data cannot be evaluated.
    """
    sweep = excitation.sweep(frequency_hz, request.periods)
    rig.lathe.program.load(read_program(sweep.text))
    gathering = DataGathering(client=rig.client, dialect=rig.dialect)
    slow_hz = carrier_hz(rig.machine, frequency_hz)
    swing_hz, swing_um = (frequency_hz, request.amplitude_um) if slow_hz is None else (slow_hz, CARRIER_UM)
    samples = math.ceil(request.periods / swing_hz / (rig.machine.controller.servo_period_ms / 1000.0))
    try:
        plan = gathering.prepare(gathering.motor_channels(*excitation.channels), samples + SPARE_SAMPLES)
        run_gathered(rig, sweep, plan, Standstill(rig, swing_hz, swing_um))
        data = gathering.fetch(plan)
    except GatherError as error:
        raise DriverError(Problem(code="identify.gather", where=rig.where, value=str(error))) from error
    return _point(rig, excitation, data, frequency_hz)


class SettingsComparison:
    """The settings that arming compares, as they were when a measurement began, without programs and PLCs."""

    def __init__(self, rig: Rig, origin: ResponseOrigin) -> None:
        """Read them. Raises RefusedError: `measurement.changed`, they are no longer those of `origin`."""
        self._rig = rig
        self._before = self._read()
        if problems := tuple(self._unlike(origin)):
            raise RefusedError(*problems)

    def refuse_changed(self) -> None:
        """Read them once more. Raises DriverError: `measurement.changed`; the link broke."""
        left_out = console_facts(self._rig.machine, self._rig.dialect)
        found = fingerprint_problems(self._before, self._read(), left_out)
        if found:
            raise DriverError(*(replace(problem, code=CHANGED) for problem in found))

    def _read(self) -> ControllerFingerprint:
        rig, machine = self._rig, self._rig.machine
        extent = replace(of_motors(rig.dialect, machine.motors), plcs=(), tables=())
        read = read_configuration(rig.client, rig.dialect, extent)
        return ControllerFingerprint(machine=machine, configuration=read, free="")

    def _unlike(self, origin: ResponseOrigin) -> Iterator[Problem]:
        motor, now, dialect = self._rig.machine.tool.motor, self._before.configuration.standing, self._rig.dialect
        for index in (dialect.motor_index(motor, number) for number in GAINS):
            values, of = (now[index], origin.gains[f"I{index}"]), name_setting(index, dialect)
            if not is_same_number(*values):
                value, limit = (amount(each, of, self._rig.machine) for each in values)
                yield Problem(code=CHANGED, key=f"I{index}", value=value, limit=limit)
        periods_ms = servo_cycle_ms(now[SERVO_TIME]), origin.servo_period_ms
        if periods_ms[0] != periods_ms[1]:
            value, limit = (f"{each:.7g} ms" for each in periods_ms)
            yield Problem(code=CHANGED, key=f"I{SERVO_TIME}", value=value, limit=limit)


def changes_in(error: DriverError) -> tuple[Problem, ...]:
    """Return the settings that changed while a program ran, in the words of a measurement; else nothing."""
    return tuple(replace(each, code=CHANGED) for each in error.problems if each.code == IN_THE_CUT)


def run_gathered(rig: Rig, sweep: Sweep, plan: GatherPlan, standstill: Standstill) -> None:
    """Run the loaded program to its end, and gather from where it is steady. Raises as `measure`."""
    out_counts = rig.lathe.snapshot().tool.position  # the tool is clear of everything where it swings
    rig.lathe.program.start(PROGRAM, out_counts)  # it reads the settings first, which may take seconds
    steady_at_s = rig.clock.now_s() + sweep.steady_s
    watch = MeasurementWatch(rig=rig, plan=plan, standstill=standstill, steady_at_s=steady_at_s)
    try:
        rig.lathe.program.follow(watch.see, sweep.longest_s + END_S)
    except DriverError as error:
        if changed := changes_in(error):
            raise DriverError(*changed) from error
        raise
    if not watch.ended:
        raise DriverError(Problem(code="identify.ended_early", where=rig.where, key=f"PROG {PROGRAM}"))


def _point(rig: Rig, excitation: Excitation, data: GatheredData, frequency_hz: float) -> IdentifiedPoint:
    count_um = rig.machine.tool.count_um
    times_s = data.times_ms / 1000.0
    reference = excitation.reference_counts(data) * count_um
    slow_hz = carrier_hz(rig.machine, frequency_hz)
    swing = reference_swing(times_s, reference, frequency_hz, slow_hz)
    if swing > STEADY_FRACTION:
        where, value = f"{frequency_hz:g} Hz", f"{100.0 * swing:.3g} %"
        limit = f"<= {100.0 * STEADY_FRACTION:g} %"
        raise DriverError(Problem(code="identify.not_steady", where=where, value=value, limit=limit))
    answered = data.values[excitation.channels[1]] * count_um
    found = frequency_response(times_s, reference, answered, frequency_hz, slow_hz)
    fitted = {key: getattr(found, key) for key in ("gain", "phase_deg", "gain_ci", "phase_ci_deg", "coherence")}
    return IdentifiedPoint(frequency_hz=frequency_hz, amplitude_um=found.reference, **fitted)
