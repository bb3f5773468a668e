"""A second host changes what shapes a cut, holds it for a while of the feed, and puts it back before its end.

Nothing of it is left when the cut has ended: only what is read during the feed can tell.
"""

from __future__ import annotations

import pytest

from benchmarks.hostile_host import GOOD, JOB, WitnessedLathe, lathe_at, plan_of, said
from console.session.cut.engine import CutContext, Step
from console.session.cut.run import cut_part
from drivers.cutting.strategy import Strategy
from profiles.problem import Problem, ProblemError
from tests.system.lathe_sites import compact

DEEDS = {
    "gain": ("I130=I130/2", "I130=I130*2", "I130"),
    "scale": ("I108=I108+1", "I108=I108-1", "I108"),
    "servo period": ("I10=I10+37137", "I10=I10-37137", "I10"),
    "friction": ("I168=400", "I168=0", "I168"),
    "carriage limit": ("I316=I316+1", "I316=I316-1", "I316"),
}
OF_A_FAMILY = {
    "pmac": {
        "conversion": ("WY:$720,$C008", "WY:$720,$C000", "Y:$720"),
        "bias": ("M500->D:$813 M500=M500+30000", "M500=M500-30000", "Y:$813"),
        "correction of the spindle": ("M500->D:$82 M500=M500+30000", "M500=M500-30000", "Y:$82"),
    },
    "turbo": {
        "conversion": ("I8000=I8001", "I8000=$78200", "I8000"),
        "bias": ("M500->D:$CC M500=M500+30000", "M500=M500-30000", "Y:$CC"),
        "correction of the spindle": ("M500->D:$110 M500=M500+30000", "M500=M500-30000", "Y:$110"),
    },
}


def cut_with(
    family: str, strategy: Strategy, lines: tuple[str, str] | None, begin: float, last_s: float
) -> tuple[Problem | str, WitnessedLathe]:
    """Cut while a second host sends the first line so far into the program, and the other so long after it."""
    machine, plan = compact(family), plan_of(family, strategy)
    sim = WitnessedLathe(machine)
    lathe = lathe_at(sim, machine)

    def tell(step: Step, _: str) -> None:
        if step is Step.CUT and lines is not None:
            at_s = sim.now_s() + begin * plan.duration_s
            first, later = (said(line, machine, plan) for line in lines)
            sim.due = [(at_s, first), (at_s + last_s, later)]

    lathe.connect()
    try:
        cut_part(CutContext(lathe=lathe, workshop=sim), JOB, plan, tell)
    except ProblemError as error:
        return error.problems[0], sim
    return GOOD, sim


CASES = [
    pytest.param(family, name, id=f"{family} {name}")
    for family in ("pmac", "turbo")
    for name in (*DEEDS, *OF_A_FAMILY[family])
]


@pytest.mark.parametrize(("family", "name"), CASES)
def test_what_is_held_for_as_long_as_the_whole_table_takes_is_seen(family: str, name: str) -> None:
    first, later, key = {**DEEDS, **OF_A_FAMILY[family]}[name]
    found, _ = cut_with(family, Strategy.PVT, (first, later), 0.5, 1.2)
    assert isinstance(found, Problem), found
    assert (found.code, found.key) == ("cut.constant_differs", key)


@pytest.mark.parametrize("strategy", list(Strategy))
@pytest.mark.parametrize("family", ["pmac", "turbo"])
@pytest.mark.first(5)
def test_what_is_held_for_the_whole_feed_is_seen_with_every_strategy(family: str, strategy: Strategy) -> None:
    last_s = 0.6 * plan_of(family, strategy).duration_s
    found, _ = cut_with(family, strategy, ("I130=I130/2", "I130=I130*2"), 0.2, last_s)
    assert isinstance(found, Problem), found
    assert (found.code, found.key) == ("cut.constant_differs", "I130")


def test_what_is_changed_at_the_end_of_the_feed_is_read_once_more() -> None:
    """The tool is on its way out, and the carriage limit comes late in the table."""
    duration_s = plan_of("turbo", Strategy.PVT).duration_s
    begin = (duration_s - 0.9) / duration_s
    found, _ = cut_with("turbo", Strategy.PVT, ("I323=I323-1", "I323=I323+1"), begin, 3.0)
    assert isinstance(found, Problem), found
    assert (found.code, found.key) == ("cut.constant_differs", "I323")
