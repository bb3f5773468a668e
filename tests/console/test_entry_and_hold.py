"""What the push of the cut leaves on a part: at its entry, and where it was held. Measured on simulated parts."""

from __future__ import annotations

import pytest

from benchmarks.feed_hold import ABOUT_HOLD_MM, Cutting, figures, row_fall_um
from drivers.cutting.planning import Strategy

DESIGNED = (766.0, 15326.0, 4.39)  # docs/tuning.md: V/m, V/(m s), V s/m


def cutting(
    strategy: Strategy, gains: tuple[float, ...] | None = DESIGNED, parts: int = 0, passive: float = 0.0
) -> Cutting:
    return Cutting(
        job_name="lee-2001-experiment-1",
        machine_name="lee-2001-lathe",
        strategy=strategy,
        plant="steady",
        parts=parts,
        gains=gains,
        passive_fraction=passive,
    )


@pytest.mark.parametrize(
    "strategy",
    [
        Strategy.PVT,
        pytest.param(Strategy.CAM, marks=pytest.mark.long),
        pytest.param(Strategy.TIMEBASE, marks=pytest.mark.long),
    ],
)
def test_with_a_stiff_loop_neither_entry_nor_hold_leaves_a_step(strategy: Strategy) -> None:
    found = figures(cutting(strategy), 7)
    assert not found.refused
    assert found.fall_um is not None and abs(found.fall_um) < 1.0
    # Both of these parts scatter by some tenths of a um: friction and noise differ after the hold.
    assert found.step_um is not None and found.step_um < 1.0
    assert min(ABOUT_HOLD_MM) < -0.4 and max(ABOUT_HOLD_MM) > 0.4  # as long as the land reaches


@pytest.mark.parametrize(
    "strategy",
    [Strategy.CAM, *(pytest.param(each, marks=pytest.mark.long) for each in (Strategy.PVT, Strategy.TIMEBASE))],
)
def test_a_stated_force_takes_the_push_of_a_soft_loop_out(strategy: Strategy) -> None:
    found = figures(cutting(strategy, gains=None, passive=0.4), 7)
    assert not found.refused
    # Without it both are 17 to 19 um; what is left of the fall is dry friction.
    assert found.fall_um is not None and abs(found.fall_um) < 4.0
    assert found.step_um is not None and found.step_um < 1.5


@pytest.mark.long
def test_a_row_of_parts_learns_the_push_of_a_soft_loop() -> None:
    soft = cutting(Strategy.CAM, gains=None, parts=2)
    # With nothing learned the second part falls by 12 um, as the first does; the third falls by 0.1 um.
    assert abs(row_fall_um(soft, 7)) < 8.0
