"""The path of `pvt`: a program commands the sine in segments, as it commands the lobe in a cut.

The reference is the controller's commanded tool position, so interpolation losses of the segments are not part
of the response.
"""

from __future__ import annotations

import math

from drivers.identification.excitation import RAMP_MS, SETTLE_S, SLACK_S, Floats, Sweep, axis_word, program_text
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.gathering.gather_client import GatheredData
from drivers.pmac.programs.pvt import longest_segment_ms, point_scales
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
        motor = machine.tool.motor
        self._machine, self._amplitude_um, self._centre = machine, amplitude_um, centre_counts
        self._word = axis_word(machine, motor)
        self.channels = (f"#{motor} commanded", f"#{motor} actual")

    def sweep(self, frequency_hz: float, periods: int) -> Sweep:
        """Return the program for one frequency."""
        sine = LobedPath(mean_um=0.0, amplitude_um=self._amplitude_um, lobes=1, phase_deg=0.0)
        segment_ms = longest_segment_ms(sine, frequency_hz)
        step_rad = 2.0 * math.pi * frequency_hz * segment_ms / 1000.0
        scales = point_scales(step_rad)
        amplitude = self._word.length(self._amplitude_um / self._machine.tool.count_um)
        ramp = math.ceil(RAMP_MS / segment_ms)
        steady = math.ceil((periods / frequency_hz + SETTLE_S + SLACK_S) * 1000.0 / segment_ms)
        text = program_text(
            _TEXT,
            self._machine,
            self._word,
            hz=frequency_hz,
            amplitude_um=self._amplitude_um,
            amplitude=amplitude * scales.position,
            step_deg=math.degrees(step_rad),
            slope=amplitude * scales.velocity * 2.0 * math.pi * frequency_hz,
            centre=self._word.position(self._centre),
            most=ramp + steady,
            ramp=ramp,
            segment=segment_ms,
        )
        ramp_s = ramp * segment_ms / 1000.0
        longest_s = 2.0 * ramp_s + steady * segment_ms / 1000.0
        return Sweep(text=text, steady_s=ramp_s + SETTLE_S, longest_s=longest_s)

    def reference_counts(self, data: GatheredData) -> Floats:
        """Return the commanded position."""
        return data.values[self.channels[0]]
