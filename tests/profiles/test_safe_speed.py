"""The speed at which each limit is reached: there the rule itself is met, and beyond it broken."""

from __future__ import annotations

from dataclasses import replace

import pytest

from profiles.axis.envelope import envelope, speed_limits_rpm
from profiles.axis.response import Source, identified_response, model_response
from profiles.axis.servo import sampled_response
from profiles.chucking.grip import centrifugal_loss_n, grip_margin_n, needed_grip_n
from profiles.job import Job
from profiles.store import load_job, load_machine

JOB = load_job("lee-2001-experiment-1").job
MACHINE = load_machine("lee-2001-lathe").machine
MODEL = model_response(MACHINE, lambda frequency_hz: complex(sampled_response(MACHINE, frequency_hz)))
AXIS = envelope(JOB, MACHINE).at_job


def at(rpm: float) -> Job:
    return replace(JOB, spindle_speed_rpm=rpm)


def test_the_chuck_holds_the_part_up_to_its_limits() -> None:
    limits = speed_limits_rpm(JOB, MACHINE, MODEL, AXIS)
    assert grip_margin_n(at(limits["grip"]), MACHINE) == pytest.approx(needed_grip_n(JOB, MACHINE))
    # DIN EN 1550: at most 67 % of the force at rest
    assert centrifugal_loss_n(at(limits["grip_loss"]), MACHINE) == pytest.approx(0.67 * JOB.chucking_force_n)
    assert limits["spindle"] == MACHINE.spindle.max_speed_rpm


def test_the_response_ends_where_the_command_would_be_eight_times_the_motion() -> None:
    limits = speed_limits_rpm(JOB, MACHINE, MODEL, AXIS)
    assert limits["response"] == pytest.approx(limits["loop"]) == pytest.approx(8233, abs=1)
    frequency_hz = 3 * limits["response"] / 60
    assert abs(complex(sampled_response(MACHINE, frequency_hz))) == pytest.approx(1 / 8)


def test_an_identified_response_ends_with_its_band() -> None:
    columns = {"frequency_hz": [10, 50], "gain": [1, 0.9], "phase_deg": [-10, -50], "gain_ci": [0, 0]}
    response = identified_response(**columns, phase_ci_deg=[0, 0], amplitude_um=25.0, name="there")  # type: ignore[arg-type]
    assert response.source is Source.IDENTIFIED
    assert speed_limits_rpm(JOB, MACHINE, response, AXIS)["response"] == pytest.approx(1000.0)


def test_a_part_that_is_not_held_at_rest_may_not_turn_at_all() -> None:
    loose = replace(JOB, chucking_force_n=100.0)
    assert speed_limits_rpm(loose, MACHINE, MODEL, AXIS)["grip"] == 0.0
