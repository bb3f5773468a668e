"""Count how often the tool oscillates in a turn of the spindle, from the actual motion.

The tool's path is cut at the middle of its stroke; between crossings in the same sense the spindle makes the angle
of one lobe. Inward and outward crossings are treated alike, so that a feed of the tool does not count as drift.
The instants are exact from the cubics.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from drivers.pmac.analysis.endless import STEADY_TURNS
from drivers.pmac.analysis.subject import Subject
from drivers.pmac.analysis.timeline import Timeline, turning_points
from drivers.pmac.trajectory.pieces import Cubic, position_at

_HALVINGS = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Lobes:
    """Repetitions of the tool's path per turn, and the mean spindle speed over them."""

    per_turn: float
    speed_rpm: float


def lobes_of(subject: Subject) -> Lobes | None:
    """Return the lobes of the steady cut, None where it is too short to have any."""
    tool, spindle, cut = subject.tool, subject.spindle, subject.cut
    if tool is None or spindle is None or not cut:
        return None
    begin_ms, end_ms = _steady(subject)
    timeline, turn = subject.timeline, subject.machine.spindle.counts_per_rev
    lowest, highest = timeline.extent(tool, begin_ms, end_ms)
    crossings = list(_crossings(timeline, tool, 0.5 * (lowest + highest), begin_ms, end_ms))
    found = []
    for inward in (True, False):
        places = [timeline.position(spindle, instant) for instant, rising in crossings if rising is inward]
        found.append(_per_turn(places, turn))
    turned = timeline.position(spindle, end_ms) - timeline.position(spindle, begin_ms)
    known = [lobes for lobes in found if lobes is not None]
    if not known or not turned:
        return None
    per_turn = len(known) / sum(1.0 / lobes for lobes in known)
    return Lobes(per_turn=per_turn, speed_rpm=subject.rpm(turned / (end_ms - begin_ms)))


def _per_turn(places: Sequence[float], turn: float) -> float | None:
    """Return the number of crossings per turn; like is compared with like, one turn apart, where there are two."""
    if len(places) < 2 or places[-1] == places[0]:
        return None
    way = abs(places[-1] - places[0]) / (len(places) - 1)
    whole = max(1, round(turn / way))
    later = [abs(place - before) for before, place in zip(places, places[whole:], strict=False)]
    return whole * turn * len(later) / sum(later) if later else turn / way


def _steady(subject: Subject) -> tuple[float, float]:
    """Return a stretch of the cut far from its start and end: some turns before an endless loop was left."""
    cut = subject.cut
    begin_ms, end_ms = cut[0].ends_ms, cut[-1].begins_ms
    for left in subject.walk.left:
        if cut[0].step < left.step <= cut[-1].step:
            end_ms = min(end_ms, subject.walk.steps[left.step].begins_ms)
    if end_ms <= begin_ms:
        return cut[0].begins_ms, cut[-1].ends_ms
    # The middle, or what follows it where the loop was left as soon as it was steady.
    speed = _mean_speed(subject, begin_ms, end_ms)
    wanted_ms = STEADY_TURNS * subject.machine.spindle.counts_per_rev / speed if speed else end_ms - begin_ms
    if wanted_ms >= end_ms - begin_ms:
        return begin_ms, end_ms
    if subject.walk.left:
        return end_ms - wanted_ms, end_ms
    middle_ms = 0.5 * (begin_ms + end_ms)
    return middle_ms - 0.5 * wanted_ms, middle_ms + 0.5 * wanted_ms


def _mean_speed(subject: Subject, begin_ms: float, end_ms: float) -> float:
    assert subject.spindle is not None
    way = subject.timeline.position(subject.spindle, end_ms) - subject.timeline.position(subject.spindle, begin_ms)
    return abs(way) / (end_ms - begin_ms)


def _crossings(
    timeline: Timeline, index: int, level: float, begin_ms: float, end_ms: float
) -> Iterator[tuple[float, bool]]:
    """Yield the instants at which a motor crosses a level, and whether it rises there."""
    above: bool | None = None
    for piece, piece_begins_ms in zip(timeline.pieces, timeline.begins_ms, strict=True):
        first, last = max(begin_ms - piece_begins_ms, 0.0), min(end_ms - piece_begins_ms, piece.duration_ms)
        if last <= first:
            continue
        cubic = piece.cubics[index]
        instants = sorted({first, last, *(t for t in turning_points(cubic) if first < t < last)})
        for start, stop in pairwise(instants):
            # The sign is carried over the joints: a value that is zero except for rounding is no crossing.
            before = position_at(cubic, start) > level if above is None else above
            above = position_at(cubic, stop) > level
            if above is not before:
                yield piece_begins_ms + _root(cubic, level, start, stop), above


def _root(cubic: Cubic, level: float, start: float, stop: float) -> float:
    """Return where a cubic that is monotonic from `start` to `stop` crosses a level."""
    rises = position_at(cubic, stop) > position_at(cubic, start)
    for _ in range(_HALVINGS):
        middle = 0.5 * (start + stop)
        if (position_at(cubic, middle) > level) is rises:
            stop = middle
        else:
            start = middle
    return 0.5 * (start + stop)
