"""What a cut was made from: the commit of the data folder, and whether its texts are those of that commit."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from console.session.errors import SessionError
from console.session.versioning.git import answer, commit_of, is_clone
from profiles.problem import Problem, ProfileError
from profiles.store import load_job

if TYPE_CHECKING:
    from console.session.work import Work

VERSIONED = "version_control"
"""Kind of the event that keeps it."""

TIMEOUT_S = 2.0  # whoever writes the log of a run waits for it


def cut_from(data: Path, texts: dict[str, tuple[Path | None, str]]) -> dict[str, object] | None:
    """Return the commit, and for each text with its file whether it differs; None where the folder is no clone.

    A text differs that has other bytes than its file in the commit, or that the commit does not have; None for
    a file outside of the folder, such as a bundled one. What git refuses is in `problem`; nothing is raised.
    """
    if not is_clone(data):
        return None
    try:
        commit = commit_of(data, TIMEOUT_S)
        differs = {f"{name}_differs": _differs(data, commit, path, text) for name, (path, text) in texts.items()}
        return {"commit": commit, **differs}
    except SessionError as error:
        return {"commit": None, "problem": error.problems[0].code}


def _differs(data: Path, commit: str | None, path: Path | None, text: str) -> bool | None:
    if path is None:  # edited on the screen
        return True
    inside = os.path.relpath(os.path.realpath(path), os.path.realpath(data))
    if inside.startswith(os.pardir):
        return None
    if commit is None:
        return True
    there = answer(data, "cat-file", "blob", f"{commit}:{inside}", timeout_s=TIMEOUT_S)
    return there is None or there.decode("utf-8-sig", "backslashreplace") != text


def changed_since_opened(work: Work | None) -> tuple[Problem, ...]:
    """Return `job.changed_on_disk` where the file of a job is not as it was opened, such as after `git pull`.

    Of one that was edited on the screen it does not matter: that is what is cut. A file that is gone cannot be
    opened again: what was opened may be cut.
    """
    if work is None or work.edited:
        return ()
    loaded = work.loaded
    try:
        same = load_job(str(loaded.path)).sha256 == loaded.sha256
    except ProfileError:
        same = not loaded.path.exists()
    return () if same else (Problem(code="job.changed_on_disk", key=loaded.job.name, where=loaded.path.name),)
