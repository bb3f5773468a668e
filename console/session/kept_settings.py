"""Settings written into the file of the account: whatever else is in it stays as it is, to the byte."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

from console.session.data.kept_files import make_folder, path_exists
from profiles.files import parse_toml, printable, read_regular_file, write_atomically
from profiles.problem import Problem, ProfileError

CAP_BYTES = 1_000_000
_TABLE = re.compile(r"^[ \t]*\[", re.MULTILINE)


def keep_settings(path: Path, values: Mapping[str, str | None]) -> None:
    """Set these keys in a configuration file, or take those without a value out; a missing file is made.

    Raises:
        ProfileError: the file cannot be read, is no TOML, or cannot be written; `config.not_kept` where the keys
            are written in a way that cannot be replaced. The file is then as it was.
    """
    where = printable(str(path))
    before = read_regular_file(path, cap_bytes=CAP_BYTES) if path_exists(path) else b""
    table = parse_toml(before, where)
    after = _with_values(before.decode("utf-8"), values).encode("utf-8")
    if after == before:
        return
    expected = {key: value for key, value in table.items() if key not in values}
    expected |= {key: value for key, value in values.items() if value is not None}
    try:
        sound = parse_toml(after, where) == expected
    except ProfileError:
        sound = False
    if not sound:
        raise ProfileError(Problem(code="config.not_kept", where=where, key=", ".join(values)))
    make_folder(path.parent)
    write_atomically(path, after, overwrite=True)


def _with_values(text: str, values: Mapping[str, str | None]) -> str:
    """Return the text with the line of each key replaced, or a new one before the first table."""
    table = _TABLE.search(text)
    head, tail = (text, "") if table is None else (text[: table.start()], text[table.start() :])
    for key, value in values.items():
        written = "" if value is None else f"{key} = {json.dumps(value, ensure_ascii=False)}"
        line = re.compile(rf"^[ \t]*{key}[ \t]*=[^\n]*\n?", re.MULTILINE)
        if (found := line.search(head)) is not None:
            comment = _comment(found[0])
            fresh = f"{written}{comment}\n" if written else ""
            head = head[: found.start()] + fresh + head[found.end() :]
        elif written:
            head += ("" if not head or head.endswith("\n") else "\n") + written + "\n"
    return head + tail


def _comment(line: str) -> str:
    """Return the comment behind a value of plain text, with the blanks before it."""
    found = re.fullmatch(r"[^=]*=[ \t]*(?:\"[^\"\\]*\"|'[^']*')([ \t]*#[^\n]*)\n?", line)
    return "" if found is None else found[1]
