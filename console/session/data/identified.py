"""Identified responses on disk: one file each, named by machine, path and date, and checked before use."""

from __future__ import annotations

from pathlib import Path

from console.session.data.kept_files import folder_name, keep, kept
from console.session.errors import refuse
from drivers.cutting.strategy import Strategy
from drivers.identification.result import IdentifiedResponse, as_response, as_table, from_table, unfit_problems
from profiles.axis.response import ServoResponse
from profiles.files import printable
from profiles.machine import MachineProfile

FOLDER = "identified"


def store(data: Path, identified: IdentifiedResponse) -> Path:
    """Keep a response in the data folder, and return its file; ProfileError as `keep`."""
    folder = data / FOLDER / folder_name(identified.origin.machine)
    date = "".join(c for c in identified.date if c.isalnum())  # valid on any file system, and sorted by date
    path = folder / f"{identified.path}-{date}.json"
    keep(path, as_table(identified))
    return path


def load(file: Path) -> IdentifiedResponse:
    """Read one file. Raises `ProfileError`: `file.unreadable`, `file.too_large`, `identify.file`."""
    return from_table(kept(file, "identify.file"), printable(str(file)))


def response_in(
    file: Path, machine: MachineProfile, path: Strategy, *, simulated: bool | None = None
) -> ServoResponse:
    """Return the response that a cut on this path inverts. `simulated` is where it will cut, None for no cut.

    Raises:
        ProfileError: `file.unreadable`, `file.too_large`, `identify.file`, `response.bad_points`.
        SessionError: `response.of_another`, every reason why it does not apply here.
    """
    identified = load(file)
    refuse(unfit_problems(identified, machine, path, simulated=simulated, where=printable(str(file))))
    return as_response(identified, printable(file.name))
