"""Plain JSON values as frozen dataclasses again: each of the type of its field and within bounds, or refused.

The file may come from anywhere. Nothing in it names a type, and nothing of it is run.
"""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_origin, get_type_hints

from console.flight.plain_values import ARRAY, DROPPED, LONGEST_TEXT
from console.flight.recorded_forms import names
from profiles.job import Job, job_from_table
from profiles.machine import OF_CALIBRATION, MachineProfile, machine_from_table
from profiles.problem import ProblemError
from profiles.strict_values import StrictReader, brief, flag, number, text, whole

LARGEST = 1e15  # no position, time or count of a lathe is larger
MOST_NUMBERS = 200_000  # in an array: a trace of a part has some thousand
MOST_ENTRIES = 10_000  # in a list or a table
_INFINITE = ("nan", "inf", "-inf")
_ARRAYS = ("ndarray", "NDArray")
"""What a field of samples is annotated with, by its name: from 2.5 on that of numpy is an alias that stays one."""


class Typed(StrictReader):
    """Reader of a recording. A part that was read is the same object wherever the same part of the JSON is."""

    most_entries = MOST_ENTRIES
    complete = True
    table = MappingProxyType

    def __init__(self) -> None:
        self.plain = _PLAIN
        self._known: dict[tuple[int, Any], tuple[object, Any]] = {}

    def read(self, hint: Any, value: Any) -> Any:
        """Return the value of a type. Raises ValueError, TypeError: of another type, out of bounds, unknown."""
        if not isinstance(value, dict | list):
            return self._read(hint, value)
        found = self._known.get((id(value), hint))
        if found is None:
            # The JSON is kept as well: its identity must not be used again.
            found = self._known[(id(value), hint)] = (value, self._read(hint, value))
        return found[1]

    def _read(self, hint: Any, value: Any) -> Any:
        if hint is Job and isinstance(value, dict):
            return _of_its_file(job_from_table, value)
        return _array(value) if getattr(get_origin(hint), "__name__", "") in _ARRAYS else super().read(hint, value)

    def hints(self, kind: type) -> Mapping[str, Any]:
        """Return the type of each field."""
        return _hints(kind)


def patched(tree: dict[str, Any], changed: Mapping[str, Any]) -> dict[str, Any]:
    """Return JSON with these parts replaced, by dotted names; what is not replaced is shared.

    Raises ValueError: there is no such part.
    """
    fresh: dict[str, dict[str, Any]] = {"": dict(tree)}
    for path, value in changed.items():
        *above, last = path.split(".")
        node, here = fresh[""], ""
        for name in above:
            here = f"{here}.{name}"
            if here not in fresh:
                if not isinstance(node.get(name), dict):
                    raise ValueError(f"no {path}")
                fresh[here] = node[name] = dict(node[name])
            node = fresh[here]
        if last not in node:
            raise ValueError(f"no {path}")
        node[last] = _slid(node[last], value) if isinstance(value, dict) and DROPPED in value else value
    return fresh[""]


def _slid(before: Any, change: dict[str, Any]) -> dict[str, Any]:
    """Return the samples after some left and some came."""
    gone = whole(change[DROPPED])
    kept = _bytes(before)[8 * gone :]
    if gone < 0 or 8 * gone > len(_bytes(before)) or change.keys() != {DROPPED, ARRAY}:
        raise ValueError("samples that do not follow")
    return {ARRAY: kept + _bytes({ARRAY: change[ARRAY]})}


def _bytes(value: Any) -> bytes:
    if not isinstance(value, dict) or value.keys() != {ARRAY}:
        raise TypeError("no array")
    data = value[ARRAY]
    found = data if isinstance(data, bytes) else b64decode(text(data), validate=True)
    if len(found) % 8 or len(found) > 8 * MOST_NUMBERS:
        raise ValueError(f"{len(found)} bytes in an array")
    return found


@cache
def _hints(kind: type) -> Mapping[str, Any]:
    return get_type_hints(kind, None, dict(names()))


def _number(value: Any) -> float:
    if isinstance(value, str) and value in _INFINITE:
        return float(value)
    found = number(value)
    if abs(found) > LARGEST:
        raise ValueError(f"{found:g} is too large")
    return found


def _whole(value: Any) -> int:
    return whole(value) if abs(_number(value)) <= LARGEST else 0


def _text(value: Any) -> str:
    found = text(value)
    if len(found) > LONGEST_TEXT or not found.isprintable():
        raise ValueError(f"a text that cannot be shown: {brief(found)}")
    return found


def _complex(value: Any) -> complex:
    real, imaginary = (_number(each) for each in value)
    return complex(real, imaginary)


def _array(value: Any) -> Any:
    import numpy as np

    found = np.frombuffer(_bytes(value), dtype="<f8").astype(float)
    with np.errstate(invalid="ignore"):
        if (np.abs(found) > LARGEST).any():
            raise ValueError("an array with a number that is too large")
    found.setflags(write=False)
    return found


def machine_of(value: Any) -> MachineProfile:
    """Return a machine with its calibrations, which its own file does not have. Raises ValueError, TypeError."""
    found: MachineProfile = Typed().read(MachineProfile, value)
    _of_its_file(machine_from_table, {**value, "chuck": {**value["chuck"], **dict.fromkeys(OF_CALIBRATION)}})
    return found


def _of_its_file(read: Callable[[Mapping[str, Any]], Any], value: dict[str, Any]) -> Any:
    """Read a job or a machine as its own file is read, with its limits."""
    try:
        return read(_stated(value))
    except ProblemError as error:
        raise ValueError(error.problems[0].facts) from error


def _stated(value: Any) -> Any:
    """Return values without those that are None: a TOML table does not have them."""
    if isinstance(value, dict):
        return {key: _stated(each) for key, each in value.items() if each is not None}
    return [_stated(each) for each in value] if isinstance(value, list) else value


_PLAIN: Mapping[Any, Any] = {
    float: _number,
    int: _whole,
    bool: flag,
    str: _text,
    complex: _complex,
    Path: lambda value: Path(_text(value)),
}
