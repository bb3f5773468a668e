"""Gathering for the page Scope: what keeps it from beginning, and the work of its thread."""

from __future__ import annotations

from console.session.station.commands import Control
from console.session.station.state import Activity, StationState
from console.tui.ui_context import UiContext
from drivers.beside.permitted import Kind
from drivers.beside.scope_gather import Progress, Record, Scope, Seen
from drivers.beside.scope_setup import ScopeSetup
from drivers.beside.side_controller import SideController
from drivers.beside.side_line import SideLine
from profiles.machine import MachineProfile
from profiles.problem import Problem


def refusal_of(ui: UiContext, state: StationState, *, running: bool) -> tuple[Problem, ...]:
    """Return why nothing can be gathered now; motion is no reason, arming is: it takes the gather buffer."""
    if running:
        return (Problem(code="screen.scope_gathers"),)
    if ui.control.side is None or state.activity in (Activity.CONNECTING, Activity.LOST):
        return (Problem(code="screen.no_controller"),)
    if not state.controls:
        return (Problem(code="screen.observes"),)
    if state.activity is Activity.ARMING:
        return (Problem(code="screen.scope_arming"),)
    return ()


class ScopeWork:
    """One record in the making; `progress` is replaced by the thread that makes it."""

    def __init__(self, side: SideLine, machine: MachineProfile, control: Control) -> None:
        self.client = SideController(side, Kind.GATHER)
        self.progress = Progress("setting")
        self._side, self._machine, self._control = side, machine, control

    def record(self, setup: ScopeSetup, taken: str) -> Record:
        """Gather; errors as `Scope.record`."""
        with self._side.working():
            cleaner = SideController(self._side, Kind.GATHER)
            scope = Scope(self.client, cleaner, self._machine, self._seen, self._tell)
            return scope.record(setup, taken)

    def _tell(self, progress: Progress) -> None:
        self.progress = progress

    def _seen(self) -> Seen:
        state = self._control.state
        snapshot = state.snapshot
        return Seen(
            now_s=self._control.now_s(),
            at_rest=not state.seen_moving and not state.may_move,
            near_cut=state.armed is not None or state.activity in (Activity.POSITIONING, Activity.CUTTING),
            cutting=snapshot is not None and snapshot.program_running,
            round_trip_s=state.round_trip_ms / 1000.0,
        )
