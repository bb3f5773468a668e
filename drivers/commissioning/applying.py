"""Write gains and axis definitions to a controller, line by line, each read back, and nothing else ever."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.commissioning.card_state import read_state
from drivers.commissioning.gains import Write
from drivers.commissioning.judged import same
from drivers.commissioning.reading import number_in
from drivers.controller import Controller
from drivers.errors import DriverError, RefusedError
from drivers.pmac.dialect import Dialect
from profiles.problem import Problem


def refuse_unready(client: Controller, dialect: Dialect) -> None:
    """Make sure that no motor of the controller is enabled and no program runs.

    Raises:
        RefusedError: `controller.drives_on`, `controller.program_running`.
        LinkError: the link broke.
    """
    state = read_state(client, dialect)
    motors = ", ".join(f"#{number}" for number in state.enabled)
    systems = ", ".join(f"&{number}" for number in state.running)
    if motors or systems:
        code = "controller.drives_on" if motors else "controller.program_running"
        raise RefusedError(Problem(code=code, where=client.link.address, value=motors or systems))


def apply(client: Controller, dialect: Dialect, writes: Sequence[Write]) -> int:
    """Send each line once and read its value back; return how many lines there were. Nothing is saved.

    The caller must have a backup.

    Raises:
        RefusedError: `controller.drives_on`, `controller.program_running`; nothing was sent.
        DriverError: `controller.not_taken`, a value differs from the one that was sent: nothing was sent after it.
        LinkError: the link broke; check what its last line did.
    """
    refuse_unready(client, dialect)
    for write in writes:
        client.request(write.line)
        (found,) = client.query(write.question, again=True)
        if not _is(found, write.wanted, client.link.address):
            value = found.strip()
            raise DriverError(
                Problem(code="controller.not_taken", key=write.line, value=value, limit=write.wanted)
            )
    return len(writes)


def _is(found: str, wanted: str, where: str) -> bool:
    if found.strip() == wanted:
        return True
    try:
        number = float(wanted)
    except ValueError:
        return False
    return same(number_in(found, where), number)
