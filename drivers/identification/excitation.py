"""The ways to excite the tool: a program per frequency, gathered channels, and the reference of the response.

`pvt`: a program commands the sine in segments, as it commands the lobe in a cut. The reference is the controller's
commanded tool position, so interpolation losses of the segments are not part of the response.

`cam`: a compensation table driven by the carriage, in place of the spindle at standstill. The table has one sine
period over a short travel of the carriage and repeats, so the carriage speed sets the frequency. The carriage
position is gathered; the reference is the table's value at that position, at that instant. So the response
includes everything in between: the one-cycle delay of the source, and whether the controller feeds a correction
forward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.cutting.corrected_motion import source_is_late
from drivers.pmac.axes import read_definitions
from drivers.pmac.compensation.table import PARTS_PER_COUNT, CompensationTable, TableDefinition, TableSource
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.gathering.gather_client import GatheredData
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from drivers.pmac.language.text import format_number
from drivers.pmac.programs.pvt import longest_segment_ms, point_scales
from drivers.pmac.programs.setup import END_FLAG, sign_program
from profiles.compensations.path import LobedPath
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

PROGRAM = 998  # number of the program that swings the tool; it must be free before, and is deleted afterwards
RAMP_MS = 400  # time over which the swing grows, and over which it fades
SETTLE_S = 0.2  # steady time before gathering starts: ten time constants of the published loop
SLACK_S = 1.2  # how much longer than its sine a program runs, for a host that is slow to begin and to end

CYCLES_A_PERIOD = 10.0  # minimum servo cycles per period of a sine alone
CARRIED_CYCLES = 2.5  # and of one that a slow swing carries
CARRIER_HZ, CARRIER_UM = 30.0, 25.0
"""The slow swing: the tool slides throughout, and a frozen encoder shows, where the fast sine moves it little."""

Floats = NDArray[np.float64]


def most_alone_hz(machine: MachineProfile) -> float:
    """Return the highest frequency of a sine alone."""
    return 1000.0 / machine.controller.servo_period_ms / CYCLES_A_PERIOD


def carrier_hz(machine: MachineProfile, frequency_hz: float) -> float | None:
    """Return the frequency of the slow swing below a fast sine; None for a sine alone.

    The sine is midway between two multiples of it, at which friction would be taken for the response.
    """
    if frequency_hz <= most_alone_hz(machine):
        return None
    return frequency_hz / (round(frequency_hz / CARRIER_HZ - 0.5) + 0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One program. It is steady from `steady_s` after its start, and ends by itself within `longest_s`."""

    text: str
    steady_s: float
    longest_s: float


class Excitation(Protocol):
    """A way to excite the tool with a sine."""

    channels: tuple[str, str]
    """The gathered channels: the source of the reference, and the tool position."""

    table: CompensationTable | None
    """The table that must be on meanwhile."""

    @property
    def late_cycles(self) -> int:
        """Delay of the reference in servo cycles; it is part of the measured response."""

    def sweep(self, frequency_hz: float, periods: int) -> Sweep:
        """Return the program for one frequency."""

    def reference_counts(self, data: GatheredData) -> Floats:
        """Return the commanded tool positions, in counts, at the gathered instants."""


def program_text(form: str, machine: MachineProfile, word: ExcitedAxis, **values: float) -> str:
    """Fill in a program; `go_on` is checked in each segment between its ramps: not ended, the watchdog alive."""
    text = form.format(
        letter=word.letter,
        program=PROGRAM,
        flag=END_FLAG,
        go_on=f"{END_FLAG}=0 AND {watchdog_condition(DIALECTS[machine.controller.family])}",
        **{name: format_number(value) for name, value in values.items()},
    )
    return sign_program(text)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitedAxis:
    """The axis of a single motor: `scale` counts per unit, zero at `offset` counts."""

    letter: str
    scale: float
    offset: float

    def position(self, counts: float) -> float:
        """Return a position of the motor in units of the axis."""
        return (counts - self.offset) / self.scale

    def length(self, counts: float) -> float:
        """Return a distance, or a speed, in units of the axis."""
        return counts / self.scale


def axis_word(machine: MachineProfile, motor: int) -> ExcitedAxis:
    """Return the axis of a motor. Raises ProfileError: `identify.axis`, the motor shares its axis."""
    definitions = read_definitions(machine.controller.axis_definitions)
    found = [each for each in definitions if each.motor == motor]
    if not found or len(found[0].terms) != 1 or not found[0].scale:
        value = str(found[0]) if found else "-"
        raise ProfileError(Problem(code="identify.axis", key="axis_definitions", where=f"#{motor}", value=value))
    return ExcitedAxis(letter=found[0].axis, scale=found[0].scale, offset=found[0].offset)


_PVT_TEXT = """\
; the tool swings at {hz} Hz by {amplitude_um} um, in segments of {segment} ms
P11={amplitude} ; amplitude at the points
P13={step_deg} ; angle of one segment, deg
P15={slope} ; greatest speed at the points, a second
P20={centre} ; where it swings about
P23={most} ; segments until it ends by itself
P24={ramp} ; segments in which the swing grows, and in which it fades
CLOSE
OPEN PROG {program}
CLEAR
ABS
{flag}=0 ; the host sets it to end the swing
P25=0
PVT{segment}
WHILE(P25<P24)
P25=P25+1
{letter}(P20+P11*P25/P24*SIN(P13*P25)):(P15*P25/P24*COS(P13*P25))
ENDWHILE
WHILE(P25<P23 AND {go_on})
P25=P25+1
{letter}(P20+P11*SIN(P13*P25)):(P15*COS(P13*P25))
ENDWHILE
P26=P24
WHILE(P26>0)
P26=P26-1
P25=P25+1
{letter}(P20+P11*P26/P24*SIN(P13*P25)):(P15*P26/P24*COS(P13*P25))
ENDWHILE
CLOSE
"""


def _carried_text() -> str:
    """Return the program with a second sine: P12 its amplitude, P14 its angle of a segment, P16 its speed."""
    text = _PVT_TEXT.replace(
        "P20={centre}",
        "P12={carrier} ; a slow swing carries it\nP14={carrier_deg}\nP16={carrier_slope}\nP20={centre}",
    )
    for size in ("*P25/P24", "", "*P26/P24"):
        for fast, slow, wave in (("P11", "P12", "SIN"), ("P15", "P16", "COS")):
            own = f"{fast}{size}*{wave}(P13*P25)"
            text = text.replace(own, f"{own}+{slow}{size}*{wave}(P14*P25)")
    return text


def carried_scales(step_rad: float) -> tuple[float, float]:
    """Return scales of positions and velocities with which cubics have a sine, and none of its first image.

    Points `step_rad` of the sine apart are those of another, 2 pi - `step_rad` apart, too. The cubics have both by
    c(k) = integral of g(u) exp(-j (step + 2 pi k) u), u from 0 to 1, of a segment g(u): c(0) is to be 1, c(-1) 0.
    """
    u = np.linspace(0.0, 1.0, 2001)
    turn = np.exp(1j * step_rad)
    to_end = 3.0 * u**2 - 2.0 * u**3
    positions = 1.0 - to_end + to_end * turn
    slopes = 1j * step_rad * (u**3 - 2.0 * u**2 + u + (u**3 - u**2) * turn)
    sizes = [
        [np.trapezoid(g * np.exp(-1j * (step_rad + image) * u), u).real for g in (positions, slopes)]
        for image in (0.0, -2.0 * np.pi)
    ]
    position, velocity = np.linalg.solve(np.array(sizes), [1.0, 0.0])
    return float(position), float(velocity)


class PvtPath:
    """The tool swings about `centre_counts`, commanded by its own program; a slow swing carries a fast sine."""

    table: CompensationTable | None = None
    late_cycles = 0

    def __init__(self, machine: MachineProfile, amplitude_um: float, centre_counts: float = 0.0) -> None:
        """Raises ProfileError: `identify.axis`."""
        motor = machine.tool.motor
        self._machine, self._amplitude_um, self._centre = machine, amplitude_um, centre_counts
        self._word = axis_word(machine, motor)
        self.channels = (f"#{motor} commanded", f"#{motor} actual")

    def sweep(self, frequency_hz: float, periods: int) -> Sweep:
        """Return the program for one frequency."""
        sine = LobedPath(mean_um=0.0, amplitude_um=self._amplitude_um, lobes=1, phase_deg=0.0)
        slow_hz = carrier_hz(self._machine, frequency_hz)
        segment_ms = longest_segment_ms(sine, frequency_hz) if slow_hz is None else 1
        step_rad = 2.0 * math.pi * frequency_hz * segment_ms / 1000.0
        amplitude = self._word.length(self._amplitude_um / self._machine.tool.count_um)
        ramp = math.ceil(RAMP_MS / segment_ms)
        steady = math.ceil((periods / (slow_hz or frequency_hz) + SETTLE_S + SLACK_S) * 1000.0 / segment_ms)
        carried: dict[str, float] = {}
        if slow_hz is None:
            scales = point_scales(step_rad)
            position, velocity = scales.position, scales.velocity
        else:
            position, velocity = carried_scales(step_rad)
            carrier = self._word.length(CARRIER_UM / self._machine.tool.count_um)
            carried = {
                "carrier": carrier,
                "carrier_deg": 0.36 * slow_hz,
                "carrier_slope": carrier * 2.0 * math.pi * slow_hz,
            }
        text = program_text(
            _carried_text() if carried else _PVT_TEXT,
            self._machine,
            self._word,
            hz=frequency_hz,
            amplitude_um=self._amplitude_um,
            amplitude=amplitude * position,
            step_deg=math.degrees(step_rad),
            slope=amplitude * velocity * 2.0 * math.pi * frequency_hz,
            centre=self._word.position(self._centre),
            most=ramp + steady,
            ramp=ramp,
            segment=segment_ms,
            **carried,
        )
        ramp_s = ramp * segment_ms / 1000.0
        longest_s = 2.0 * ramp_s + steady * segment_ms / 1000.0
        return Sweep(text=text, steady_s=ramp_s + SETTLE_S, longest_s=longest_s)

    def reference_counts(self, data: GatheredData) -> Floats:
        """Return the commanded position."""
        return data.values[self.channels[0]]


COLUMNS = 40  # linear segments per period: within 0.3 % of the amplitude
WAVE_COUNTS = 400  # travel per period where speeds leave the choice: a count is a hundredth of the swing
SHARE_OF_SPEED = 0.5  # fraction of Ix16 of the carriage, for the highest frequency
CAM_RAMP_MS, STEP_MS, HOME_IN_MS = 200, 50, 400

_CAM_TEXT = """\
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
    seconds = periods / frequency_hz + SETTLE_S + SLACK_S + 2.0 * (CAM_RAMP_MS + STEP_MS) / 1000.0
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
            _CAM_TEXT,
            self._machine,
            word,
            hz=frequency_hz,
            wave=self._wave,
            speed=word.length(self._wave * frequency_hz),
            start=word.position(0.0),
            period=word.length(self._wave),
            most=steps,
            ramp=CAM_RAMP_MS,
            step=STEP_MS,
            home_in=HOME_IN_MS,
        )
        longest_s = (2 * CAM_RAMP_MS + HOME_IN_MS + steps * STEP_MS) / 1000.0
        return Sweep(text=text, steady_s=CAM_RAMP_MS / 1000.0 + SETTLE_S, longest_s=longest_s)

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
    return definition.fill_table([round(parts * math.sin(2.0 * math.pi * turn)) for turn in turns])
