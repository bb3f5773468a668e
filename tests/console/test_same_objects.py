"""What was computed of the very same objects is not computed again; of others it is, however alike they are."""

from __future__ import annotations

from dataclasses import replace

from console.session.cut.alignment import Alignment, AlignStep, clamping_of, problems, step_problems
from profiles.findings import refusals
from profiles.rules import check
from profiles.same_objects import SameObjects
from profiles.store import load_job, load_machine

JOB, MACHINE = load_job("lee-2001-experiment-1").job, load_machine("lee-2001-lathe").machine


def test_keys_of_equal_objects_differ() -> None:
    alike = replace(JOB)
    assert alike == JOB and SameObjects(JOB, MACHINE) == SameObjects(JOB, MACHINE)
    assert SameObjects(alike, MACHINE) != SameObjects(JOB, MACHINE) != (JOB, MACHINE)
    assert len({SameObjects(JOB, MACHINE), SameObjects(JOB, MACHINE), SameObjects(alike, MACHINE)}) == 2


def test_a_job_or_a_machine_that_was_changed_is_judged_anew() -> None:
    good = check(JOB, MACHINE)
    assert check(JOB, MACHINE) is good and not refusals(good)
    fast = replace(JOB, spindle_speed_rpm=100.0 * JOB.spindle_speed_rpm)
    weak = replace(MACHINE, chuck=replace(MACHINE.chuck, max_force_n=100.0))
    for _ in range(2):
        assert refusals(check(fast, MACHINE)) and refusals(check(JOB, weak))
        assert check(JOB, MACHINE) == good
    for number in range(20):  # more than are kept
        assert check(replace(JOB, name=f"ring-{number}"), MACHINE) == good
    assert check(JOB, MACHINE) == good


def test_a_stamp_that_was_made_or_lost_is_seen_at_once() -> None:
    bare = Alignment()
    stamped = replace(bare, clamping=clamping_of(JOB, "08:40"))
    assert step_problems(bare, AlignStep.CLAMP, JOB) and not step_problems(stamped, AlignStep.CLAMP, JOB)
    thicker = replace(JOB, wall_thickness_mm=JOB.wall_thickness_mm + 1.0)
    assert step_problems(stamped, AlignStep.CLAMP, thicker)
    assert step_problems(bare, AlignStep.CLAMP, JOB) and len(problems(stamped, JOB)) < len(problems(bare, JOB))
