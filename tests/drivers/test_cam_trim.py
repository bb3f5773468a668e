"""A cut on a table that listens: the wave that a host asks for while the tool is in the part."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.cutting.planning import Strategy, plan_cut
from drivers.errors import DriverError
from drivers.pmac.programs.cam_trim import MOST_TRIM_UM, trim_line
from profiles.machine import MachineProfile
from tests.drivers.conftest import JobMaker
from tests.drivers.cut_floor import FAMILIES, CutFloor, Floats, of_family, short, with_inverter

LONG_MM = 2.0
"""54 turns: some before the wave, some while it comes, and some behind it."""

TRIM_UM = cmath.rect(5.0, 1.1)
OVAL_UM = 1.5 - 2j
COUNTS_PER_DEG = 10_000 / 360.0


ASKED_S = 5.0
"""When the wave is asked for: in the 32nd turn; the feed begins in the tenth and ends with the 63rd."""


def added_um(floor: CutFloor, spindle: Floats) -> Floats:
    """What the table adds in its full rows: the card saw the spindle, whose motor comes second, a cycle before."""
    table = floor.plan.table
    assert table is not None
    row = floor.plan.carriage_start
    seen = np.concatenate([spindle[:1], spindle[:-1]])
    return np.array([table.correction(float(place), row) for place in seen]) * 0.2


@pytest.mark.first(1)
@FAMILIES
def test_the_wave_that_is_asked_for_is_added_smoothly_and_gone_when_the_tool_is_out(
    machine: MachineProfile, experiment: JobMaker, family: str
) -> None:
    job = replace(experiment(1), cut_length_mm=LONG_MM)
    floor = CutFloor(job, of_family(machine, family), Strategy.CAM, trimmed=True)
    floor.start()
    floor.card.sim.wait(ASKED_S)
    floor.card.tell(trim_line(TRIM_UM, 0.2, OVAL_UM))
    track = floor.finish()

    turns = (track.spindle - floor.plan.spindle_start) / 10_000
    before, behind = (turns > 14) & (turns < 28), (turns > 42) & (turns < 60)
    angle = np.radians(track.spindle / COUNTS_PER_DEG)
    for part, target_um in ((before, {3: 0j, 2: 0j}), (behind, {3: TRIM_UM, 2: OVAL_UM})):
        beside_um = track.tool_told[part] * 0.2 - added_um(floor, track.spindle[part])
        for order, asked_um in target_um.items():
            found = 2.0 * np.mean((beside_um - beside_um.mean()) * np.exp(-1j * order * angle[part]))
            assert found == pytest.approx(asked_um, abs=0.15)
    # Asked for at once, it comes in some hundredths of a second: no step in what the tool is told.
    steps_um = np.abs(np.diff(track.tool_told, 2)) * 0.2
    quiet = steps_um[(turns[1:-1] > 14) & (turns[1:-1] < 28)].max()
    assert steps_um[(turns[1:-1] > 28) & (turns[1:-1] < 45)].max() < 1.5 * quiet
    # The way out never goes further in than the path did.
    deepest = track.tool_told[turns < 60].max()
    assert track.tool_told[turns >= 60].max() <= deepest + 0.5
    assert track.tool_told[-1] == pytest.approx(floor.plan.setup.retracted, abs=1e-6)


def test_without_a_wish_it_is_the_cut_that_it_was(machine: MachineProfile, experiment: JobMaker) -> None:
    listening = CutFloor(short(experiment), machine, Strategy.CAM, trimmed=True)
    listening.cut()
    assert listening.measured().ront_um < 0.2


@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.TIMEBASE, Strategy.NONE])
def test_other_strategies_do_not_listen(machine: MachineProfile, experiment: JobMaker, strategy: Strategy) -> None:
    with pytest.raises(DriverError, match=r"program\.no_trim"):
        plan_cut(short(experiment), machine, strategy, trimmed=True)


def test_nor_does_a_spindle_that_others_turn(machine: MachineProfile, experiment: JobMaker) -> None:
    with pytest.raises(DriverError, match=r"program\.no_trim"):
        plan_cut(short(experiment), with_inverter(machine), Strategy.CAM, trimmed=True)


def test_no_line_asks_for_more_than_a_cutting_force_explains() -> None:
    with pytest.raises(ValueError, match="at most"):
        trim_line(complex(1.01 * MOST_TRIM_UM, 0.0), 0.2)
    with pytest.raises(ValueError, match="at most"):
        trim_line(complex(math.nan, 0.0), 0.2)
    with pytest.raises(ValueError, match="at most"):
        trim_line(0j, 0.2, complex(0.0, 1.01 * MOST_TRIM_UM))


@pytest.mark.parametrize("trimmed", [False, True])
def test_the_carriage_goes_back_to_the_row_of_zeros_and_no_further(
    machine: MachineProfile, experiment: JobMaker, trimmed: bool
) -> None:
    plan = plan_cut(short(experiment), machine, Strategy.CAM, trimmed=trimmed)
    assert plan.zero_row_z is not None
    assert plan.checked.lowest[3] == pytest.approx(plan.zero_row_z, abs=1.0)


def test_a_wave_that_no_host_of_ours_asks_for_is_not_cut(machine: MachineProfile, experiment: JobMaker) -> None:
    floor = CutFloor(replace(experiment(1), cut_length_mm=LONG_MM), machine, Strategy.CAM, trimmed=True)
    floor.start()
    floor.card.sim.wait(ASKED_S)
    floor.card.tell("P39=500 P40=0 P60=500")
    floor.finish()
    assert floor.measured().ront_um < 0.3
