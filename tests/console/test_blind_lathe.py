"""A lathe that shows only what a lathe shows: whoever reads its dials can align it, and the truth is nowhere."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from console.session.cut.jaw_by_indicator import RESULTS, allowed_spread_deg
from console.session.station.commands import (
    Approach,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Home,
    Jog,
    NoteSkim,
    TakeFlank,
    TakeJaw,
    TakeTouchOff,
)
from console.session.station.jogging import tool_gap_mm
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.workshop_view import Dials
from tests.compact import compact_machine
from tests.console.floor import Floor, experiment_1, known, open_floor

MACHINE = compact_machine().machine
AT_ITS_END_UM = 500.0
DEG_PER_UM = math.degrees(0.001 / 50.0)  # of a stylus 50 mm from the axis
HALF_JAW_DEG = 11.5


def dials(floor: Floor) -> Dials:
    seen = known(floor.idle().seen)
    assert seen.dials is not None and seen.tool_gap_mm is None
    return seen.dials


def turn(floor: Floor, deg: float) -> None:
    floor.do(Jog(axis=AxisName.SPINDLE, distance=deg))


def infeed(floor: Floor, mm: float) -> None:
    floor.infeed(mm)


def find_flank(floor: Floor, side: int) -> None:
    """Turn until the indicator shows 0; `side` is +1 where turning on frees the stylus."""
    for _ in range(12):
        read_um = dials(floor).indicator_um
        if read_um is None:
            turn(floor, -0.4 * side)
        elif abs(read_um) >= AT_ITS_END_UM:
            turn(floor, 0.4 * side)
        elif abs(read_um) > 30.0:  # a count of the spindle is 31 um at the stylus
            turn(floor, read_um * DEG_PER_UM * side)
        else:
            break
    floor.do(TakeFlank())


def homed(tmp_path: Path, seed: int) -> Floor:
    floor = open_floor(tmp_path, seed, blind=True)
    floor.do(DisableDrives(), ConfirmClamping(job=experiment_1()), EnableDrives(), Home())
    return floor


def find_jaw(floor: Floor) -> None:
    seen = known(floor.idle().seen)
    turn(floor, -seen.jaw_1_past_mark_deg)
    turn(floor, HALF_JAW_DEG)
    for number in range(2 * RESULTS):
        side = 1 if number % 4 in (0, 3) else -1
        find_flank(floor, side)
        if number % 2 == 0:
            turn(floor, -2.0 * side * HALF_JAW_DEG)
    floor.do(TakeJaw(most_spread_deg=allowed_spread_deg(experiment_1())))


def feel(floor: Floor) -> None:
    """Step in until the contact is heard, ever finer, and each time where the part is not scratched yet."""
    dials(floor)
    believed_mm = known(tool_gap_mm(floor.lathe.snapshot(), MACHINE, floor.state.alignment))
    infeed(floor, believed_mm - 0.5)  # the tip is within 0.3 mm of where it is believed
    for step_mm in (0.02, 0.001):
        while not dials(floor).contact:
            infeed(floor, step_mm)
        if step_mm > 0.001:
            infeed(floor, -2.0 * step_mm)
            turn(floor, 20.0)


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.long
def test_whoever_only_reads_dials_finds_jaw_1_and_touches_off(tmp_path: Path, seed: int) -> None:
    true = plant_named("mounted", MACHINE, seed, mounted_by_hand=True)
    floor = homed(tmp_path, seed)
    find_jaw(floor)
    jaw = known(floor.state.alignment.jaw)
    assert true.jaw_1_deg is not None
    assert math.remainder(jaw.angle_deg - true.jaw_1_deg, 360.0) == pytest.approx(0.0, abs=0.3)
    floor.do(Approach(job=experiment_1()))
    feel(floor)
    floor.do(TakeTouchOff(radius_mm=experiment_1().radius_mm))
    touched = known(floor.state.alignment.touch_off)
    assert 1000.0 * (touched.zero_radius_mm - true.home_radius_mm) == pytest.approx(0.0, abs=5.0)
    assert floor.state.alarms == ()


def test_the_truth_is_in_nothing_that_the_console_has_seen(tmp_path: Path) -> None:
    floor, shown = homed(tmp_path, 5), set()
    for _ in range(10):
        turn(floor, 7.77)
        seen = known(floor.idle().seen)
        assert seen.tool_gap_mm is None
        shown.add(math.fmod(seen.jaw_1_past_mark_deg, 5.0))
    assert shown == {0.0}


@pytest.mark.long
def test_a_micrometer_reads_a_standing_part_that_the_tool_is_clear_of_and_scatters(tmp_path: Path) -> None:
    floor = homed(tmp_path, 6)
    find_jaw(floor)
    floor.do(Approach(job=experiment_1()))
    feel(floor)
    assert dials(floor).micrometer_mm is None, "the tool is in the way"
    floor.do(NoteSkim())
    infeed(floor, -3.0)
    dials(floor)
    read_mm = dials(floor).micrometer_mm
    assert read_mm == pytest.approx(2.0 * experiment_1().radius_mm, abs=0.008)
    assert dials(floor).micrometer_mm == read_mm, "one part, one reading"
