"""Carries orders of the instructor to the machine, and their answers back.

The dispatcher runs in the thread that serves the instructor, the orders in the link thread, between two polls.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING

from console.school.instructing.mailbox import InstructorAct, Mailbox
from console.school.instructing.order import InstructorOrder, OrderKind, OrderReply
from console.session.errors import SessionError, fault_problem, refuse
from console.session.station.context import Checkpoint, Shop, StationContext, Training
from console.session.station.state import Activity
from console.session.station.training import Instruct, run_on, set_speed
from drivers.errors import LinkError
from drivers.simulator.hosts.control_address import OK
from profiles.problem import Problem, ProblemError

if TYPE_CHECKING:
    from console.session.station.commands import Command

ANSWER_S = 15.0  # a silent controller may hold up the console for some seconds
PICTURE_S, LOOK_S = 2.0, 0.02


class Dispatcher:
    """`post` passes a command to the machine, False before there is one; `now_s` is machine time."""

    def __init__(self, mailbox: Mailbox, post: Callable[[Command], bool], now_s: Callable[[], float]) -> None:
        self._mailbox, self._post, self._now_s = mailbox, post, now_s

    async def carry(self, order: InstructorOrder) -> OrderReply:
        """Return what comes of an order."""
        match order.do:
            case OrderKind.SCREEN:
                return await self._picture()
            case OrderKind.LOG:
                return OrderReply(lines=self._mailbox.log())
        answer = await self._await_answer(order)
        if answer.problem is None and (order.is_fault or order.is_seen):
            self._mailbox.note(InstructorAct(at=datetime.now(), at_s=self._now_s(), order=order))
        return answer

    async def _await_answer(self, order: InstructorOrder) -> OrderReply:

        loop = asyncio.get_running_loop()
        came: asyncio.Future[OrderReply] = loop.create_future()

        def settle(answer: OrderReply) -> None:
            if not came.done():
                came.set_result(answer)

        def answered(answer: OrderReply) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(settle, answer)

        if not self._post(CarryOut(order=order, answered=answered)):
            return OrderReply(problem=Problem(code="instruct.not_ready"))
        try:
            async with asyncio.timeout(ANSWER_S):
                return await came
        except TimeoutError:
            return OrderReply(problem=Problem(code="instruct.no_answer", limit=f"{ANSWER_S:g} s"))

    async def _picture(self) -> OrderReply:
        """Return the screen of now; that of an earlier moment, with its age, where the screen does not answer."""
        loop, mailbox, number = asyncio.get_running_loop(), self._mailbox, self._mailbox.request_picture()
        until_s = loop.time() + PICTURE_S
        while (picture := mailbox.picture) is None or picture.number < number:
            if loop.time() > until_s:
                break
            await asyncio.sleep(LOOK_S)
        if picture is None:
            return OrderReply(problem=Problem(code="instruct.no_screen"))
        age_s = loop.time() - picture.at_s if picture.number < number else 0.0
        return OrderReply(lines=picture.rows, age_s=age_s)


MOST_CHECKPOINTS = 8

KEPT = tuple(
    "alignment cut cut_done touched marks_mm measured uncompensated tool_loop tested uncommissioned trial".split()
)
"""Fields of the state that are about the lathe and its part, and are not read with every poll."""


@dataclass(frozen=True, kw_only=True)
class CarryOut(Instruct):
    """An order of the instructor; `answered` is called with what came of it, from the link thread."""

    order: InstructorOrder
    answered: Callable[[OrderReply], object]

    def carry_out(self, context: StationContext) -> None:
        """Do it, and answer."""
        self.answered(_answer(context, self.order))


def _answer(context: StationContext, order: InstructorOrder) -> OrderReply:
    try:
        refuse(() if (paused := context.pause_problem()) is None else (paused,))
        return _carry_out_order(context, order)
    except ProblemError as error:
        return OrderReply(problem=error.problems[0])
    except Exception as fault:
        return OrderReply(problem=fault_problem(fault))


def _carry_out_order(context: StationContext, order: InstructorOrder) -> OrderReply:
    shop, training = context.shop, context.training
    if shop is None or training is None:
        return OrderReply(problem=Problem(code="session.not_simulated"))
    match order.do:
        case OrderKind.FAULT:
            return _fault(context, shop, order)
        case OrderKind.SPEED if training.clock.paused:
            training.speed = order.speed
        case OrderKind.SPEED | OrderKind.RESUME:
            run_on(context, training, order.speed if order.do is OrderKind.SPEED else training.speed)
        case OrderKind.PAUSE if training.clock.leaving:
            return OrderReply(problem=Problem(code="instruct.leaving"))
        case OrderKind.PAUSE:
            set_speed(context, training, 0.0)
        case OrderKind.CHECKPOINTS:
            known = training.checkpoints.values()
            return OrderReply(lines=tuple(f"{each.name}  {each.at}" for each in known))
        case OrderKind.CHECKPOINT:
            _set_checkpoint(context, training, order.name)
        case OrderKind.RETURN:
            _return(context, training, order.name)
        case _:
            return OrderReply(problem=Problem(code="instruct.unknown", value=order.line))
    context.note_anyway("instructed", line=order.line)
    return OrderReply()


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
    training.checkpoints[name] = _checkpoint(context, name)


def _checkpoint(context: StationContext, name: str) -> Checkpoint:
    """Return a checkpoint with what is known now."""
    state, plan, started, limits_seen = context.state, context.plan, context.started, context.limits_seen
    fingerprint = None if context.commissioned is None else context.commissioned.fingerprint
    fields = {each: getattr(state, each) for each in KEPT}

    def restore() -> None:
        context.end_record()  # what ended meanwhile is over, and its record complete
        context.plan, context.started, context.limits_seen = plan, started, limits_seen
        if context.commissioned is not None:
            context.commissioned.fingerprint = fingerprint
        stop = context.state.stop
        if stop is not None:  # of what it ended, nothing is there any more
            stop = replace(stop, of_cut=False, mark_mm=None, tool_in_part=None, can_retract=False)
        # The last poll was of another lathe: what differs from it has not happened.
        context.tell(**fields, snapshot=None, armed=None, stop=stop)

    return Checkpoint(name=name, at=context.local_time(), fields=fields, restore=restore)


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
    run_on(context, training, training.speed)


def _fault(context: StationContext, shop: Shop, order: InstructorOrder) -> OrderReply:
    try:
        lines = shop.fault(order.line).splitlines()
    except LinkError as error:
        problem = error.problems[0]
        refused = problem.code == "simulator.refused"
        return OrderReply(problem=Problem(code="instruct.refused", value=problem.value) if refused else problem)
    if order.is_fault:
        context.note_anyway("fault", line=order.line, by="instructor")
    return OrderReply(lines=tuple(lines[:-1] if lines[-1:] == [OK] else lines))
