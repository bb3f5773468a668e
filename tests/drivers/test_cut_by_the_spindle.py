"""A cut that goes by the spindle, in a table or on its time: the lobe is gone whatever the chuck and the speed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drivers.cutting.planning import Strategy
from drivers.simulator.plant.true_parameters import ideal
from tests.drivers.close_together import machine as machine
from tests.drivers.cut_floor import CutFloor, short

if TYPE_CHECKING:
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import JobMaker

BY_THE_SPINDLE = pytest.mark.parametrize("strategy", [Strategy.CAM, Strategy.TIMEBASE])


@pytest.mark.first(2)
@pytest.mark.parametrize(
    ("strategy", "jaws", "phase_deg", "rpm", "error_um"),
    [
        (Strategy.CAM, 4, 33.0, 640.0, 21.0),
        (Strategy.CAM, 6, -100.0, 477.0, 55.0),
        (Strategy.TIMEBASE, 6, -100.0, 477.0, 55.0),
        (Strategy.TIMEBASE, 3, 47.0, 1234.5, 55.0),
    ],
)
def test_less_than_a_third_of_a_micrometre_is_left_whatever_the_chuck(
    machine: MachineProfile,
    experiment: JobMaker,
    strategy: Strategy,
    jaws: int,
    phase_deg: float,
    rpm: float,
    error_um: float,
) -> None:
    job = replace(
        short(experiment),
        jaws=jaws,
        lobe_phase_deg=phase_deg,
        spindle_speed_rpm=rpm,
        lobe_spindle_speed_rpm=rpm,
        lobe_error_um_pp=error_um,
    )
    floor = CutFloor(job, machine, strategy)
    floor.cut()
    assert floor.measured().ront_um < 0.3


@BY_THE_SPINDLE
def test_a_spindle_with_inertia_that_lags_in_its_loop_costs_nothing(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy
) -> None:
    job = replace(short(experiment), cut_length_mm=0.6)
    floor = CutFloor(job, machine, strategy, replace(ideal(machine), ideal_spindle=False))
    floor.cut()
    assert floor.measured().ront_um < 0.3


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("strategy", "left_um", "within_um"),
    [(Strategy.PVT, 2.07, 0.1), (Strategy.CAM, 0.99, 0.25), (Strategy.TIMEBASE, 0.99, 0.25)],
)
def test_a_ripple_of_the_speed_moves_the_tool_with_the_angle(
    machine: MachineProfile, experiment: JobMaker, strategy: Strategy, left_um: float, within_um: float
) -> None:
    """5 % twice a turn is 1.43 deg of spindle, 0.075 of a lobe's radian.

    Beside the part: lobes by the even and by the swung angle, over the servo's response at 50 Hz, then through all
    of that response (Fourier, 7200 points a turn), less the lobe by the swung angle: 2.07 um by the clock and
    0.99 um by the angle are left. What stays is the servo's: it was inverted at one frequency, the ripple makes
    others.
    """
    floor = CutFloor(short(experiment), machine, strategy)
    floor.ripple(0.05)
    floor.cut()
    assert floor.measured().ront_um == pytest.approx(left_um, abs=within_um)
