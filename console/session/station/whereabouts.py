"""Where a machine is: what the command line says, or else its profile. Light, for a screen opens with it."""

from __future__ import annotations

from console.session.errors import SessionError
from drivers.link.address import LinkAddress, SimulatedAddress, parse_address
from profiles.machine import MachineProfile
from profiles.problem import Problem


def address_of(machine: MachineProfile, told: str | None, *, simulated: bool) -> LinkAddress:
    """Return where the machine is: the simulated one, where somebody says, or where its profile does.

    Raises:
        SessionError: `session.no_machine`, nobody says.
        LinkError: `link.bad_address`.
    """
    if simulated:
        return SimulatedAddress()
    address = told or machine.link
    if not address:
        raise SessionError(Problem(code="session.no_machine", where=machine.name, key="link"))
    return parse_address(address)
