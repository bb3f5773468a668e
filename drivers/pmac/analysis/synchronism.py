"""Findings about the tool against the spindle: what stops them together, and what lets them drift apart.

Tool and spindle are motors of one program here, so that a stop stops both. With a spindle that turns independently
(an external time base), the same stop loses the angle: that is why it is reported.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from drivers.pmac.analysis.endless import STEADY_TURNS
from drivers.pmac.analysis.findings import FindingCode, ProgramFinding, Subject, finding, moves
from drivers.pmac.analysis.moves import RAMPED
from drivers.pmac.analysis.timeline import Timeline, turning_points
from drivers.pmac.requests import BlendBreak, DwellRequest, Halt
from drivers.pmac.trajectory.pieces import Cubic, position_at

DRIFT_DEG = 1e-3  # Least reported drift per turn: a degree in a thousand turns

SPEED_TOLERANCE = 1e-6

USELESS_LOBE_DEG = 60.0
"""Error of the lobe angle at which a compensation no longer removes anything: |1 - exp(j 60 deg)| = 1."""

_WHOLE = 0.25
"""A path whose lobes per turn are further than this from an integer is not drifting: it does not fit the turn."""

_HALVINGS = 60


def synchronism_findings(subject: Subject) -> list[ProgramFinding]:
    """Return what disturbs the synchronism of tool and spindle in the cut."""
    if not subject.cut:
        return []
    return [*_stops(subject), *_feedrate(subject), *_check_speed(subject), *_drift(subject)]


def _stops(subject: Subject) -> list[ProgramFinding]:
    """Find DWELL, or a blend that breaks, between the first and the last move of the cut."""
    inside = subject.walk.steps[subject.cut[0].step : subject.cut[-1].step]
    kinds = {FindingCode.DWELL_IN_CUT: DwellRequest, FindingCode.STOP_IN_CUT: BlendBreak | Halt}
    findings = []
    for code, kind in kinds.items():
        steps = [step for step in inside if isinstance(step.request, kind)]
        if steps:
            lines = tuple(sorted({subject.place_of(step.program, step.line) for step in steps}))
            ms = sum(step.ends_ms - step.begins_ms for step in steps)
            findings.append(finding(code, lines, stops=len(steps), ms=ms))
    return findings


def _feedrate(subject: Subject) -> list[ProgramFinding]:
    by_feed = [move for move in subject.cut if move.mode in RAMPED and not move.by_move_time]
    if not by_feed:
        return []
    times = [move.asked.tm_ms for move in by_feed]
    lines = subject.lines(by_feed)
    return [
        finding(FindingCode.FEEDRATE_IN_CUT, lines, moves=len(by_feed), least_ms=min(times), most_ms=max(times))
    ]


def _check_speed(subject: Subject) -> list[ProgramFinding]:
    """Check that the spindle turns evenly while the tool moves; the first and the last such move do not count."""
    tool, spindle = subject.tool, subject.spindle
    assert tool is not None and spindle is not None
    together = [move for move in subject.cut if moves(move, tool)][1:-1]
    speeds = [subject.rpm(move.motors[spindle].commanded / move.used.tm_ms) for move in together]
    if not speeds:
        return []
    slowest, fastest = min(speeds), max(speeds)
    if fastest - slowest <= SPEED_TOLERANCE * abs(fastest):
        return []
    usual = sorted(speeds)[len(speeds) // 2]
    pairs = zip(together, speeds, strict=True)
    lines = subject.lines(move for move, rpm in pairs if abs(rpm - usual) > SPEED_TOLERANCE * abs(usual))
    return [finding(FindingCode.SPEED_CHANGES, lines, slowest_rpm=slowest, fastest_rpm=fastest, usual_rpm=usual)]


def _drift(subject: Subject) -> list[ProgramFinding]:
    lobes = _lobes(subject)
    if lobes is None:
        return []
    lines = subject.lines(subject.cut)
    per_turn = round(lobes.per_turn)
    if not per_turn or abs(lobes.per_turn - per_turn) > _WHOLE:
        return [finding(FindingCode.NO_WHOLE_LOBES, lines, lobes=lobes.per_turn)]
    # One turn later the tool is where it was when the spindle has made the angle of `per_turn` lobes.
    drift_deg = 360.0 * (per_turn / lobes.per_turn - 1.0)
    if abs(drift_deg) < DRIFT_DEG:
        return []
    turns = USELESS_LOBE_DEG / per_turn / abs(drift_deg)
    values = {
        "lobes": per_turn,
        "counts_per_turn": drift_deg / 360.0 * subject.machine.spindle.counts_per_rev,
        "deg_per_turn": drift_deg,
        "useless_after_turns": turns,
        "useless_after_s": 60.0 * turns / abs(lobes.speed_rpm),
    }
    return [finding(FindingCode.DRIFT, lines, **values)]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lobes:
    """Repetitions of the tool's path per turn, and the mean spindle speed over them."""

    per_turn: float
    speed_rpm: float


def _lobes(subject: Subject) -> _Lobes | None:
    """Return the lobes of the steady cut, None where it is too short to have any.

    The tool's path is cut at the middle of its stroke; between crossings in the same sense the spindle makes the
    angle of one lobe. Inward and outward crossings are treated alike, so that a feed of the tool does not count as
    drift. The instants are exact from the cubics.
    """
    tool, spindle = subject.tool, subject.spindle
    assert tool is not None and spindle is not None
    begin_ms, end_ms = _steady(subject, spindle)
    timeline, turn = subject.timeline, subject.machine.spindle.counts_per_rev
    lowest, highest = timeline.extent(tool, begin_ms, end_ms)
    crossings = list(_crossings(timeline, tool, 0.5 * (lowest + highest), begin_ms, end_ms))
    known = []
    for inward in (True, False):
        places = [timeline.position(spindle, instant) for instant, rising in crossings if rising is inward]
        lobes = _per_turn(places, turn)
        if lobes is not None:
            known.append(lobes)
    turned = timeline.position(spindle, end_ms) - timeline.position(spindle, begin_ms)
    if not known or not turned:
        return None
    per_turn = len(known) / sum(1.0 / lobes for lobes in known)
    return _Lobes(per_turn=per_turn, speed_rpm=subject.rpm(turned / (end_ms - begin_ms)))


def _per_turn(places: Sequence[float], turn: float) -> float | None:
    """Return the number of crossings per turn; like is compared with like, one turn apart, where there are two."""
    if len(places) < 2 or places[-1] == places[0]:
        return None
    way = abs(places[-1] - places[0]) / (len(places) - 1)
    whole = max(1, round(turn / way))
    later = [abs(place - before) for before, place in zip(places, places[whole:], strict=False)]
    return whole * turn * len(later) / sum(later) if later else turn / way


def _steady(subject: Subject, spindle: int) -> tuple[float, float]:
    """Return a stretch of the cut far from its start and end: some turns before an endless loop was left."""
    cut, timeline = subject.cut, subject.timeline
    begin_ms, end_ms = cut[0].ends_ms, cut[-1].begins_ms
    for left in subject.walk.left:
        if cut[0].step < left.step <= cut[-1].step:
            end_ms = min(end_ms, subject.walk.steps[left.step].begins_ms)
    if end_ms <= begin_ms:
        return cut[0].begins_ms, cut[-1].ends_ms
    # The middle, or what follows it where the loop was left as soon as it was steady.
    way = timeline.position(spindle, end_ms) - timeline.position(spindle, begin_ms)
    speed = abs(way) / (end_ms - begin_ms)
    length_ms = STEADY_TURNS * subject.machine.spindle.counts_per_rev / speed if speed else end_ms - begin_ms
    if length_ms >= end_ms - begin_ms:
        return begin_ms, end_ms
    if subject.walk.left:
        return end_ms - length_ms, end_ms
    middle_ms = 0.5 * (begin_ms + end_ms)
    return middle_ms - 0.5 * length_ms, middle_ms + 0.5 * length_ms


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
