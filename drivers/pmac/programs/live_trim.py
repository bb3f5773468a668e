"""The trim of a program in segments: gain and phase of its path, blended over a turn at the end of a turn.

A host sets P53, the factor of the amplitude, and P54, what is added to the lobe angle, degrees. The program reads
them once a turn and comes nearer by the same in each segment of the turn; P55 and P56 are those in the path, so
that there is no step in it whatever is written. What is beyond the bounds, as by a line with a wrong digit, is put
back to those. A turn need not be whole segments: what the rounding leaves is made up for in the next one.
"""

from __future__ import annotations

from drivers.pmac.language.text import format_number

GAIN, LOBE_ANGLE = "P53", "P54"
GAIN_IN_PATH, ANGLE_IN_PATH = "P55", "P56"

MOST_GAIN_PERCENT = 10
MOST_PHASE_DEG = 5.0  # of the spindle

ROUNDING = 1e-4  # by which a number may be rounded in transmission, and a blend may be off at its end

BEGIN = "P53=1 P54=0 P55=1 P56=0 P57=0 P58=0 ; trim, none asked for\n"

AT_TURN = """\
IF(ABS(P53-1)>{most_gain} OR ABS(P54)>{most_angle}) ; beyond the bounds: it stays as it is
P53=P55 P54=P56
ENDIF
P57=(P53-P55)/P32
P58=(P54-P56)/P32
"""

IN_SEGMENT = "P55=P55+P57 P56=P56+P58\n"


def live_trim_values(lobes: int) -> dict[str, object]:
    """Return the template values of `AT_TURN`."""
    return {
        "most_gain": format_number(MOST_GAIN_PERCENT / 100.0 + ROUNDING),
        "most_angle": format_number(MOST_PHASE_DEG * lobes + ROUNDING),
    }


def live_trim_line(gain_percent: float, phase_deg: float, lobes: int) -> str:
    """Return the line that asks for a trim; a phase that is later by degrees of spindle.

    Raises ValueError: beyond the bounds.
    """
    if not (abs(gain_percent) <= MOST_GAIN_PERCENT and abs(phase_deg) <= MOST_PHASE_DEG):
        raise ValueError(f"a trim of {gain_percent:g} %, {phase_deg:g} deg")
    gain, angle_deg = 1.0 + gain_percent / 100.0, -lobes * phase_deg
    return f"{GAIN}={format_number(round(gain, 4))} {LOBE_ANGLE}={format_number(round(angle_deg, 3))}"
