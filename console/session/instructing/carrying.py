"""Orders of the instructor at the machine, in the link thread, between two polls."""

from __future__ import annotations

from console.session.errors import fault_problem
from console.session.instructing.answer import Answer
from console.session.instructing.order import Do, Order
from console.session.station.context import Shop, StationContext
from drivers.simulator.hosts.control_address import OK
from profiles.problem import Problem, ProblemError


def carry_out(context: StationContext) -> None:
    """Carry out what the instructor has ordered since the last poll; each gets its answer."""
    while context.orders:
        intent = context.orders.popleft()
        try:
            answer = _done(context, intent.order)
        except ProblemError as error:
            answer = Answer(problem=error.problems[0])
        except Exception as fault:
            answer = Answer(problem=fault_problem(fault))
        intent.answered(answer)


def _done(context: StationContext, order: Order) -> Answer:
    shop = context.shop
    if shop is None:
        return Answer(problem=Problem(code="session.not_simulated"))
    match order.do:
        case Do.FAULT:
            return _fault(context, shop, order)
        case _:
            return Answer(problem=Problem(code="instruct.unknown", value=order.line))


def _fault(context: StationContext, shop: Shop, order: Order) -> Answer:
    lines = shop.fault(order.line).splitlines()
    if order.is_fault:
        context.note_anyway("fault", line=order.line, by="instructor")
    return Answer(lines=tuple(lines[:-1] if lines[-1:] == [OK] else lines))
