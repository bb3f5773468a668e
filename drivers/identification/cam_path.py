"""The path of `cam`: a compensation table driven by the carriage, in place of the spindle at standstill.

The table has one sine period over a short travel of the carriage and repeats, so the carriage speed sets the
frequency. The carriage position is gathered; the reference is the table's value for that position at that
instant. So the response includes everything in between: the one-cycle delay of the source, and whether the
controller feeds a correction forward.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.cutting.corrected import source_is_late
from drivers.identification.excitation import SETTLE_S, SLACK_S, Floats, Sweep, axis_word, program_text
from drivers.pmac.compensation.table import PARTS_PER_COUNT, CompensationTable, TableDefinition, TableSource
from drivers.pmac.gathering.gather_client import GatheredData
from profiles.machine import MachineProfile

COLUMNS = 40  # linear segments per period: within 0.3 % of the amplitude
WAVE_COUNTS = 400  # travel per period where speeds leave the choice: a count is a hundredth of the swing
SHARE_OF_SPEED = 0.5  # fraction of Ix16 of the carriage, for the highest frequency
RAMP_MS, STEP_MS, HOME_IN_MS = 200, 50, 400

_TEXT = """\
; the carriage goes along the table at {hz} Hz of {wave} counts
P17={speed} ; its speed, a second
P21={start} ; where it begins, at a zero of the table
P22={period} ; one wave
P23={most} ; segments until it ends by itself
CLOSE
OPEN PROG {program}
CLEAR
ABS
{flag}=0 ; the host sets it to end the way
P25=0
PVT{ramp}
{letter}(P21+P17*{ramp}/2000):(P17)
PVT{step}
WHILE(P25<P23 AND {go_on})
P25=P25+1
{letter}(P21+P17*({ramp}/2000+P25*{step}/1000)):(P17)
ENDWHILE
P26=P17*({ramp}/1000+P25*{step}/1000)
PVT{ramp}
{letter}(P21+P26):0
PVT{home_in} ; to rest at a zero of the table
{letter}(P21+P22*(INT(P26/P22)+1)):0
CLOSE
"""


def wave_counts(machine: MachineProfile, most_hz: float) -> int:
    """Return the carriage travel per period of the table.

    Long enough that a jog back does not exceed the highest requested frequency, and short enough that half the
    speed of the carriage suffices.
    """
    motor, variables = machine.carriage.motor, machine.controller.variables
    shortest = variables[f"I{motor}22"] * 1000.0 / most_hz
    longest = SHARE_OF_SPEED * variables[f"I{motor}16"] * 1000.0 / most_hz
    return max(COLUMNS, math.floor(min(max(shortest, WAVE_COUNTS), longest)))


def return_hz(machine: MachineProfile, most_hz: float) -> float:
    """Return the frequency at which the tool swings while the carriage is jogged back."""
    return machine.controller.variables[f"I{machine.carriage.motor}22"] * 1000.0 / wave_counts(machine, most_hz)


def way_counts(machine: MachineProfile, most_hz: float, frequency_hz: float, periods: int) -> float:
    """Return the maximum travel of the carriage."""
    seconds = periods / frequency_hz + SETTLE_S + SLACK_S + 2.0 * (RAMP_MS + STEP_MS) / 1000.0
    return wave_counts(machine, most_hz) * (frequency_hz * seconds + 1.0)


class CamPath:
    """The tool swings about its position, by the table, while the carriage moves along it from its zero."""

    def __init__(self, machine: MachineProfile, amplitude_um: float, most_hz: float) -> None:
        """Raises ProfileError: `identify.axis`."""
        self._machine, self._wave = machine, wave_counts(machine, most_hz)
        self._word = axis_word(machine, machine.carriage.motor)
        self.table: CompensationTable | None = _sine_table(machine, self._wave, amplitude_um)
        self.channels = (f"#{machine.carriage.motor} actual", f"#{machine.tool.motor} actual")

    def sweep(self, frequency_hz: float, periods: int) -> Sweep:
        """Return the program for one frequency."""
        word, steady_s = self._word, periods / frequency_hz + SETTLE_S + SLACK_S
        steps = math.ceil(steady_s * 1000.0 / STEP_MS)
        text = program_text(
            _TEXT,
            self._machine,
            word,
            hz=frequency_hz,
            wave=self._wave,
            speed=word.length(self._wave * frequency_hz),
            start=word.position(0.0),
            period=word.length(self._wave),
            most=steps,
            ramp=RAMP_MS,
            step=STEP_MS,
            home_in=HOME_IN_MS,
        )
        longest_s = (2 * RAMP_MS + HOME_IN_MS + steps * STEP_MS) / 1000.0
        return Sweep(text=text, steady_s=RAMP_MS / 1000.0 + SETTLE_S, longest_s=longest_s)

    def reference_counts(self, data: GatheredData) -> Floats:
        """Return the table's value for each carriage position."""
        assert self.table is not None  # this path consists of it
        places = data.values[self.channels[0]]
        return np.array([self.table.correction(float(place)) for place in places])

    @property
    def late_cycles(self) -> int:
        """Delay of the carriage as a source, in servo cycles; the spindle's may differ."""
        return int(self.table is not None and source_is_late(self.table, 0))


def _sine_table(machine: MachineProfile, wave: int, amplitude_um: float) -> CompensationTable:
    motor, source = machine.tool.motor, TableSource(motor=machine.carriage.motor, span_counts=wave)
    definition = TableDefinition(motor=motor, sources=(source,), target=motor, columns=COLUMNS)
    parts = PARTS_PER_COUNT * amplitude_um / machine.tool.count_um
    turns = (k / COLUMNS for k in range(1, COLUMNS + 1))
    return definition.filled([round(parts * math.sin(2.0 * math.pi * turn)) for turn in turns])
