"""What is checked of every cell: what moves, what is energised, what was sent, and what was read."""

from __future__ import annotations

import re
from collections.abc import Sequence, Set
from enum import StrEnum
from itertools import pairwise

from console.session.station.state import STALE_S
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.expected_replies import expected_replies
from tests.matrix.faults import Row
from tests.matrix.rig import Watched
from tests.matrix.truth import MOTORS, Moment, Sent

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
