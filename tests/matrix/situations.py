"""The states in which a fault may meet the console, and how it is brought into each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

from console.session.cut.alignment import JawAngle, TouchOff, clamping_of
from console.session.station.commands import Arm, Command, DisableDrives, EnableDrives, Home, Jog, Start
from console.session.station.progress import CutStage
from console.session.station.state import Activity
from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import AxisName, Snapshot
from tests.matrix.rig import SHORT_MM, Rig, compact_machine, short_job
from tests.matrix.truth import Sent

JOG_MM = 3.0


class Situation(StrEnum):
    """What the console is doing when the fault comes."""

    OFF = "drives off"
    IDLE = "idle"
    JOGGING = "jogging"
    HOMING = "homing"
    DOWNLOADING = "downloading"
    ARMED = "armed"
    CUTTING = "cutting"
    STOPPING = "stopping"


MAY_MOVE: dict[Situation, frozenset[AxisName]] = {
    Situation.JOGGING: frozenset({AxisName.CARRIAGE}),
    Situation.HOMING: frozenset(AxisName),
    Situation.CUTTING: frozenset(AxisName),
    Situation.STOPPING: frozenset(AxisName),
}
"""What was ordered to move; in every other situation nothing was."""


MOVING = frozenset({Situation.JOGGING, Situation.HOMING, Situation.CUTTING})
"""Where something moves that nobody has stopped."""


RUNNING_OUT = frozenset({Situation.OFF, Situation.JOGGING, Situation.CUTTING, Situation.STOPPING})
"""Where an axis may run out: spindle or carriage, or what another host moves behind drives that are off."""


@dataclass(kw_only=True)
class Begun:
    """`fault` lets the fault happen, once; `at_s` is when it did. An `early` one is there before the order."""

    rig: Rig
    fault: Callable[[], None]
    early: bool = False
    strategy: Strategy = Strategy.PVT
    cut_mm: float = SHORT_MM
    at_s: float | None = None

    def happen(self) -> None:
        if self.at_s is None:
            self.at_s = self.rig.sim.now_s()
            self.fault()


def enter(situation: Situation, begun: Begun) -> None:
    """Bring the station there, have the fault happen, and let what is being carried out come to its end."""
    rig = begun.rig
    assert rig.station.connect()
    _do(rig, DisableDrives())
    if situation is not Situation.OFF:
        _switch_on(rig)
    if begun.early:
        begun.happen()
    _ENTRIES[situation](begun)
    assert begun.at_s is not None, "the fault has not happened"


def _do(rig: Rig, order: Command) -> None:
    assert rig.station.post(order), rig.state.refusals
    rig.station.step()


def _switch_on(rig: Rig) -> None:
    """Drives on, and everything known that an alignment finds out."""
    _do(rig, EnableDrives())
    for motor in rig.sim.controller.motors.values():
        motor.home_zero()
    job, machine = short_job(), compact_machine().machine
    rig.station.step()
    on = rig.state.alignment.on
    alignment = replace(
        rig.state.alignment,
        clamping=clamping_of(job, at="-"),
        jaw=JawAngle(angle_deg=90.0, jaws=job.jaws, at="-", on=on),
        touch_off=TouchOff(zero_radius_mm=machine.tool.home_radius_mm, diameter_mm=job.diameter_mm, at="-", on=on),
    )
    rig.context.tell(alignment=alignment)
    assert rig.state.activity is Activity.READY and rig.state.refusals == () and rig.state.alarms == ()


def _at_rest(begun: Begun) -> None:
    begun.happen()


def _arm(begun: Begun) -> None:
    _do(begun.rig, Arm(job=short_job(begun.cut_mm), job_sha256="0" * 64, strategy=begun.strategy))


def _armed(begun: Begun) -> None:
    _arm(begun)
    assert begun.rig.state.armed is not None, begun.rig.state.refusals
    begun.happen()


def _jogging(begun: Begun) -> None:
    _on_look(begun, lambda s: "desired_velocity_zero" not in s.carriage.flags)
    _do(begun.rig, Jog(axis=AxisName.CARRIAGE, distance=JOG_MM))


def _homing(begun: Begun) -> None:
    _on_look(begun, lambda s: "home_search" in s.tool.flags)
    _do(begun.rig, Home())


def _downloading(begun: Begun) -> None:
    def look(sent: Sent) -> None:
        if sent.line.startswith("PVT"):
            begun.happen()

    begun.rig.wire.before = look
    _arm(begun)
    begun.rig.wire.before = lambda _: None


def _cutting(begun: Begun) -> None:
    _arm(begun)
    _on_look(begun, lambda _: _in_the_part(begun.rig))
    _do(begun.rig, Start())


def _stopping(begun: Begun) -> None:
    rig = begun.rig

    def press() -> None:
        rig.stop.stop("space")
        begun.happen()

    begun_here = Begun(rig=rig, fault=press)
    _arm(begun)
    _on_look(begun_here, lambda _: _in_the_part(rig))
    _do(rig, Start())


def _in_the_part(rig: Rig) -> bool:
    cut = rig.state.cut
    return cut is not None and cut.stage is CutStage.CUT and cut.turn > 2.0


def _on_look(begun: Begun, condition: Callable[[Snapshot], bool]) -> None:
    def look(snapshot: Snapshot) -> None:
        if begun.at_s is None and condition(snapshot):
            begun.happen()

    begun.rig.looks.append(look)


_ENTRIES: dict[Situation, Callable[[Begun], None]] = {
    Situation.OFF: _at_rest,
    Situation.IDLE: _at_rest,
    Situation.JOGGING: _jogging,
    Situation.HOMING: _homing,
    Situation.DOWNLOADING: _downloading,
    Situation.ARMED: _armed,
    Situation.CUTTING: _cutting,
    Situation.STOPPING: _stopping,
}
