"""Gains on trial, in the link thread: judged with every comparison of the controller, applied, and taken back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from console.session.cut.alignment import invalidate_retuned_tool
from console.session.errors import SessionError
from console.session.station import commands
from console.session.station.alarms import Priority
from console.session.station.context import StationContext
from console.session.tuning.air_proof import stated_filter_problems
from console.session.tuning.standing_trial import UNPROVEN, StandingTrial
from console.session.tuning.trial import TrialPlace, apply_trial, revert_trial, safe_trial
from drivers.errors import LinkError
from profiles.problem import Problem, ProblemError

ALARMS = ("trial.active", "trial.stands", "trial.unknown", "trial.file", *UNPROVEN)


def verify_controller(context: StationContext) -> tuple[Problem, ...]:
    """Return how the controller differs from its profile, with the gains that are on trial, and publish those.

    Gains on trial that stand as they were applied are no difference: drives may be enabled, to test them. Any
    other mixture is told first, beside the settings that differ. Nothing is written to the controller.
    """
    trial, problems = _standing(context)
    context.lathe.on_trial = dict(trial.proposed) if trial is not None and trial.whole else {}
    differing = context.lathe.verify()
    _alarm(context, problems if trial is None else trial.problems)
    context.tell(trial=trial)
    return differing if trial is None or trial.whole else (*trial.problems, *differing)


def trial_problems(context: StationContext) -> tuple[Problem, ...]:
    """Return why nothing is cut with the gains that are in the controller."""
    trial, state = context.state.trial, context.state
    if trial is not None:
        return trial.problems
    machine = context.loaded_machine.machine
    return stated_filter_problems(machine, context.records, state.firmware, simulated=state.simulated)


def apply_gains(context: StationContext, command: commands.ApplyGains) -> None:
    """Write proposed gains, drives disabled, within the bounds, each read back."""
    _change_gains(context, lambda place: apply_trial(place, dict(command.settings), dict(command.shown)))


def revert_gains(context: StationContext, _: commands.RevertGains) -> None:
    """Write back the gains there were before the trial, drives disabled, each read back."""
    _change_gains(context, revert_trial)


def _change_gains(context: StationContext, work: Callable[[TrialPlace], None]) -> None:
    place = _place(context)
    if place is None:
        raise SessionError(Problem(code="session.lost"))
    before = place.gains.read()
    try:
        try:
            work(place)
        finally:
            _take_up(context, place, before)
    except LinkError:
        context.tell(alignment=invalidate_retuned_tool(context.state.alignment, context.local_time()))
        context.alarm_once(Problem(code="trial.unknown"), Priority.MEDIUM)
        raise
    except SessionError:
        raise
    except ProblemError as refused:  # of a file, or of a profile: at rest nothing has to be stopped
        raise SessionError(*refused.problems) from refused


def _take_up(context: StationContext, place: TrialPlace, before: Mapping[str, float]) -> None:
    """Publish what stands now, whatever came of it; others' changes are told from it. The touch-off is void."""
    after = place.gains.read()
    if after != before:
        if context.commissioned is not None:
            context.commissioned.wrote({place.gains.indices[name]: value for name, value in after.items()})
        context.tell(alignment=invalidate_retuned_tool(context.state.alignment, context.local_time()))
    settings = verify_controller(context)
    lasting = () if context.commissioned is None else context.commissioned.lasting_problems()
    context.tell(
        alignment=replace(context.state.alignment, settings=settings),
        uncommissioned=(*trial_problems(context), *lasting),
        tool_loop=place.gains.loop(context.local_time()),
    )


def _standing(context: StationContext) -> tuple[StandingTrial | None, tuple[Problem, ...]]:
    place = _place(context)
    return (None, ()) if place is None else safe_trial(place, settle=context.state.controls)


def _place(context: StationContext) -> TrialPlace | None:
    if context.client is None:
        return None
    return TrialPlace(
        client=context.client,
        machine=context.loaded_machine.machine,
        data=context.records,
        simulated=context.state.simulated,
        firmware=context.state.firmware,
    )


def _alarm(context: StationContext, problems: tuple[Problem, ...]) -> None:
    raised = {alarm.problem for alarm in context.state.alarms if alarm.active and alarm.problem.code in ALARMS}
    wanted = tuple(problem for problem in problems if problem.code in ALARMS)
    if raised == set(wanted):
        return
    context.end_alarms(*ALARMS)
    for problem in wanted:
        context.alarm(problem, Priority.LOW if problem.code == "trial.active" else Priority.MEDIUM)
