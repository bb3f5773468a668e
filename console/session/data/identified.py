"""Identified responses on disk: one file each, named by machine, path and date, and checked before use."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from console.session.data.kept_files import file_error, folder_name, keep, kept
from console.session.errors import refuse
from drivers.cutting.strategy import Strategy
from drivers.identification.result import IdentifiedResponse, as_response, as_table, from_table, unfit_problems
from profiles.axis.response import ServoResponse
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

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


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptResponse:
    """One file of a machine: its response, or why it cannot be read."""

    file: Path
    response: IdentifiedResponse | None
    problems: tuple[Problem, ...] = ()


def responses_of(data: Path, machine: str, most: int) -> tuple[KeptResponse, ...]:
    """Return the newest responses that are kept for a machine, by the dates in their names, at most so many.

    Raises ProfileError: `file.unreadable`, the folder cannot be read.
    """
    folder = data / FOLDER / folder_name(machine)
    try:
        files = [file for file in folder.iterdir() if file.suffix == ".json"]
    except (FileNotFoundError, NotADirectoryError):  # it is made with the first one
        return ()
    except OSError as error:
        raise file_error("file.unreadable", folder, error) from error
    files.sort(key=lambda file: (file.stem.rpartition("-")[2], file.name), reverse=True)
    found = []
    for file in files[:most]:
        try:
            found.append(KeptResponse(file=file, response=load(file)))
        except ProfileError as error:
            found.append(KeptResponse(file=file, response=None, problems=tuple(error.problems)))
    return tuple(found)


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
