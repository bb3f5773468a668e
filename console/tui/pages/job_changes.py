"""What the page Jobs changes on disk, at rest: each change with its refusals, and what it says afterwards."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from console.session.job_files import delete_job, export_job, import_job, last_deleted, restore_job
from console.session.work import differs, open_work, relabel_work
from console.tui.pages.fields import free_name, name_problem
from console.tui.ui_context import UiContext
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.store import LibraryEntry, load_job, relabel_job, rename_job, save_job


def own_or_refused(entry: LibraryEntry) -> None:
    """Refuse a supplied job: ProfileError `screen.job_bundled`."""
    if entry.bundled:
        raise _refusal("screen.job_bundled", value=printable(entry.name))


def rename_refused(ui: UiContext, entry: LibraryEntry) -> None:
    """Refuse to rename a supplied job, or the open one with edits: ProfileError."""
    own_or_refused(entry)
    if is_open(ui, entry) and ui.work is not None and ui.work.edited:
        raise _refusal("screen.job_edited", value=printable(entry.name))


def rename_job_file(ui: UiContext, entry: LibraryEntry, name: str, taken: frozenset[str]) -> Path:
    """Rename a job, and return its file; the open one stays open. What is kept by its old name stays there.

    Raises ProfileError: as `rename_refused`, `name_problem` and `rename_job`.
    """
    rename_refused(ui, entry)
    if problem := name_problem(name, taken):
        raise ProfileError(problem)
    kept_open, before = is_open(ui, entry), ui.work
    path = rename_job(entry.path, name)
    if kept_open and before is not None:
        # Loads numerics, which the first page does without.
        from console.session.cut.compensated_cut import with_accepted

        work = replace(open_work(load_job(str(path)), ui.machine), strategy=before.strategy, stage=before.stage)
        state = ui.control.state
        ui.work = with_accepted(work, ui.data, simulated=state.simulated, lathe=state.lathe)
    ui.say("screen.job_renamed", key=printable(entry.name), value=printable(name))
    return path


def label_job(ui: UiContext, entry: LibraryEntry, *, note: str | None = None, tags: str | None = None) -> None:
    """Give a job another note or other tags, words with blanks or commas between them; unsaved edits stay.

    Raises ProfileError: as `own_or_refused` and `relabel_job`.
    """
    own_or_refused(entry)
    before = load_job(str(entry.path))
    words = before.job.tags if tags is None else tuple(dict.fromkeys(filter(None, re.split(r"[,\s]+", tags))))
    after = relabel_job(entry.path, note=before.job.note if note is None else note.strip(), tags=words)
    # One that somebody else has changed meanwhile stays as it was opened: saving it says so.
    if is_open(ui, entry) and ui.work is not None and not differs(before, ui.work.loaded):
        ui.work = relabel_work(ui.work, after)


def delete_refused(ui: UiContext, entry: LibraryEntry) -> None:
    """Refuse to delete a supplied job, or the open one with edits: ProfileError."""
    rename_refused(ui, entry)


def remove_job(ui: UiContext, entry: LibraryEntry) -> None:
    """Move a job to the deleted ones; the open one is closed. ProfileError: as `delete_refused`, `delete_job`."""
    delete_refused(ui, entry)
    delete_job(ui.data, entry.path)
    if is_open(ui, entry):
        ui.work = None
    ui.say("screen.job_deleted", value=printable(entry.name))


def brought_back(ui: UiContext, taken: frozenset[str]) -> Path | None:
    """Bring the last deleted job back, under a free name where its own is `taken`; None where there is none.

    Raises ProfileError: as `last_deleted` and `restore_job`.
    """
    last = last_deleted(ui.data)
    if last is None:
        ui.say("screen.nothing_deleted")
        return None
    deleted_file, name = last
    other = name in taken
    name = free_name(name, taken) if other else name
    path = restore_job(ui.data, deleted_file, name)
    if other:
        with suppress(ProfileError):  # one that cannot be read is listed with its reason
            save_job(replace(load_job(str(path)).job, name=name), path, overwrite=True)
    ui.say("screen.job_back", value=printable(name))
    return path


def import_job_file(ui: UiContext, source: Path, taken: frozenset[str]) -> Path:
    """Copy a job file among the own jobs, and return the copy.

    Raises ProfileError: as `name_problem` for the name of the file, and `import_job`.
    """
    if problem := name_problem(source.stem, taken):
        raise ProfileError(problem)
    path = import_job(ui.data, source)
    ui.say("screen.job_imported", value=printable(source.stem))
    return path


def copy_job_out(ui: UiContext, entry: LibraryEntry) -> None:
    """Copy a job file to the exported ones; ProfileError as `export_job`."""
    ui.say("screen.job_exported", value=printable(str(export_job(ui.data, entry.path))))


def is_open(ui: UiContext, entry: LibraryEntry) -> bool:
    """Whether this is the open job."""
    return ui.work is not None and ui.work.loaded.path == entry.path


def _refusal(code: str, *, value: str) -> ProfileError:
    return ProfileError(Problem(code=code, value=value))
