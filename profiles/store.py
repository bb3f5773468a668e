"""Find, load and save profiles: the bundled library, overlaid by the operator's own folder.

A reference is the name of a saved profile (its file name without `.toml`; the operator's folder comes first),
an entry of the library, or a path, which contains a separator or ends in `.toml`. A name is that of the file and
of the profile in it, by which its records are found: else `job.name_differs`, `machine.name_differs`,
`gauge.name_differs`. Bundled profiles are never written.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import MutableMapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from profiles.fields import spell_toml
from profiles.files import parse_toml, printable, read_toml, write_atomically
from profiles.gauge import GaugeProfile, gauge_from_table
from profiles.job import JOB_FIELDS, LABELS, Job, hash_of_job, job_from_table, with_labels
from profiles.machine import MachineProfile, machine_from_table
from profiles.problem import Problem, ProfileError, refusal_error

_LIBRARY = Path(__file__).parent / "library"
BUNDLED_JOBS = _LIBRARY / "jobs"
BUNDLED_MACHINES = _LIBRARY / "machines"
BUNDLED_GAUGES = _LIBRARY / "gauges"


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryEntry:
    """A profile that can be loaded by name. Listing does not open it; it may prove unusable."""

    name: str
    path: Path
    bundled: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedJob:
    """A job with the file it came from, the hash (sha256, hexadecimal) of that file's bytes, and its text.

    Note and tags are no part of the hash (`profiles.job`).
    """

    job: Job
    path: Path
    sha256: str
    text: str = dataclasses.field(default="", repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedMachine:
    """A machine profile with the file it came from, the hash of that file's bytes, and its text."""

    machine: MachineProfile
    path: Path
    sha256: str
    text: str = dataclasses.field(default="", repr=False)


def list_jobs(user_folder: Path | None = None) -> tuple[LibraryEntry, ...]:
    """Return the jobs by name; one in `user_folder` hides a bundled one of the same name."""
    return _entries(BUNDLED_JOBS, user_folder)


def list_machines(user_folder: Path | None = None) -> tuple[LibraryEntry, ...]:
    """Return the machine profiles by name; one in `user_folder` hides a bundled one of the same name."""
    return _entries(BUNDLED_MACHINES, user_folder)


def load_job(reference: str | LibraryEntry, user_folder: Path | None = None) -> LoadedJob:
    """Return the job that `reference` names, or raise `ProfileError` with every problem of it."""
    path, name = _find(reference, list_jobs(user_folder), "job.unknown")
    content, table = read_toml(path)
    job = job_from_table(table, where=printable(str(path)))
    _refuse_other_name("job.name_differs", path, name, job.name)
    return LoadedJob(job=job, path=path, sha256=hash_of_job(content), text=_text(content))


def load_machine(reference: str | LibraryEntry, user_folder: Path | None = None) -> LoadedMachine:
    """Return the machine that `reference` names, or raise `ProfileError` with every problem of it."""
    path, name = _find(reference, list_machines(user_folder), "machine.unknown")
    content, table = read_toml(path)
    machine = machine_from_table(table, where=printable(str(path)))
    _refuse_other_name("machine.name_differs", path, name, machine.name)
    return LoadedMachine(
        machine=machine, path=path, sha256=hashlib.sha256(content).hexdigest(), text=_text(content)
    )


def list_gauges(user_folder: Path | None = None) -> tuple[LibraryEntry, ...]:
    """Return the gauges by name; one in `user_folder` hides a bundled one of the same name."""
    return _entries(BUNDLED_GAUGES, user_folder)


def load_gauge(reference: str | LibraryEntry, user_folder: Path | None = None) -> GaugeProfile:
    """Return the gauge that `reference` names, or raise `ProfileError` with every problem of it."""
    path, name = _find(reference, list_gauges(user_folder), "gauge.unknown")
    gauge = gauge_from_table(read_toml(path)[1], where=printable(str(path)))
    _refuse_other_name("gauge.name_differs", path, name, gauge.name)
    return gauge


def save_job(job: Job, path: Path, *, overwrite: bool = False, private: bool = False) -> None:
    """Write `job` to `path` in one step, `private` for its owner alone.

    With `overwrite`, comments and layout of an existing readable job file are kept. Raises
    `ProfileError` with the problems of the job itself, `file.exists`, `file.bundled` or `file.not_writable`.
    """
    where = printable(str(path))
    values = {key: value for key, value in asdict(job).items() if value is not None}
    job_from_table(values, where=where)
    _refuse_bundled(path)
    content = _job_text(values, path if overwrite else None).encode("utf-8")
    write_atomically(path, content, overwrite=overwrite, private=private)


def relabel_job(path: Path, *, note: str, tags: tuple[str, ...]) -> LoadedJob:
    """Write note and tags into a job's file, and return it as `load_job`; all else in the file stays as it is.

    Raises `ProfileError` with the problems of the file or of the labels, `file.bundled` or `file.not_writable`.
    """
    where = printable(str(path))
    _refuse_bundled(path)
    content, table = read_toml(path)
    wanted = dataclasses.replace(job_from_table(table, where=where), note=note, tags=tags)
    labelled = with_labels(content, note, tags)
    try:
        found = job_from_table(parse_toml(labelled, where))
        fits = (found.note, found.tags) == (note, tags)
    except ProfileError:  # the file spells a label otherwise, or the label is no text
        fits = False
    if fits:
        write_atomically(path, labelled, overwrite=True)
    else:
        save_job(wanted, path, overwrite=True)
    return load_job(str(path))


def rename_job(path: Path, name: str) -> Path:
    """Give a job another name: in its file, and as the name of that file, which is returned.

    Raises `ProfileError` with the problems of the job, `file.exists`, `file.bundled` or `file.not_writable`.
    The old file stays until the new one is complete.
    """
    where, target = printable(str(path)), path.with_name(f"{name}.toml")
    _refuse_bundled(path)
    _, table = read_toml(path)
    job = dataclasses.replace(job_from_table(table, where=where), name=name)
    values = {key: value for key, value in asdict(job).items() if value is not None}
    job_from_table(values, where=where)
    write_atomically(target, _job_text(values, path).encode("utf-8"), overwrite=False, private=True)
    try:
        path.unlink()
    except OSError as error:
        raise refusal_error("file.not_writable", where=where, value=error.strerror or str(error)) from error
    return target


def job_text(job: Job) -> str:
    """Return a job as the text of a new file."""
    return _job_text({key: value for key, value in asdict(job).items() if value is not None}, None)


def _refuse_bundled(path: Path) -> None:
    where = printable(str(path))
    try:
        bundled = _LIBRARY.resolve() in path.resolve().parents
    except (OSError, ValueError, RuntimeError) as error:
        raise refusal_error("file.not_writable", where=where, value=str(error)) from error
    if bundled:
        raise refusal_error("file.bundled", where=where)


def _text(content: bytes) -> str:
    return content.decode("utf-8")  # the parser has taken it as that


def _entries(bundled_folder: Path, user_folder: Path | None) -> tuple[LibraryEntry, ...]:
    entries: dict[str, LibraryEntry] = {}
    for folder, bundled in ((bundled_folder, True), (user_folder, False)):
        if folder is None:
            continue
        try:
            paths = [path for path in folder.iterdir() if path.suffix == ".toml" and path.is_file()]
        except OSError:  # the operator's folder is created with the first saved job
            continue
        entries.update({p.stem: LibraryEntry(name=p.stem, path=p, bundled=bundled) for p in paths})
    return tuple(entries[name] for name in sorted(entries))


def _refuse_other_name(code: str, path: Path, name: str | None, found: str) -> None:
    if name not in (None, found):
        raise refusal_error(code, where=printable(str(path)), value=printable(name or ""), limit=found)


def _find(reference: str | LibraryEntry, entries: tuple[LibraryEntry, ...], code: str) -> tuple[Path, str | None]:
    """Return the file of a profile, and the name that the profile in it must have, None for a path."""
    if isinstance(reference, LibraryEntry):
        return reference.path, reference.name
    if os.sep in reference or reference.endswith(".toml"):
        return Path(reference), None
    for entry in entries:
        if entry.name == reference:
            return entry.path, entry.name
    known = " | ".join(printable(entry.name) for entry in entries)
    raise refusal_error(code, value=spell_toml(reference), limit=known)


def _job_text(values: dict[str, Any], existing: Path | None) -> str:
    """Return the TOML of a job, merged into the text of `existing` where that is a sound job file."""
    # Loading needs only the standard library; start-up should not pay for saving.
    import tomlkit

    document = tomlkit.document()
    if existing is not None:
        try:
            content, table = read_toml(existing)
            job_from_table(table)
            document = tomlkit.parse(content.decode("utf-8-sig"))
        except ProfileError:
            pass  # the existing file is no job: nothing to keep
    for field in JOB_FIELDS:
        value = values.get(field.key)
        if value is None:
            continue
        plain = list(value) if isinstance(value, tuple) else value
        place = _place(document, field.key, field.table)
        if field.key in LABELS and not value and field.key not in place:
            continue
        if field.key not in place or place[field.key] != plain:  # an unchanged value keeps its spelling
            place[field.key] = plain
    text = tomlkit.dumps(document)
    job_from_table(parse_toml(text.encode("utf-8"), str(existing)))
    return text


def _place(document: MutableMapping[str, Any], key: str, table: str) -> MutableMapping[str, Any]:
    """Return the table of `document` that holds `key`, or the one where it belongs in a new file."""
    import tomlkit

    waiting = [document]
    while waiting:
        inner = waiting.pop()
        if key in inner:
            return inner
        waiting.extend(value for value in inner.values() if isinstance(value, MutableMapping))
    if not table:
        return document
    if not isinstance(document.get(table), MutableMapping):
        document[table] = tomlkit.table()
    found: MutableMapping[str, Any] = document[table]
    return found


UNSIGNED = "simulator only: sign again for a real machine"
MOST_CHARACTERS = 60
_MOST_BYTES = 200


def unfit_name(name: str) -> Problem | None:
    """Return why nothing can be saved under this name: `file.name_unfit`, `file.name_long`."""
    beyond = not name.strip() or not name.isprintable() or "/" in name or "\\" in name
    if beyond or name.startswith((".", "-", "~")) or name.lower().endswith(".toml"):
        return Problem(code="file.name_unfit", value=name or '""')
    if len(name) > MOST_CHARACTERS or len(name.encode()) > _MOST_BYTES:
        return Problem(code="file.name_long", value=str(len(name)), limit=f"<= {MOST_CHARACTERS}")
    return None


def copy_machine(loaded: LoadedMachine, name: str, folder: Path) -> LoadedMachine:
    """Write a profile into `folder` under another name, comments and all, and return it.

    A signature is one for a machine and does not pass to another: the copy is signed for the simulator only. Its
    link is taken out: it would be that of the other machine. Raises `ProfileError`: `file.name_unfit`,
    `file.name_long`, `file.exists`, `file.not_writable`.
    """
    if problem := unfit_name(name):
        raise ProfileError(problem)
    path = folder / f"{name}.toml"
    content = _text_of_copy(loaded.text, name).encode("utf-8")
    machine_from_table(parse_toml(content, str(path)), where=str(path))
    write_atomically(path, content, overwrite=False, private=True)
    return load_machine(str(path))


def _text_of_copy(text: str, name: str) -> str:
    import tomlkit  # slow to import, and only saving needs it

    document = tomlkit.parse(text.removeprefix("\N{BOM}"))
    document["name"] = name
    document.pop("link", None)
    if "safety" in document:
        safety = document["safety"]
        assert isinstance(safety, dict)
        safety["signed_by"], safety["signed_for"] = UNSIGNED, "simulator"
    return tomlkit.dumps(document)
