"""Identified responses on disk: one file each, named by machine, path and date, and checked before use."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from console.session.data.kept_files import folder_name, keep, names_in, path_exists, read_kept_values
from console.session.errors import SessionError, refuse
from drivers.cutting.strategy import Strategy
from drivers.identification.result import IdentifiedResponse, as_response, as_table, from_table, unfit_problems
from profiles.axis.response import ServoResponse
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError, ProfileError

FOLDER = "identified"
NEWEST = "newest"

MOST_OFFERED = 20
"""The newest responses among which one is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenResponse:
    """A kept response that a cut inverts instead of the model: its file, what that says, the curve through it."""

    file: Path
    identified: IdentifiedResponse
    response: ServoResponse

    @property
    def name(self) -> str:
        """The name by which the run record knows it."""
        return self.response.name


def store(data: Path, identified: IdentifiedResponse) -> Path:
    """Keep a response in the data folder, and return its file; ProfileError as `keep`."""
    folder = data / FOLDER / folder_name(identified.origin.machine)
    date = "".join(c for c in identified.date if c.isalnum())  # valid on any file system, and sorted by date
    path = folder / f"{identified.path}-{date}.json"
    keep(path, as_table(identified))
    return path


def load(file: Path) -> IdentifiedResponse:
    """Read one file. Raises `ProfileError`: `file.unreadable`, `file.too_large`, `identify.file`."""
    return from_table(read_kept_values(file, "identify.file"), printable(str(file)))


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
    files = names_in(data / FOLDER / folder_name(machine), ".json")
    files.sort(key=lambda file: (file.stem.rpartition("-")[2], file.name), reverse=True)
    found = []
    for file in files[:most]:
        try:
            found.append(KeptResponse(file=file, response=load(file)))
        except ProfileError as error:
            found.append(KeptResponse(file=file, response=None, problems=tuple(error.problems)))
    return tuple(found)


def kept_responses(
    data: Path, machine: MachineProfile, path: Strategy, *, simulated: bool | None = None
) -> tuple[ChosenResponse, ...]:
    """Return the responses of this path that apply to this machine, newest first, at least one.

    Raises:
        SessionError: `response.none_kept`; where none applies, every reason of the newest.
        ProfileError: the folder cannot be read; where none applies, the newest cannot be read.
    """
    folder = data / FOLDER / folder_name(machine.name)
    files = sorted((file for file in names_in(folder, ".json") if file.match(f"{path}-*")), reverse=True)
    files = files[:MOST_OFFERED]
    if not files:
        raise SessionError(Problem(code="response.none_kept", key=machine.name, value=path))
    found: list[ChosenResponse] = []
    refused: ProblemError | None = None
    for file in files:
        try:
            found.append(response_in(file, machine, path, simulated=simulated))
        except ProblemError as error:
            refused = refused or error
    if not found and refused is not None:
        raise refused
    return tuple(found)


def asked_response(
    data: Path, asked: str, machine: MachineProfile, path: Strategy, *, simulated: bool | None = None
) -> ChosenResponse:
    """Return the response that is `asked` for: `NEWEST` of this machine, the name of a kept one, or a file.

    Raises as `kept_responses` and `response_in`.
    """
    if asked == NEWEST:
        return kept_responses(data, machine, path, simulated=simulated)[0]
    file = Path(asked)
    if not path_exists(file):
        file = kept_file(data, machine, asked) or file
    return response_in(file, machine, path, simulated=simulated)


def kept_file(data: Path, machine: MachineProfile, name: str) -> Path | None:
    """Return the file of a kept response by its name, None where there is none."""
    file = data / FOLDER / folder_name(machine.name) / name
    return file if Path(name).name == name and path_exists(file) else None


def response_problems(
    chosen: ChosenResponse, machine: MachineProfile, path: Strategy, *, simulated: bool
) -> tuple[Problem, ...]:
    """Return why a chosen response does not apply to a cut on this path. Nothing is read."""
    where = printable(str(chosen.file))
    return unfit_problems(chosen.identified, machine, path, simulated=simulated, where=where)


def changed_problems(chosen: ChosenResponse) -> tuple[Problem, ...]:
    """Return why a response is no longer that of its file: `response.file_changed`, or the file's problems."""
    try:
        now = load(chosen.file)
    except ProblemError as error:
        return tuple(error.problems)
    return () if now == chosen.identified else (Problem(code="response.file_changed", key=chosen.name),)


def response_in(
    file: Path, machine: MachineProfile, path: Strategy, *, simulated: bool | None = None
) -> ChosenResponse:
    """Return the response that a cut on this path inverts. `simulated` is where it will cut, None for no cut.

    Raises:
        ProfileError: `file.unreadable`, `file.too_large`, `identify.file`, `response.bad_points`.
        SessionError: `response.of_another`, every reason why it does not apply here.
    """
    identified = load(file)
    refuse(unfit_problems(identified, machine, path, simulated=simulated, where=printable(str(file))))
    response = as_response(identified, printable(file.name))
    return ChosenResponse(file=file, identified=identified, response=response)
