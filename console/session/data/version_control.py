"""What a cut was made from: the commit of the data folder, and whether its texts are those of that commit.

Git is asked about a folder that may come from elsewhere: nothing is changed, nothing is fetched.

Its configuration and attributes may name programs. So only commands that run none are used (`status` and `diff`
would filter files), the monitor is off, and no transport is allowed: git would fetch what a partial clone lacks.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from shutil import which

from console.session.errors import SessionError
from profiles.files import printable
from profiles.problem import Problem

VERSIONED = "version_control"
"""Kind of the event that keeps it."""

LOG_TIMEOUT_S = 2.0  # whoever writes the log of a run waits for it
TIMEOUT_S = 20.0
SHOWN_CHARACTERS = 200
CLONE = ".git"

_QUIET = (
    *("-c", "core.fsmonitor=false", "-c", "core.hooksPath=/dev/null", "-c", "safe.bareRepository=explicit"),
    *("--no-optional-locks", "--no-pager", "--no-replace-objects"),
)
_NEVER = ("GIT_DIR", "GIT_INDEX_FILE", "GIT_NAMESPACE", "GIT_OBJECT_DIRECTORY")
"""Variables that would lead to another repository."""


def is_clone(data: Path) -> bool:
    """Return whether a data folder itself is a clone; one that lies in somebody's clone is not."""
    return os.path.lexists(data / CLONE)


def answer(data: Path, *words: str, timeout_s: float = TIMEOUT_S) -> bytes | None:
    """Return what git answers about a data folder; None where it refuses, such as a file that no commit has.

    Raises SessionError: `git.not_installed`; `git.refused`, the clone cannot be read at all; `git.timeout`.
    """
    program = which("git")
    if program is None:
        raise SessionError(Problem(code="git.not_installed"))
    environment = {key: value for key, value in os.environ.items() if key not in _NEVER}
    environment |= {"LC_ALL": "C", "GIT_TERMINAL_PROMPT": "0", "GIT_NO_LAZY_FETCH": "1", "GIT_ALLOW_PROTOCOL": ""}
    # A clone that is damaged is not taken for part of one above it, nor its configuration for where its files are.
    environment |= {
        "GIT_CEILING_DIRECTORIES": os.path.realpath(data.parent),
        "GIT_WORK_TREE": os.path.abspath(data),
    }
    where = printable(str(data))
    try:
        done = subprocess.run(
            [program, "-C", str(data), *_QUIET, *words],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            env=environment,
            timeout=timeout_s,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        value = f"{timeout_s:g} s"
        raise SessionError(Problem(code="git.timeout", where=where, value=value)) from error
    except OSError as error:
        raise SessionError(Problem(code="git.refused", where=where, value=error.strerror or str(error))) from error
    if done.returncode == 0:
        return done.stdout
    said = done.stderr.decode("utf-8", "replace").strip()
    if any(word in said for word in ("dubious ownership", "not a git repository", "invalid gitfile")):
        first = said.splitlines()[0] if said else ""
        raise SessionError(Problem(code="git.refused", where=where, value=printable(first, SHOWN_CHARACTERS)))
    return None


def commit_of(data: Path, timeout_s: float = TIMEOUT_S) -> str | None:
    """Return the commit that a clone is at, None before the first one. SessionError: as `answer`."""
    found = answer(data, "rev-parse", "--verify", "--quiet", "HEAD^{commit}", timeout_s=timeout_s)
    return None if found is None else found.decode("ascii", "replace").strip()


def cut_from(data: Path, texts: dict[str, tuple[Path | None, str]]) -> dict[str, object] | None:
    """Return the commit, and for each text with its file whether it differs; None where the folder is no clone.

    A text differs that has other bytes than its file in the commit, or that the commit does not have; None for
    a file outside of the folder, such as a bundled one. What git refuses is in `problem`; nothing is raised.
    """
    if not is_clone(data):
        return None
    try:
        commit = commit_of(data, LOG_TIMEOUT_S)
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
    there = answer(data, "cat-file", "blob", f"{commit}:{inside}", timeout_s=LOG_TIMEOUT_S)
    return there is None or there.decode("utf-8-sig", "backslashreplace") != text
