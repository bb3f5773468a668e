"""A stop on a connection of its own, while a question still waits for its answer on the other one.

That is what such a connection is for, and nobody knows of a board that it does so before it was seen.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers.errors import LinkError
from drivers.link.base import StopWay
from drivers.pmac.configuration.proofs.bench import REASON, ProofBench

QUESTION = "P0..99"
"""It changes nothing, and takes a card longer to answer than a stop takes to come."""


def past_a_question(bench: ProofBench, press: Callable[[str], None]) -> bool:
    """Press; return whether the board kept apart what goes on two connections. On one there is no question.

    Raises:
        LinkError: the question could not be sent; nothing was pressed.
    """
    if bench.stop.way is not StopWay.RESERVED:
        press(REASON)
        return bench.stop.way is StopWay.DIRECT
    bench.client.send(QUESTION)
    press(REASON)
    try:
        bench.client.reply(QUESTION)
    except LinkError:
        return False  # the stop went; whether it was obeyed is looked at, in step again
    return True
