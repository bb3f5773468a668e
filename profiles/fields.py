"""A table of fields, and the strict reading of a TOML table against it.

Both profiles (job and machine) are lists of `Field`. Reading collects every problem, so that a file needs to be
corrected only once. Nothing is guessed: a truth value is not a number, a text is not a number, and 3.0 is not a
whole number.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice
from typing import Any

from profiles.files import printable
from profiles.problem import Problem

SCHEMA = 1
TEXT_CAP_CHARACTERS = 80

LEAST_MAGNITUDE = 1e-9
"""Below this, in any unit, a number is 0 or a mistake: its squares and quotients leave the range of a float."""

_Place = tuple[str, ...]
_DEPTH_CAP_TABLES = 8
# Invisible letters and symbols: Hangul fillers, an empty Braille cell.
_INVISIBLE = frozenset("\u115f\u1160\u3164\uffa0\u2800")
_UNKNOWN_CAP = 20  # more than these in one file mean that it is another kind of file
# More missing keys than these, and nothing else, are one problem: the file is empty or hardly begun.
_MISSING_CAP = 3


class FieldType(StrEnum):
    """The type of a field. TEXTS is a list of texts."""

    NUMBER = "number"
    WHOLE = "whole"
    TEXT = "text"
    CHOICE = "choice"
    TEXTS = "texts"


_CONVERSIONS: Mapping[FieldType, Callable[[Any], object]] = {FieldType.NUMBER: float, FieldType.TEXTS: tuple}


@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """One key: its kind and what it may hold.

    `above` is an exclusive lower bound, `at_least` an inclusive one, `below` an exclusive upper one, `at_most` an
    inclusive one, all in `unit`. A field with a `default` may be missing; an `optional` one, too: it is then None.
    `table` is where a newly written file puts the key.
    `choices` are the words of a CHOICE, and of a TEXTS field the only members allowed. `longest` is the number of
    characters that a text may have.
    """

    key: str
    kind: FieldType = FieldType.NUMBER
    unit: str = ""
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    choices: tuple[str, ...] = ()
    default: object = None
    optional: bool = False
    table: str = ""
    longest: int = TEXT_CAP_CHARACTERS

    @property
    def required(self) -> bool:
        """Whether the key must be there."""
        return self.default is None and not self.optional

    @property
    def limit(self) -> str:
        """What is allowed, as text with its unit: "> 0, <= 500 mm" or "measured | fitted"."""
        if self.choices:
            return " | ".join(self.choices)
        if self.kind in (FieldType.TEXT, FieldType.TEXTS):
            texts = '["...", ...], each ' if self.kind is FieldType.TEXTS else ""
            return f"{texts}<= {self.longest} characters, one line"
        bounds = (("> ", self.above), (">= ", self.at_least), ("< ", self.below), ("<= ", self.at_most))
        return " ".join(filter(None, (", ".join(f"{s}{b:g}" for s, b in bounds if b is not None), self.unit)))


def read_fields(
    fields: Sequence[Field], found: Mapping[str, object], *, where: str, prefix: str = ""
) -> tuple[dict[str, Any], list[Problem]]:
    """Return the values (numbers as float, whole numbers as int, defaults filled in) and every problem.

    `prefix` is put before the key in the problems, such as "tool.".
    """
    known = {field.key: field for field in fields}
    problems = unknown_keys(found, known, where=where, prefix=prefix)
    values: dict[str, Any] = {}
    for field in fields:
        key = prefix + field.key
        if field.key not in found:
            if field.required:
                problems.append(Problem(code="key.missing", where=where, key=key, limit=field.limit))
            values[field.key] = field.default
            continue
        value = found[field.key]
        code = fault(field, value)
        if code:
            problems.append(Problem(code=code, where=where, key=key, value=spell_toml(value), limit=field.limit))
        else:
            convert = _CONVERSIONS.get(field.kind)
            values[field.key] = convert(value) if convert else value
    return values, _combine_missing_keys(problems, where)


def fault(field: Field, value: object) -> str:
    """Return the problem code of `value` in `field`, or "" where it is valid."""
    match field.kind:
        case FieldType.TEXT:
            return _fault_of_text(field, value)
        case FieldType.TEXTS:
            return _fault_of_texts(field, value)
        case FieldType.CHOICE:
            return "" if isinstance(value, str) and value in field.choices else "value.not_choice"
        case FieldType.WHOLE if isinstance(value, bool) or not isinstance(value, int):
            return "value.not_whole"
    return _fault_of_number(field, value)


def _fault_of_texts(field: Field, value: object) -> str:
    texts = value if isinstance(value, list | tuple) else [""]
    if not all(_is_text(each, field.longest) and not is_blank(each) for each in texts):
        return "value.not_text"
    return "value.not_choice" if field.choices and not set(texts) <= set(field.choices) else ""


def _fault_of_number(field: Field, value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "value.not_number"
    if isinstance(value, float) and not math.isfinite(value):
        return "value.not_finite"
    above, least, most = field.above, field.at_least, field.at_most
    low = (above is not None and value <= above) or (least is not None and value < least)
    high = (field.below is not None and value >= field.below) or (most is not None and value > most)
    if low or high:
        return "value.out_of_range"
    return "value.too_small" if 0 < abs(value) < LEAST_MAGNITUDE else ""


def flatten(table: Mapping[str, Any], *, where: str) -> tuple[dict[str, object], list[Problem]]:
    """Return the leaves of nested tables under their last key, and a problem for each key met twice."""
    places: dict[str, list[str]] = {}
    leaves: dict[str, object] = {}
    problems: list[Problem] = []
    for place, key, value in _leaves(table):
        full = ".".join((*place, key))
        if len(place) >= _DEPTH_CAP_TABLES:
            limit = f"<= {len(place)} tables"
            problems.append(Problem(code="key.unknown", where=where, key=printable(full), limit=limit))
            continue
        places.setdefault(key, []).append(full)
        leaves.setdefault(key, value)
    for key, found in places.items():
        if len(found) > 1:
            value = printable(", ".join(found))
            problems.append(Problem(code="key.twice", where=where, key=printable(key), value=value))
    return leaves, problems[:_UNKNOWN_CAP]


def schema_problem(table: Mapping[str, Any], *, where: str) -> Problem | None:
    """Return the refusal of a file written for another schema; a file without the key is of schema 1."""
    value = table.get("schema", SCHEMA)
    if type(value) is int and value == SCHEMA:
        return None
    return Problem(
        code="schema.unsupported", where=where, key="schema", value=spell_toml(value), limit=str(SCHEMA)
    )


def unknown_keys(
    found: Iterable[str], known: Mapping[str, object], *, where: str, prefix: str = ""
) -> list[Problem]:
    """Return the refusals of unknown keys, a screenful of them at most.

    The limit is the nearest known key, or all of them.
    """
    problems = []
    for key in islice((key for key in found if key not in known), _UNKNOWN_CAP):
        near = difflib.get_close_matches(key[:TEXT_CAP_CHARACTERS], known, n=1)
        limit = prefix + near[0] if near else " | ".join(known)
        shown = prefix + printable(key)
        problems.append(Problem(code="key.unknown", where=where, key=shown, limit=limit))
    return problems


def spell_toml(value: object) -> str:
    """Return `value` as TOML spells it, on one line and cut to 60 characters."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, int):
        # Beyond 4300 digits Python refuses to write an integer in decimal.
        text = str(value) if value.bit_length() < 4000 else hex(value)
    elif isinstance(value, str):
        text = '"' + value[:80].replace("\\", "\\\\").replace('"', '\\"') + '"'
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(spell_toml(item) for item in value[:4]) + (", …]" if len(value) > 4 else "]")
    elif isinstance(value, dict):
        text = "{" + ", ".join(str(key) for key in list(value)[:4]) + "}"
    else:
        text = str(value)
    return printable(text, 60)


def _combine_missing_keys(problems: list[Problem], where: str) -> list[Problem]:
    """Return the problems, combined into one where they are only many missing keys."""
    if len(problems) <= _MISSING_CAP or any(problem.code != "key.missing" for problem in problems):
        return problems
    keys = ", ".join(problem.key for problem in problems)
    return [Problem(code="key.missing_several", where=where, key=keys, value=str(len(problems)))]


def is_blank(text: str) -> bool:
    """Whether a text is empty or contains only blank characters of some kind."""
    return all(character.isspace() or character in _INVISIBLE for character in text)


def _is_text(value: object, longest: int) -> bool:
    return isinstance(value, str) and value.isprintable() and len(value) <= longest


def _fault_of_text(field: Field, value: object) -> str:
    if not isinstance(value, str) or not _is_text(value, field.longest):
        return "value.not_text"
    if not is_blank(value) or (not value and not field.required):
        return ""
    return "value.not_text" if field.required else "value.blank"


def _leaves(table: Mapping[str, Any], place: _Place = ()) -> Iterator[tuple[_Place, str, object]]:
    """Walk nested tables in their order; a table at the depth cap counts as a leaf."""
    for key, value in table.items():
        if isinstance(value, dict) and len(place) < _DEPTH_CAP_TABLES:
            yield from _leaves(value, (*place, key))
        else:
            yield place, key, value
