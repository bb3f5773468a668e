"""One cell of the matrix: one fault in one situation, and everything that was seen of it."""

from __future__ import annotations

import re
from collections.abc import Set
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import cast

import pytest

from console.session.errors import SessionError
from console.session.intents import Measure
from console.session.orders import measure
from console.session.state import STALE_S, Activity
from console.session.workplace import ShopFloor
from drivers.pmac.foreseen import foresee
from drivers.snapshot import AxisName, Snapshot
from tests.matrix.faults import Row
from tests.matrix.rig import Rig, build_rig
from tests.matrix.situations import MAY_MOVE, MOVING, Begun, Situation, enter
from tests.matrix.truth import MOTORS, Moment, Sent

SETTLED_S, STEP_S = 0.6, 0.1
"""How long the station looks on before its end state counts, and between two of its turns."""

CARD_ENDS_S = 2.2
"""A card that is alone ends what moves within 2 s of the last lease."""

WATCHED_S = 0.3
JITTER = {name: counts for name, counts in zip(MOTORS, (5.0, 20.0, 5.0), strict=True)}
"""Counts by which an axis may stir that nobody moves: 1 um, 0.7 deg, 5 um."""

READ_COUNTS = 1.0

STOP_GAP_S = 0.29
"""Between two repetitions of a stop that is not proven: 0.2 s, or a try to close a buffer in between."""


NO_ANSWER = {"link.silent", "link.out_of_step", "link.not_in_step"}


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
    if line == _GUARD_ENDED or (rest != line and (not rest or foresee(rest).reads_only)):
        return Kind.RENEWAL
    return None if foresee(line).reads_only else Kind.LINE


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


def run_cell(row: Row, situation: Situation, records: Path) -> Seen:
    """Have a fault in a situation, wait until the console has come to an end, mend it, and look on."""
    rig = build_rig(records)
    wrong: list[str] = []
    rig.looks.append(lambda snapshot: wrong.extend(_misread(rig, snapshot)))
    begun = Begun(rig=rig, fault=lambda: row.inject(rig.sim), early=row.early, strategy=row.strategy)
    enter(situation, begun)
    assert begun.at_s is not None
    _settle(rig)
    state, end_s = rig.state, rig.sim.now_s()
    told = (*(a.problem.code for a in state.alarms), *(p.code for p in state.refusals))
    sent = [piece for piece in rig.wire.sent if piece.at_s >= begun.at_s]
    wrong += _restless(rig, state.activity, row)
    _mend(rig)
    after = rig.sim.since(begun.at_s)
    may_move = {*MAY_MOVE.get(situation, ()), *row.moves}
    wrong += [*_energised(rig, begun.at_s, row), *_unasked(after, may_move), *_after_stop(rig)]
    wrong += _slow_to_repeat(sent, state.activity)
    if situation in MOVING and NO_ANSWER & set(told):
        wrong += _slow_to_stop(sent, begun.at_s)
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
    rig.place.shop = cast(ShopFloor, object())  # a gauge is there; it is not asked
    with pytest.raises(SessionError) as refused:
        measure(rig.place, Measure())
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


def _restless(rig: Rig, end: Activity, row: Row) -> list[str]:
    """What moves behind the end; a machine that is lost is given the time in which the card ends it.

    A lost machine whose drives are off may coast, and where an encoder does not count nobody can see it coast.
    What another host moves while this one does nothing is that one's.
    """
    anothers = row.moves if end is Activity.READY else frozenset()
    if end is Activity.LOST:
        rig.sim.wait(CARD_ENDS_S)
    begun_s = rig.sim.now_s()
    rig.sim.wait(WATCHED_S)
    moments = rig.sim.since(begun_s)
    return [
        f"{axis} moves behind the end"
        for place, axis in enumerate(MOTORS)
        if axis != row.unseen
        and axis not in anothers
        and way(moments, place) > JITTER[axis]
        and (end is not Activity.LOST or moments[-1].powered[place])
    ]


def way(moments: list[Moment], place: int) -> float:
    """Return how far the iron of an axis has gone to and fro, counts."""
    track = [moment.iron[place] for moment in moments]
    return max(track) - min(track)


def _energised(rig: Rig, begun_s: float, row: Row) -> list[str]:
    """Amplifiers that came on after the fault, in whatever situation: nobody has ordered that."""
    return [f"{axis} energised" for at_s, axis in rig.sim.energised if at_s >= begun_s and axis not in row.moves]


def _unasked(moments: list[Moment], may_move: Set[AxisName]) -> list[str]:
    return [
        f"{axis} moves unasked by {way(moments, place):.0f} counts"
        for place, axis in enumerate(MOTORS)
        if axis not in may_move and way(moments, place) > JITTER[axis]
    ]


def _slow_to_stop(sent: list[Sent], begun_s: float) -> list[str]:
    """What moves and is not seen any more is stopped before what was seen last is stale."""
    first_s = next((piece.at_s for piece in sent if piece.urgent), float("inf"))
    late_s = first_s - begun_s
    return [] if late_s <= STALE_S + STOP_GAP_S else [f"the first stop {late_s:.2f} s behind the fault"]


def _slow_to_repeat(sent: list[Sent], end: Activity) -> list[str]:
    """A stop that is never proven goes out five times a second."""
    stops = [piece.at_s for piece in sent if piece.urgent]
    gaps = [after - before for before, after in pairwise(stops)]
    if end is not Activity.LOST or max(gaps, default=0.0) <= STOP_GAP_S:
        return []
    return [f"{max(gaps):.2f} s between two stops"]


def _after_stop(rig: Rig) -> list[str]:
    """Lines that move or write behind a stop; switching off is none."""
    stops = [place for place, piece in enumerate(rig.wire.sent) if piece.urgent][1:]
    behind = rig.wire.sent[stops[0] :] if stops else []
    return [f"behind a stop: {piece.line}" for piece in behind if kind_of(piece) is Kind.LINE]


def _misread(rig: Rig, snapshot: Snapshot) -> list[str]:
    """Positions and amplifiers that the card did not have at any moment between request and reply."""
    moments = rig.sim.since(snapshot.at_s - rig.lathe.round_trip_s - 0.005, snapshot.at_s)
    wrong = []
    for place, (axis, state) in enumerate(zip(MOTORS, snapshot.axes, strict=True)):
        told = [moment.told[place] for moment in moments]
        if not min(told) - READ_COUNTS <= state.position <= max(told) + READ_COUNTS:
            wrong.append(f"{axis} is shown at {state.position}, was {min(told)} to {max(told)}")
        if ("amplifier_enabled" in state.flags) not in {moment.powered[place] for moment in moments}:
            wrong.append(f"{axis}: amplifier misread")
    return wrong
