"""Another host has changed something: the next order that moves is refused, and nothing has moved by then."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.intents import Intent, Jog, Start
from drivers.snapshot import AxisName
from tests.matrix.cell import JITTER, way
from tests.matrix.faults import Row
from tests.matrix.rig import build_rig
from tests.matrix.situations import Begun, Situation, enter
from tests.matrix.truth import MOTORS

JOG = Jog(axis=AxisName.CARRIAGE, distance=1.0)

MOVES_FIRST = pytest.mark.xfail(reason="the way to the start is gone before settings are compared", strict=True)
UNGUARDED = pytest.mark.xfail(reason="the heartbeat is looked at when drives are switched on alone", strict=True)
UNREAD = pytest.mark.xfail(reason="the program is not read again between arming and start", strict=True)


def refusals(situation: Situation, order: Intent, line: str, records: Path) -> tuple[str, ...]:
    """Give an order after a stranger's line; return why it is refused. Nothing may have moved."""
    rig = build_rig(records)
    row = Row(name="", fault="stranger-writes", given={"line": line})
    enter(situation, Begun(rig=rig, fault=lambda: row.inject(rig.sim)))
    rig.step()
    begun_s = rig.sim.now_s()
    if rig.station.post(order):
        rig.station.step()
    moments = rig.sim.since(begun_s)
    moved = [axis for place, axis in enumerate(MOTORS) if way(moments, place) > JITTER[axis]]
    assert moved == []
    return tuple(problem.code for problem in rig.state.refusals)


@pytest.mark.parametrize(
    ("situation", "order", "line", "code"),
    [
        pytest.param(Situation.ARMED, Start(), "P1000=7", "owner.observer"),
        pytest.param(Situation.IDLE, JOG, "P1000=7", "owner.observer"),
        pytest.param(Situation.ARMED, Start(), "I130=264", "controller.setting", marks=MOVES_FIRST),
        pytest.param(Situation.ARMED, Start(), "I113=400000", "controller.setting", marks=MOVES_FIRST),
        pytest.param(
            Situation.ARMED, Start(), "OPEN PROG 2 CLEAR X0 CLOSE", "controller.program_differs", marks=UNREAD
        ),
        pytest.param(Situation.ARMED, Start(), "DISABLE PLC20", "heartbeat.plc_silent", marks=UNGUARDED),
        pytest.param(Situation.IDLE, JOG, "DISABLE PLC20", "heartbeat.plc_silent", marks=UNGUARDED),
        pytest.param(Situation.IDLE, JOG, "I5=0", "heartbeat.plcs_forbidden", marks=UNGUARDED),
    ],
)
def test_after_a_stranger_the_next_motion_is_refused(
    situation: Situation, order: Intent, line: str, code: str, tmp_path: Path
) -> None:
    assert code in refusals(situation, order, line, tmp_path)
