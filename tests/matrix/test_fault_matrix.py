"""Every fault in every state: what the console makes of it, and that nothing of it is dangerous.

In no cell does anything move unasked, is a line sent twice, a reply taken for another, a dead drive energised,
or an exception shown. What is right in each cell stands in `expected.py`, and as a page in docs/fault-matrix.md.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from console.session.cut import run
from console.session.data import records
from drivers.lathe import standstill
from drivers.lathe.jogs import Jogs
from drivers.simulator.faults.catalogue import CATALOGUE
from tests.matrix.cell import run_cell
from tests.matrix.expected import TABLE, tried
from tests.matrix.faults import ROWS, Row
from tests.matrix.judging import problems
from tests.matrix.known import KNOWN
from tests.matrix.page import page
from tests.matrix.rig import RUN_OUT_S, TIMEOUT_S, LogNowhere, planned_once, record_in_memory
from tests.matrix.situations import RUNNING_OUT, Situation

pytestmark = pytest.mark.long

PAGE = Path(__file__).parents[2] / "docs" / "fault-matrix.md"


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plan once for all cells, and keep records nowhere."""
    monkeypatch.setattr(run, "plan_cut", planned_once)
    monkeypatch.setattr(records, "opened", record_in_memory)
    monkeypatch.setattr(records, "RunLog", LogNowhere)


CELLS = [(row, situation) for row in ROWS for situation in Situation if tried(row.name, situation)]


@pytest.mark.parametrize(
    ("row", "situation"), CELLS, ids=[f"{row.name}-{each.value.replace(' ', '-')}" for row, each in CELLS]
)
def test_a_fault_in_a_state_ends_as_it_should(
    row: Row, situation: Situation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    timeout_s = RUN_OUT_S if situation in RUNNING_OUT else TIMEOUT_S
    monkeypatch.setattr(standstill, "COAST_TIMEOUT_S", timeout_s)
    monkeypatch.setattr(Jogs.home, "__defaults__", (timeout_s,))
    found = problems(row, situation, run_cell(row, situation, tmp_path))
    if (row.name, situation) in KNOWN:
        assert found != [], "this cell is right now: take it out of the list of known ones"
    else:
        assert found == []


def test_every_fault_of_the_catalogue_has_a_row() -> None:
    assert {row.fault for row in ROWS if row.fault} == set(CATALOGUE)
    assert [row.name for row in ROWS] == list(TABLE)


def test_the_page_is_the_table() -> None:
    if os.environ.get("GOLDENS") == "write":
        PAGE.write_text(page(), encoding="utf-8")
        pytest.fail(f"{PAGE.name} was written: look at it, then run without GOLDENS", pytrace=False)
    assert PAGE.read_text(encoding="utf-8") == page()
