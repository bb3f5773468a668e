"""Keys a and b of the page Tune: gains are asked for with the first press, and written with the second."""

from __future__ import annotations

from dataclasses import dataclass

from console.session.station.commands import ApplyGains, Command, RevertGains
from console.session.station.state import Activity, StationState
from console.session.trial.proposal import GainFacts
from console.session.trial.standing import Gains
from console.tui.records.beside import Problems
from console.tui.tuning.arming import ARMED_S, moment_of
from console.tui.ui_context import refusal
from profiles.problem import Problem

APPLY, REVERT = "tune.apply", "tune.revert"


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedGains:
    """Gains that the next press of the same key writes until `until_s`, machine time; `before` are those now."""

    action: str
    until_s: float
    moment: tuple[object, ...]
    before: Gains
    after: Gains

    def holds(self, action: str, state: StationState, now_s: float) -> bool:
        """Whether this press of a key is the second one, with everything as it was."""
        return self.action == action and now_s <= self.until_s and self.moment == _moment(state)

    @property
    def command(self) -> Command:
        """What is written."""
        return ApplyGains(settings=self.after, shown=self.before) if self.action == APPLY else RevertGains()


def trial_reasons(
    action: str, state: StationState, facts: GainFacts | Problems | None, *, shown: bool
) -> tuple[Problem, ...]:
    """Return why gains cannot be written now; `shown` is whether the proposal is in front of the operator."""
    if reasons := refusal(state, action):
        return reasons
    if state.armed is not None or state.activity is not Activity.READY:
        return (Problem(code="screen.tune_gains_armed"),)
    if state.snapshot is None or not state.snapshot.loops_open:
        return (Problem(code="screen.tune_drives_on"),)
    if action == REVERT:
        return () if state.trial is not None else (Problem(code="trial.none", key=state.machine),)
    if state.tool_loop is None:
        return (Problem(code="screen.tune_unread"),)
    if not shown or facts is None:
        return (Problem(code="screen.tune_look_first"),)
    found = facts.proposal if isinstance(facts, GainFacts) else None
    if found is None or found.settings == found.present:
        return (Problem(code="screen.tune_no_proposal"),)
    return ()


def asked(action: str, state: StationState, facts: GainFacts | Problems | None, now_s: float) -> AskedGains | None:
    """Return what a first press asks for."""
    moment, until_s = _moment(state), now_s + ARMED_S
    trial = state.trial
    if action == REVERT and trial is not None:
        return AskedGains(action=action, until_s=until_s, moment=moment, before=trial.found, after=trial.before)
    if action == APPLY and isinstance(facts, GainFacts) and facts.proposal is not None:
        found = facts.proposal
        after = tuple((name, float(value)) for name, value in found.settings.items())
        before = tuple(found.present.items())
        return AskedGains(action=action, until_s=until_s, moment=moment, before=before, after=after)
    return None


def _moment(state: StationState) -> tuple[object, ...]:
    return *moment_of(state), state.tool_loop, state.trial
