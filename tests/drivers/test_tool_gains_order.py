"""The order in which gains and filter are written: on the way the loop is never more than at both ends."""

from __future__ import annotations

import pytest

from drivers.identification.tool_gains import in_writing_order

PLAIN = {"I130": 528.0, "I131": 4905.0, "I132": 4905.0, "I133": 811.0}
NONE = {"I136": 0.0, "I137": 0.0, "I138": 0.0, "I139": 0.0}
DEEP = {"I136": -1.2, "I137": 0.6, "I138": -1.5, "I139": 0.6}
OTHER = {"I136": -1.0, "I137": 0.5, "I138": 0.4, "I139": -0.3}


@pytest.mark.parametrize("before", [NONE, DEEP, OTHER])
@pytest.mark.parametrize("after", [NONE, DEEP, OTHER])
@pytest.mark.parametrize("scale", [300.0, 2000.0])
def test_each_state_on_the_way_has_a_steady_filter_and_no_more_gain(
    before: dict[str, float], after: dict[str, float], scale: float
) -> None:
    found, wanted = {**PLAIN, **before}, {**PLAIN, **after, "I130": scale}
    now = dict(found)
    for name in in_writing_order(found, wanted):
        now[name] = wanted[name]
        assert abs(now["I139"]) < 1.0 and abs(now["I138"]) < 1.0 + now["I139"], "its poles are inside"
        if now != wanted:
            assert now["I130"] == min(scale, 528.0)
    assert now == wanted
