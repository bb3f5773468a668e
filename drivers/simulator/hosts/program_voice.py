"""What programs and PLCs do to hosts: their on-line commands (CMD) are executed, their texts (SEND) are told.

Both happen in the background cycle. Everything that is told goes to every host: which of them listens is not the
card's to know.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers.pmac.language.errors import PmacError
from drivers.pmac.plcs.plc import Addressed
from drivers.simulator.card.controller import Controller
from drivers.simulator.commands.control_characters import ACTIONS
from drivers.simulator.commands.line import execute
from drivers.simulator.context import ALL_CARDS, Context
from drivers.simulator.hosts import replies
from drivers.simulator.hosts.port import Port
from drivers.simulator.hosts.share import WORK_PER_TURN

COMMANDS_PER_CYCLE = 16
"""Commands of programs that are executed in one background cycle, fewer when they are heavy."""


def speak(controller: Controller, ports: Sequence[Port]) -> None:
    """Carry out what programs have asked for since the last cycle."""
    commands, messages = controller.pending_commands, controller.host_messages
    if not commands and not messages:
        return
    done = work = 0
    while commands and done < COMMANDS_PER_CYCLE and work < WORK_PER_TURN:
        said, cost = _command(controller, *commands.popleft())
        done, work = done + 1, work + cost
        if said:
            _announce(said, ports)
    while messages:
        text, _ = messages.popleft()
        _announce(replies.message(text, replies.wording(controller.variables)), ports)


def _command(controller: Controller, text: str, port: str, addressed: Addressed) -> tuple[bytes, int]:
    """Execute a command as from a host with these addresses; return what hosts are told, and what it has cost.

    Data is told only when the program named a port for it.
    """
    context = Context(
        controller,
        motor_number=addressed.motor,
        system_number=addressed.system,
        card_number=ALL_CARDS,
    )
    try:
        if len(text) == 1 and ord(text) < ord(" "):
            action = ACTIONS.get(ord(text))
            report = action(context) if action is not None else None
            context.lines.extend([report] if report is not None else [])
        else:
            execute(text, context)
    except PmacError as refusal:
        return replies.complaint(refusal.code, replies.wording(controller.variables)), context.work
    if not port:
        return b"", context.work
    how = replies.wording(controller.variables)
    return b"".join(replies.message(line, how) for line in context.lines), context.work


def _announce(said: bytes, ports: Sequence[Port]) -> None:
    for port in ports:
        port.announce(said)
