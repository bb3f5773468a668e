"""A blank that a tool has been in is not called uncut until another one is clamped; and how long a step takes."""

from __future__ import annotations

import pytest

from console.session.data.records import killed_runs
from console.session.stages import Stage
from console.session.station.commands import ConfirmClamping, DisableDrives, EndCut, Jog, Recover, Retract, Start
from console.session.station.progress import CutStage
from console.session.station.state import StationState
from drivers.lathe.snapshot import AxisName
from tests.console.floor import Floor, experiment_1

JOB = experiment_1()


def in_the_part(floor: Floor) -> bool:
    cut = floor.state.cut
    return cut is not None and cut.stage is CutStage.CUT and cut.turn > 20.0


def cut_to_mm(state: StationState) -> float:
    assert state.touched is not None
    assert state.touched.of_mm == JOB.cut_length_mm
    return state.touched.to_mm


def hold(floor: Floor) -> None:
    assert floor.station.post(EndCut())


def left_in_the_part(floor: Floor) -> StationState:
    """Stopped behind turn 20, after F2 and with the tool out."""
    floor.arm(JOB)
    floor.when(lambda _: in_the_part(floor), lambda: floor.stop.stop("space"))
    floor.do(Start())
    floor.do(Recover())
    return floor.do(Retract())


@pytest.mark.long
def test_after_a_stop_it_is_known_how_far_the_blank_is_cut(aligned: Floor) -> None:
    assert aligned.state.touched is None
    left = left_in_the_part(aligned)
    (mark_mm,) = left.marks_mm
    # 20 turns of 0.05 mm, and the turn in which it was stopped.
    assert 1.0 < cut_to_mm(left) < 1.1
    assert cut_to_mm(left) == pytest.approx(mark_mm, abs=0.05)


@pytest.mark.long
def test_it_is_not_forgotten_before_another_blank_is_clamped(aligned: Floor) -> None:
    left = left_in_the_part(aligned)
    aligned.arm(JOB)
    aligned.when(lambda _: aligned.state.cut is not None, lambda: aligned.stop.stop("space"))
    again = aligned.do(Start())
    assert again.cut is not None and again.cut.stage is CutStage.POSITION
    assert (again.touched, again.marks_mm) == (left.touched, left.marks_mm)
    aligned.do(Recover())
    aligned.do(DisableDrives())
    fresh = aligned.do(ConfirmClamping(job=JOB))
    assert (fresh.touched, fresh.marks_mm) == (None, ())


@pytest.mark.long
def test_a_hold_leaves_a_blank_cut_in_part_and_a_cut_in_air_one_as_it_was(aligned: Floor) -> None:
    aligned.arm(JOB, stage=Stage.AIR)
    assert aligned.do(Start()).touched is None
    aligned.arm(JOB)
    aligned.when(lambda _: in_the_part(aligned), lambda: hold(aligned))
    held = aligned.do(Start())
    assert held.cut is not None and held.cut.stage is CutStage.HELD
    assert 1.0 < cut_to_mm(held) < 1.2


@pytest.mark.parametrize(
    ("axis", "distance"), [(AxisName.CARRIAGE, 0.01), (AxisName.TOOL, -0.01), (AxisName.SPINDLE, 0.1)]
)
def test_a_jog_step_is_over_before_a_person_presses_again(aligned: Floor, axis: AxisName, distance: float) -> None:
    """Presses 0.45 s apart are all taken: 0.1 s is left for the keyboard and the line."""
    began_s = aligned.sim.now_s()
    aligned.do(Jog(axis=axis, distance=distance))
    assert aligned.sim.now_s() - began_s < 0.35


@pytest.mark.parametrize("retracted", [False, True])
@pytest.mark.first(1)
def test_a_console_that_is_left_with_the_tool_in_the_part_tells_the_next_one(
    aligned: Floor, monkeypatch: pytest.MonkeyPatch, retracted: bool
) -> None:
    monkeypatch.setattr(aligned.context, "shop", None)  # as on a real machine: nobody else sees the chuck
    machine = aligned.context.machine.name
    if retracted:
        left_in_the_part(aligned)
    else:
        aligned.arm(JOB)
        aligned.when(lambda _: in_the_part(aligned), lambda: aligned.stop.stop("SIGHUP"))
        aligned.do(Start())
    assert killed_runs(aligned.context.records, machine, simulated=False) == ()
    aligned.station.close("SIGHUP")
    told = killed_runs(aligned.context.records, machine, simulated=False)
    assert [problem.code for problem in told] == ([] if retracted else ["record.left_in_part"])
    assert killed_runs(aligned.context.records, machine, simulated=False) == (), "told once"
