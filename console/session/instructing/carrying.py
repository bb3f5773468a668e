"""Orders of the instructor at the machine, in the link thread, between two polls.

A pause is here, too: simulated time and machine time stand still, and this thread with them. Nothing is polled, so
nothing times out. A stop goes its own way to the controller, which takes it in the pause.
"""

from __future__ import annotations

from console.session.errors import SessionError, fault_problem, refuse
from console.session.instructing.answer import Answer
from console.session.instructing.order import Do, Order
from console.session.instructing.remembering import knowledge_of
from console.session.station.context import Shop, StationContext, Training
from console.session.station.state import Activity
from drivers.errors import LinkError
from drivers.simulator.hosts.control_address import OK
from profiles.problem import Problem, ProblemError

MOST_CHECKPOINTS = 8
PAUSED_LOOK_S = 0.02  # period in which an end of the pause is looked for


def carry_out(context: StationContext) -> None:
    """Carry out what the instructor has ordered since the last poll; return when time is not paused."""
    _carry_out_all(context)
    training = context.training
    while training is not None and training.clock.paused:
        if training.clock.asked_on or training.clock.leaving:
            _run_on(context, training, training.speed)
            return
        stop_waits = context.lathe.stop.reason is not None and not context.lathe.stop.proven
        if stop_waits is not context.state.stop_waits:
            context.tell(stop_waits=stop_waits)
        training.clock.wait(PAUSED_LOOK_S)
        _carry_out_all(context)


def _carry_out_all(context: StationContext) -> None:
    while context.orders:
        intent = context.orders.popleft()
        try:
            refuse(() if (paused := context.pause_problem()) is None else (paused,))
            answer = _done(context, intent.order)
        except ProblemError as error:
            answer = Answer(problem=error.problems[0])
        except Exception as fault:
            answer = Answer(problem=fault_problem(fault))
        intent.answered(answer)


def _done(context: StationContext, order: Order) -> Answer:
    shop, training = context.shop, context.training
    if shop is None or training is None:
        return Answer(problem=Problem(code="session.not_simulated"))
    match order.do:
        case Do.FAULT:
            return _fault(context, shop, order)
        case Do.SPEED if training.clock.paused:
            training.speed = order.speed
        case Do.SPEED:
            _run_on(context, training, order.speed)
        case Do.PAUSE if training.clock.leaving:
            return Answer(problem=Problem(code="instruct.leaving"))
        case Do.PAUSE:
            _set_speed(context, training, 0.0)
        case Do.RESUME:
            _run_on(context, training, training.speed)
        case Do.CHECKPOINTS:
            known = training.checkpoints.values()
            return Answer(lines=tuple(f"{each.name}  {each.at}" for each in known))
        case Do.CHECKPOINT:
            _set_checkpoint(context, training, order.name)
        case Do.RETURN:
            _return(context, training, order.name)
        case _:
            return Answer(problem=Problem(code="instruct.unknown", value=order.line))
    context.note_anyway("instructed", line=order.line)
    return Answer()


def _run_on(context: StationContext, training: Training, speed: float) -> None:
    training.speed = speed
    _set_speed(context, training, speed)
    context.tell(stop_waits=False)


def _set_speed(context: StationContext, training: Training, speed: float) -> None:
    """Change the time of the lathe and ours; a lathe that is gone has none."""
    if speed == 0.0:
        training.lathe.set_speed(speed)
        training.clock.set_speed(speed)
    else:
        training.clock.set_speed(speed)  # before anything else: this thread must come out of a pause
        context.tell(speed=speed)
        training.lathe.set_speed(speed)
    context.tell(speed=speed)


def _set_checkpoint(context: StationContext, training: Training, name: str) -> None:
    """Freeze the lathe at rest, set as its profile says: only that is known to be so after a return.

    Raises SessionError: `instruct.not_at_rest`, `instruct.too_many`.
    """
    state = context.state
    at_rest = state.snapshot is not None and state.snapshot.at_rest and not state.is_stale(context.clock.now_s())
    if not at_rest or state.activity not in (Activity.READY, Activity.STOPPED) or state.armed is not None:
        raise SessionError(Problem(code="instruct.not_at_rest"))
    if name not in training.checkpoints and len(training.checkpoints) >= MOST_CHECKPOINTS:
        raise SessionError(Problem(code="instruct.too_many", limit=str(MOST_CHECKPOINTS)))
    context.lathe.program.put_back()
    training.lathe.checkpoint(name)
    training.checkpoints[name] = knowledge_of(context, name)


def _return(context: StationContext, training: Training, name: str) -> None:
    """Go back to a checkpoint, from any state: for this console it is as if the link were lost, and opened again.

    Raises SessionError: `instruct.no_checkpoint`.
    """
    known, reopening = training.checkpoints.get(name), context.reopening
    if known is None or reopening is None:
        names = ", ".join(training.checkpoints) or "–"
        raise SessionError(Problem(code="instruct.no_checkpoint", value=name, limit=names))
    training.lathe.return_to(name)
    training.returning = known
    context.tell(**known.fields)  # nothing may be judged by a part that is not there any more
    reopening.lose(Problem(code="link.returned", value=f"{name} ({known.at})"))
    _run_on(context, training, training.speed)


def _fault(context: StationContext, shop: Shop, order: Order) -> Answer:
    try:
        lines = shop.fault(order.line).splitlines()
    except LinkError as error:
        problem = error.problems[0]
        refused = problem.code == "simulator.refused"
        return Answer(problem=Problem(code="instruct.refused", value=problem.value) if refused else problem)
    if order.is_fault:
        context.note_anyway("fault", line=order.line, by="instructor")
    return Answer(lines=tuple(lines[:-1] if lines[-1:] == [OK] else lines))
