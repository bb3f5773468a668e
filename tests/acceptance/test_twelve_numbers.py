"""The twelve numbers by which the twin, the servo and the compensation are known to be right.

What must come out, and how nearly, was computed elsewhere (numpy, scipy and control, double precision) or is the
paper's; it stands in the records with its tolerance. Those of the lathe are real cuts by the simulated card:
1 and 5 to 9. Each is told in docs/paper.md as it came out here.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import pytest

from console.cli.measured.comparison import ACCEPTANCE, head, rows
from console.session.reproduction.numbers import NUMBERS
from profiles.paper import reproduction
from profiles.paper.record import Experiments, Record, Relation, Section, lee_2001
from tests.acceptance.test_paper_document import TEXT, compare_block, table_lines

pytestmark = [pytest.mark.timeout(300), pytest.mark.long]

WANTED = {
    1: {"lathe.plain 1": (55.0, 0.1), "lathe.plain 2": (33.0, 0.1), "lathe.plain_lobe 1": (27.5, 0.02)},
    2: {"accept.servo bandwidth": (55.24, 0.1), "accept.servo overshoot": (2.31, 0.02)},
    3: {"cause.sine_eq9 1": (38.8, 0.2), "cause.sine_eq9 2": (23.3, 0.2)},
    4: {"cause.sine_measured 1": (14.0, 0.1), "cause.sine_measured 2": (8.4, 0.1)},
    5: {
        "lathe.s_curve 1": (25.2, 0.3),
        "lathe.s_curve 2": (15.1, 0.3),
        "lathe.linear 1": (31.4, 0.3),
        "lathe.linear 2": (18.8, 0.3),
        "lathe.literal 1": (30.0, 6.0),
        "lathe.literal 2": (14.0, 6.0),
    },
    6: {
        "lathe.segment ": (20.0, 0.001),
        "lathe.speed ": (500.0, 0.1),
        "lathe.lobe_frequency ": (25.0, 0.005),
        "lathe.stroke ": (183.3, 0.1),
        "lathe.mean ": (637.5, 0.1),
    },
    7: {"lathe.lobe ": (0.0, 0.05), "lathe.places ": (0.0, 0.3)},
    8: {f"lathe.pass {n}": (0.0, limit) for n, limit in enumerate((10.0, 2.0, 0.5, 0.1))},
    9: {
        "lathe.unlearned ": (0.0, 18.0),
        "lathe.cut 1": (0.0, 5.0),
        "lathe.cut 2": (0.0, 1.2),
        "lathe.cut 3": (0.0, 0.5),
        "lathe.averaged ": (0.0, 1.5),
    },
    10: {
        f"accept.alignment {at}": (um, 0.005) for at, um in (("1", 2.88), ("0.347", 1.0), ("20", 55), ("60", 110))
    },
    11: {
        "accept.stiffness steady": (10.86, 0.01),
        "accept.stiffness lobe": (1.495, 0.001),
        "accept.stiffness recovery": (4.57, 0.05),
    },
    12: {
        "accept.clamping three": (55.0, 0.05),
        "accept.clamping six": (19.1, 0.05),
        "accept.clamping centrifugal": (1579.0, 0.5),
        "accept.clamping crest": (0.0, 0.5),
        "accept.clamping spinning": (0.8247, 1e-3),
    },
}
"""The numbers with their tolerances once more, so that no record can be bent unseen."""


@cache
def paper() -> Experiments:
    return lee_2001()


@cache
def by_formula() -> Section:
    return reproduction.section(paper())


BY_BOTH = 5
"""The number that has formulas beside its cuts."""


def test_the_numbers_of_formulas_come_out() -> None:
    of_cuts = NUMBERS.keys() - {BY_BOTH}
    assert {record.number for record in by_formula().records} == set(range(1, 13)) - of_cuts
    for number in sorted(set(range(1, 13)) - NUMBERS.keys()):
        comes_out(number, [record for record in by_formula().records if record.number == number])


@pytest.mark.parametrize("number", NUMBERS)
def test_the_number_comes_out(number: int) -> None:
    formulas = by_formula().records if number == BY_BOTH else ()
    cut = NUMBERS[number](paper())  # on the lathe of the command: how the tool came stays in its slow integrator
    comes_out(number, [*(each for each in formulas if each.number == number), *cut])


def comes_out(number: int, records: Sequence[Record]) -> None:
    """Compare a number with what must come out, and with what is told of it."""
    assert records
    assert {record.number for record in records} == {number}
    assert [row for row, record in zip(rows(records, TEXT), records, strict=True) if record.holds is False] == []
    met = {f"{record.name} {record.at}": record.ours for record in records}
    for name, (expected, tolerance) in WANTED[number].items():
        assert met[name] == pytest.approx(expected, abs=tolerance), name
    lines = table_lines(head(Section(ACCEPTANCE, ()), TEXT), records)
    compare_block(f"number {number}", lines, measured=number in NUMBERS)


def test_a_number_that_is_missed_is_told() -> None:
    near = Record(name="accept.servo", at="gain", ours=0.76, expected=0.7455, tolerance=0.0037, number=2)
    most = Record(name="lathe.lobe", ours=0.06, expected=0.05, relation=Relation.AT_MOST, unit="um", number=7)
    assert (near.holds, most.holds) == (False, False)
    assert [row[-1] for row in rows([near, most], TEXT)] == ["✗", "✗"]
    assert rows([near], TEXT)[0][3] == "+0.0145 (± 0.0037)"
