"""Learned compensations on disk: one file per version, never overwritten, found by what they apply to."""

from __future__ import annotations

from pathlib import Path

from console.session.data.dates import is_ahead, utc_now
from console.session.data.kept_files import folder_name, keep, kept
from console.session.errors import SessionError
from profiles.compensations.learned import HoldsFor, LearnedCompensation, as_table, differences, from_table
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedJob, LoadedMachine

FOLDER = "learned"
NONE, NEWEST = "none", "newest"


def asked_for(job: LoadedJob, machine: LoadedMachine, strategy: str, *, simulated: bool) -> HoldsFor:
    """Return what a compensation must match to be used in this cut."""
    return HoldsFor(
        job=job.job.name,
        job_sha256=job.sha256,
        machine=machine.machine.name,
        machine_sha256=machine.sha256,
        simulated=simulated,
        strategy=strategy,
    )


def store(data: Path, learned: LearnedCompensation) -> Path:
    """Keep a version in the data folder, and return its file.

    Raises:
        ProfileError: `file.exists`, somebody else has kept this version meanwhile; `file.not_writable`.
    """
    path = _folder(data, learned.holds_for) / _name(learned.version)
    keep(path, as_table(learned))
    return path


def versions(data: Path, asked: HoldsFor) -> tuple[LearnedCompensation, ...]:
    """Return all versions of a job on a machine, oldest first, whether they still apply or not.

    Raises:
        ProfileError: a file that cannot be read, or is not ours: it may be the one that was asked for.
    """
    return tuple(_load(file) for file in sorted(_folder(data, asked).glob("version-*.json")))


def accepted(job: LoadedJob, machine: LoadedMachine, data: Path, *, simulated: bool) -> LearnedCompensation | None:
    """Return the newest version of a job on a machine, whether it still applies or not; None without any.

    Raises:
        ProfileError: as `versions`.
    """
    known = versions(data, asked_for(job, machine, "", simulated=simulated))
    return known[-1] if known else None


def chosen(word: str, known: tuple[LearnedCompensation, ...], asked: HoldsFor) -> LearnedCompensation | None:
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
        limit = f"1 … {known[-1].version}"
        raise SessionError(Problem(code="learned.unknown", value=word, limit=limit))
    if problems := differences(found, asked):
        raise SessionError(*problems)
    return found


def date_problems(learned: LearnedCompensation | None) -> tuple[Problem, ...]:
    """Return `learned.date_ahead` for a version dated in the future; nothing for the model's, None."""
    now = utc_now()
    if learned is None or not is_ahead(learned.date, now):
        return ()
    value = printable(learned.date, 60)
    return (Problem(code="learned.date_ahead", key=str(learned.version), value=value, limit=now),)


def _load(file: Path) -> LearnedCompensation:
    where = printable(str(file))
    learned = from_table(kept(file, "learned.file"), where)
    if file.name != _name(learned.version):
        raise ProfileError(Problem(code="learned.file", where=where, value=f"version {learned.version}"))
    return learned


def _name(version: int) -> str:
    return f"version-{version:06d}.json"


def _folder(data: Path, asked: HoldsFor) -> Path:
    """Return the folder of a job on a machine."""
    names = [folder_name(name) for name in (asked.machine, asked.job)]
    return data.joinpath(FOLDER, "simulated" if asked.simulated else "machine", *names)
