"""The change of a path along the cut, in a program of segments: amplitude and mean as polynomials of the feed.

In each segment of the feed P59 is the factor of the amplitude, and P79 what is added to the mean, at the place P80
of the carriage, in half lengths of the cut past its middle. While the amplitude grows, clear of the part, they are
those of the beginning; while the tool goes out, those of the last segment. Their own rate of change, some um a
second, is left out of the speed at the points.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers.pmac.language.text import format_number
from drivers.pmac.programs.setup import CutSetup
from profiles.compensations.path import AlongCut, LobedPath
from profiles.job import Job

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
