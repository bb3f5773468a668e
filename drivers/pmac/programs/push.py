"""The tool's offset against the push of the cut: fed forward at the entry, and at the return from a feed hold.

The cut pushes the tool out by the force times the compliance of its loop, P72; the integrator takes it over, P74,
with the time constant of the loop, and goes on pushing once the tool is out of the part. So the path is offset by
what the integrator has not taken over yet, P72 P71 - P74, with P71 from 0 to 1 while the chip begins; after a hold
the program knows how far the integrator has relaxed meanwhile.

The chip begins late rather than early: what stands high is cut by the land of the turns that follow, what was cut
too deep stays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.language.text import format_number
from drivers.pmac.programs.setup import APPROACH_MM, CutSetup
from profiles.compensations.path import AlongCut, LobedPath
from profiles.job import Job

MOST_BLEND_TURNS, LEAST_BLEND_TURNS = 2.0, 0.5
TURNS_OF_LAND = 0.25  # fraction of the turns that cut a place in which the chip begins

_VALUES = """\
P72={push} ; push of the cut, counts
P73={relaxes} ; fraction of it that the integrator takes over in a segment
P76={step} ; blend of a segment
"""

_BEGIN = """\
P70=0 P71=0 P74=0 ; offset, fraction of the push in effect, what the integrator has taken over
P77={contact} ; segment of the feed at which the chip begins
"""

_RESUME = """\
P71=0
P74=P74*EXP((P52-P25-{{hold_in}})*{decays}) ; the integrator relaxes while the tool is out
P70=0-P74
"""


def _in_segment(fed: str) -> str:
    """Return the lines of a segment; `fed` are the segments of the feed so far."""
    return f"IF({fed}>P77 AND P71<0.999) P71=P71+P76\nP74=P74+(P72*P71-P74)*P73\nP70=P72*P71-P74\n"


def blend_turns(setup: CutSetup) -> float:
    """Return the turns from the face of the part within which the push comes into effect."""
    return min(MOST_BLEND_TURNS, max(LEAST_BLEND_TURNS, TURNS_OF_LAND * setup.land_turns))


def with_push(text: str, job: Job, setup: CutSetup, push_um: float, segment_ms: float) -> str:
    """Return a template with the lines against a push of `push_um` before it relaxes; none where that is 0.

    It marks its places: `{push_values}`, `{push_begin}`, `{push_resume}`, `{push@FED}` in a segment, and
    `{pushed}` in a position of the tool.
    """
    turn_ms, number = 60_000.0 / job.spindle_speed_rpm, format_number
    decays = segment_ms / setup.relaxation_ms
    values = {
        "push": number(push_um / setup.tool_count_um),
        "relaxes": number(-math.expm1(-decays)),
        "step": number(1.0 / max(1, round(blend_turns(setup) * turn_ms / segment_ms))),
        "contact": number(APPROACH_MM / job.feed_mm_per_rev * turn_ms / segment_ms),
        "decays": number(decays),
    }
    lines = {"push_values": _VALUES, "push_begin": _BEGIN, "push_resume": _RESUME}
    for name, piece in lines.items():
        text = text.replace(f"{{{name}}}", piece.format(**values) if push_um else "")
    for fed in ("P25-P24-P49", "P25-P49-P24", "(P25-P49)", "P25"):
        text = text.replace(f"{{push@{fed}}}", _in_segment(fed) if push_um else "")
    return text.replace("{pushed}", "+P70" if push_um else "")


def left_of_push(setup: CutSetup, turn_ms: float, since_ms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the fraction of the push that moves the tool, by the time since the chip began: the program's offset.

    It comes into effect evenly over the blend, and the integrator takes it over.
    """
    blend_ms, t_ms = blend_turns(setup) * turn_ms, np.maximum(since_ms, 0.0)
    rising_ms, relaxes_ms = np.minimum(t_ms, blend_ms), setup.relaxation_ms
    if math.isinf(relaxes_ms):
        return rising_ms / blend_ms
    risen = -np.expm1(-rising_ms / relaxes_ms) * relaxes_ms / blend_ms
    return np.asarray(risen * np.exp(-(t_ms - rising_ms) / relaxes_ms), dtype=np.float64)


_FACTOR, _FURTHER, _PLACE, _STEP, _BEGIN = "P59", "P79", "P80", "P81", "P82"
_OF_FACTOR, _OF_MEAN = 83, 89  # first variables of the two polynomials, from the power of 1 on
_FEEDS = ("P25-P24-P49", "P25-P49-P24")


def with_along(text: str, command: LobedPath, setup: CutSetup, job: Job, segment_ms: float) -> str:
    """Return a template with the lines that change its path along the cut; none where `command` does not change.

    It marks its places: `{along_values}`, `{along@FED}` in a segment and `{along@0}` before the feed; the terms of
    the tool's position are those of `LOBE_PATH`.
    """
    along = command.along
    powers = along.powers(command.lobes)
    if not powers and not along.mean_um:
        for mark in ("{along_values}", "{along@0}", "{along@in}", *(f"{{along@{fed}}}" for fed in _FEEDS)):
            text = text.replace(mark, "")
        return text
    text = text.replace("{along_values}", _values(along, powers, setup, job, segment_ms))
    text = text.replace("{along@0}", _in_segment("0", len(powers), len(along.mean_um)))
    text = text.replace("{along@in}", _in_segment("P25+{hold_out}-P24-P49", len(powers), len(along.mean_um)))
    for fed in _FEEDS:
        text = text.replace(f"{{along@{fed}}}", _in_segment(fed, len(powers), len(along.mean_um)))
    for term in ("P12*P55", "P15*P55", "P12*P26", "P15*P26"):
        text = text.replace(term, f"{term[:3]}*{_FACTOR}{term[3:]}")
    return text.replace("X(P11+P12", f"X(P11+{_FURTHER}*P26+P12").replace("{pushed}", f"{{pushed}}+{_FURTHER}")


def _values(along: AlongCut, powers: Sequence[float], setup: CutSetup, job: Job, segment_ms: float) -> str:
    number, half = format_number, along.half_length_mm * setup.carriage_per_turn / job.feed_mm_per_rev
    step = setup.carriage_per_turn * job.spindle_speed_rpm / 60_000.0 * segment_ms / half
    begin = (setup.carriage_start - setup.carriage_middle) / half
    lines = [
        f"{_STEP}={number(step)} ; half lengths of the cut in one segment",
        f"{_BEGIN}={number(begin)} ; half lengths past its middle at the start",
    ]
    mean = [each / setup.tool_count_um for each in along.mean_um]
    for first, coefficients, of in ((_OF_FACTOR, powers, "amplitude"), (_OF_MEAN, mean, "mean")):
        for power, value in enumerate(coefficients, start=1):
            lines.append(f"P{first + power - 1}={number(value)} ; {of} along the cut, power {power}")
    return "\n".join(lines) + "\n"


def _in_segment(fed: str, powers: int, mean: int) -> str:
    factor, further = (_horner(first, count) for first, count in ((_OF_FACTOR, powers), (_OF_MEAN, mean)))
    return f"{_PLACE}={_BEGIN}+{_STEP}*({fed})\n{_FACTOR}=1+{factor}\n{_FURTHER}={further}\n"


def _horner(first: int, count: int) -> str:
    """Return P80 (c1 + P80 (c2 + ...)) of the variables from `first` on; 0 without any."""
    text = ""
    for number in reversed(range(first, first + count)):
        text = f"{_PLACE}*(P{number}{'+' + text if text else ''})"
    return text or "0"
