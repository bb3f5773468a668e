"""The order in which gains and filter are written: on the way the loop is never more than at both ends."""

from __future__ import annotations

import pytest

from drivers.identification.tool_gains import in_writing_order
from profiles.axis.notch import Notch

PLAIN = {"I130": 528.0, "I131": 4905.0, "I132": 4905.0, "I133": 811.0}
NONE = {"I136": 0.0, "I137": 0.0, "I138": 0.0, "I139": 0.0}
DEEP = {"I136": -1.2, "I137": 0.6, "I138": -1.5, "I139": 0.6}
OTHER = {"I136": -1.0, "I137": 0.5, "I138": 0.4, "I139": -0.3}
FIRST = {"I136": -1.09375, "I137": 0.908203125, "I138": -0.169921875, "I139": 0.134765625}
"""The first filter for the paper's tool where it bends at 300 Hz: n1 alone would turn its sign at rest."""


def at_rest(now: dict[str, float]) -> float:
    """The gain of the loop at rest, in units of Ix30."""
    n1, n2, d1, d2 = (now[name] for name in NONE)
    return now["I130"] * Notch(n1=n1, n2=n2, d1=d1, d2=d2).at_rest


@pytest.mark.parametrize("before", [NONE, DEEP, OTHER, FIRST])
@pytest.mark.parametrize("after", [NONE, DEEP, OTHER, FIRST])
@pytest.mark.parametrize("scale", [300.0, 2000.0])
def test_each_state_on_the_way_has_a_steady_filter_and_no_more_gain(
    before: dict[str, float], after: dict[str, float], scale: float
) -> None:
    found, wanted = {**PLAIN, **before}, {**PLAIN, **after, "I130": scale, "I131": 4000.0}
    now, most = dict(found), max(at_rest(found), at_rest(wanted))
    for name, value in in_writing_order(found, wanted):
        now[name] = value
        assert abs(now["I139"]) < 1.0 and abs(now["I138"]) < 1.0 + now["I139"], "its poles are inside"
        assert 0.0 <= at_rest(now) <= most, "no positive feedback, and no more than at both ends"
        assert at_rest(now) * now["I131"] <= max(at_rest(found) * found["I131"], at_rest(wanted) * wanted["I131"])
    assert now == wanted


def test_where_the_filter_stays_there_is_a_loop_all_the_time() -> None:
    for scale in (300.0, 2000.0):
        wanted = {**PLAIN, **FIRST, "I130": scale}
        order = in_writing_order({**PLAIN, **FIRST}, wanted)
        assert [name for name, _ in order].count("I130") == 1
        assert order[0 if scale < PLAIN["I130"] else -1] == ("I130", scale)


def test_where_a_coefficient_changes_there_is_no_force_until_all_are_written() -> None:
    order = in_writing_order({**PLAIN, **NONE}, {**PLAIN, **FIRST})
    assert (order[0], order[-1]) == (("I130", 0.0), ("I130", 528.0))
