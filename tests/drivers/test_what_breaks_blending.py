"""What brings the axes to their programmed point between two moves, and what does not."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drivers.ideal_card import CYCLE_MS, IdealCard, rests, stops

BREAKS = {
    "a DWELL": ("DWELL50",),
    "a DWELL of nothing": ("DWELL0",),
    "PSET": ("PSET Y0",),
    "HOME": ("HOMEZ2",),
    "a RAPID move": ("RAPID Y10 LINEAR",),
    "WAIT": ("WHILE(P1=0)WAIT",),
    "two jumps back": ("WHILE(P2<3)", "P2=P2+1", "ENDWHILE"),
    "two jumps back with GOTO": ("N1 P2=P2+1", "IF(P2<3)", "GOTO1", "ENDIF"),
}
GOES_ON = {
    "nothing": (),
    "calculation": ("P1=1 P2=2",),
    "one jump back": ("WHILE(P2<1)", "P2=P2+1", "ENDWHILE"),
    "GOSUB": ("GOSUB7",),
    "CALL": ("CALL500",),
    "another mode word": ("ABS INC LINEAR",),
}


AT_THE_POINT = [pytest.approx(1000, abs=0.05)]
"""Between two servo cycles a motion at half a count/ms2 may be that far from where it stood for an instant."""


def run(lines: tuple[str, ...], **settings: float) -> np.ndarray:
    """Two moves of 1000 counts with something between them."""
    card = IdealCard(**settings)
    card.store("P3=1", "RETURN", number=500)
    card.program("INC TA20 TS0 TM100", "X1000", *lines, "X1000", "DWELL0", "RETURN", "N7 P3=1", "RETURN")

    def go() -> None:
        card.system.run()
        card.wait(400)
        card.set(P1=1)
        card.settle()

    track = card.record(go)
    assert track[-1] == pytest.approx(2000)
    return track


@pytest.mark.parametrize("name", BREAKS)
def test_it_comes_to_rest_at_its_point(name: str) -> None:
    assert stops(run(BREAKS[name])) == AT_THE_POINT


@pytest.mark.parametrize("name", GOES_ON)
def test_it_goes_on_without_a_rest(name: str) -> None:
    assert stops(run(GOES_ON[name])) == []


def test_a_delay_is_a_blended_move_of_no_distance() -> None:
    """The motion rests inside it, from half of TA after its nominal start to half of TA before its end."""
    ((position, ms),) = rests(run(("DELAY50",)))
    assert position == pytest.approx(1000)
    assert ms == pytest.approx(30, abs=2 * CYCLE_MS)


def test_ix92_stops_after_each_move() -> None:
    assert stops(run((), I192=1)) == AT_THE_POINT


def test_single_step_stops_after_each_move() -> None:
    card = IdealCard()
    card.program("INC TA20 TS0 TM100", "X1000", "X1000")

    def go() -> None:
        card.system.step()
        card.settle()
        card.system.step()
        card.settle()

    assert stops(card.record(go)) == AT_THE_POINT


def test_the_end_of_the_program_does() -> None:
    card = IdealCard()
    track = card.run("INC TA20 TS0 TM100", "X1000")
    assert track[-1] == 1000
    assert (len(track) - 1) * CYCLE_MS < 200


def test_a_dwell_waits_for_its_time_from_rest_on() -> None:
    ((_, ms),) = rests(run(("DWELL50",)))
    assert ms == pytest.approx(50, abs=2 * CYCLE_MS)
