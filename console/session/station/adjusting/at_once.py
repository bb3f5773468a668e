"""Commands that do not wait their turn: taken from any thread, whatever the machine is doing."""

from __future__ import annotations

from functools import partial

from console.session.station.adjusting.holding import hold_refusal
from console.session.station.adjusting.refusals import adjust_refusal
from console.session.station.alarms import seen
from console.session.station.commands import (
    Acknowledge,
    Adjust,
    Command,
    EndCut,
    HoldFeed,
    InjectFault,
    Recover,
    ResumeFeed,
)
from console.session.station.context import StationContext
from console.session.station.state import Activity
from console.session.station.training import Instruct
from profiles.problem import Problem


def taken_at_once(context: StationContext, intent: Command) -> tuple[Problem, ...] | None:  # noqa: C901 - one branch a case
    """Take what does not wait its turn: return why not, empty where it was taken; None for all else."""
    if isinstance(intent, Acknowledge | EndCut | HoldFeed | ResumeFeed | Adjust):
        context.log_command(intent)
    problem: Problem | None = None
    match intent:
        case Acknowledge():
            context.change_alarms(partial(seen, shown=intent.shown))
        case EndCut():
            cutting = context.state.activity is Activity.CUTTING
            problem = None if cutting else Problem(code="session.nothing_to_hold")
            context.end_asked = context.end_asked or cutting
        case HoldFeed() | ResumeFeed():
            problem = hold_refusal(intent, context.state)
            context.hold_asked = intent if problem is None else context.hold_asked
        case Adjust():
            problem = adjust_refusal(intent, context.state)
            if problem is None:
                context.adjust_asked.append(intent)
        case InjectFault():
            problem = None if context.shop is not None else Problem(code="session.not_simulated")
            if problem is None:
                context.faults_asked.append(intent.line)
        case Instruct():
            context.orders.append(intent.carry_out)
        case Recover() if context.state.speed == 0.0 and context.training is not None:
            context.training.clock.ask_on()  # its instructor may be gone
        case _ if context.state.speed == 0.0:
            problem = Problem(code="instruct.paused")
        case _:
            return None
    return () if problem is None else (problem,)
