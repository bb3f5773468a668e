"""Another host has changed something: the next order that moves is refused, and nothing has moved by then."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.station.commands import Command, Jog, Start
from drivers.lathe.snapshot import AxisName
from tests.matrix.checks import JITTER, way
from tests.matrix.faults import Row
from tests.matrix.rig import build_rig
from tests.matrix.situations import Begun, Situation, enter
from tests.matrix.truth import MOTORS

JOG = Jog(axis=AxisName.CARRIAGE, distance=1.0)


def refusals(situation: Situation, order: Command, line: str, records: Path) -> tuple[str, ...]:
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
        (Situation.ARMED, Start(), "P1000=7", "owner.observer"),
        (Situation.IDLE, JOG, "P1000=7", "owner.observer"),
        (Situation.ARMED, Start(), "I130=264", "controller.setting"),
        (Situation.ARMED, Start(), "I113=400000", "controller.setting"),
        (Situation.ARMED, Start(), "OPEN PROG 2 CLEAR X0 CLOSE", "controller.program_differs"),
        (Situation.ARMED, Start(), "P23=5", "controller.constant_differs"),
        (Situation.ARMED, Start(), "P11=P11+500", "controller.constant_differs"),
        (Situation.ARMED, Start(), "P12=P12*4 P15=P15*4", "controller.constant_differs"),
        (Situation.ARMED, Start(), "#1K", "session.not_armed"),
        (Situation.ARMED, Start(), "^K", "session.not_armed"),
        (Situation.ARMED, Start(), "$$$", "session.not_armed"),
        (Situation.IDLE, JOG, "#3K", "alignment.drives_off"),
        (Situation.IDLE, JOG, "^K", "alignment.drives_off"),
        (Situation.ARMED, Start(), "DISABLE PLC20", "heartbeat.plc_silent"),
        (Situation.IDLE, JOG, "DISABLE PLC20", "heartbeat.plc_silent"),
        (Situation.IDLE, JOG, "I5=0", "heartbeat.plcs_forbidden"),
    ],
)
def test_after_a_stranger_the_next_motion_is_refused(
    situation: Situation, order: Command, line: str, code: str, tmp_path: Path
) -> None:
    assert code in refusals(situation, order, line, tmp_path)
