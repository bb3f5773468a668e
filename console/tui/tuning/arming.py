"""What F5 arms and F6 starts on the page Tune: a test of the tool, confirmed for some seconds."""

from __future__ import annotations

from dataclasses import dataclass

from console.session.station import jogging
from console.session.station.commands import CheckHealth, Command, IdentifyTool
from console.session.station.state import Activity, StationState
from console.tui.ui_context import refusal
from drivers.cutting.strategy import Strategy
from drivers.identification.health import HealthRequest, health_problems
from drivers.identification.request import IdentificationRequest, request_problems
from drivers.identification.rig import homed
from profiles.machine import MachineProfile
from profiles.problem import Problem

KINDS = ("health", "pvt", "cam", "timebase")
"""A health test, or an identification of one of these paths."""

ARMED_S = 20.0  # within which F6 starts what F5 has armed


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmedTest:
    """A test that may be started until `until_s`, machine time, while nothing happens at the machine."""

    kind: str
    until_s: float
    moment: tuple[object, ...]


def moment_of(state: StationState) -> tuple[object, ...]:
    """Return what must stay as it is from F5 to F6."""
    on = state.snapshot is not None and state.snapshot.loops_closed
    return state.activity, state.stop is None, state.standing, on, state.tested, state.alignment.clamping


def holds(armed: ArmedTest | None, state: StationState, now_s: float) -> bool:
    """Whether a test may still be started."""
    return armed is not None and now_s <= armed.until_s and armed.moment == moment_of(state)


def command_of(kind: str) -> Command:
    """Return the command that starts a test."""
    if kind == KINDS[0]:
        return CheckHealth(step_um=HealthRequest().step_um)
    return IdentifyTool(path=Strategy(kind))


def arm_reasons(kind: str, state: StationState, machine: MachineProfile) -> tuple[Problem, ...]:
    """Return why a test cannot be armed now; the machine asks everything again before it moves."""
    if reasons := refusal(state, "tune.arm"):
        return reasons
    if state.armed is not None or state.activity is not Activity.READY:
        return (Problem(code="screen.tune_cut_armed"),)
    snapshot = state.snapshot
    if snapshot is None or not snapshot.loops_closed:
        return (Problem(code="alignment.drives_off"),)
    if not homed(snapshot):
        return (Problem(code="alignment.not_homed"),)
    if jogging.tool_in_part(snapshot, machine, state.alignment):
        return (Problem(code="machine.tool_in_part"),)
    if kind == KINDS[0]:
        return health_problems(HealthRequest(), machine)
    return request_problems(IdentificationRequest(path=Strategy(kind)), machine)
