"""Read values from our own files: of the right type, or refused. Nothing is converted.

A file in the data folder may be old, cut short, or edited by hand; its content moves a machine. So "false" is
not a truth value, 2.7 not a whole number, "1e3" not a number, and neither are infinity and NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from datetime import date
from enum import Enum
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from profiles.files import printable
from profiles.problem import refusal_error

Record = TypeVar("Record")

DEPTH_CAP = 40  # far deeper than any of our files: deeper nesting would fail in Python when it is read or shown
DAMAGED_AT = "damaged or cut short at line"


def from_json(content: str | bytes) -> Any:
    """Parse a JSON text. Raises `ValueError`: it is none, with the line; or nested too deeply."""
    import json  # not for the first page

    try:
        found = json.loads(content)
    except RecursionError:
        raise ValueError(f"> {DEPTH_CAP} levels") from None
    except json.JSONDecodeError as error:  # its words are English and those of a programmer
        raise ValueError(f"{DAMAGED_AT}: {error.lineno}") from error
    except UnicodeDecodeError as error:
        raise ValueError(f"{DAMAGED_AT}: {1 + error.object.count(10, 0, error.start)}") from error
    level: list[Any] = [found]
    for _ in range(DEPTH_CAP):
        nested = (each for each in level if isinstance(each, dict | list))
        level = [inner for each in nested for inner in (each.values() if isinstance(each, dict) else each)]
        if not level:
            return found
    raise ValueError(f"> {DEPTH_CAP} levels")


def rename_keys(value: Any, names: Mapping[str, str]) -> Any:
    """Return plain values with the keys of all their tables renamed, for files that call things otherwise."""
    if isinstance(value, dict):
        return {names.get(key, key): rename_keys(each, names) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [rename_keys(each, names) for each in value]
    return value


def number(value: object) -> float:
    """Return a finite number as a float.

    Raises `TypeError` of a text, a truth value, anything that is no number; `ValueError` of infinity, NaN, or an
    integer that no float can hold.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    try:
        found = float(value)
    except OverflowError:
        found = math.inf
    if not math.isfinite(found):
        raise ValueError(f"{found} is not finite")
    return found


def number_or_none(value: object) -> float | None:
    """Return a finite number as a float, None of anything else."""
    try:
        return number(value)
    except (TypeError, ValueError):
        return None


def positive(value: object) -> float:
    """Return a finite number above 0. Raises as `number`."""
    found = number(value)
    if found <= 0.0:
        raise ValueError(f"{found} is not above 0")
    return found


def whole_number(value: object) -> int:
    """Return a whole number unchanged: nothing is rounded. Raises `TypeError` of anything else."""
    if type(value) is not int:
        raise TypeError(f"{value!r} is no whole number")
    return value


def text(value: object) -> str:
    """Return a text. Raises `TypeError` of anything else."""
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def flag(value: object) -> bool:
    """Return a truth value. Raises `TypeError` of anything else."""
    if not isinstance(value, bool):
        raise TypeError(f"{value!r} is neither true nor false")
    return value


def read_own(
    kind: type[Record],
    table: object,
    *,
    schema: int,
    code: str,
    where: str = "",
    judge: Callable[[Record], None] = lambda _: None,
) -> Record:
    """Read the content of one of our files from its JSON; every kind of file is read by this.

    `code` is the problem code for a file that is not such a record. `judge` raises a ValueError for impossible
    values. Raises `ProfileError`: `schema.unsupported`, it was written by another version of the console; `code`.
    """
    try:
        if not isinstance(table, Mapping):
            raise TypeError("no object")
        version = table["schema"]
        if type(version) is not int or version != schema:
            shown = printable(str(version), 60)
            raise refusal_error("schema.unsupported", where=where, key="schema", value=shown, limit=str(schema))
        own = {field.name for field in fields(kind)}  # type: ignore[arg-type]
        found = record(kind, {key: value for key, value in table.items() if key != "schema" or key in own})
        judge(found)
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        said = f"{error.args[0]} missing" if isinstance(error, KeyError) and error.args else str(error)
        raise refusal_error(code, where=where, value=printable(" ".join(said.split()))) from error
    return found


def record(kind: type[Record], table: Mapping[str, Any]) -> Record:
    """Return a dataclass of plain values, each of the type of its field; a field with a default may be missing.

    Raises `TypeError`, `ValueError`: a value of another type, a key that is missing, or one that is unknown.
    """
    return StrictReader().record(kind, table)


class StrictReader:
    """Reads plain values as what a type hint says: dataclasses, choices, tuples, sets and tables of plain types.

    `plain` has a reader for each plain type. Lists and tables have at most `most_entries`. With `complete` a field
    that has a default may not be missing either. `table` is what a mapping becomes.
    """

    plain: Mapping[Any, Callable[[Any], Any]]
    most_entries: float = math.inf
    complete = False
    table: type = dict

    def __init__(self) -> None:
        self.plain = PLAIN

    def read(self, hint: Any, value: Any) -> Any:
        """Return the value of a type. Raises ValueError, TypeError: of another type, out of bounds, unknown."""
        if hint in self.plain:
            return self.plain[hint](value)
        if is_dataclass(hint) and isinstance(hint, type) and isinstance(value, Mapping):
            return self.record(hint, value)
        if isinstance(hint, type) and issubclass(hint, Enum):
            return hint(value)
        origin, inner = get_origin(hint), get_args(hint)
        if origin in (UnionType, Union):
            (other,) = (each for each in inner if each is not NoneType)
            return None if value is None else self.read(other, value)
        if origin in (tuple, frozenset) and isinstance(value, list | tuple):
            return self._read_list(origin, inner, value)
        if isinstance(origin, type) and issubclass(origin, Mapping) and isinstance(value, Mapping):
            if len(value) > self.most_entries:
                raise ValueError(f"{len(value)} entries")
            return self.table({self.plain[str](key): self.read(inner[1], each) for key, each in value.items()})
        raise TypeError(f"{brief(value)} is no {getattr(hint, '__name__', hint)}")

    def _read_list(self, origin: Any, inner: tuple[Any, ...], value: Sequence[Any]) -> Any:
        kinds = [inner[0]] * len(value) if origin is frozenset or inner[1:] == (...,) else list(inner)
        if len(kinds) != len(value) or len(value) > self.most_entries:
            raise ValueError(f"{len(value)} values in the place of {len(kinds)}")
        return origin(self.read(kind, each) for kind, each in zip(kinds, value, strict=True))

    def record(self, kind: type[Record], table: Mapping[str, Any]) -> Record:
        """Return a dataclass; raises as `read`, with the name of the field."""
        own = fields(kind)  # type: ignore[arg-type]
        if strange := sorted(map(str, table.keys() - {each.name for each in own})):
            raise TypeError(f"unknown {', '.join(brief(each) for each in strange[:3])}")
        needed = {each.name for each in own if self.complete or _has_no_default(each)}
        if missing := needed - table.keys():
            raise TypeError(f"{', '.join(sorted(missing))} missing")
        hints = self.hints(kind)
        found = {}
        for name, value in table.items():
            try:
                found[name] = self.read(hints[name], value)
            except (TypeError, ValueError, OverflowError) as error:
                raise type(error)(f"{name}: {error}") from error
        return kind(**found)

    def hints(self, kind: type) -> Mapping[str, Any]:
        """Return the type of each field."""
        return get_type_hints(kind)


def _has_no_default(field: Field[Any]) -> bool:
    return field.default is MISSING and field.default_factory is MISSING


def brief(value: object) -> str:
    """Return a value as Python writes it, cut short."""
    words = repr(value)
    return words if len(words) <= 60 else f"{words[:59]}…"


PLAIN: Mapping[Any, Callable[[Any], Any]] = {
    Any: lambda value: value,
    float: number,
    int: whole_number,
    bool: flag,
    str: text,
    date: lambda value: date.fromisoformat(text(value)),
}
