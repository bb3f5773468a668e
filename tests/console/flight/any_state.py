"""Any state that the types allow, for the properties of a recording; and whether two values are the same."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import MappingProxyType, NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from hypothesis import strategies as st

from console.flight.recorded_forms import names
from console.session.learning.calibrating import PartLobe
from console.session.learning.part_learning import PartLearning
from profiles.job import Job
from profiles.store import load_job

NUMBERS = st.floats(-1e15, 1e15) | st.sampled_from([math.nan, math.inf, -math.inf])
WORDS = st.text(st.characters(categories=("L", "N", "P", "S")), max_size=12)
SAMPLES = st.lists(st.floats(-1e6, 1e6), max_size=6).map(np.array)
PLAIN: Mapping[Any, st.SearchStrategy[Any]] = {
    float: NUMBERS,
    int: st.integers(-(10**15), 10**15),
    bool: st.booleans(),
    str: WORDS,
    complex: st.builds(complex, st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)),
    Path: WORDS.map(lambda name: Path(f"/data/{name}")),
    Job: st.sampled_from(["lee-2001-experiment-1", "thin-ring-6-jaws"]).map(lambda name: load_job(name).job),
}


def values(hint: Any) -> st.SearchStrategy[Any]:
    """Any value of a type."""
    if hint in PLAIN:
        return PLAIN[hint]
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (UnionType, Union):
        return st.one_of(*(st.none() if each is NoneType else values(each) for each in inner))
    if origin is tuple and inner[1:] == (...,):
        return st.lists(values(inner[0]), max_size=2).map(tuple)
    if origin is tuple:
        return st.tuples(*(values(each) for each in inner))
    if origin is frozenset:
        return st.frozensets(values(inner[0]), max_size=3)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return st.dictionaries(WORDS, values(inner[1]), max_size=2).map(MappingProxyType)
    if getattr(origin, "__name__", "") in ("ndarray", "NDArray"):  # the alias of numpy 2.5 keeps its name
        return SAMPLES
    if isinstance(hint, type) and issubclass(hint, Enum):
        return st.sampled_from(hint)
    assert isinstance(hint, type) and is_dataclass(hint), hint
    return _records(hint)


def _records(kind: Any) -> st.SearchStrategy[Any]:
    hints = get_type_hints(kind, None, dict(names()))
    given = {field.name: hints[field.name] for field in fields(kind)}
    if kind in (PartLearning, PartLobe):  # what they hold is not recorded
        given["taught" if kind is PartLearning else "found"] = NoneType
    # What holds one of its own kind holds it once.
    given = {name: NoneType if hint == kind | None else hint for name, hint in given.items()}
    return st.builds(
        kind, **{name: st.none() if hint is NoneType else values(hint) for name, hint in given.items()}
    )


def same(a: object, b: object) -> bool:
    """Whether two values are equal and of the same types; an array by its numbers."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and np.array_equal(a, b, equal_nan=True)
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if type(a) is not type(b):
        return False
    if is_dataclass(a):
        return all(same(getattr(a, field.name), getattr(b, field.name)) for field in fields(a))
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(same(*pair) for pair in zip(a, b, strict=True))
    return a == b or (a != a and b != b)
