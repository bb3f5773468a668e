"""Carries orders from the thread that serves the instructor to the console, and their answers back."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from datetime import datetime
from typing import TYPE_CHECKING

from console.school.instructing.mailbox import InstructorAct, Mailbox
from console.school.instructing.order import InstructorOrder, OrderKind, OrderReply
from profiles.problem import Problem

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
        from console.school.instructing.order_execution import CarryOut  # not for the first paint

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
