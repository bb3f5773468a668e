"""One cell of the matrix: one fault in one situation, and everything that was seen of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import pytest

from console.session.errors import SessionError
from console.session.station.commands import Measure
from console.session.station.context import Shop
from console.session.station.handlers import measure
from console.session.station.state import Activity
from drivers.cutting.planning import Strategy
from tests.branching import Branching
from tests.matrix.checks import (
    Kind,
    after_stop,
    energised,
    kind_of,
    misread,
    restless,
    slow_to_repeat,
    slow_to_stop,
    unasked,
)
from tests.matrix.faults import Row
from tests.matrix.rig import Rig, build_rig, compact_machine, planned_once, short_job
from tests.matrix.situations import MAY_MOVE, MOVING, Begun, Situation, enter

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

_WAYS: dict[tuple[Situation, Strategy, float], Branching[Row, Seen]] = {}


def run_cell(row: Row, situation: Situation, records: Path) -> Seen:
    """Have a fault in a situation, wait until the console has come to an end, mend it, and look on."""
    if row.early or situation in SHORT_WAY:
        return _cell(situation, records, row, lambda: row)
    way = situation, row.strategy, row.cut_mm
    if way not in _WAYS:
        planned_once(short_job(row.cut_mm), compact_machine().machine, row.strategy)
        _WAYS[way] = Branching(lambda wait: _cell(situation, records, row, wait))
    return _WAYS[way](row)


def _cell(situation: Situation, records: Path, way: Row, which: Callable[[], Row]) -> Seen:
    """`which` is asked for the fault when it is to happen: one of the strategy and the length of cut of `way`."""
    rig = build_rig(records)
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
