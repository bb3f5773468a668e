"""What holds the part: VDI 3106, the wrench, and the adviser that says how hard it must and how hard it may be."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from profiles.chucking.advice import Stands, clamping_advice, force_span
from profiles.chucking.grip import (
    cut_grip_n,
    least_force_n,
    lobe_um_per_n,
    loss_n,
    most_loss_speed_rpm,
    permitted_speed_rpm,
)
from profiles.chucking.holding import Wrench, torque_n_m
from profiles.cutting import cutting_force
from profiles.findings import Severity, refusals
from profiles.job import Job
from profiles.materials import material_named
from profiles.problem import ProfileError
from profiles.rules import check
from profiles.store import load_job, load_machine

JOB = load_job("lee-2001-experiment-1").job
LATHE = load_machine("lee-2001-lathe").machine
HEAVY_KG_M = 3 * 0.8 * 0.06


def warned(job: Job) -> set[str]:
    return {f.problem.code for f in check(job, LATHE) if f.severity is Severity.WARNING}


@pytest.mark.parametrize(
    ("mass_radius", "speed_rpm", "lost_n"),
    [
        (HEAVY_KG_M, 500, 395),
        (HEAVY_KG_M, 1000, 1579),
        (HEAVY_KG_M, 2000, 6317),
        (HEAVY_KG_M, 3000, 14212),
        (3 * 5.33 * 0.107, 1200, 27018),  # a maker's catalogue
    ],
)
def test_centrifugal_force(mass_radius: float, speed_rpm: float, lost_n: float) -> None:
    assert loss_n(mass_radius, speed_rpm) == pytest.approx(lost_n, abs=1)


def test_least_force_and_permitted_speed() -> None:
    assert least_force_n(200, loss_n(HEAVY_KG_M, 1000), 1.5) == pytest.approx(2818.7, abs=0.1)
    assert permitted_speed_rpm(3077, 200, HEAVY_KG_M, 1.0) == pytest.approx(1326, abs=0.5)
    assert permitted_speed_rpm(3077, 200, HEAVY_KG_M, 1.5) == pytest.approx(1053, abs=0.5)
    assert most_loss_speed_rpm(3077, HEAVY_KG_M) == pytest.approx(1143, abs=0.5)
    assert permitted_speed_rpm(100, 200, HEAVY_KG_M, 1.5) == 0


def test_a_force_is_a_torque_above_what_there_is_without_any() -> None:
    """24 N m x 60 N/(N m) - 120 N = 1320 N."""
    fitted = Wrench(force_per_torque_n_per_n_m=60.0, offset_n=-120.0)
    assert torque_n_m(fitted, 1320.0) == pytest.approx(24.0)
    for wrench, force in ((fitted, 0.0), (replace(fitted, offset_n=500.0), 500.0)):
        with pytest.raises(ProfileError, match="chucking_force_n"):
            torque_n_m(wrench, force)


def test_the_advised_least_force_is_where_the_rule_begins_to_hold() -> None:
    least_n = clamping_advice(JOB, LATHE).span.least_n
    assert least_n > loss_n(3 * 0.2 * 0.035, 1000) * 1.5
    held, slips = (replace(JOB, chucking_force_n=share * least_n) for share in (1.001, 0.999))
    assert "rule.grip_need" not in warned(held)
    assert "rule.grip_need" in warned(slips)
    assert refusals(check(slips, LATHE)) == ()


def test_the_advised_most_force_is_where_its_rules_begin_to_fail() -> None:
    advice = clamping_advice(JOB, LATHE)
    assert advice.span.most_n == advice.span.limits_n["scatter"]
    for name, code, beyond in (
        ("scatter", "rule.clamp_scatter", Severity.WARNING),
        ("wall", "rule.clamp_stress", Severity.REFUSAL),
    ):
        for share, severity in ((0.999, Severity.OK), (1.001, beyond)):
            # The lobe is taken as found at 1314 N; it grows with what is left of the force at speed.
            pressed = replace(JOB, chucking_force_n=share * advice.span.limits_n[name])
            (finding,) = [f for f in check(pressed, LATHE) if f.problem.code == code]
            assert finding.severity is severity


OF_THE_FORCE = {
    "rule.force_over_chuck",
    "rule.grip_margin",
    "rule.grip_need",
    "rule.grip_loss",
    "rule.clamp_stress",
    "rule.clamp_scatter",
}


@given(
    force_n=st.floats(10.0, 12_000.0),
    speed_rpm=st.floats(50.0, 3000.0),
    wall_mm=st.floats(0.5, 26.0),
    depth_mm=st.floats(0.01, 0.4),
    tolerance_um=st.floats(0.5, 60.0),
    jaw_mass_kg=st.floats(0.05, 1.5),
    safety=st.floats(1.0, 3.0),
    sd_percent=st.floats(0.5, 30.0),
)
def test_inside_the_span_no_rule_minds_the_force_and_outside_one_does(
    force_n: float,
    speed_rpm: float,
    wall_mm: float,
    depth_mm: float,
    tolerance_um: float,
    jaw_mass_kg: float,
    safety: float,
    sd_percent: float,
) -> None:
    chuck = replace(LATHE.chuck, jaw_mass_kg=jaw_mass_kg, safety_factor=safety, force_sd_percent=sd_percent)
    machine = replace(LATHE, chuck=chuck)
    job = replace(
        JOB,
        chucking_force_n=force_n,
        lobe_force_n=1314.0,
        lobe_spindle_speed_rpm=200.0,
        spindle_speed_rpm=speed_rpm,
        wall_thickness_mm=wall_mm,
        depth_of_cut_mm=depth_mm,
        roundness_tolerance_um=tolerance_um,
    )
    span = force_span(job, machine)
    assume(min(abs(force_n / end - 1.0) for end in (span.least_n, span.most_n)) > 1e-9)
    minded = {f.problem.code: f.severity for f in check(job, machine) if f.severity is not Severity.OK}
    assert span.most_n == span.limits_n[span.binding] == min(span.limits_n.values())
    assert ("rule.clamp_span" in minded) is (span.least_n > span.most_n)
    inside = span.least_n < force_n < span.most_n
    assert bool(minded.keys() & OF_THE_FORCE) is not inside
    if not span.empty:
        assert span.stands(force_n) is (
            Stands.INSIDE if inside else Stands.BELOW if force_n < span.least_n else Stands.ABOVE
        )


def test_a_soft_ring_and_heavy_jaws_leave_no_force_that_will_do() -> None:
    """The least is above 2.6 kN; a lobe of 55 um scatters beyond its tolerance long before."""
    chuck = replace(LATHE.chuck, jaw_mass_kg=0.8, jaw_radius_mm=60.0, force_sd_percent=10.0)
    job = replace(JOB, chucking_force_n=3000.0, lobe_force_n=2500.0)
    advice = clamping_advice(job, replace(LATHE, chuck=chuck))
    assert advice.span.least_n > advice.span.most_n
    assert advice.span.stands(3000.0) is Stands.NONE
    (found,) = [f for f in check(job, replace(LATHE, chuck=chuck)) if f.problem.code == "rule.clamp_span"]
    assert found.severity is Severity.WARNING
    assert advice.at_speed_n == pytest.approx(3000 - 1579.1, abs=0.1)


def test_a_plain_cut_is_within_the_tolerance_at_the_force_of_its_limit() -> None:
    """The lobe goes with what is left of the force: 55 um at 1314 - 230.3 N, so 5 um at 98.5 N; 230.3 are lost."""
    assert JOB.roundness_tolerance_um == 5.0
    assert clamping_advice(JOB, LATHE).uncompensated_n == pytest.approx(328.8, abs=0.05)


def test_the_lobe_for_a_newton_is_of_the_speed_at_which_it_was_found() -> None:
    """55 um held by 1314 N less the 57.6 N that 500 rpm take; the job itself turns at 1000."""
    found = replace(JOB, lobe_spindle_speed_rpm=500.0)
    assert lobe_um_per_n(found, LATHE) == pytest.approx(55.0 / (1314.0 - 230.29 / 4), rel=1e-5)


@pytest.mark.parametrize(("jaws", "overhang_mm"), [(3, 0.0), (3, 30.0), (6, 40.0)])
def test_the_lever_of_the_overhang_empties_a_jaw_edge(jaws: int, overhang_mm: float) -> None:
    """Equal springs at the front and the back edge of each jaw: none may be pulled by more than it is pressed."""
    cut, jaw_length_mm = cutting_force(material_named("Al"), 0.1, 0.05), 40.0
    at = 2 * np.pi * np.arange(jaws) / jaws
    towards = np.column_stack([np.cos(at), np.sin(at)])
    pressed = np.array([math.hypot(cut.main_n, cut.passive_n), 0.0])
    front, back = pressed * (1 + overhang_mm / jaw_length_mm), -pressed * overhang_mm / jaw_length_mm
    most_n = max(np.abs(towards @ np.linalg.solve(towards.T @ towards, load)).max() for load in (front, back))
    lifting_n = cut_grip_n(cut, friction=1e12, overhang_mm=overhang_mm, jaw_length_mm=jaw_length_mm)
    assert lifting_n == pytest.approx(2 * jaws * most_n)


def test_the_grip_that_a_cut_needs_is_against_slipping_and_against_lifting_together() -> None:
    """hypot(F_c, F_f) / mu, and 4 hypot(F_c, F_p) (1 + 30 / 40) on top."""
    cut = cutting_force(material_named("Al"), 0.1, 0.05)
    slipping_n = math.hypot(cut.main_n, cut.feed_n) / 0.2
    lifting_n = 7.0 * math.hypot(cut.main_n, cut.passive_n)
    needed_n = cut_grip_n(cut, friction=0.2, overhang_mm=30.0, jaw_length_mm=40.0)
    assert needed_n == pytest.approx(slipping_n + lifting_n)


def test_the_torque_comes_from_the_machines_own_wrench_or_not_at_all() -> None:
    assert clamping_advice(JOB, LATHE).torque_n_m == pytest.approx(1314 / 377)
    # The force that there is without any torque needs none: (1314 - 114) / 377.
    preloaded = replace(LATHE, chuck=replace(LATHE.chuck, force_offset_n=114.0))
    assert clamping_advice(JOB, preloaded).torque_n_m == pytest.approx(1200 / 377)
    hard = clamping_advice(JOB, replace(LATHE, chuck=replace(LATHE.chuck, force_offset_n=1000.0)))
    assert hard.span.least_n < 1000.0
    assert hard.torque_span_n_m is not None and hard.torque_span_n_m[0] == 0.0
    # 2000 N without any torque are more than the 1970 N that the wrench's scatter allows: no torque will do.
    biased = replace(LATHE, chuck=replace(LATHE.chuck, force_offset_n=2000.0))
    assert (
        clamping_advice(replace(JOB, chucking_force_n=2100.0, lobe_force_n=1314.0), biased).torque_span_n_m is None
    )
    unknown = replace(LATHE, chuck=replace(LATHE.chuck, force_per_torque_n_per_n_m=None))
    assert clamping_advice(JOB, unknown).torque_n_m is None


def test_a_material_without_numbers_is_told_and_asks_nothing_of_the_grip() -> None:
    job = replace(JOB, material="unobtainium")
    found = {f.problem.code: f for f in check(job, LATHE)}
    assert found["rule.material_unknown"].severity is Severity.WARNING
    assert found["rule.grip_need"].problem.limit == ">= 0 N"
    assert clamping_advice(job, LATHE).span.least_n == pytest.approx(1.5 * 230.29, abs=0.01)
