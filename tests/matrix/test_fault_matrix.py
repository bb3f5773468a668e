"""Every fault in every state: what the console makes of it, and that nothing of it is dangerous."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from console.session.cut import run
from console.session.data import records
from drivers.lathe import standstill
from drivers.lathe.jogs import Jogs
from drivers.simulator.faults.catalogue import CATALOGUE
from tests.matrix.cell import problems, run_cell
from tests.matrix.faults import KNOWN, ROWS, SAME, TABLE, UNTRIED, WRONG, Row, tried
from tests.matrix.headless import HEADLESS, Moment
from tests.matrix.headless import KNOWN as HEADLESS_KNOWN
from tests.matrix.rig import (
    RUN_OUT_S,
    RUNNING_OUT,
    TIMEOUT_S,
    LogNowhere,
    Situation,
    planned_once,
    record_in_memory,
)

_HEAD = """# The fault matrix

The outcome of each fault ([faults.md](faults.md)) in each state of the console: first at the screens, then in
`console run`, which makes one part without anybody at its keys. Each cell is tested on the simulated lathe, with
the heartbeat that a host keeps; the test checks everything that was sent, and every axis.

In no cell does anything move without a command, nor after the end. No line that moves or writes is sent more
often than without the fault, and none after a stop. No position is shown that the controller did not have between
request and reply. Nothing enables an amplifier. No exception is shown. Motion without an answer is
stopped within a second, and a stop that is not proven goes out five times a second. When the fault is gone nothing
resumes by itself, and a machine that was lost is found again at rest, unless its link is gone for good. A cut that
ends otherwise than planned does not count as done: its part is not measured, and nothing is learned from it.

A cell gives the final state, the strongest thing that was sent (a stop, before a line, before a renewal of the
heartbeat, before polls alone), and the alarms, or the reasons of a refusal:

- **ready**, **armed**: the console continues. **stopped**: rest is proven, and F2 resets. **lost**: rest cannot be
  proven; the heartbeat ends what moves.
- `–` is as without the fault. An empty cell is not tested: another one shows the same, or its fault concerns
  something that does not exist there. A stop in parentheses may be sent, when a poll fails on the way to rest.
- *no answer* is one of `link.silent`, `link.out_of_step` and `link.not_in_step`: nothing came, or something else,
  or the client did not resynchronise.
- Control-A is sent only while every loop was seen closed and nothing is in doubt. A fault of the line puts that in
  doubt, an amplifier fault or a trip opens a loop: then it is control-K, and the spindle coasts.

*Drives off*: somebody is inside the guard. The jog is one of the carriage, the home search that of the tool. The
download is that of a program, the cut one of experiment 1 at 1000 rpm, with one lobe along Z; rows that name Z, or
one row of a table, are of a shell. *Stopping* is that cut after Space; the
fault comes at that moment.

## At the screens

"""

_HEADLESS = """
## Without an operator

`console run` claims the machine, loads the program and reads it back, enables the drives and homes, moves to
the start, compares everything once more (*checking*), starts, cuts, retracts the tool, and checks that all is
at rest and the tool clear (*ended*). The fault comes in the middle of it: of *claiming* with the first line that
is sent, of *loading* with the first line of the path, of *homing* in the search of the tool, of *positioning* with
the carriage on its way; *starting* is after the last comparison.

It ends with a part, or with an error. **refused** or **interrupted**: nothing has moved, or another console
controls the machine. **stopped**: rest is proven, and the error states whether the tool is in the part and can be
retracted. **unproven**: the machine may move until its heartbeat ends that. Only a finished part is measured. What
was sent and what has moved is checked as above, also while the machine is left with its drives disabled.

"""

_LIMITS = """
## What cannot be seen

- An axis whose encoder does not count appears to rest. After a trip by a lost encoder the spindle may coast
  while the console proves rest: it relies on the controller's report. The alarm names the axis.
- Control-A closes a loop that has tripped, or that another host has opened, since the last poll, where it stands.
  The controller trips it again if the cause lasts; the next poll then finds it open, and the next stop is
  control-K.
- The console does not prevent what another host moves, enables or writes. During a motion of this console the
  next poll checks it: uncommanded motion is stopped at that poll. The constants of a running program are read
  in turn, within a second, unless an axis has left its plan before. At rest the next poll, within 0.1 s, stops
  the motion of another host; the next command refuses what it has disabled or rewritten, and the first poll of
  the program finds a feed override. An axis that is found elsewhere than it was left has no home any more. A
  zero that is set while no console is in control, or a shift of less than 0.01 mm or 0.5 degrees, is not seen:
  after other software has been at the controller, home again. Between the last comparison and the start a
  program may be rewritten: it then runs until an axis leaves the plan, or it ends otherwise than the planned
  one.
- A line that arrives otherwise than it was sent shows only in its effect. What is loaded is read back, so that it
  has none; a jog has begun by the time of the next poll.
"""


def page() -> str:
    """Return the page."""
    return "".join(
        (_HEAD, *_table(), *_not_yet([wrong.what for wrong in WRONG]), _HEADLESS, *_headless(), _LIMITS)
    )


def _table() -> Iterator[str]:
    yield _row("fault", *(situation.value for situation in Situation))
    yield _row(*("---",) * (len(Situation) + 1))
    for name, cells in TABLE.items():
        said = (_cell(name, situation, cell) for situation, cell in cells.items())
        yield _row(name if name == "no fault" else f"`{name}`", *said)


def _headless() -> Iterator[str]:
    yield _row("fault", *(moment.value for moment in Moment))
    yield _row(*("---",) * (len(Moment) + 1))
    for name, cells in HEADLESS.items():
        said = (_ways(cell) + _mark(HEADLESS_KNOWN, name, moment) for moment, cell in cells.items())
        yield _row(name if name == "no fault" else f"`{name}`", *said)
    yield from _not_yet(HEADLESS_KNOWN.values())


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |\n"


def _cell(row: str, situation: Situation, said: str) -> str:
    return _ways(said) + _mark(KNOWN, row, situation)


def _mark(known: Collection[tuple[str, Situation]] | Collection[tuple[str, Moment]], row: str, column: str) -> str:
    return " \\*" if (row, column) in known else ""


def _ways(said: str) -> str:
    if said in (SAME, UNTRIED):
        return "–" if said == SAME else ""
    return " or ".join(map(_way, said.split(" or ")))


def _way(said: str) -> str:
    state, _, codes = said.partition(": ")
    end, _, sent = state.partition(", ")
    told = [_code(code) for code in codes.split()]
    return f"**{end}**, {sent}" + (f": {' '.join(told)}" if told else "")


def _code(code: str) -> str:
    return "*no answer*" if "/" in code else f"`{code}`"


def _not_yet(wrong: Collection[str]) -> Iterator[str]:
    if not wrong:
        return
    yield "\n### Not yet so\n\nThe cells with an asterisk do not yet behave as the table states:\n\n"
    for what in wrong:
        yield f"- {what}\n"


PAGE = Path(__file__).parents[2] / "docs" / "fault-matrix.md"


@pytest.fixture(autouse=True)
def quick(monkeypatch: MonkeyPatch) -> None:
    """Plan once for all cells, and keep records nowhere."""
    monkeypatch.setattr(run, "plan_cut", planned_once)
    monkeypatch.setattr(records, "open_records", record_in_memory)
    monkeypatch.setattr(records, "RunLog", LogNowhere)


pytestmark = pytest.mark.long

CELLS = [(row, situation) for row in ROWS for situation in Situation if tried(row.name, situation)]


@pytest.mark.parametrize(
    ("row", "situation"), CELLS, ids=[f"{row.name}-{each.value.replace(' ', '-')}" for row, each in CELLS]
)
def test_a_fault_in_a_state_ends_as_it_should(
    row: Row, situation: Situation, tmp_path: Path, monkeypatch: MonkeyPatch
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
