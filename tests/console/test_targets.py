"""A typed target of the carriage or the spindle: one watched jog, refused where the machine could be damaged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.cut.alignment import Alignment, Mounted, TouchOff, clamping_of
from console.session.station.commands import DisableDrives, EnableDrives, GoTo, Home, Jog
from console.session.station.jogging import speed_problem
from console.session.station.state import Activity
from console.session.station.targets import distance_to, target_problems, target_range, travel_of
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine
from tests.console.floor import open_floor
from tests.tui.machine_states import ON, look_at

Z, C = AxisName.CARRIAGE, AxisName.SPINDLE
JOB = load_job("lee-2001-experiment-1").job
CLAMPED = Alignment(clamping=clamping_of(JOB, at="08:40"))
TOUCHED = replace(CLAMPED, touch_off=TouchOff(zero_radius_mm=76.0, diameter_mm=52.0, at="08:45"))


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return load_machine("lee-2001-lathe").machine


def at(radius_mm: float, z_mm: float, spindle_counts: float = 0.0) -> Snapshot:
    """The machine with its tip at a radius: the zero is at 76 mm, 5000 counts/mm towards the work."""
    tool = 5000.0 * (76.0 - radius_mm)
    return look_at(ON, tool=tool, spindle=spindle_counts, carriage=1000.0 * z_mm)


def codes(*given: object) -> list[str]:
    return [problem.code for problem in target_problems(*given)]  # type: ignore[arg-type]


def test_z_ends_before_the_jaws_and_c_at_a_turn(machine: MachineProfile) -> None:
    # Jaw faces at 200 mm, and what the profile keeps clear of them; the lower end is that of the travel.
    low, high = target_range(machine, Z)
    assert (low, high) == (machine.carriage.travel_min_mm, 200.0 - machine.carriage.jaw_clearance_mm)
    assert target_range(machine, C) == (0.0, 360.0)
    away = at(60.0, 10.0)
    assert codes(away, machine, TOUCHED, Z, high + 0.001) == ["machine.target_out_of_range"]
    assert codes(away, machine, TOUCHED, Z, low - 0.001) == ["machine.target_out_of_range"]
    assert codes(away, machine, TOUCHED, C, 360.0) == ["machine.target_out_of_range"]
    assert codes(away, machine, TOUCHED, C, -0.01) == ["machine.target_out_of_range"]
    assert codes(away, machine, TOUCHED, Z, high) == []


@pytest.mark.parametrize(
    ("radius_mm", "z_mm", "axis", "target", "refused"),
    [
        (26.5, 10.0, Z, 165.0, False),  # to 5 mm before the face of the part, which is at 170 mm
        (26.5, 10.0, Z, 175.0, False),  # over it, clear by half a millimetre
        (26.1, 10.0, Z, 175.0, True),  # into it
        (25.0, 175.0, Z, 100.0, True),  # in it: it is jogged out first
        (26.1, 175.0, C, 90.0, True),
        (26.5, 175.0, C, 90.0, False),
        (25.0, 100.0, C, 90.0, False),  # beside it
    ],
)
def test_a_tool_at_the_part_is_jogged_away_first(
    machine: MachineProfile, radius_mm: float, z_mm: float, axis: AxisName, target: float, refused: bool
) -> None:
    expected = ["machine.tool_in_the_way"] if refused else []
    assert codes(at(radius_mm, z_mm), machine, TOUCHED, axis, target) == expected


def test_before_the_touch_off_the_tip_may_be_nearer_than_it_seems(machine: MachineProfile) -> None:
    # Clear by 0.5 mm, of which 1.5 are not known; it has to be clear by 0.2.
    (problem,) = target_problems(at(26.5, 10.0), machine, CLAMPED, Z, 175.0)
    assert (problem.code, problem.limit) == ("machine.tool_in_the_way", "1.7 mm")
    assert codes(at(28.0, 10.0), machine, CLAMPED, Z, 175.0) == []
    (problem,) = target_problems(at(26.5, 10.0), machine, replace(TOUCHED, on=Mounted(tool="another")), Z, 175.0)
    assert (problem.code, problem.limit) == ("machine.tool_in_the_way", "1.7 mm"), (
        "the touch-off is another tool's"
    )


def test_while_nobody_knows_what_is_clamped_the_carriage_goes_away_alone(machine: MachineProfile) -> None:
    assert codes(at(60.0, 50.0), machine, Alignment(), Z, 51.0) == ["machine.nothing_clamped_known"]
    assert codes(at(60.0, 50.0), machine, Alignment(), Z, 10.0) == []


@pytest.mark.parametrize(
    ("counts", "target", "distance"),
    [(0.0, 90.0, 90.0), (0.0, 270.0, -90.0), (10_350.0, 0.0, -12.6), (-2500.0, 350.0, 80.0)],
)
def test_the_spindle_goes_the_shorter_way(
    machine: MachineProfile, counts: float, target: float, distance: float
) -> None:
    assert distance_to(at(60.0, 0.0, counts), machine, C, target) == pytest.approx(distance)


def test_the_travel_bar_is_between_the_soft_limits(machine: MachineProfile) -> None:
    # I113 = 375000, I114 = -10000 counts of 0.2 um: -2 to 75 mm.
    travel = travel_of(at(26.0, 0.0), machine, AxisName.TOOL)
    assert (travel.low_mm, travel.high_mm, travel.at_mm) == (-2.0, 75.0, 50.0)
    assert travel.to_limit_mm == pytest.approx(25.0)
    assert travel.fraction == pytest.approx(52.0 / 77.0)
    assert travel_of(at(26.0, 0.0), machine, C).fraction is None


def test_what_is_faster_than_set_up_allows_is_refused_and_not_slowed_down(machine: MachineProfile) -> None:
    # 100 rpm and 10 mm/s by the profile; 2 m/min are allowed.
    assert speed_problem(machine, C, 180.0) is None
    assert speed_problem(machine, Z, 100.0) is None
    variables = {**machine.controller.variables, "I322": 40.0}
    fast = replace(machine, controller=replace(machine.controller, variables=variables))
    found = speed_problem(fast, Z, 100.0)
    assert found is not None and (found.value, found.limit) == ("40.0 mm/s", "<= 33.3 mm/s")
    assert speed_problem(fast, Z, 0.1) is None
    assert codes(at(60.0, 10.0), fast, TOUCHED, Z, 100.0) == ["machine.setup_speed"]


def test_the_machine_goes_where_it_was_asked_to(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    floor.do(EnableDrives())
    assert [each.code for each in floor.do(GoTo(axis=C, target=90.0)).refusals] == ["alignment.not_homed"]
    floor.do(Home())
    ends: list[float] = []
    floor.looks.append(lambda _: ends.append(floor.state.ends_s or 0.0))
    before_s = floor.sim.now_s()
    state = floor.do(GoTo(axis=C, target=90.0))
    assert (state.refusals, state.jogs, state.activity) == ((), 1, Activity.READY)
    assert state.snapshot is not None
    assert state.snapshot.spindle.position / (10_000.0 / 360.0) == pytest.approx(90.0, abs=0.05)
    # It took as long as was shown while it moved, and some moments to settle.
    assert 0.0 <= floor.sim.now_s() - max(ends) < 0.3 < max(ends) - before_s
    back = floor.do(GoTo(axis=Z, target=-1.0))
    assert back.snapshot is not None and back.jogs == 2
    assert back.snapshot.carriage.position == pytest.approx(-1000.0, abs=2.0)
    refused = floor.do(GoTo(axis=Z, target=10.0))
    assert [each.code for each in refused.refusals] == ["machine.nothing_clamped_known"]
    assert [each.code for each in floor.do(GoTo(axis=AxisName.TOOL, target=1.0)).refusals] == [
        "machine.no_target_axis"
    ]
    assert floor.do(Jog(axis=Z, distance=0.1)).jogs == 3
    floor.do(DisableDrives())
    assert [each.code for each in floor.do(GoTo(axis=C, target=0.0)).refusals] == ["alignment.drives_off"]
