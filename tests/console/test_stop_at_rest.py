"""A stop key that is pressed while nothing moves: sent as any other, and no reset is asked for."""

from __future__ import annotations

import pytest

from console.session.station.commands import DisableDrives, Jog, Recover, Start
from console.session.station.state import Activity
from drivers.lathe.snapshot import AxisName
from tests.console.floor import Floor, experiment_1, in_turn


@pytest.mark.parametrize("key", ["space", "escape", "f12"])
@pytest.mark.first(1)
def test_a_stop_key_at_rest_needs_no_reset_and_ends_what_was_armed(aligned: Floor, key: str) -> None:
    """Rule S5: a stop that was pressed by accident costs as little as can be."""
    aligned.arm(experiment_1())
    aligned.idle(2.0)
    before, sent = aligned.state, aligned.stop.count
    aligned.stop.stop(key)
    after = aligned.idle()
    assert aligned.stop.count > sent
    assert after.activity is Activity.READY and after.stop is None and after.armed is None
    assert [problem.code for problem in after.refusals] == ["session.stopped_at_rest"]
    assert before.snapshot is not None and after.snapshot is not None
    assert after.snapshot.loops_closed == before.snapshot.loops_closed
    aligned.arm(experiment_1())
    assert aligned.state.armed is not None
    aligned.stop.kill("f9")
    killed = aligned.idle()
    assert killed.activity is Activity.STOPPED and killed.stop is not None, "the drives are disabled by it"


def test_directly_after_a_motion_it_is_a_stop_of_that_motion(aligned: Floor) -> None:
    """Somebody who stops between two steps of a jog means the jog: F2 is asked for."""
    aligned.do(Jog(axis=AxisName.CARRIAGE, distance=-0.1))
    aligned.stop.stop("space")
    assert aligned.idle().activity is Activity.STOPPED
    assert aligned.do(Recover()).activity is Activity.READY


def test_a_stop_in_a_cut_tells_when_all_stood_still_and_when_that_was_proven(aligned: Floor) -> None:
    """The proof takes longer than the stop: by the polls the spindle turned until `still_s`, and no longer."""
    aligned.arm(experiment_1())
    spindle: dict[float, float] = {}
    aligned.looks.append(lambda seen: spindle.update({seen.at_s: seen.spindle.position}))
    aligned.when(lambda _: in_turn(aligned, 5.0), lambda: aligned.stop.stop("space"))
    stop = aligned.do(Start()).stop
    assert stop is not None and stop.still_s is not None and stop.rest_s is not None
    assert stop.sent_s < stop.still_s < stop.rest_s - 0.3
    after, before = ([at for s, at in spindle.items() if (s >= stop.still_s) is later] for later in (True, False))
    assert max(after) - min(after) <= 2.0 and abs(before[-1] - after[0]) > 2.0


@pytest.mark.parametrize("drives_on", [True, False])
@pytest.mark.parametrize("key", ["space", "f12"])
@pytest.mark.first(2)
def test_a_stop_key_held_for_a_minute_at_rest_is_one_stop(aligned: Floor, key: str, drives_on: bool) -> None:
    """A terminal repeats a held key some 30 times a second, after a quarter to two thirds of a second."""
    if not drives_on:
        aligned.do(DisableDrives())
    aligned.idle(2.0)
    before, wait = aligned.state, aligned.sim.wait
    assert before.snapshot is not None
    presses = [before.at_s + first for first in (0.0, *(0.66 + n / 30.0 for n in range(round(59.3 * 30))))]
    pending = list(presses)

    def held(seconds: float) -> None:
        end_s = aligned.sim.now_s() + seconds
        while pending and pending[0] <= end_s:
            wait(max(pending.pop(0) - aligned.sim.now_s(), 0.0))
            aligned.stop.stop(key)
        wait(max(end_s - aligned.sim.now_s(), 0.0))

    aligned.sim.wait = held  # type: ignore[method-assign]
    sent = aligned.stop.count
    while pending:
        aligned.sim.wait(0.1)
        aligned.station.step()
    after = aligned.idle(1.0)
    assert aligned.stop.count - sent == len(presses)
    assert not [alarm.problem.code for alarm in after.alarms if alarm.problem.code == "machine.not_at_rest"]
    assert after.activity is Activity.READY and after.stop is None
    assert after.stops - before.stops <= 2, "the key was pressed once"
    assert after.snapshot is not None
    assert after.snapshot.loops_closed == before.snapshot.loops_closed
