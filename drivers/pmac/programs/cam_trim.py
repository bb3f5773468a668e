"""In-process trim of a cut on a table: two small harmonics of the program, superimposed on the table.

A table cannot be changed during the cut. So the program adds a harmonic at the lobe frequency and one of twice a
turn, as an oval blank makes it (three times a turn where twice is the lobe), read once per segment from variables
that a host may write at any time: P39 is the commanded cosine amplitude, P40 the sine, in counts against the lobe
angle of the spindle; P60 and P61 against that of the other. The effective values follow smoothly, so that no write
causes a step, and a host that falls silent leaves them as they are. During the retraction the harmonics fade out
with the depth.
"""

from __future__ import annotations

import math

from drivers.pmac.language.text import format_number
from drivers.pmac.programs.pvt import longest_segment_ms, point_scales
from drivers.pmac.programs.setup import CutSetup
from profiles.compensations.path import LobedPath
from profiles.job import Job

OVAL = 2
MOST_TRIM_UM = 8.0
"""Maximum amplitude: a few times a soft servo's deflection by a fine cut's force at the lobe frequency."""

ROUNDING_COUNTS = 0.01  # Maximum rounding-up of the two numbers of a harmonic on transmission
SMOOTHED_MS = 40.0  # Time constant with which the effective harmonic follows the commanded one


def trim_segment_ms(job: Job) -> int:
    """Return the longest segment in which cubics reproduce the largest harmonic."""
    order = max(job.jaws, beside_order(job.jaws))
    largest = LobedPath(mean_um=0.0, amplitude_um=MOST_TRIM_UM, lobes=order, phase_deg=0.0)
    return longest_segment_ms(largest, order * job.spindle_speed_rpm / 60.0)


def beside_order(lobes: int) -> int:
    """Return the order that is trimmed beside the lobe: twice a turn, or three times where that is the lobe.

    With two jaws an oval blank moves the tool as their lobe does; dry friction makes three times a turn of it.
    """
    return OVAL if lobes != OVAL else OVAL + 1


def trim_line(trim_um: complex, tool_count_um: float, oval_um: complex | None = None) -> str:
    """Return the line that commands the harmonic Re(c exp(j lobe angle)), c in um; at rest it causes no motion.

    `oval_um` is the c of twice a turn, None: not changed. Raises ValueError: more than `MOST_TRIM_UM`.
    """
    names = {("P39", "P40"): trim_um} | ({} if oval_um is None else {("P60", "P61"): oval_um})
    words = []
    for (cosine, sine), each_um in names.items():
        if not abs(each_um) <= MOST_TRIM_UM:
            raise ValueError(f"a trim of {abs(each_um):.2f} um; at most {MOST_TRIM_UM:g} um")
        words.append(f"{cosine}={format_number(round(each_um.real / tool_count_um, 3))}")
        words.append(f"{sine}={format_number(round(-each_um.imag / tool_count_um, 3))}")
    return " ".join(words)


def trim_values(job: Job, setup: CutSetup, segment_ms: int, first_spindle: float) -> dict[str, object]:
    """Return the values of `TRIM_VALUES` and `TRIMMED_CUT`, except those common to every cut."""
    turns_per_ms = job.spindle_speed_rpm / 60_000.0
    values: dict[str, object] = {}
    for name, order in (("", job.jaws), ("oval_", beside_order(job.jaws))):
        speed = 2.0 * math.pi * order * job.spindle_speed_rpm / 60.0
        start_deg = math.fmod(360.0 * order * first_spindle / setup.counts_per_turn, 360.0)
        scales = point_scales(speed * segment_ms / 1000.0)
        values |= {
            f"{name}position": format_number(scales.position),
            f"{name}step_deg": format_number(360.0 * order * turns_per_ms * segment_ms),
            f"{name}start_deg": format_number(start_deg),
            f"{name}slope": format_number(scales.velocity * speed),
        }
    return {
        **values,
        "most": format_number((MOST_TRIM_UM / setup.tool_count_um + ROUNDING_COUNTS) ** 2),
        "fraction": format_number(round(-math.expm1(-segment_ms / SMOOTHED_MS), 6)),
    }


TRIM_VALUES = """\
P12={position} ; of the wave that the host may ask for: its points are raised by so much
P13={step_deg} ; lobe angle of one segment, deg
P14={start_deg} ; lobe angle at the start, deg
P15={slope} ; greatest speed of a wave of one count, counts/s
P65={oval_step_deg} ; the same of twice a turn
P66={oval_start_deg}
P67={oval_position}
P68={oval_slope}
"""

TRIMMED_CUT = """\
PVT{segment}
P25=0 P45=0
P30=0 ; turns begun
P31=0 ; the segment in which the present turn ends
P36=0 ; cosine and sine of the wave in effect
P37=0
P39=0 ; and as the host wants them
P40=0
P60=0 ; the same of twice a turn
P61=0
P62=0
P63=0
WHILE(P25<P31 OR {go_on} AND P30<P23)
IF(P25!<P31)
P30=P30+1
P31=P30*P32-0.5
ENDIF
P25=P25+1 P45=P45+1
{push@P25}\
P41=P14+P13*P25
P64=P66+P65*P25
IF(P39*P39+P40*P40>{most}) ; no cutting force asks for so much: it stays as it is
P39=P36
P40=P37
ENDIF
IF(P60*P60+P61*P61>{most})
P60=P62
P61=P63
ENDIF
P36=P36+(P39-P36)*{fraction}
P37=P37+(P40-P37)*{fraction}
P62=P62+(P60-P62)*{fraction}
P63=P63+(P61-P63)*{fraction}
P38=P15*(P37*COS(P41)-P36*SIN(P41))+P68*(P63*COS(P64)-P62*SIN(P64))
P69=P12*(P36*COS(P41)+P37*SIN(P41))+P67*(P62*COS(P64)+P63*SIN(P64))
X(P11{pushed}+P69):(P38) Y(P28+P16*P25):(P17) Z(P21+P18*P25):(P19)
ENDWHILE
P43=P30 ; turns of the cut
P29=P21+P18*P25 ; carriage at the end of the cut
P33=0
IF(P30>0) P33=P19
P34={out_segments} ; the tool goes out, the carriage comes to rest
WHILE(P34>0)
P34=P34-1
P25=P25+1 P45=P45+1
P41=P14+P13*P25
P64=P66+P65*P25
P27=P34/{out_segments} ; from 1 to 0
P38=P27*P27*(3-2*P27) ; what is left of the path
P42=P11{pushed}+P12*(P36*COS(P41)+P37*SIN(P41))+P67*(P62*COS(P64)+P63*SIN(P64))-P20
P69=P15*(P37*COS(P41)-P36*SIN(P41))+P68*(P63*COS(P64)-P62*SIN(P64))
P24=P69*P38-P42*6*P27*(1-P27)/{out_ms}*1000
X(P20+P42*P38):(P24) Y(P28+P16*P25):(P17) Z(P29+P33*{out_ms}/3000*(1-P27*P27*P27)):(P33*P27*P27)
ENDWHILE
P30=P28+P16*P25
P29=P29+P33*{out_ms}/3000
"""
