"""Deeds of another host that are undone before the cut ends are in the part, and it is not called good.

They were drawn by `benchmarks.hostile_host` with seed 2001, and called good once.
"""

from __future__ import annotations

import pytest

from benchmarks.hostile_host import KINDS, Attack, make
from benchmarks.hostile_lines import Deed
from console.session.cut.engine import Step


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("kind", "first", "later", "after_s", "for_s", "outcome"),
    [
        (3, "P25=P25+40", "", 3.78, 0.0, "cut.disturbed"),
        (1, "I{tool}30={gain}/4", "I{tool}30={gain}", 3.15, 0.39, "cut.lagged"),
        (5, "&1H", "&1R", 3.08, 0.2, "cut.off_path"),
    ],
)
def test_what_was_undone_is_found(
    kind: int, first: str, later: str, after_s: float, for_s: float, outcome: str
) -> None:
    attack = Attack(deed=Deed(first=first, later=later), step=Step.CUT, after_s=after_s, undone_after_s=for_s)
    made, _ = make(*KINDS[kind], attack, 1)
    assert made.outcome == outcome
