"""The feed hold of a cutting program: at the end of a turn the tool goes out, and comes back in at the same angle.

A host sets P46: 1 asks for the hold, 0 ends it, 2 ends it for one turn. The program reads it once in each turn and
in each segment of the hold; P47 reports where it is. The tool leaves on the path by which every cut ends, and
returns on the same one, backwards: at no angle is it further in than on its path. Meanwhile the spindle turns on,
and segments are counted on, so that tool and spindle keep their phase.

The carriage returns to its place in the feed: a hold takes whole turns off the count of the feed (P49, in
segments, which need not be whole), and ends at the last segment before they are over. So the tool comes in at the
angle at which it left, less than a segment earlier, and cuts on along the same helix. It comes in some turns
before the place at which it left, above the surface that is cut already, and comes down to its path from there on;
not where it is resumed for one turn.

The program leaves a hold by itself, as at the end of the cut, when the end of the cut is asked for, when the
heartbeat has lost its host (P1004, whatever its policy), and after `MOST_HELD_S`. Only P46 brings the tool in.
"""

from __future__ import annotations

import math

from drivers.pmac.language.text import format_number
from drivers.pmac.reserved import LOST

HOLD, HOLD_STATE, HELD_SEGMENTS = "P46", "P47", "P49"
"""What a host sets, what the program reports (0 cuts, 1 goes out, 2 is held, 3 comes in), turns off the feed."""

SEGMENTS_A_TURN = "P32"

LIFT_UM = (
    30.0  # above the path on surface that is cut already: what swings as the tool comes in cuts nothing there
)
MOST_LOWERED_TURNS = 2
TURNS_OF_LAND = 0.25
"""Turns in which it comes down to its path from where it had left: a fraction of those that cut a place, so that
the others cut what stays high.
"""

MOST_HELD_S = 600.0  # longest hold

_CUT_ON = 10  # label of the loop of turns

BEGIN = f"{HOLD}=0 {HOLD_STATE}=0 {HELD_SEGMENTS}=0 ; feed hold, none asked for\n"
LOOP = f"N{_CUT_ON}\n"
NOT_HELD = f"{HOLD}!=1"
ONE_TURN = f"IF({HOLD}=2) {HOLD}=1 ; this turn alone\n"
OUT = f"{HOLD_STATE}=1\nP52=P25 ; segment at which the tool leaves\n"

HELD = f"""\
IF({HOLD}=1 AND {{go_on}} AND P30<P23) ; feed hold: the tool is out, the spindle turns on
{HOLD_STATE}=2
P48=0
P51=P29+P33*{{out_ms}}/3000 ; carriage at rest
PVT{{segment}}
WHILE({HOLD}=1 AND {{go_on}} AND P{LOST}=0 AND P48<{{most_held}})
P25=P25+1 P45=P45+1 P48=P48+1
X(P20):0{{y}} Z(P51):0
ENDWHILE
IF({HOLD}!=1 AND {{go_on}} AND P{LOST}=0) ; resume
{HOLD_STATE}=3
P50=INT((P25+{{hold_in}}-P52)/P32)+1 ; turns until the tool is in
WHILE(P25+{{hold_in}}+1!>P52+P50*P32) ; until the angle comes
P25=P25+1 P45=P45+1
X(P20):0{{y}} Z(P51):0
ENDWHILE
P75=0 P77=P30*P32-0.5 ; segment of the feed at which the tool left
{{push_resume}}{HELD_SEGMENTS}={HELD_SEGMENTS}+P50*P32+{{hold_settle}}*P32
IF(P30=0) {HELD_SEGMENTS}=P25+{{hold_in}}-{{hold_first}} ; the feed has not begun
IF({HOLD}=0 AND P30+{{hold_lowered}}!>P23) P75={{hold_lift}} ; above its path, then down to it within these turns
IF(P75>0) P30=P30+{{hold_lowered}} P77=P77+{{hold_lowered}}*P32
P31={{hold_first}}-0.5+P30*P32+{HELD_SEGMENTS} ; the segment in which the last turn ended
P29=P21+P18*(P25+{{hold_in}}-{{hold_first}}-{HELD_SEGMENTS}) ; carriage with the tool in
PVT{{hold_back_ms}}
P25=P25+{{hold_back}} P45=P45+{{hold_back}}
X(P20):0{{y}} Z(P29-P33*{{out_ms}}/3000):0
{{enter}}WHILE(P25+1<P31 AND {{go_on}}) ; on surface that is cut already
P25=P25+1 P45=P45+1
{{lift}}{{cut}}ENDWHILE
P25=P25+1 P45=P45+1
{{lift}}{{cut}}{HOLD_STATE}=0
GOTO{_CUT_ON}
ENDIF
ENDIF
"""
"""The lines after the tool has gone out. It goes out and comes in within `hold_out` segments, `out_ms`, after the
carriage has gone back within `hold_back` segments; `hold_in` are both. The feed begins at segment `hold_first`;
`cut` moves on the path.

The last move stands alone: after it the program goes back, and two ways back without a move would stop it.
"""

ENTER_ON_PATH = """\
{along@in}PVT{segment}
P34=0
WHILE(P34<{hold_out})
P34=P34+1
P25=P25+1 P45=P45+1
P27=P14+P56+P13*P25
P35=P34/{hold_out} ; from 0 to 1
P36=P35*P35*(3-2*P35)
P37=P11-P75{pushed}+P12*P55*COS(P27)-P20
P38=-P15*P55*SIN(P27)*P36+P37*6*P35*(1-P35)/{out_ms}*1000
X(P20+P37*P36):(P38){y} Z(P29-P33*{out_ms}/3000*(1-P35*P35*P35)):(P33*P35*P35)
ENDWHILE
"""

ENTER_ON_TABLE = """\
PVT{out_ms}
P25=P25+{hold_out} P45=P45+{hold_out}
X(P11-P75{pushed}):0{y} Z(P29):(P33)
PVT{segment}
"""


LIFTED = "-P75*P78*P78*(3-2*P78)"

LIFT = """\
P78=(P77-({fed}))/P32/{hold_lowered}
IF(P78>1) P78=1
IF(P78<0) P78=0
"""
"""What is left of the lift in a segment, from 1 to 0; `LIFTED` is a term of its position."""


SETTLE_MS = 400.0  # time on surface that is cut already
BACK_MM_S = 10.0  # peak speed of the carriage on its way back


def settle_turns(turn_ms: float) -> int:
    """Return the turns before its place at which the tool comes in."""
    return math.ceil(SETTLE_MS / turn_ms)


def back_mm(feed_mm: float, turn_ms: float, out_ms: float) -> float:
    """Return how far before its place the carriage goes on its way back, for a feed in mm a turn."""
    return feed_mm * (settle_turns(turn_ms) + out_ms / (3.0 * turn_ms))


def back_segments(feed_mm: float, turn_ms: float, out_ms: float, segment_ms: float) -> int:
    """Return the segments of the way back: the carriage stands behind its place by as much as it braked."""
    way_mm = back_mm(feed_mm, turn_ms, out_ms) + feed_mm * out_ms / (3.0 * turn_ms)
    return math.ceil(max(1.5 * way_mm / BACK_MM_S * 1000.0, out_ms) / segment_ms)


def hold_values(
    feed_mm: float, turn_ms: float, segment_ms: float, out: float, tool_count_um: float, land_turns: float
) -> dict[str, object]:
    """Return the template values of `HELD`; the tool goes out in `out` segments, which need not be whole."""
    back = back_segments(feed_mm, turn_ms, out * segment_ms, segment_ms)
    lowered = min(MOST_LOWERED_TURNS, round(TURNS_OF_LAND * land_turns))
    return {
        "hold_out": format_number(out),
        "hold_back": back,
        "hold_back_ms": back * segment_ms,
        "hold_in": format_number(back + out),
        "hold_lift": format_number(LIFT_UM / tool_count_um) if lowered else 0,
        "hold_lowered": max(1, lowered),
        "hold_settle": settle_turns(turn_ms),
    }


def most_held(segment_ms: float) -> int:
    """Return the segments of the longest hold."""
    return math.floor(1000.0 * MOST_HELD_S / segment_ms)
