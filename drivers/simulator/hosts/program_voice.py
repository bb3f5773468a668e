"""Execute on-line commands (CMD) of programs and PLCs, and send their messages (SEND) to hosts.

Both happen in the background cycle. Messages go to every host: the controller does not know which of them listens.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers.pmac.language.errors import PmacError
from drivers.pmac.plcs.plc import Addressed
from drivers.simulator.card.controller import Controller
from drivers.simulator.commands.line import commands
from drivers.simulator.commands.status import ACTIONS
from drivers.simulator.context import ALL_CARDS, Context
from drivers.simulator.hosts import replies
from drivers.simulator.hosts.port import WORK_PER_TURN, Port

COMMANDS_PER_CYCLE = 16  # maximum program commands per background cycle, fewer when they are costly


def speak(controller: Controller, ports: Sequence[Port]) -> None:
    """Execute the programs' requests since the last cycle."""
    pending, messages = controller.host.pending_commands, controller.host.host_messages
    if not pending and not messages:
        return
    done = work = 0
    while pending and done < COMMANDS_PER_CYCLE and work < WORK_PER_TURN:
        said, cost = _command(controller, *pending.popleft())
        done, work = done + 1, work + cost
        if said:
            _announce(said, ports)
    while messages:
        text, _ = messages.popleft()
        _announce(replies.message(text, replies.wording(controller.variables)), ports)


def _command(controller: Controller, text: str, port: str, addressed: Addressed) -> tuple[bytes, int]:
    """Execute a command as from a host; return the cost, and the output, data only for a named port."""
    motor, system = addressed.motor, addressed.system
    context = Context(controller, motor_number=motor, system_number=system, card_number=ALL_CARDS)
    try:
        if len(text) == 1 and ord(text) < ord(" "):
            action = ACTIONS.get(ord(text))
            report = action(context) if action is not None else None
            context.lines += [report] if report is not None else []
        else:
            for _ in commands(text, context):
                pass
    except PmacError as refusal:
        how = replies.wording(controller.variables)
        # With I6 = 2 only hosts get error messages.
        return b"" if how.errors == 2 else replies.refused(refusal.code, how), context.work
    how = replies.wording(controller.variables)
    return b"".join(replies.message(line, how) for line in context.lines if port), context.work


def _announce(said: bytes, ports: Sequence[Port]) -> None:
    for port in ports:
        port.announce(said)
