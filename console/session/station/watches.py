"""Monitors run on every status poll, each with an alarm for as long as its condition holds."""

from __future__ import annotations

from console.session.cut.alignment import handed_over
from console.session.station.alarms import HOME_LOST, Priority, with_faults
from console.session.station.context import StationContext
from console.session.station.progress import CutStage
from console.session.station.state import MOVING
from drivers.lathe.ownership import Standing
from drivers.lathe.safety import device_problems
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.heartbeat.arming import lost_problem
from profiles.problem import Problem


def watch_axes(place: StationContext, snapshot: Snapshot) -> None:
    """Report who controls the machine, and axis faults not reported elsewhere."""
    _watch_owner(place, snapshot)
    if snapshot.homed:
        place.end_alarms(*HOME_LOST)
    now_s = place.clock.now_s()
    place.change_alarms(lambda alarms: with_faults(alarms, snapshot.axis_faults, now_s))


def watch_devices(place: StationContext, before: Snapshot | None, snapshot: Snapshot) -> None:
    """Report the safety device that drops while drives are on: automatic motion ends, and no command is sent.

    In motion, the wait for it stops the machine, and reports it.
    """
    problems = device_problems(snapshot.inputs)
    if snapshot.inputs and not problems:
        place.end_alarms("safety.not_good")
    on = not snapshot.loops_open or (before is not None and not before.loops_open)
    if not problems or not on or not place.state.controls or place.state.activity in MOVING:
        return
    place.tell(armed=None)
    for problem in problems:
        if not any(alarm.active and alarm.problem == problem for alarm in place.state.alarms):
            place.alarm(problem)


def watch_guard(place: StationContext) -> None:
    """Report once, while something moves, that the controller's watchdog no longer guards it."""
    unguarded = place.lathe.unguarded
    if unguarded is not None and not place.alarmed(unguarded.code):
        place.alarm(unguarded)


def watch_loss(place: StationContext, snapshot: Snapshot) -> None:
    """Report once what the controller has ended after losing its host; after a stop, settling the stop does."""
    if not snapshot.lost:
        place.end_alarms("heartbeat.lost")
    elif not place.alarmed("heartbeat.lost"):
        place.alarm(lost_problem(snapshot.lost))


def watch_phase(place: StationContext) -> None:
    """Report once per cut that tool and lobe are out of phase, or that the spindle has stopped."""
    cut = place.state.cut
    if cut is None or cut.stage is not CutStage.CUT:
        return
    if cut.in_phase is False and not place.alarmed("cut.out_of_phase"):
        problem = Problem(code="cut.out_of_phase", limit=f"± {cut.phase_limit_deg:.2g} deg")
        place.alarm(problem, Priority.MEDIUM)
    elif cut.is_lost and cut.in_phase is not False and not place.alarmed("cut.spindle_stands"):
        place.alarm(Problem(code="cut.spindle_stands"))


def _watch_owner(place: StationContext, snapshot: Snapshot) -> None:
    """Report once that another console has taken control; the alignment made here is no longer known."""
    if place.state.standing is not Standing.OUSTED:
        return
    place.tell(alignment=handed_over(place.state.alignment, place.local_time()))
    if not place.alarmed("owner.ousted"):
        place.tell(armed=None)
        place.alarm(Problem(code="owner.ousted", value=str(snapshot.owner)))
