"""The folder of traces, looked at beside the screen again and again: one that hangs delays its list alone."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from console.session.data.made_parts import CutPart
from console.session.data.trace_folder import offered, trace_folder
from console.tui.records.beside import Beside, Problems
from profiles.problem import Problem, ProfileError

Changed = tuple[int, int]
"""When a file or a folder was changed, ns, and its size; zeros where it is gone."""

GONE: Changed = (0, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What was found: the files, those of typed paths first, the others newest first, and when they were changed.

    `file` is the one that was asked for. `problems`: why the folder can no longer be read. `part` is the newest
    one in the record at the first look.
    """

    folder: Path
    part: CutPart | None
    listed: Changed
    typed: tuple[Path, ...] = ()
    files: tuple[Path, ...] = ()
    dates_ns: Mapping[Path, int] = field(default_factory=dict)
    file: Path | None = None
    changed: Changed = GONE
    problems: tuple[Problem, ...] = ()


class TraceListing:
    """Polls the folder while it is asked; each poll begins when the one before has ended."""

    def __init__(self, data: Path) -> None:
        self._data = data
        self._looks: Beside[Look] = Beside()
        self._checks: Beside[bool] = Beside()
        self._turn = self._check = 0
        self._last: Look | Problems | None = None

    def begin(self) -> None:
        """Forget what was seen: the list is opened."""
        self._turn, self._last = self._turn + 1, None

    def look(
        self, file: Path | None, typed: tuple[Path, ...], part: Callable[[], CutPart | None]
    ) -> Look | Problems | None:
        """Return the newest poll; problems where nothing can be read at all, None before the first one."""
        before = self._last if isinstance(self._last, Look) else None
        question = (self._turn, file, typed)
        found = self._looks.answer(question, lambda: _looked(self._data, before, file, typed, part))
        if found is not None:
            self._turn, self._last = self._turn + 1, found
        return self._last

    def check(self) -> None:
        """Begin to find out about a typed path."""
        self._check += 1

    def is_file(self, path: Path) -> bool | None:
        """Return whether there is a file at the typed path, None while that is found out."""
        found = self._checks.answer((self._check, path), path.is_file)
        return found if found is None else found is True


def _looked(
    data: Path, before: Look | None, file: Path | None, typed: tuple[Path, ...], part: Callable[[], CutPart | None]
) -> Look:
    """Poll once; the folder is listed again only where something in it has come or gone."""
    at = GONE if file is None else changed(file)
    if before is None:
        folder = trace_folder(data)
        listed = changed(folder)
        first = Look(folder=folder, part=part(), listed=listed, file=file, changed=at)
        return _with_files(first, typed, offered(folder))
    listed = changed(before.folder)
    if listed == before.listed and typed == before.typed:
        return replace(before, file=file, changed=at)
    now = replace(before, listed=listed, file=file, changed=at, problems=())
    try:
        return _with_files(now, typed, offered(before.folder))
    except ProfileError as error:
        return _with_files(replace(now, problems=tuple(error.problems)), typed, ())


def _with_files(look: Look, typed: tuple[Path, ...], found: tuple[Path, ...]) -> Look:
    files = (*typed, *(each for each in found if each not in typed))
    return replace(look, typed=typed, files=files, dates_ns={each: changed(each)[0] for each in files})


def changed(path: Path) -> Changed:
    """Return when a file or a folder was changed, and its size."""
    try:
        status = os.stat(path)
    except OSError:
        return GONE
    return status.st_mtime_ns, status.st_size
