"""Any state comes back from a recording as it was, whole or by what changed; what is no state is refused."""

from __future__ import annotations

import json
import math
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from types import GenericAlias, MappingProxyType, NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from console.flight.plain_values import ARRAY, changes, to_json_value
from console.flight.recorded_forms import RecordedMoment, names, to_recorded_form, work_of
from console.flight.recording import RecordingReader, apply_changes, machine_of
from console.session.learning.calibrating import PartLobe
from console.session.learning.part_learning import PartLearning
from console.session.learning.row_faults import NO_FAULTS, RowFaults
from console.session.station.progress import CutProgress
from console.tui.keymap import PageName
from profiles.arrays import Floats
from profiles.job import Job
from profiles.store import list_machines, load_job, load_machine
from tests.tui import scenes
from tests.tui.scenes import scene_of

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
    RowFaults: st.just(NO_FAULTS),  # as what a part has taught: not recorded
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


MOMENTS = values(RecordedMoment)


def written(tree: Any) -> Any:
    """A tree as it comes from the disk."""
    return json.loads(json.dumps(tree, allow_nan=False))


@given(MOMENTS)
def test_any_moment_comes_back_as_it_was(moment: RecordedMoment) -> None:
    assert same(RecordingReader().read(RecordedMoment, written(to_json_value(moment, to_recorded_form))), moment)


@pytest.mark.long
@settings(suppress_health_check=[HealthCheck.large_base_example])  # a moment is large, and here are two
@given(MOMENTS, MOMENTS)
def test_what_changed_leads_from_any_moment_to_any_other(before: RecordedMoment, now: RecordedMoment) -> None:
    tree = apply_changes(
        written(to_json_value(before, to_recorded_form)), written(changes(before, now, to_recorded_form))
    )
    assert same(RecordingReader().read(RecordedMoment, tree), now)


@pytest.mark.parametrize("page", PageName)
def test_the_scenes_of_all_pages_come_back(page: PageName) -> None:
    scene = scene_of(page)
    moment = RecordedMoment(state=scene.state, page=page, work=work_of(scene.work))
    back = RecordingReader().read(RecordedMoment, written(to_json_value(moment, to_recorded_form)))
    assert same(written(to_json_value(back, to_recorded_form)), written(to_json_value(moment, to_recorded_form)))
    assert (back.work, back.page) == (moment.work, moment.page)


def test_samples_of_a_cut_that_slide_are_written_once() -> None:
    cut = scenes.cut()
    later = replace(cut, errors_um=np.append(cut.errors_um[3:], [1.0, 2.0, 3.0]))
    change = changes(cut, later)
    assert [*change] == ["errors_um"]
    assert len(json.dumps(change)) < 100  # three numbers of eight bytes in base64, of 240
    tree = apply_changes(written(to_json_value(cut)), written(change))
    assert same(RecordingReader().read(CutProgress, tree), later)


def test_the_bundled_machines_come_back() -> None:
    for entry in list_machines():
        machine = load_machine(entry.name).machine
        assert machine_of(written(to_json_value(machine))) == machine


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("activity", "flying"),
        ("at_s", "1e3"),
        ("at_s", 1e16),
        ("at_s", 10**400),
        ("at_s", True),
        ("at_s", None),
        ("simulated", 1),
        ("machine", "\x1b[2J"),
        ("machine", "x" * 5000),
        ("holder", 2.0),
        ("alarms", {"0": 1}),
        ("marks_mm", [1.0] * 20_000),
        ("snapshot", {"tool": 1}),
        ("touched", [1.0, 2.0]),
        ("unknown", 1),
        ("alignment.settings.x", 1),
        ("cut.errors_um", {"f8": "AAAA"}),
        ("cut.errors_um", {"f8": "AAAAAAAA8H8="}),  # infinity
        ("cut.errors_um", {"drop": 100_000, "f8": ""}),
        ("cut.errors_um", {"drop": -1, "f8": ""}),
        ("cut.errors_um.f8", "no base64!"),
    ],
)
def test_a_value_that_is_none_is_refused(path: str, value: object) -> None:
    tree = written(to_json_value(scene_of(PageName.RUN).state))
    kind = type(scene_of(PageName.RUN).state)
    RecordingReader().read(kind, tree)
    with pytest.raises((TypeError, ValueError, OverflowError)):
        RecordingReader().read(kind, apply_changes(tree, {path: value}))


def test_samples_are_read_as_an_array_however_numpy_writes_its_alias() -> None:
    """From numpy 2.5 on, which Python 3.12 gets, `NDArray` is an alias that stays one."""

    class NDArray:
        pass

    samples = np.array([1.0, 2.5])
    for hint in (Floats, GenericAlias(NDArray, (np.float64,))):
        found = RecordingReader().read(hint, {ARRAY: b64encode(samples.tobytes()).decode()})
        assert np.array_equal(found, samples)
