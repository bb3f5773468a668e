"""The cut as PVT segments: a sinusoid locked to the spindle angle, with the servo's gain and phase inverted.

PVT passes through every point, and the angle of each segment is calculated from its number, so that no rounding
accumulates from turn to turn. Segment times are whole milliseconds, as this controller needs them.

The cut is whole turns, counted from the start of the feed, each ended at the segment that is nearest to its end.
Then the tool retracts from any phase of the lobe: the path continues, and is faded into the retracted position. So
at no angle is the tool further in than on the path.

The trim changes gain and phase of the path, blended over a turn at the end of a turn. A host sets P53, the factor
of the amplitude, and P54, added to the lobe angle, degrees. The program reads them once a turn and approaches them
by the same step in each segment of the turn; P55 and P56 are the values in the path, so the path has no step,
whatever is written. A value beyond the bounds, as by a line with a wrong digit, is set to the bound. A turn need
not be whole segments: the next one makes up for the rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from drivers.pmac.language.text import format_number
from drivers.pmac.programs import hold
from drivers.pmac.programs.along import with_along
from drivers.pmac.programs.push import with_push
from drivers.pmac.programs.setup import CutSetup, cut_values, refuse_endless
from profiles.compensations.path import LobedPath
from profiles.job import Job
from profiles.lobe import moving_out

SPINDLE_STEP = " Y(P28+P16*P25):(P17)"  # The statement that moves the spindle in a segment

_ON_PATH = """\
{along@P25-P24-P49}{push@P25-P24-P49}\
P27=P14+P56+P13*P25
X(P11{lifted}{pushed}+P12*P55*COS(P27)):(-P15*P55*SIN(P27)){y} Z(P21+P18*(P25-P24-P49)):(P19)
"""

# The same in other words: a line that is reported by its text alone is then known by its number.
_BACK_ON_PATH = _ON_PATH.replace("P25-P24-P49", "P25-P49-P24").replace("{lifted}", hold.LIFTED)

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


LOBE_PATH = (
    """\
{along@0}PVT{segment} ; the amplitude grows
P25=0 P45=0
WHILE(P25<P24)
P25=P25+1 P45=P45+1
P26=P25/P24
P27=P14+P13*P25
X(P11+P12*P26*COS(P27)):(-P15*P26*SIN(P27)){y} Z(P21):0
ENDWHILE
P30=0 ; turns begun
P31=P25 ; the segment in which the present turn ends
"""
    + hold.LOOP
    + """\
WHILE(P25<P31 OR {go_on} AND {not_held} AND P30<P23)
IF(P25!<P31)
P30=P30+1
P31=P24-0.5+P30*P32+P49
"""
    + hold.ONE_TURN
    + AT_TURN
    + """\
ENDIF
P25=P25+1 P45=P45+1
"""
    + IN_SEGMENT
    + _ON_PATH.replace("{lifted}", "")
    + """\
ENDWHILE
P43=P30 ; turns of the cut
P29=P21+P18*(P25-P24-P49) ; carriage at the end of the cut
"""
    + hold.OUT
    + """\
P33=0
IF(P30>0) P33=P19
P34={out_segments} ; the tool goes out, the carriage comes to rest
WHILE(P34>0)
P34=P34-1
P25=P25+1 P45=P45+1
P27=P14+P56+P13*P25
P35=P34/{out_segments} ; from 1 to 0
P36=P35*P35*(3-2*P35) ; what is left of the path
P37=P11{pushed}+P12*P55*COS(P27)-P20
P38=-P15*P55*SIN(P27)*P36-P37*6*P35*(1-P35)/{out_ms}*1000
X(P20+P37*P36):(P38){y} Z(P29+P33*{out_ms}/3000*(1-P35*P35*P35)):(P33*P35*P35)
ENDWHILE
"""
    + hold.HELD.replace("{lift}", hold.LIFT.replace("{fed}", "P25-P24-P49"))
    .replace("{enter}", hold.ENTER_ON_PATH)
    .replace("{cut}", _BACK_ON_PATH)
)
"""The lines that move the tool along the lobe, with the spindle as an axis of the program or as its time base.

Four steps: the amplitude grows clear of the part, whole turns are cut, the path is faded into the retracted
position, everything rests; from there a feed hold leads back to the second (`hold`). `{y}` moves the spindle,
empty where something else turns it; `{go_on}` is the condition for another turn.
"""

PROGRAM_NUMBER = 2

INTERPOLATION_LIMIT_UM = 0.05  # Permitted deviation of the cubics between the points from the sinusoid

LONGEST_SEGMENT_MS = 8
HALF_RUN_UP_MS = 500
SETTLE_MS = 400
"""Time in which the amplitude grows to its full value, clear of the part."""

_TEXT = """\
; {job}: the lobe at {hz} Hz as PVT segments of {segment} ms. x tool, y spindle, z carriage; all in counts.
; Between the points the cubics are within {error} um of the sinusoid.
P11={mean} ; tool at the mean depth
P12={amplitude} ; amplitude at the points: the wanted one over the gain of the servo
P13={step_deg} ; lobe angle of one segment, deg
P14={start_deg} ; lobe angle at the start, ahead by the lag of the servo, deg
P15={slope} ; greatest tool speed at the points, counts/s
P16={spindle_step} ; spindle counts in one segment
P17={spindle_speed} ; spindle speed, counts/s: {rpm} rpm
P18={feed_step} ; carriage counts in one segment
P19={feed_speed} ; carriage speed, counts/s
P20={out} ; tool retracted
P21={z} ; carriage clear of the part
P22={spindle_start} ; spindle at the start
P23={turns} ; turns of the cut
P24={ramp} ; segments in which the amplitude grows
P28=P22+{before} ; spindle at the first segment
P32={turn} ; segments in one turn
{along_values}{push_values}{end_marks}CLOSE
OPEN PROG {program}
CLEAR
ABS
{flag}=0 ; the host sets it to end the cut at the end of a turn
{no_trim}{no_hold}{push_begin}"""

RUN_UP = """\
PVT{half} ; the spindle runs up
X(P20):0 Y(P22+P17*{half}/6000):(P17/2) Z(P21):0
X(P20):0 Y(P22+P17*{half}/1000):(P17) Z(P21):0
PVT{approach} ; the tool goes to its mean depth, clear of the part
X(P11):0 Y(P28):(P17) Z(P21):0
"""

RUN_DOWN = """\
PVT{half} ; the spindle runs down
X(P20):0 Y(P30+P17*{half}*5/6000):(P17/2) Z(P29):0
X(P20):0 Y(P30+P17*{half}/1000):0 Z(P29):0
"""

_AT_REST = "P30=P28+P16*P25\nP29=P29+P33*{out_ms}/3000\n" + RUN_DOWN + "IF(P45=P25) P44=1\nCLOSE\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class PvtTiming:
    """The times of the program, all in whole ms."""

    segment_ms: int
    approach_ms: int
    ramp_segments: int
    retract_segments: int
    turn_segments: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PointScales:
    """Scales for the best fit of a sinusoid by cubics with matching ends and end velocities.

    Positions and velocities at the points are scaled so that the cubics between them fit the sinusoid in the
    least-squares sense; `error` is the largest remaining deviation, for an amplitude of 1. Without the scales the
    cubics run inside the sinusoid, by (w h)^4 / 384 at most.
    """

    position: float
    velocity: float
    error: float


@lru_cache(maxsize=64)
def point_scales(step_rad: float) -> PointScales:
    """Return the scales for points that are `step_rad` of the sinusoid apart."""
    phase = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)[:, None]
    u = np.linspace(0.0, 1.0, 33)[None, :]
    from_start = 2.0 * u**3 - 3.0 * u**2 + 1.0
    positions = from_start * np.cos(phase) + (1.0 - from_start) * np.cos(phase + step_rad)
    slopes = (u**3 - 2.0 * u**2 + u) * np.sin(phase) + (u**3 - u**2) * np.sin(phase + step_rad)
    basis = np.stack([positions.ravel(), (-step_rad * slopes).ravel()], axis=1)
    target = np.cos(phase + step_rad * u).ravel()
    scales = np.linalg.lstsq(basis, target, rcond=None)[0]
    error = float(np.abs(basis @ scales - target).max())
    return PointScales(position=float(scales[0]), velocity=float(scales[1]), error=error)


def interpolation_error_um(amplitude_um: float, frequency_hz: float, segment_ms: float) -> float:
    """Return the largest deviation of the cubics from the sinusoid."""
    return amplitude_um * point_scales(_step_rad(frequency_hz, segment_ms)).error


def _step_rad(frequency_hz: float, segment_ms: float) -> float:
    return 2.0 * math.pi * frequency_hz * segment_ms / 1000.0


def fits_whole_milliseconds(command: LobedPath, frequency_hz: float) -> bool:
    """Whether segments of 1 ms, the shortest possible, keep within the interpolation error limit."""
    return interpolation_error_um(command.largest_um, frequency_hz, 1.0) < INTERPOLATION_LIMIT_UM


def longest_segment_ms(command: LobedPath, frequency_hz: float) -> int:
    """Return the longest segment that keeps well within the interpolation error limit, at least 1 ms."""
    for segment_ms in range(LONGEST_SEGMENT_MS, 1, -1):
        if interpolation_error_um(command.largest_um, frequency_hz, segment_ms) < 0.5 * INTERPOLATION_LIMIT_UM:
            return segment_ms
    return 1


def out_ms(setup: CutSetup) -> int:
    """Return how long the tool takes between its mean depth and its retracted position, at its peak speed, ms."""
    way_mm = (setup.surface + setup.depth - setup.retracted) * setup.tool_count_um / 1000.0
    return math.ceil(moving_out.out_ms(way_mm))


def pvt_timing(job: Job, setup: CutSetup, command: LobedPath) -> PvtTiming:
    """Return the times for a job. Raises ProblemError: `program.too_long`."""
    turn_ms = 60_000.0 / job.spindle_speed_rpm
    # The end of a turn is checked once in a segment.
    segment_ms = max(1, min(longest_segment_ms(command, job.lobe_frequency_hz), math.floor(turn_ms)))
    approach_ms = out_ms(setup)
    turn_segments = turn_ms / segment_ms
    refuse_endless(setup.whole_turns * turn_segments)
    return PvtTiming(
        segment_ms=segment_ms,
        approach_ms=approach_ms,
        ramp_segments=math.ceil(SETTLE_MS / segment_ms),
        retract_segments=math.ceil(approach_ms / segment_ms),
        turn_segments=turn_segments,
    )


def pvt_program(job: Job, setup: CutSetup, command: LobedPath) -> str:
    """Return the text of the program that makes the tool follow `command` (um from the surface, infeed).

    The command must fit whole milliseconds. The program starts with the tool retracted and the carriage clear of
    the part, and ends the same way.

    Raises ProblemError: `program.too_long`.
    """
    timing = pvt_timing(job, setup, command)
    turns_per_ms = job.spindle_speed_rpm / 60_000.0
    spindle = turns_per_ms * setup.counts_per_turn  # counts/ms
    before_ms = HALF_RUN_UP_MS + timing.approach_ms
    number = format_number
    values = {
        **path_values(job, setup, command, timing, setup.spindle_start + spindle * before_ms),
        "y": SPINDLE_STEP,
        "spindle_step": number(spindle * timing.segment_ms),
        "spindle_speed": number(1000.0 * spindle),
        "spindle_start": number(setup.spindle_start),
        "before": number(spindle * before_ms),
        "half": HALF_RUN_UP_MS,
        "program": PROGRAM_NUMBER,
    }
    text = with_along(_TEXT + RUN_UP + LOBE_PATH + _AT_REST, command, setup, job, timing.segment_ms)
    text = with_push(text, job, setup, command.push_um, timing.segment_ms)
    return text.format(**values)


def path_values(
    job: Job, setup: CutSetup, command: LobedPath, timing: PvtTiming, first_spindle: float
) -> dict[str, object]:
    """Return the template values of `LOBE_PATH`; the spindle is at `first_spindle` where its lines begin."""
    turns_per_ms = job.spindle_speed_rpm / 60_000.0
    first_turns = first_spindle / setup.counts_per_turn
    amplitude = command.amplitude_um / setup.tool_count_um
    scales = point_scales(_step_rad(job.lobe_frequency_hz, timing.segment_ms))
    error_um = interpolation_error_um(command.largest_um, job.lobe_frequency_hz, timing.segment_ms)
    lobe_deg = 360.0 * command.lobes
    number = format_number
    return {
        **cut_values(job, setup, timing.segment_ms),
        "hz": number(job.lobe_frequency_hz),
        "error": f"{error_um:.4f}",
        "mean": number(setup.surface + command.mean_um / setup.tool_count_um),
        "amplitude": number(amplitude * scales.position),
        "step_deg": number(lobe_deg * turns_per_ms * timing.segment_ms),
        "start_deg": number(math.fmod(lobe_deg * first_turns - command.lobes * command.phase_deg, 360.0)),
        "slope": number(amplitude * scales.velocity * 2.0 * math.pi * job.lobe_frequency_hz),
        "feed_step": number(setup.carriage_per_turn * turns_per_ms * timing.segment_ms),
        "feed_speed": number(1000.0 * setup.carriage_per_turn * turns_per_ms),
        "ramp": timing.ramp_segments,
        "turn": number(timing.turn_segments),
        "out_segments": timing.retract_segments,
        "hold_first": "P24",
        "no_trim": BEGIN,
        **live_trim_values(command.lobes),
        **hold.hold_values(
            job.feed_mm_per_rev,
            60_000.0 / job.spindle_speed_rpm,
            timing.segment_ms,
            timing.retract_segments,
            setup.tool_count_um,
            setup.land_turns,
        ),
        "out_ms": timing.retract_segments * timing.segment_ms,
        "approach": timing.approach_ms,
    }
