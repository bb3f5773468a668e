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
from tests.console.floor import Floor, experiment_1, open_floor


@pytest.fixture
def cutting(tmp_path: Path) -> Floor:
    """A lathe that is stopped in the part, as soon as it is started."""
    floor = open_floor(tmp_path)
    floor.set_up(experiment_1())
    floor.arm(experiment_1())
    floor.when(lambda _: in_the_part(floor), lambda: floor.stop.stop("space"))
    return floor


def in_the_part(floor: Floor) -> bool:
    cut = floor.state.cut
    return cut is not None and cut.stage is CutStage.CUT and cut.turn > 5.0


def events(data: Path) -> list[tuple[str, bool | None]]:
    """What is in the record behind the start, each with whether rest was proven."""
    with closing(sqlite3.connect(data / "records.sqlite3")) as database:
        found = database.execute("SELECT kind, data FROM events ORDER BY number").fetchall()
    assert [kind for kind, _ in found[:2]] == ["armed", "started"]
    return [(kind, json.loads(data).get("proven")) for kind, data in found[2:]]


def test_a_stop_that_is_asked_for_again_and_again_is_one_stop(cutting: Floor, tmp_path: Path) -> None:
    cutting.do(Start())
    for _ in range(2):
        cutting.stop.stop("space")
        cutting.idle()
    assert events(tmp_path) == [("stopped", True)]
    cutting.stop.kill("escape")
    cutting.idle()
    cutting.idle()
    assert events(tmp_path) == [("stopped", True), ("killed", True)]
    cutting.station.close("quit")
    assert events(tmp_path) == [("stopped", True), ("killed", True)]


def test_a_stop_after_going_on_is_another(cutting: Floor, tmp_path: Path) -> None:
    cutting.do(Start())
    cutting.do(Recover())
    cutting.stop.stop("space")
    cutting.idle()
    assert events(tmp_path) == [("stopped", True), ("stopped", True)]


def test_rest_that_is_proven_late_is_no_other_stop(
    cutting: Floor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def silent() -> None:
        raise LinkError(Problem(code="link.silent"))

    with monkeypatch.context() as broken:
        broken.setattr(cutting.lathe, "wait_for_rest", silent)
        cutting.do(Start())
        cutting.idle()
    cutting.idle()
    assert events(tmp_path) == [("stopped", False), ("at_rest", None)]
