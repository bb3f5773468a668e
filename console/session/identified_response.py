"""An identified response from its file, made sure to be the one of this machine and path."""

from __future__ import annotations

from pathlib import Path

from console.session.errors import SessionError
from console.session.identified import load
from drivers.cutting.plan import Strategy
from drivers.identification.fit import unfit_problems
from drivers.identification.result import as_response
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.response import ServoResponse


def response_in(
    file: Path, machine: MachineProfile, path: Strategy, *, simulated: bool | None = None
) -> ServoResponse:
    """Return what a cut on this path inverts. `simulated` says where it will be, None where nothing will be cut.

    Raises:
        ProfileError: `file.unreadable`, `file.too_large`, `identify.file`, `response.bad_points`.
        SessionError: `response.of_another`, everything by which it does not hold here.
    """
    identified = load(file)
    if problems := unfit_problems(identified, machine, path, simulated=simulated, where=printable(str(file))):
        raise SessionError(*problems)
    return as_response(identified, printable(file.name))
