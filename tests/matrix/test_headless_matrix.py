"""Every fault at every moment of a part that `console run` makes: how it ends, and that nothing is dangerous.

What is right in each cell stands in `headless_expected.py`, and as a page in docs/fault-matrix.md.
"""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path

import pytest

from drivers.cutting.planning import Strategy
from drivers.lathe import standstill
from drivers.pmac.reserved import WITNESS
from tests.matrix.cell import sent_fits, strongest, told_fits
from tests.matrix.faults import NO_FAULT, ROWS
from tests.matrix.headless import HEADLESS, INTERRUPT, KNOWN, TRIED, Moment, Part, make, right_of
from tests.matrix.rig import RUN_OUT_S, TIMEOUT_S

pytestmark = pytest.mark.long

BY_NAME = {row.name: row for row in (*ROWS, INTERRUPT)}


STANDING = (Moment.CLAIMING, Moment.LOADING, Moment.HOMING, Moment.CHECKING)
"""Where nothing may have to run out."""


WINDOW = f"P{WITNESS[2]}="
_USUAL: list[tuple[str, ...]] = []


def lines_without_fault(records: Path) -> tuple[str, ...]:
    """The lines that move or write, of one part; found once."""
    if not _USUAL:
        _USUAL.append(make(NO_FAULT, Moment.ENDED, records).lines)
    return _USUAL[0]


def fits(target: str, part: Part) -> bool:
    state, _, codes = target.partition(": ")
    end, _, sent = state.partition(", ")
    return end == part.end.value and sent_fits(sent, part.sent) and told_fits(codes.split(), part.codes)


def sent_otherwise(part: Part, records: Path) -> list[str]:
    """What moves or writes goes out as without the fault, up to where it ends.

    Where the witness of the controller looks depends on where the carriage is.
    """
    own, others = (
        [WINDOW if line.startswith(WINDOW) else line for line in lines]
        for lines in (part.lines, lines_without_fault(records)[: len(part.lines)])
    )
    return [f"{line} was sent, not {usual}" for line, usual in zip_longest(own, others) if line != usual][:1]


@pytest.mark.parametrize(("name", "moment"), TRIED, ids=[f"{name}-{moment}" for name, moment in TRIED])
def test_a_part_ends_as_it_should(
    name: str, moment: Moment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    timeout_s = TIMEOUT_S if moment in STANDING else RUN_OUT_S
    monkeypatch.setattr(standstill, "COAST_TIMEOUT_S", timeout_s)
    part = make(BY_NAME[name], moment, tmp_path)
    target = right_of(name, moment)
    said = f"{part.end}, {' '.join(strongest(part.sent))}: {' '.join(part.codes)}"
    assert any(fits(way, part) for way in target.split(" or ")), f"{said}, not {target}"
    again = sent_otherwise(part, tmp_path) if BY_NAME[name].strategy is Strategy.PVT else []
    met = [*part.wrong, *again]
    if (name, moment) in KNOWN:
        assert met != [], "this cell is right now: take it out of the list of known ones"
    else:
        assert met == []


def test_each_row_is_one_of_the_screens_too_in_their_order() -> None:
    assert list(HEADLESS) == [name for name in BY_NAME if name in HEADLESS]
