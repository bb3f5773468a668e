"""The path of `pvt`: a program commands the sine in segments, as it commands the lobe in a cut.

The reference is the controller's commanded tool position, so interpolation losses of the segments are not part
of the response.
"""

from __future__ import annotations

import math

from drivers.identification.excitation import PROGRAM, RAMP_MS, SETTLE_S, SLACK_S, Floats, Sweep, go_on
from drivers.identification.words import axis_word
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.gathering.gather_client import GatheredData
from drivers.pmac.language.text import format_number
from drivers.pmac.programs.pvt import longest_segment_ms, point_scales
from drivers.pmac.programs.setup import END_FLAG
from profiles.compensations.path import LobedPath
from profiles.machine import MachineProfile

_TEXT = """\
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


class PvtPath:
    """The tool swings about `centre_counts`, commanded by its own program."""

    table: CompensationTable | None = None
    late_cycles = 0

    def __init__(self, machine: MachineProfile, amplitude_um: float, centre_counts: float = 0.0) -> None:
        """Raises ProfileError: `identify.axis`."""
        self._machine = machine
        self._amplitude_um = amplitude_um
        self._centre = centre_counts
        self._word = axis_word(machine, machine.tool.motor)
        self._dialect = DIALECTS[machine.controller.family]
        motor = machine.tool.motor
        self.channels = (f"#{motor} commanded", f"#{motor} actual")

    def sweep(self, frequency_hz: float, periods: int) -> Sweep:
        """Return the program for one frequency."""
        sine = LobedPath(mean_um=0.0, amplitude_um=self._amplitude_um, lobes=1, crest_deg=0.0)
        segment_ms = longest_segment_ms(sine, frequency_hz)
        step_rad = 2.0 * math.pi * frequency_hz * segment_ms / 1000.0
        scales = point_scales(step_rad)
        amplitude = self._word.length(self._amplitude_um / self._machine.tool.count_um)
        ramp = math.ceil(RAMP_MS / segment_ms)
        steady = math.ceil((periods / frequency_hz + SETTLE_S + SLACK_S) * 1000.0 / segment_ms)
        number = format_number
        text = _TEXT.format(
            hz=number(frequency_hz),
            amplitude_um=number(self._amplitude_um),
            amplitude=number(amplitude * scales.position),
            step_deg=number(math.degrees(step_rad)),
            slope=number(amplitude * scales.velocity * 2.0 * math.pi * frequency_hz),
            centre=number(self._word.position(self._centre)),
            most=ramp + steady,
            ramp=ramp,
            segment=segment_ms,
            letter=self._word.letter,
            program=PROGRAM,
            flag=END_FLAG,
            go_on=go_on(self._dialect),
        )
        ramp_s = ramp * segment_ms / 1000.0
        longest_s = 2.0 * ramp_s + steady * segment_ms / 1000.0
        return Sweep(text=text, steady_s=ramp_s + SETTLE_S, longest_s=longest_s)

    def reference_counts(self, data: GatheredData) -> Floats:
        """Return the commanded position."""
        return data.values[self.channels[0]]
