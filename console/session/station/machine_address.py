"""Address of a machine: from the command line, or else from its profile. Light, because a screen opens with it."""

from __future__ import annotations

from console.session.errors import SessionError
from drivers.link.address import LinkAddress, SimulatedAddress, parse_address
from profiles.machine import MachineProfile
from profiles.problem import Problem


def address_of(machine: MachineProfile, given: str | None, *, simulated: bool) -> LinkAddress:
    """Return the machine's address: the simulated one, that of the argument, or that of the profile.

    Raises:
        SessionError: `session.no_machine`, neither gives one.
        LinkError: `link.bad_address`.
    """
    if simulated:
        return SimulatedAddress()
    address = given or machine.link
    if not address:
        raise SessionError(Problem(code="session.no_machine", where=machine.name, key="link"))
    return parse_address(address)
