"""Whatever a host sends, and when: nothing breaks, no motor jumps, and the card rests when it is told to."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import PmacError
from drivers.simulator.card.coordinate import CoordinateSystem
from tests.drivers.ideal_card import CYCLE_MS, IdealCard

PROGRAMS = (
    (
        "INC TA20 TS5 TM50",
        "X500 Y100",
        "X-300",
        "BSTART",
        "X200",
        "Y50",
        "BSTOP",
        "DWELL20",
        "X100",
        "STOP",
        "X-400",
    ),
    ("ABS TA10 TS0 TM40", "X200", "HOME1", "X100", "PSET X0 Y5", "X-50", "HOMEZ2", "Y30"),
    ("INC", "PVT50", "X200:4000", "X200:4000", "X100:0", "LINEAR TA10 TM60 X-300 Y100", "DELAY30", "M1==1 X40"),
    ("INC TA20 TS0 TM30", "WHILE(P1<40)", "P1=P1+1", "X100", "X-90", "ENDWHILE"),
    ("RAPID INC X300 Y-100", "SPLINE1 TA40 X50", "X50", "LINEAR TM100 X500", "GOTO77"),
)

Act = Callable[[IdealCard], object]

ACTS: dict[str, Act] = {
    "R": lambda card: card.system.run(),
    "S": lambda card: card.system.step(),
    "Q": lambda card: card.system.quit(),
    "/": lambda card: card.system.stop_at_block(),
    "H": lambda card: card.system.hold(),
    "A": lambda card: card.system.abort(),
    "%0": lambda card: card.system.set_override(0),
    "%40": lambda card: card.system.set_override(40),
    "%100": lambda card: card.system.set_override(100),
    "%200": lambda card: card.system.set_override(200),
    "PMATCH": lambda card: card.system.match_positions(),
    "Z": lambda card: card.system.zero_axes(),
    "^A": lambda card: card.controller.abort_all(),
    "^R": lambda card: card.controller.each_system(CoordinateSystem.run),
    **{f"B{number}": lambda card, number=number: card.system.point(number) for number in range(1, 6)},  # type: ignore[misc]
}
JOGS: dict[str, Act] = {
    "J+": lambda card: card.motor().jog_speed(1),
    "J-": lambda card: card.motor().jog_speed(-1),
    "J/": lambda card: card.motor().jog_speed(0),
    "J=": lambda card: card.motor().jog_back(),
    "J=700": lambda card: card.motor().jog_to(700),
    "J:-90": lambda card: card.motor().jog_by(-90),
    "J=900^5": lambda card: card.motor().jog_to(900, 5),
    "HM": lambda card: card.motor().home(),
    "HMZ": lambda card: card.motor().home_zero(),
}

FASTEST = 50.0
"""Counts/ms: a jog; the programs make 20 at most (Ix16), and 40 at 200 %."""


def do(card: IdealCard, name: str) -> None:
    with suppress(PmacError):
        if name in JOGS:
            card.controller.refuse_in_control(1)
            JOGS[name](card)
        else:
            ACTS[name](card)


@given(
    st.integers(1, 5),
    st.sampled_from([0, 10]),
    st.lists(st.tuples(st.sampled_from([*ACTS, *JOGS, "R", "R", "S", "H"]), st.integers(0, 25)), max_size=14),
)
def test_no_motor_jumps_and_a_stop_stops(program: int, segment_ms: int, acts: list[tuple[str, int]]) -> None:
    card = IdealCard(I113=60_000, I114=-60_000, I116=20, I216=20, I13=segment_ms, I194=40_000, I195=40_000)
    for number, lines in enumerate(PROGRAMS, start=1):
        card.store(*lines, number=number)
    card.system.point(program)
    machine: list[float] = []
    for name, blocks in [("R", 5), *acts]:
        do(card, name)
        for _ in range(blocks):
            card.block()
            machine.append(card.motor().actual + card.motor().axis.origin)
    if not segment_ms:  # segmented moves know no Ix16
        assert np.abs(np.diff(machine)).max() <= FASTEST * 11 * CYCLE_MS * 1.001
    assert all(card.motor(number).enabled for number in (1, 2))
    card.controller.abort_all()
    card.wait(200)
    assert not card.system.moving
    assert not card.system.running
    assert all(card.motor(number).velocity == 0 for number in (1, 2))
    assert all(card.motor(number).in_position for number in (1, 2))
