"""One cell of the matrix: one fault in one situation, what was seen of it, and whether that is right."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise, zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import cast

import pytest

from console.session.errors import SessionError
from console.session.station.commands import Measure
from console.session.station.context import Shop
from console.session.station.handlers import measure
from console.session.station.state import STALE_S, Activity
from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.expected_replies import expected_replies
from tests.branching import Branching
from tests.matrix.faults import NO_FAULT, SAME, TABLE, UNKNOWN, Row, right
from tests.matrix.rig import (
    MAY_MOVE,
    MOTORS,
    MOVING,
    Begun,
    Moment,
    Rig,
    Sent,
    Situation,
    Watched,
    build_rig,
    enter,
    lathe_that_holds,
    planned_once,
    short_job,
)

CARD_ENDS_S = 2.2
"""A card that is alone ends what moves within 2 s of the last lease."""

WATCHED_S = 0.3
JITTER = {name: counts for name, counts in zip(MOTORS, (5.0, 20.0, 5.0), strict=True)}
"""Counts by which an axis may stir that nobody moves: 1 um, 0.7 deg, 5 um."""

READ_COUNTS = 1.0

STOP_GAP_S = 0.29
"""Between two repetitions of a stop that is not proven: 0.2 s, or a try to close a buffer in between."""


class Kind(StrEnum):
    """What a host sends, as far as it is more than a look."""

    ABORT = "^A"
    KILL = "^K"
    RENEWAL = "renewals"
    LINE = "lines"


_LEASE = re.compile(r"M70=\d+( |$)")
_GUARD_ENDED = "P1003=0"
_WAY_BACK = re.compile(r"CLOSE|((I(3=2|6=1|4=0|64=1) )*P1001=\d+ P1001)?")
"""What brings link and card back in step: it may be sent again and again, and changes nothing of the machine."""


def kind_of(sent: Sent) -> Kind | None:
    """What a piece is, None for a look and for what keeps the link in step."""
    if sent.urgent:
        return {b"\x01": Kind.ABORT, b"\x0b": Kind.KILL}[sent.data]
    line = sent.line
    rest = _LEASE.sub("", line)
    if line == "\x18" or _WAY_BACK.fullmatch(line):
        return None
    if line == _GUARD_ENDED or (rest != line and (not rest or expected_replies(rest).reads_only)):
        return Kind.RENEWAL
    return None if expected_replies(line).reads_only else Kind.LINE


def restless(watched: Watched, row: Row, *, lost: bool, idle: bool) -> list[str]:
    """What moves behind the end; a machine that is lost is given the time in which the card ends it.

    A lost machine whose drives are off may coast, and where an encoder does not count nobody can see it coast.
    What another host moves while this one is `idle`, and does nothing, is that one's.
    """
    anothers = row.moves if idle else frozenset()
    if lost:
        watched.sim.wait(CARD_ENDS_S)
    begun_s = watched.sim.now_s()
    watched.sim.wait(WATCHED_S)
    moments = watched.sim.since(begun_s)
    return [
        f"{axis} moves behind the end"
        for place, axis in enumerate(MOTORS)
        if axis != row.unseen
        and axis not in anothers
        and way(moments, place) > JITTER[axis]
        and (not lost or moments[-1].powered[place])
    ]


def way(moments: list[Moment], place: int) -> float:
    """Return how far the iron of an axis has gone to and fro, counts."""
    track = [moment.true_position[place] for moment in moments]
    return max(track) - min(track)


def energised(watched: Watched, begun_s: float, row: Row) -> list[str]:
    """Amplifiers that came on after the fault, in whatever situation: nobody has ordered that."""
    since = (axis for at_s, axis in watched.sim.energised if at_s >= begun_s)
    return [f"{axis} energised" for axis in since if axis not in row.moves]


def unasked(moments: list[Moment], may_move: Set[AxisName], jitters: float = 1.0) -> list[str]:
    return [
        f"{axis} moves unasked by {way(moments, place):.0f} counts"
        for place, axis in enumerate(MOTORS)
        if axis not in may_move and way(moments, place) > jitters * JITTER[axis]
    ]


def slow_to_stop(sent: list[Sent], begun_s: float) -> list[str]:
    """What moves and is not seen any more is stopped before what was seen last is stale."""
    first_s = next((piece.at_s for piece in sent if piece.urgent), float("inf"))
    late_s = first_s - begun_s
    return [] if late_s <= STALE_S + STOP_GAP_S else [f"the first stop {late_s:.2f} s behind the fault"]


def slow_to_repeat(sent: list[Sent], *, lost: bool) -> list[str]:
    """A stop that is never proven goes out five times a second."""
    stops = [piece.at_s for piece in sent if piece.urgent]
    gaps = [after - before for before, after in pairwise(stops)]
    if not lost or max(gaps, default=0.0) <= STOP_GAP_S:
        return []
    return [f"{max(gaps):.2f} s between two stops"]


def after_stop(sent: Sequence[Sent]) -> list[str]:
    """Lines that move or write behind the first stop."""
    stops = [place for place, piece in enumerate(sent) if piece.urgent]
    behind = sent[stops[0] :] if stops else []
    return [f"behind a stop: {piece.line}" for piece in behind if kind_of(piece) is Kind.LINE]


def misread(watched: Watched, snapshot: Snapshot) -> list[str]:
    """Positions and amplifiers that the card did not have at any moment between request and reply."""
    moments = watched.sim.since(snapshot.at_s - watched.lathe.round_trip_s - 0.005, snapshot.at_s)
    wrong = []
    for place, (axis, state) in enumerate(zip(MOTORS, snapshot.axes, strict=True)):
        told = [moment.told[place] for moment in moments]
        if not min(told) - READ_COUNTS <= state.position <= max(told) + READ_COUNTS:
            wrong.append(f"{axis} is shown at {state.position}, was {min(told)} to {max(told)}")
        if ("amplifier_enabled" in state.flags) not in {moment.powered[place] for moment in moments}:
            wrong.append(f"{axis}: amplifier misread")
    return wrong


SETTLED_S, STEP_S = 0.6, 0.1
"""How long the station looks on before its end state counts, and between two of its turns."""

NO_ANSWER = {"link.silent", "link.out_of_step", "link.not_in_step"}


@dataclass(frozen=True, kw_only=True)
class Seen:
    """How a cell ended: activity, what was told (alarms and refusals), what was sent since the fault came.

    `mended` is the activity once the fault is gone. `lines` are those that move or write, of the whole cell.
    `done` is whether a cut counts as one, so that its part may be measured.
    """

    end: Activity
    armed: bool
    told: tuple[str, ...]
    sent: tuple[Kind, ...]
    mended: Activity
    lines: tuple[str, ...]
    wrong: tuple[str, ...]
    done: bool


SHORT_WAY = frozenset({Situation.OFF, Situation.IDLE})
"""What is come to at once. To everything else the way is made once, and gone on from for each fault."""

_WAYS: dict[tuple[Situation, Strategy, float, bool], Branching[Row, Seen]] = {}


def run_cell(row: Row, situation: Situation, records: Path) -> Seen:
    """Have a fault in a situation, wait until the console has come to an end, mend it, and look on."""
    if row.early or situation in SHORT_WAY:
        return _cell(situation, records, row, lambda: row)
    way = situation, row.strategy, row.cut_mm, row.shell
    if way not in _WAYS:
        planned_once(short_job(row.cut_mm), lathe_that_holds(shell=row.shell).machine, row.strategy)
        _WAYS[way] = Branching(lambda wait: _cell(situation, records, row, wait))
    return _WAYS[way](row)


def _cell(situation: Situation, records: Path, way: Row, which: Callable[[], Row]) -> Seen:
    """`which` is asked for the fault when it is to happen: one of the cut of `way`."""
    rig = build_rig(records, shell=way.shell)
    wrong: list[str] = []
    rig.looks.append(lambda snapshot: wrong.extend(misread(rig, snapshot)))
    met: list[Row] = []

    def happen() -> None:
        met.append(which())
        met[0].inject(rig.sim)

    begun = Begun(rig=rig, fault=happen, early=way.early, strategy=way.strategy, cut_mm=way.cut_mm)
    enter(situation, begun)
    assert begun.at_s is not None
    (row,) = met
    return _seen(rig, row, situation, begun.at_s, wrong)


def _seen(rig: Rig, row: Row, situation: Situation, begun_s: float, wrong: list[str]) -> Seen:
    """What is seen from the fault on. `wrong` is what was found so far, and grows."""
    _settle(rig)
    state, end_s = rig.state, rig.sim.now_s()
    told = (*(a.problem.code for a in state.alarms), *(p.code for p in state.refusals))
    sent = [piece for piece in rig.wire.sent if piece.at_s >= begun_s]
    end = state.activity
    wrong += restless(rig, row, lost=end is Activity.LOST, idle=end is Activity.READY)
    _mend(rig)
    after = rig.sim.since(begun_s)
    may_move = {*MAY_MOVE.get(situation, ()), *row.moves}
    switched_off = next(place for place, piece in enumerate(rig.wire.sent) if piece.urgent)
    wrong += [
        *energised(rig, begun_s, row),
        *unasked(after, may_move),
        *after_stop(rig.wire.sent[switched_off + 1 :]),
    ]
    wrong += slow_to_repeat(sent, lost=end is Activity.LOST)
    if situation in MOVING and NO_ANSWER & set(told):
        wrong += slow_to_stop(sent, begun_s)
    if any(a.problem.code == "session.fault" for a in rig.state.alarms):
        wrong.append(f"an exception: {rig.state.alarms}")
    return Seen(
        end=state.activity,
        armed=state.armed is not None,
        told=tuple(dict.fromkeys(told)),
        sent=tuple(kind for kind in Kind if kind in {kind_of(piece) for piece in sent if piece.at_s <= end_s}),
        mended=rig.state.activity,
        lines=tuple(piece.line for piece in rig.wire.sent if kind_of(piece) is Kind.LINE),
        wrong=tuple(dict.fromkeys(wrong)),
        done=_may_be_measured(rig),
    )


def _may_be_measured(rig: Rig) -> bool:
    """Whether the cut counts as done; of another one the order to measure is refused, past all else against it."""
    if rig.state.cut_done:
        return True
    rig.context.shop = cast(Shop, object())  # a gauge is there; it is not asked
    with pytest.raises(SessionError) as refused:
        measure(rig.context, Measure())
    assert [problem.code for problem in refused.value.problems] == ["session.nothing_cut"]
    return False


def _settle(rig: Rig) -> None:
    for _ in range(round(SETTLED_S / STEP_S)):
        if rig.state.activity is Activity.LOST:
            return
        rig.step(STEP_S)


def _mend(rig: Rig) -> None:
    """Everything is put right; a card that was shut down is switched off and on."""
    if rig.sim.faults.shut_down_s is not None:
        rig.sim.faults.clear()
        rig.sim.power_cycle()
    else:
        rig.sim.faults.clear()
    for _ in range(3):
        rig.step(STEP_S)


HOLD = "M26=1"
"""Asks a cut to end at the end of its turn: it moves nothing, and may be sent twice."""

STRONGEST_FIRST = (Kind.LINE, Kind.RENEWAL)
_FOUND: dict[tuple[Situation, Strategy, float, bool], Seen] = {}


def without_fault(situation: Situation, row: Row) -> Seen:
    """What is seen without the fault of a row; found once."""
    way = situation, row.strategy, row.cut_mm, row.shell
    if way not in _FOUND:
        with TemporaryDirectory() as folder:
            sound = replace(NO_FAULT, strategy=row.strategy, cut_mm=row.cut_mm, shell=row.shell)
            _FOUND[way] = run_cell(sound, situation, Path(folder))
    return _FOUND[way]


def problems(row: Row, situation: Situation, seen: Seen) -> list[str]:
    """Return everything that is not as it should be."""
    target = right(row.name, situation)
    told = [] if any(_fits(way, seen) for way in target.split(" or ")) else [f"{_said(seen)}, not {target}"]
    again = _sent_again(seen, without_fault(situation, row))
    return [*told, *seen.wrong, *again, *_not_mended(seen, target), *_not_done(situation, seen, target)]


def unharmed(row: Row, situation: Situation) -> bool:
    """Whether the fault makes no difference there."""
    return TABLE[row.name][situation] == SAME


def _fits(target: str, seen: Seen) -> bool:
    state, _, codes = target.partition(": ")
    end, _, sent = state.partition(", ")
    return end == _end(seen) and sent_fits(sent, seen.sent) and told_fits(codes.split(), seen.told)


def _end(seen: Seen) -> str:
    return "armed" if seen.armed and seen.end is Activity.READY else seen.end.value


def sent_fits(target: str, sent: Collection[Kind]) -> bool:
    """The strongest that was sent is what is wanted; in parentheses is what may be sent besides."""
    may = {word.strip("()") for word in target.split()}
    must = {word for word in target.split() if not word.startswith("(")}
    return must <= set(strongest(sent)) <= may


def strongest(sent: Collection[Kind]) -> tuple[str, ...]:
    """The stops, or where there are none the strongest thing that was sent."""
    stops = tuple(kind.value for kind in Kind if kind in sent and kind in (Kind.ABORT, Kind.KILL))
    others = [kind.value for kind in STRONGEST_FIRST if kind in sent]
    return stops or tuple(others[:1]) or ("nothing",)


BEHIND = ("machine.left_behind", "machine.tool_left_behind", "machine.behind_after_change")


def told_fits(target: list[str], told: tuple[str, ...]) -> bool:
    """Each code is told, and nothing else.

    That the outcome of a look with its lease is unknown may be told, and of a fault how far the axis was behind.
    """
    left = list(told)
    for code in target:
        found = next((one for one in code.split("/") if one in left), None)
        if found is None:
            return False
        left.remove(found)
    may = {UNKNOWN, *(BEHIND if "machine.fault" in told else ())}
    return may.issuperset(left)


def _said(seen: Seen) -> str:
    return f"{_end(seen)}, {' '.join(strongest(seen.sent))}: {' '.join(seen.told)}"


def _sent_again(seen: Seen, usual: Seen) -> Iterator[str]:
    """What moves or writes goes out as without the fault, up to where it ends; so no line is sent again."""
    lines, others = ([line for line in each.lines if line != HOLD] for each in (seen, usual))
    pairs = zip_longest(lines, others[: len(lines)], fillvalue="nothing")
    odd = next(((line, other) for line, other in pairs if line != other), None)
    if odd is not None:
        yield f"{odd[0]} was sent, where without the fault it is {odd[1]}"


def _not_mended(seen: Seen, target: str) -> Iterator[str]:
    """A machine that was lost is found again at rest, once all is right; a link that is gone stays so."""
    lost = seen.end is Activity.LOST
    expected = Activity.STOPPED if lost and "link.lost" not in target else seen.end
    if seen.mended is not expected:
        yield f"when it was mended: {seen.mended.value}, not {expected.value}"


def _not_done(situation: Situation, seen: Seen, target: str) -> Iterator[str]:
    """A cut is done, and its part may be measured, where it has ended as without a fault, and nowhere else."""
    done = situation is Situation.CUTTING and target == right(NO_FAULT.name, situation)
    if seen.done is not done:
        yield "the part may be measured" if seen.done else "a cut that was made is not called done"
