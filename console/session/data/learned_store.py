"""Learned compensations on disk: one file per version, never overwritten, found by what they apply to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from console.session.data.kept_files import ahead_problems, folder_name, keep, paths_in, read_kept_values
from console.session.errors import SessionError, refuse
from profiles.compensations.learned_compensation import (
    HoldsFor,
    LearnedCompensation,
    as_table,
    differences,
    from_table,
    path_settings,
)
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedJob, LoadedMachine

FOLDER = "learned"
NONE, NEWEST = "none", "newest"


def asked_for(
    job: LoadedJob, machine: LoadedMachine, strategy: str, *, simulated: bool, lathe: str = ""
) -> HoldsFor:
    """Return what a compensation must match to be used in this cut; `lathe` is "" where it is not known."""
    return HoldsFor(
        job=job.job.name,
        job_sha256=job.sha256,
        machine=machine.machine.name,
        machine_sha256=machine.sha256,
        simulated=simulated,
        strategy=strategy,
        lathe=lathe,
        settings=path_settings(job.job, machine.machine),
    )


def store(data: Path, learned: LearnedCompensation) -> Path:
    """Keep a version in the data folder, and return its file; ProfileError as `keep`."""
    path = _folder(data, learned.holds_for) / _name(learned.version)
    keep(path, as_table(learned))
    return path


def versions(data: Path, asked: HoldsFor) -> tuple[LearnedCompensation, ...]:
    """Return all versions of a job on a machine, oldest first, applying or not; errors as `read_kept_values`."""
    return tuple(_load(file) for file in sorted(paths_in(_folder(data, asked))) if file.match("version-*.json"))


def elsewhere_problems(data: Path, asked: HoldsFor) -> tuple[Problem, ...]:
    """Return `learned.elsewhere_*` if the other kind of lathe, real or simulated, has versions.

    Raises the errors of `read_kept_values`.
    """
    other = versions(data, replace(asked, simulated=not asked.simulated))
    code = "learned.elsewhere_real" if asked.simulated else "learned.elsewhere_simulated"
    return (Problem(code=code, key=asked.job, value=str(len(other))),) if other else ()


def find_newest_version(
    job: LoadedJob, machine: LoadedMachine, data: Path, *, simulated: bool
) -> LearnedCompensation | None:
    """Return the newest of the `versions` of a job on a machine, whether it applies or not; None without any."""
    known = versions(data, asked_for(job, machine, "", simulated=simulated))
    return known[-1] if known else None


def choose_version(
    word: str, known: tuple[LearnedCompensation, ...], asked: HoldsFor
) -> LearnedCompensation | None:
    """Return the version that `word` means: "none", "newest" or its number; None is the model's.

    Raises:
        SessionError: `learned.none`, `learned.unknown`; why it does not apply to this cut, see `differences`.
    """
    if word == NONE:
        return None
    if not known:
        raise SessionError(Problem(code="learned.none", key=asked.job, value=asked.machine))
    found = known[-1] if word == NEWEST else next((each for each in known if str(each.version) == word), None)
    if found is None:
        raise SessionError(Problem(code="learned.unknown", value=word, limit=f"1 … {known[-1].version}"))
    refuse(differences(found, asked))
    return found


def date_problems(learned: LearnedCompensation | None) -> tuple[Problem, ...]:
    """Return `learned.date_ahead` for a version dated in the future; nothing for the model's, None."""
    if learned is None:
        return ()
    return ahead_problems("learned.date_ahead", [learned.date], key=str(learned.version))


def lathe_problems(learned: LearnedCompensation | None, asked: HoldsFor) -> tuple[Problem, ...]:
    """Return `learned.lathe_unknown` for a version of simulated parts that does not say on which lathe."""
    if learned is None or learned.is_model or learned.holds_for.lathe or not asked.lathe:
        return ()
    return (Problem(code="learned.lathe_unknown", key=str(learned.version), value=asked.lathe),)


def _load(file: Path) -> LearnedCompensation:
    where = printable(str(file))
    learned = from_table(read_kept_values(file, "learned.file"), where)
    if file.name != _name(learned.version):
        raise ProfileError(Problem(code="learned.file", where=where, value=f"version {learned.version}"))
    return learned


def _name(version: int) -> str:
    return f"version-{version:06d}.json"


def _folder(data: Path, asked: HoldsFor) -> Path:
    """Return the folder of a job on a machine."""
    where = "simulated" if asked.simulated else "machine"
    return data / FOLDER / where / folder_name(asked.machine) / folder_name(asked.job)
