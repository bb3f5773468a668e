"""Profiles in a list: each with what was loaded, or with why it cannot be."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeAlias, TypeVar

from console.text.catalogue import Catalogue
from profiles.problem import Problem, ProfileError
from profiles.store import LibraryEntry

Loaded = TypeVar("Loaded")
Listed: TypeAlias = tuple[LibraryEntry, Loaded | tuple[Problem, ...]]
"""An entry with its profile, or why it is unreadable."""


def list_library(entries: Iterable[LibraryEntry], load: Callable[[LibraryEntry], Loaded]) -> list[Listed[Loaded]]:
    """Return each entry with its profile as `load` returns it, or with the problems of the file."""
    return [(entry, _load_entry(entry, load)) for entry in entries]


def fields_of_entry(each: Listed[Loaded], text: Catalogue) -> dict[str, object]:
    """Return where a profile is from, for JSON, with the problems of one that cannot be read."""
    entry, loaded = each
    fields: dict[str, object] = {"name": entry.name, "path": str(entry.path), "bundled": entry.bundled}
    return {**fields, "problems": [text.problem(one) for one in loaded]} if isinstance(loaded, tuple) else fields


def sentences(found: Iterable[Listed[Loaded]], text: Catalogue) -> list[str]:
    """Return why some cannot be read."""
    return [text.problem(problem) for _, loaded in found if isinstance(loaded, tuple) for problem in loaded]


def _load_entry(entry: LibraryEntry, load: Callable[[LibraryEntry], Loaded]) -> Loaded | tuple[Problem, ...]:
    try:
        return load(entry)
    except ProfileError as error:
        return tuple(error.problems)
