"""The compensation table that the tool has already: read before another takes its place, and sent back after it.

A cut by `cam` leaves its table in the controller, switched off; a table may be another host's, too.
"""

from __future__ import annotations

from drivers.commissioning.reading import LISTING_TIMEOUT_S, ask_or_none
from drivers.errors import RefusedError
from drivers.pmac.client import PmacClient
from drivers.pmac.compensation.table_text import read_table, table_lines
from drivers.pmac.language.errors import PmacError
from profiles.problem import Problem


def kept_table(client: PmacClient, motor: int) -> tuple[str, ...]:
    """Return the lines that send the table of a motor again; empty where it has none.

    Raises RefusedError: `identify.in_use`, one that is not understood; it stays. LinkError: the link broke.
    """
    definition = ask_or_none(client, f"#{motor}LIST COMP DEF")
    if not definition:
        return ()
    listed = client.question(f"#{motor}LIST COMP", LISTING_TIMEOUT_S)
    try:
        table = read_table([f"#{motor} DEFINE COMP {definition[0].strip()}", *listed], client.dialect.motor_count)
    except PmacError as unknown:
        problem = Problem(code="identify.in_use", where=client.link.address, key=f"#{motor} COMP")
        raise RefusedError(problem) from unknown
    return tuple(table_lines(table))
