"""Any state comes back from a recording as it was, whole or by what changed; what is no state is refused."""

from __future__ import annotations

import json
from base64 import b64encode
from dataclasses import replace
from types import GenericAlias
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from console.flight.plain_values import ARRAY, changes, plain
from console.flight.recorded_forms import Moment, recorded, work_of
from console.flight.recording import Typed, machine_of, patched
from console.session.station.progress import CutProgress
from console.tui.keymap import PageName
from profiles.arrays import Floats
from profiles.store import list_machines, load_machine
from tests.console.flight.any_state import same, values
from tests.tui import scenes
from tests.tui.scenes import scene_of

MOMENTS = values(Moment)


def written(tree: Any) -> Any:
    """A tree as it comes from the disk."""
    return json.loads(json.dumps(tree, allow_nan=False))


@given(MOMENTS)
def test_any_moment_comes_back_as_it_was(moment: Moment) -> None:
    assert same(Typed().read(Moment, written(plain(moment, recorded))), moment)


@pytest.mark.long
@settings(suppress_health_check=[HealthCheck.large_base_example])  # a moment is large, and here are two
@given(MOMENTS, MOMENTS)
def test_what_changed_leads_from_any_moment_to_any_other(before: Moment, now: Moment) -> None:
    tree = patched(written(plain(before, recorded)), written(changes(before, now, recorded)))
    assert same(Typed().read(Moment, tree), now)


@pytest.mark.parametrize("page", PageName)
def test_the_scenes_of_all_pages_come_back(page: PageName) -> None:
    scene = scene_of(page)
    moment = Moment(state=scene.state, page=page, work=work_of(scene.work))
    back = Typed().read(Moment, written(plain(moment, recorded)))
    assert same(written(plain(back, recorded)), written(plain(moment, recorded)))
    assert (back.work, back.page) == (moment.work, moment.page)


def test_samples_of_a_cut_that_slide_are_written_once() -> None:
    cut = scenes.cut()
    later = replace(cut, errors_um=np.append(cut.errors_um[3:], [1.0, 2.0, 3.0]))
    change = changes(cut, later)
    assert [*change] == ["errors_um"]
    assert len(json.dumps(change)) < 100  # three numbers of eight bytes in base64, of 240
    tree = patched(written(plain(cut)), written(change))
    assert same(Typed().read(CutProgress, tree), later)


def test_the_bundled_machines_come_back() -> None:
    for entry in list_machines():
        machine = load_machine(entry.name).machine
        assert machine_of(written(plain(machine))) == machine


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
    tree = written(plain(scene_of(PageName.RUN).state))
    kind = type(scene_of(PageName.RUN).state)
    Typed().read(kind, tree)
    with pytest.raises((TypeError, ValueError, OverflowError)):
        Typed().read(kind, patched(tree, {path: value}))


def test_samples_are_read_as_an_array_however_numpy_writes_its_alias() -> None:
    """From numpy 2.5 on, which Python 3.12 gets, `NDArray` is an alias that stays one."""

    class NDArray:
        pass

    samples = np.array([1.0, 2.5])
    for hint in (Floats, GenericAlias(NDArray, (np.float64,))):
        found = Typed().read(hint, {ARRAY: b64encode(samples.tobytes()).decode()})
        assert np.array_equal(found, samples)
