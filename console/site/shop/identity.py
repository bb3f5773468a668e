"""Which lathe a data folder belongs to: a random id, made once, and a name for people.

Machines have names that are the same in many shops, and clocks may be wrong: neither can say where a record is
from.
"""

from __future__ import annotations

import platform
import re
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from console.session.data.kept_files import file_error, keep, read_kept_values, utc_now
from console.session.errors import SessionError
from profiles.files import printable
from profiles.problem import Problem, ProfileError

FILE_NAME = "lathe.json"
SCHEMA = 1
NAME_CAP = 60
_ID = re.compile(r"[0-9a-f]{32}")


@dataclass(frozen=True, slots=True)
class LatheIdentity:
    """A lathe: `lathe_id` never changes, `name` is for people and may be edited in the file."""

    lathe_id: str
    name: str


def lathe_identity(data: Path) -> LatheIdentity:
    """Return the identity in a data folder, which is made where there is none yet.

    Raises:
        SessionError: `ship.no_folder`, there is no such folder; `ship.identity`, the file is not ours.
        ProfileError: `file.*`, it cannot be read or written.
    """
    path = data / FILE_NAME
    try:
        present, made = data.is_dir(), path.exists()
    except OSError as error:
        raise file_error("file.unreadable", path, error) from error
    if not present:
        raise SessionError(Problem(code="ship.no_folder", where=printable(str(data))))
    if not made:
        try:
            keep(path, _new())
        except ProfileError as error:
            if error.problems[0].code != "file.exists":  # another console was quicker
                raise
    return _identity(read_kept_values(path, "ship.identity"), path)


def _new() -> dict[str, Any]:
    name = printable(platform.node() or "lathe", NAME_CAP)
    return {"schema": SCHEMA, "id": uuid.uuid4().hex, "name": name, "made_utc": utc_now()}


def _identity(table: Any, path: Path) -> LatheIdentity:
    found = table if isinstance(table, dict) else {}
    lathe_id, name = found.get("id"), found.get("name")
    sound = found.get("schema") == SCHEMA and isinstance(lathe_id, str) and _ID.fullmatch(lathe_id)
    if not sound or not isinstance(name, str) or not name.strip() or printable(name, NAME_CAP) != name:
        value = printable(str({key: found.get(key) for key in ("schema", "id", "name")}), 100)
        raise SessionError(Problem(code="ship.identity", where=printable(str(path)), value=value))
    assert isinstance(lathe_id, str)
    return LatheIdentity(lathe_id, name)
