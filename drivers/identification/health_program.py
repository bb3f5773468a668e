"""The moves of a health test: a step out and back, and a parabola out and back, each followed by rest.

All are cubic segments: the step a single short one, the parabola four of constant acceleration. The program waits
before the first move until the host has begun to gather, and ends by itself; whoever ends it or stops keeping the
watchdog alive ends it within a segment and a pair of moves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.identification.excitation import AxisWord, program_text
from profiles.machine import MachineProfile

EDGE_MS = 5  # duration of the step: short against the rise of the loop, long enough for the drive
HALF_MS = 40  # duration of each of the four parts of the parabola
SEGMENT_MS = 50
LEAD_S, SETTLE_S = 1.0, 0.2  # rest before the first move; when in it gathering begins
HOLD_S = 0.3  # rest after each move
PARABOLA_TIMES = 8.0  # distance of the parabola in steps: at four times 40 ms it needs a third of the acceleration

_HOLD = """\
P25=0
PVT{segment}
WHILE(P25<{most} AND {go_on})
P25=P25+1
{letter}{place}:0
ENDWHILE
"""

_TEXT = """\
; health test: a step of {step_um} um in {edge} ms, a parabola of {far_um} um
P11={step} ; the step
P12={far} ; the parabola
P13={speed} ; its greatest speed, a second
P20={centre} ; where it begins
CLOSE
OPEN PROG {program}
CLEAR
ABS
{flag}=0 ; the host sets it to end the test
{before}IF({go_on})
PVT{edge}
{letter}(P20+P11):0
{out}PVT{edge}
{letter}(P20):0
ENDIF
{between}IF({go_on})
PVT{half}
{letter}(P20+P12/2):(P13)
{letter}(P20+P12):0
{far_hold}PVT{half}
{letter}(P20+P12/2):(-P13)
{letter}(P20):0
ENDIF
{after}CLOSE
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthMoves:
    """Sizes of one test, um, and its times from the beginning of the step, s."""

    step_um: float

    @property
    def parabola_um(self) -> float:
        """The distance of the parabola."""
        return PARABOLA_TIMES * self.step_um

    @property
    def back_s(self) -> float:
        """When the step goes back."""
        return EDGE_MS / 1000.0 + HOLD_S

    @property
    def parabola_s(self) -> float:
        """When the parabola begins."""
        return 2.0 * self.back_s

    @property
    def end_s(self) -> float:
        """When the last rest ends."""
        return self.parabola_s + 4.0 * HALF_MS / 1000.0 + 2.0 * HOLD_S

    @property
    def longest_s(self) -> float:
        """How long the program runs at most."""
        return LEAD_S + self.end_s + 1.0

    def peak_speed_mm_per_s(self) -> float:
        """Return the greatest commanded speed, of step or parabola."""
        return max(1.5 * self.step_um / EDGE_MS, self.parabola_um / HALF_MS)

    def peak_acceleration_m_per_s2(self) -> float:
        """Return the greatest commanded acceleration."""
        step = 6.0 * self.step_um / EDGE_MS**2
        return max(step, self.parabola_um / HALF_MS**2)


def health_text(machine: MachineProfile, word: AxisWord, moves: HealthMoves, centre_counts: float) -> str:
    """Return the program."""
    count_um, half_s = machine.tool.count_um, HALF_MS / 1000.0

    def hold(place: str, seconds: float) -> str:
        most = str(math.ceil(seconds * 1000.0 / SEGMENT_MS))
        return _HOLD.replace("{most}", most).replace("{place}", place)

    text = _TEXT
    for name, place, seconds in (
        ("before", "(P20)", LEAD_S),
        ("out", "(P20+P11)", HOLD_S),
        ("between", "(P20)", HOLD_S),
        ("far_hold", "(P20+P12)", HOLD_S),
        ("after", "(P20)", HOLD_S + 1.0),
    ):
        text = text.replace(f"{{{name}}}", hold(place, seconds))
    return program_text(
        text,
        machine,
        word,
        step_um=moves.step_um,
        far_um=moves.parabola_um,
        step=word.length(moves.step_um / count_um),
        far=word.length(moves.parabola_um / count_um),
        speed=word.length(moves.parabola_um / count_um) / half_s,
        centre=word.position(centre_counts),
        edge=EDGE_MS,
        half=HALF_MS,
        segment=SEGMENT_MS,
    )
