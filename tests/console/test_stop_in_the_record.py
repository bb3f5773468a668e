"""A stop stands once in the record, however often it is asked for; what becomes of it later is told as such."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from console.session.station.commands import Recover, Start
from console.session.station.progress import CutStage
from drivers.errors import LinkError
from profiles.problem import Problem
from tests.console.floor import LOGGED, Floor, experiment_1, set_up_once


@pytest.fixture
def floor(tmp_path: Path, in_copies: None) -> Floor:
    return set_up_once(tmp_path)


def stopped_in_the_part(floor: Floor) -> None:
    """Arm it, start it, and stop it in the part."""
    floor.arm(experiment_1())
    floor.when(lambda _: in_the_part(floor), lambda: floor.stop.stop("space"))
    floor.do(Start())


def in_the_part(floor: Floor) -> bool:
    cut = floor.state.cut
    return cut is not None and cut.stage is CutStage.CUT and cut.turn > 5.0


def events(floor: Floor) -> list[tuple[str, bool | None]]:
    """What is in the record behind the start, each with whether rest was proven."""
    with closing(sqlite3.connect(floor.context.records / "records.sqlite3")) as database:
        events = database.execute("SELECT kind, data FROM events ORDER BY number").fetchall()
    found = [(kind, data) for kind, data in events if kind not in LOGGED]
    assert [kind for kind, _ in found[:2]] == ["armed", "started"]
    return [(kind, json.loads(data).get("proven")) for kind, data in found[2:]]


def test_a_stop_that_is_asked_for_again_and_again_is_one_stop(floor: Floor) -> None:
    stopped_in_the_part(floor)
    for _ in range(2):
        floor.stop.stop("space")
        floor.idle()
    assert events(floor) == [("stopped", True)]
    floor.stop.kill("escape")
    floor.idle()
    floor.idle()
    assert events(floor) == [("stopped", True), ("killed", True)]
    floor.station.close("quit")
    assert events(floor) == [("stopped", True), ("killed", True)]


def test_a_stop_after_going_on_is_another(floor: Floor) -> None:
    stopped_in_the_part(floor)
    floor.do(Recover())
    floor.stop.stop("space")
    floor.idle()
    assert events(floor) == [("stopped", True), ("stopped", True)]


def test_rest_that_is_proven_late_is_no_other_stop(floor: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    def silent() -> None:
        raise LinkError(Problem(code="link.silent"))

    with monkeypatch.context() as broken:
        broken.setattr(floor.lathe, "wait_for_rest", silent)
        stopped_in_the_part(floor)
        floor.idle()
    floor.idle()
    assert events(floor) == [("stopped", False), ("at_rest", None)]
