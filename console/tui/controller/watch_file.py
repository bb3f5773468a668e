"""The watch table of a machine: items that an engineer added, kept in the data folder."""

from __future__ import annotations

import json
from pathlib import Path

from console.session.data.kept_files import folder_name, kept, make_folder, there
from profiles.files import printable, write_atomically
from profiles.problem import Problem, ProfileError

FOLDER = "watch"
MOST = 24
_TITLE = "trilobe watch 1"


def watch_path(data: Path, machine: str) -> Path:
    """Return the file of the table of a machine."""
    return data / FOLDER / f"{folder_name(machine)}.json"


def read_watch(path: Path) -> tuple[str, ...]:
    """Return the items, none where there is no file.

    Raises ProfileError: `watch.unreadable`, it is not such a table; or as `read_regular_file`.
    """
    if not there(path):
        return ()
    found = kept(path, "watch.unreadable")
    items = found.get("items") if isinstance(found, dict) and found.get("schema") == _TITLE else None
    if not isinstance(items, list) or len(items) > MOST or not all(isinstance(each, str) for each in items):
        raise ProfileError(Problem(code="watch.unreadable", where=printable(str(path)), value=_TITLE))
    return tuple(dict.fromkeys(items))


def write_watch(path: Path, items: tuple[str, ...]) -> None:
    """Write the items. Raises ProfileError: `file.not_writable`."""
    make_folder(path.parent)
    content = json.dumps({"schema": _TITLE, "items": list(items)}, indent=2)
    write_atomically(path, f"{content}\n".encode(), overwrite=True, private=True)
