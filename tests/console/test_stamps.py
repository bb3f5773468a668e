"""What was found of the set-up holds for what it was found with, and what is not known is said so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.station.commands import (
    Approach,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Home,
    Jog,
    Retract,
    TakeJaw,
)
from console.session.station.jogging import tool_in_part
from console.session.station.state import StationState
from drivers.lathe.snapshot import AxisName
from tests.console.floor import Floor, experiment_1, open_floor


@pytest.fixture
def floor(tmp_path: Path) -> Floor:
    return open_floor(tmp_path)


@pytest.fixture
def aligned(floor: Floor) -> Floor:
    floor.set_up(experiment_1())
    return floor


def codes(state: StationState) -> list[str]:
    return [problem.code for problem in state.refusals]


def test_before_the_touch_off_the_tip_is_known_to_its_band_only(floor: Floor) -> None:
    """The tip is 1 mm from the surface by the profile, and a touch-off may find it 1.5 mm elsewhere."""
    job = experiment_1()
    floor.do(DisableDrives())
    floor.do(ConfirmClamping(job=job))
    floor.do(EnableDrives())
    floor.do(Home())
    floor.do(Approach(job=job))
    machine = floor.context.loaded_machine.machine
    assert tool_in_part(floor.lathe.snapshot(), machine, floor.state.alignment) is False
    floor.infeed(1.0)
    assert tool_in_part(floor.lathe.snapshot(), machine, floor.state.alignment) is None


@pytest.mark.parametrize(
    ("homed", "code"), [(True, "alignment.drives_off"), (False, "machine.tool_unknown")], ids=["homed", "fresh"]
)
def test_a_retract_without_drives_says_what_is_known_of_the_tool(floor: Floor, homed: bool, code: str) -> None:
    floor.do(DisableDrives())
    floor.do(ConfirmClamping(job=experiment_1()))
    if homed:
        floor.do(EnableDrives())
        floor.do(Home())
        floor.do(DisableDrives())
    assert codes(floor.do(Retract())) == [code]


def test_another_chuck_and_another_diameter_are_not_armed_on_the_stamps_of_before(aligned: Floor) -> None:
    """Experiment 1 is aligned; then one with 2 jaws of 50 mm is clamped, and experiment 1 again."""
    first = experiment_1()
    other = replace(first, jaws=2, diameter_mm=50.0, lobe_diameter_mm=50.0)
    aligned.do(Jog(axis=AxisName.CARRIAGE, distance=-10.0))
    aligned.do(DisableDrives())
    aligned.do(ConfirmClamping(job=other))
    aligned.do(EnableDrives())
    refused = codes(aligned.arm(other))
    assert refused == ["alignment.jaws_changed", "alignment.no_jaw", "alignment.touched_otherwise"]
    aligned.do(TakeJaw())
    jaw = aligned.state.alignment.jaw
    assert jaw is not None and jaw.jaws == 2
    assert codes(aligned.arm(other)) == ["alignment.touched_otherwise"]
    aligned.do(DisableDrives())
    aligned.do(ConfirmClamping(job=first))
    aligned.do(EnableDrives())
    # The touch-off was not taken anew, and is that of this diameter.
    assert codes(aligned.arm(first)) == ["alignment.jaws_changed", "alignment.no_jaw"]
