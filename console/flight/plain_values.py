"""Frozen dataclasses as plain JSON values, and what changed from one to the next.

Nothing is imported for it: what is written is found by looking at the value. `recording` reads it.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import PurePath
from typing import Any

from profiles.files import printable

LONGEST_TEXT = 4000  # characters; a longer text is cut when it is written, and refused when it is read
ARRAY, DROPPED = "f8", "drop"  # keys of an array: its numbers in base64, and how many of the one before are gone

Form = Callable[[object], object]
"""What is recorded in the place of a value: most often the value itself."""


def as_it_is(value: object) -> object:
    """Record every value as it is."""
    return value


def to_json_value(value: object, form: Form = as_it_is) -> Any:
    """Return a value as JSON has it. Raises TypeError of what is no value, such as an open file."""
    value = form(value)
    if isinstance(value, Enum):
        return value.value
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        found = float(value)
        return found if math.isfinite(found) else str(found)
    if isinstance(value, str | PurePath):
        return printable(str(value), LONGEST_TEXT)
    if isinstance(value, complex):
        return [to_json_value(value.real), to_json_value(value.imag)]
    return _plain_parts(value, form)


def _plain_parts(value: object, form: Form) -> Any:
    if is_dataclass(value):
        return {name: to_json_value(getattr(value, name), form) for name in names_of(type(value))}
    if isinstance(value, Mapping):
        return {to_json_value(str(key)): to_json_value(each, form) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [to_json_value(each, form) for each in value]
    if isinstance(value, frozenset | set):
        return sorted(to_json_value(each, form) for each in value)
    if _is_array(value):
        return {ARRAY: _base64(value)}
    if hasattr(value, "item"):  # a number of numpy's own
        return to_json_value(value.item())
    raise TypeError(f"{type(value).__name__} cannot be recorded")


def changes(before: object, now: object, form: Form = as_it_is) -> dict[str, Any]:
    """Return what changed, by dotted names of fields; what is the same object is not looked into."""
    found: dict[str, Any] = {}
    _compare(before, now, form, "", found)
    return found


def _compare(before: object, now: object, form: Form, path: str, found: dict[str, Any]) -> None:
    if before is now:
        return
    before, now = form(before), form(now)
    if type(before) is type(now) and is_dataclass(now):
        for name in names_of(type(now)):
            old, new = getattr(before, name), getattr(now, name)
            if old is not new:  # most are the same, ten times a second
                _compare(old, new, form, f"{path}.{name}" if path else name, found)
    elif _is_array(now):
        _compare_arrays(before, now, path, found)
    elif type(before) is not type(now) or before != now:
        found[path] = to_json_value(now, form)


def _compare_arrays(before: Any, now: Any, path: str, found: dict[str, Any]) -> None:
    """Samples that slide: those that left and those that came, where that is all."""
    if not _is_array(before) or not len(before) or not len(now):
        found[path] = {ARRAY: _base64(now)}
        return
    starts = (before == now[0]).nonzero()[0]
    for start in starts[:1]:
        kept = len(before) - int(start)
        if kept <= len(now) and (before[start:] == now[:kept]).all():
            if start or kept < len(now):
                found[path] = {DROPPED: int(start), ARRAY: _base64(now[kept:])}
            return
    found[path] = {ARRAY: _base64(now)}


def _is_array(value: object) -> bool:
    return bool(getattr(value, "ndim", 0))  # not by its type: numpy need not be there


def _base64(array: Any) -> str:
    return b64encode(array.astype("<f8").tobytes()).decode("ascii")


def names_of(kind: Any) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass."""
    found = _NAMES.get(kind)
    if found is None:
        found = _NAMES[kind] = tuple(field.name for field in fields(kind))
    return found


_NAMES: dict[Any, tuple[str, ...]] = {}
