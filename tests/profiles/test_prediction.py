"""What a plain cut will leave, and which mechanism leaves it."""

from dataclasses import replace

import numpy as np
import pytest

from profiles.chucking.diagnosis import Mechanism, diagnose
from profiles.chucking.held_part import held_part
from profiles.findings import Severity
from profiles.job import Job
from profiles.lobe.prediction import Prediction, predict
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine

ONE = load_job("lee-2001-experiment-1").job
TWO = load_job("lee-2001-experiment-2").job
MODEL = replace(ONE, lobe_error_source="model")
"""The same part before anybody has measured it."""

LATHE = load_machine("lee-2001-lathe").machine
COLLAR = replace(LATHE, chuck=replace(LATHE.chuck, jaw_straight_fraction=1.0))
"""The same with jaws that hold straight."""

BAR = replace(
    MODEL,
    material="steel",
    diameter_mm=65.0,
    wall_thickness_mm=32.5,
    overhang_mm=125.0,
    chucking_force_n=5000.0,
    lobe_force_n=5000.0,
)


def warned(found: Prediction) -> set[str]:
    return {f.problem.code for f in found.findings if f.severity is Severity.WARNING}


def still(job: Job) -> Job:
    """The job at a speed that takes next to nothing of the force."""
    return replace(job, spindle_speed_rpm=1.0)


def test_a_ring_without_overhang_springs_back_by_55_um_high_at_the_jaws() -> None:
    """438 N on each of three jaws, OD 52, wall 2.5, 40 mm long: 55 um as a ring, less by nu^2 in straight jaws."""
    job = still(replace(MODEL, overhang_mm=1e-6, cut_length_mm=1e-7))
    found = predict(job, COLLAR)
    sprung = found.parts_um[Mechanism.SPRING_BACK]
    assert np.ptp(sprung, axis=1) == pytest.approx(np.full(7, 55.0 * (1 - 0.33**2)), rel=2e-3)
    assert found.cut.mechanism is Mechanism.SPRING_BACK
    assert (found.angle_deg[sprung[0].argmax()] - job.jaw_1_deg) % 120 == 0
    assert found.error_um == pytest.approx(sprung + found.parts_um[Mechanism.WALL])
    assert found.cut.phase_deg == pytest.approx(job.jaw_1_deg)


@pytest.mark.parametrize("job", [ONE, TWO])
def test_the_papers_errors_follow_from_chucking_forces_near_the_papers(job: Job) -> None:
    """The paper chucked with 3.1 to 6.6 kN; how far the parts stood out and how the jaws held, it does not say."""
    near = predict(replace(job, overhang_mm=10.0, lobe_overhang_mm=10.0), COLLAR)
    found = predict(job, LATHE)
    assert found.model.measured_um_pp == job.lobe_error_um_pp
    assert found.model.matching_force_n is not None and near.model.matching_force_n is not None
    assert near.model.matching_force_n < 3077 and 6593 < found.model.matching_force_n
    matched = predict(replace(job, chucking_force_n=found.model.matching_force_n), LATHE)
    assert matched.model.um_pp == pytest.approx(job.lobe_error_um_pp)


def test_chucking_force_and_speed_take_the_lobe_with_them() -> None:
    slow, fast = predict(still(MODEL), LATHE), predict(MODEL, LATHE)
    share = fast.cut.spring_back_um_pp / slow.cut.spring_back_um_pp
    assert share == pytest.approx((1314 - 230.29) / 1314, abs=1e-4)
    job = still(replace(MODEL, overhang_mm=1e-6, cut_length_mm=1e-7))
    three, six = (predict(replace(job, jaws=jaws), COLLAR).cut.spring_back_um_pp for jaws in (3, 6))
    assert three / six == pytest.approx(19.1, abs=0.1)
    found = predict(still(ONE), LATHE)
    assert found.cut.sd_um_pp == pytest.approx(0.05 * found.cut.spring_back_um_pp, rel=1e-3)
    # One standard deviation of the wrench, as the difference of two predictions: 65.7 of 1083.7 N, 6.1 %.
    usual, harder = predict(ONE, LATHE).cut, predict(replace(ONE, chucking_force_n=1.05 * 1314), LATHE).cut
    assert usual.sd_um_pp == pytest.approx(harder.spring_back_um_pp - usual.spring_back_um_pp)


def test_the_lobe_stands_where_it_was_found_or_at_jaw_1() -> None:
    job = replace(MODEL, lobe_phase_deg=105.0, lobe_past_jaw_deg=15.0)
    found = predict(job, LATHE)
    assert found.angle_deg[found.error_um[0].argmax()] % 120 == 90
    assert found.cut.phase_deg == pytest.approx(90.0)
    # Low at the jaws, as a wall that gives way leaves it; the model alone has it high there.
    found = predict(replace(ONE, lobe_phase_deg=150.0, lobe_past_jaw_deg=60.0), LATHE)
    assert found.angle_deg[found.error_um[0].argmax()] % 120 == 30
    assert (found.cut.phase_deg, found.model.phase_deg) == pytest.approx((150.0, 90.0))


@pytest.mark.parametrize("source", ["measured", "fitted"])
def test_a_lobe_that_was_found_on_a_part_is_compared_with_the_model(source: str) -> None:
    """High at the jaws it is the clamping, and has a force; low there it is the wall, and no force makes it."""
    at_jaw = predict(replace(ONE, lobe_error_source=source, lobe_past_jaw_deg=3.0), LATHE).model
    assert at_jaw.measured_um_pp == 55.0 and at_jaw.matching_force_n is not None
    assert at_jaw.diagnosis is not None and at_jaw.diagnosis.mechanism is Mechanism.SPRING_BACK
    between = predict(replace(ONE, lobe_error_source=source, lobe_past_jaw_deg=-58.0), LATHE).model
    assert between.diagnosis is not None and between.diagnosis.mechanism is Mechanism.WALL
    assert between.matching_force_n is None
    assumed = predict(replace(ONE, lobe_error_source="assumed", lobe_past_jaw_deg=3.0), LATHE).model
    assert (assumed.measured_um_pp, assumed.diagnosis, assumed.matching_force_n) == (None, None, None)


@pytest.mark.parametrize(
    ("job", "pass_um", "force_n", "moved_um"), [(ONE, 7.58, 0.81, 1.22), (TWO, 5.34, 0.49, 0.73)]
)
def test_what_was_found_on_a_part_is_spoken_of(job: Job, pass_um: float, force_n: float, moved_um: float) -> None:
    """55 and 33 um by the paper, 8.2 and 0.9 um by the model: its shape and growth, the height of the part."""
    found, by_model = predict(job, LATHE), predict(replace(job, lobe_error_source="model"), LATHE)
    assert found.scaled_to is not None and by_model.scaled_to is None
    assert (found.scaled_to.source, found.scaled_to.z_mm) == ("measured", 26.0)
    assert found.cut.um_pp == pytest.approx(job.lobe_error_um_pp)
    factor = job.lobe_error_um_pp / by_model.cut.um_pp
    assert found.error_um == pytest.approx(factor * by_model.error_um)
    assert found.stock_um_pp == pytest.approx(factor * by_model.stock_um_pp)
    assert found.model == replace(
        by_model.cut, measured_um_pp=job.lobe_error_um_pp, matching_force_n=found.model.matching_force_n
    )
    assert found.model_um_pp == pytest.approx(by_model.error_um_pp)
    assert found.stock_um_pp[-1] - found.stock_um_pp[0] == pytest.approx(pass_um, abs=0.01)
    assert (warned(found), warned(by_model)) == ({"rule.second_pass"}, set())
    process = found.process
    assert (process.lobed_force_n, process.lobed_motion_um) == pytest.approx((force_n, moved_um), abs=0.01)


def test_what_is_scaled_halved_or_without_a_lobe() -> None:
    """With half of the speed more force is left, and the lobe that was found grows as that of the model does."""
    slower = replace(ONE, spindle_speed_rpm=500.0)
    share = (1314 - 230.29 / 4) / (1314 - 230.29)
    assert predict(slower, LATHE).cut.spring_back_um_pp == pytest.approx(
        share * predict(ONE, LATHE).cut.spring_back_um_pp, rel=1e-4
    )
    # Far from the jaws it changes its sign: any height there would be another one everywhere else.
    far = replace(ONE, overhang_mm=54.0, lobe_overhang_mm=54.0)
    found = predict(far, LATHE)
    assert found.scaled_to is None and found.model.measured_um_pp == 55.0
    assert found.cut == found.model and found.cut.um_pp < 1.0
    assert "rule.second_pass" not in {f.problem.code for f in found.findings}
    assert found.process.lobed_force_n == pytest.approx(0.81, abs=0.01), "the blank is as lobed as it was found"
    # What is judged at each key is what the whole turn shows.
    for job in (MODEL, replace(MODEL, jaws=2), replace(MODEL, jaws=6), BAR):
        found = predict(job, LATHE)
        assert held_part(job, LATHE).error_um_pp(found.cut.z_mm) == pytest.approx(found.cut.um_pp, rel=1e-9)
        turn = predict(job, LATHE, z_mm=found.cut.z_mm).error_um_pp[0]
        assert found.cut.um_pp == pytest.approx(turn, rel=1e-3)


def test_a_second_pass_has_less_stock_and_a_warning() -> None:
    job = still(replace(MODEL, overhang_mm=1e-6, cut_length_mm=1e-7, lobe_error_um_pp=0.0))
    found = predict(job, LATHE)
    assert found.stock_mm[[0, -1]] == pytest.approx([0.0, 0.1])
    assert found.stock_um_pp[-1] / found.stock_um_pp[0] == pytest.approx(1.124, abs=2e-3)
    assert "rule.second_pass" in warned(found)
    assert "rule.second_pass" not in warned(predict(replace(job, roundness_tolerance_um=8.0), LATHE))
    # Before the lobe changes its sign a thinner wall is lobed less: it changes nearer to the jaws.
    far = replace(MODEL, wall_thickness_mm=1.0, overhang_mm=60.0, cut_length_mm=5.0, roundness_tolerance_um=1.0)
    found = predict(far, LATHE)
    change_um = found.stock_um_pp[-1] - found.stock_um_pp[0]
    assert change_um < -far.roundness_tolerance_um
    assert "rule.second_pass" in warned(found)
    assert "rule.second_pass" not in warned(predict(replace(far, roundness_tolerance_um=-change_um + 0.1), LATHE))


def test_a_solid_bar_stands_in_its_contacts() -> None:
    found = predict(BAR, LATHE)
    assert found.cut.mechanism is Mechanism.CONTACT
    assert 0 < found.cut.um_pp < 0.1
    assert (np.diff(found.error_um_pp) > 0).all()
    assert (np.diff(found.size_um) > 0).all()
    assert found.cut.matching_force_n is None
    # The tool pushes from the other side: soft, so high, where a jaw stands at the tool.
    high_deg = found.angle_deg[found.error_um[-1].argmax()]
    assert (high_deg - BAR.jaw_1_deg) % 120 == pytest.approx(0, abs=1)
    assert predict(replace(BAR, jaws=4), LATHE).cut.um_pp == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("name", ["steel-bar-65", "thin-ring-3-jaws", "thin-ring-6-jaws", "two-jaw-tube"])
def test_the_bundled_model_errors_are_those_of_the_model(name: str) -> None:
    job = load_job(name).job
    found = predict(job, LATHE)
    assert job.lobe_error_source == "model"
    assert found.cut.um_pp == pytest.approx(job.lobe_error_um_pp, rel=0.13, abs=5e-4)
    assert warned(found) == set()


def test_six_and_two_jaws_and_a_lobed_blank_on_a_soft_tool() -> None:
    found = predict(replace(MODEL, jaws=2, chucking_force_n=700.0), LATHE)
    spectrum = np.abs(np.fft.rfft(found.error_um[0]))
    assert spectrum.argmax() == 2
    assert found.cut.um_pp > 10 * predict(replace(MODEL, chucking_force_n=700.0), LATHE).cut.um_pp
    # dFp/dap = 0.4 x 0.074 N/um over half of the error that was found, times 1.495 um/N at 50 Hz.
    process = predict(ONE, LATHE).process
    assert process.lobed_force_n == pytest.approx(0.4 * 0.0740 * 55.0 / 2, rel=1e-3)
    assert process.lobed_motion_um / process.lobed_force_n == pytest.approx(1.4951, abs=1e-3)


def test_warnings_of_the_process() -> None:
    assert warned(predict(MODEL, LATHE)) == set()
    deeper = replace(MODEL, depth_of_cut_mm=0.3)
    assert warned(predict(deeper, LATHE)) == {"rule.chatter_width", "rule.moving_out"}
    for share, near in ((0.17, False), (0.199, True), (0.201, True), (0.23, False)):
        walled = replace(MODEL, wall_thickness_mm=share * MODEL.radius_mm)
        assert warned(predict(walled, LATHE)) == ({"rule.wall_border"} if near else set())
    ringing = replace(LATHE, chuck=replace(LATHE.chuck, work_mode_hz=151.0))
    assert warned(predict(MODEL, ringing)) == {"rule.mode_near"}


def test_tool_and_part_give_way_to_an_earlier_error_together() -> None:
    """mu / (1 + mu) with mu = k (c_tool + c_part): a weak part leaves more than the tool alone would."""
    for job in (ONE, replace(ONE, wall_thickness_mm=1.0)):
        found = predict(job, LATHE)
        k = found.process.force.passive_n / 100.0
        # The mean radius comes out too large by what the part gives way.
        part_um_per_n = found.size_um[-1] / found.process.force.passive_n
        mu = k * (1.4951 + part_um_per_n)
        assert found.process.copying.fraction_left() == pytest.approx(mu / (1 + mu), rel=1e-3)


def test_angles_and_places_may_be_asked_for() -> None:
    found = predict(ONE, LATHE, angle_deg=[0.0, 90.0, 210.0], z_mm=[5.0, 26.0])
    assert found.error_um.shape == (2, 3)
    assert found.error_um[:, 1] == pytest.approx(found.error_um[:, 2])
    assert not found.error_um.flags.writeable
    with pytest.raises(ProfileError, match="z_mm"):
        predict(ONE, LATHE, z_mm=30.1)
    with pytest.raises(ProfileError, match="z_mm"):
        predict(ONE, LATHE, z_mm=float("nan"))


@pytest.mark.parametrize(
    ("job", "code"),
    [
        (replace(ONE, material="cheese"), "rule.material_unknown"),
        (replace(ONE, chucking_force_n=300.0), "rule.grip_margin"),
        (replace(ONE, wall_thickness_mm=27.0), "rule.wall_over_radius"),
        (replace(ONE, wall_thickness_mm=0.1), "rule.depth_over_wall"),
    ],
)
def test_what_cannot_be_held_or_cut_is_refused(job: Job, code: str) -> None:
    with pytest.raises(ProfileError) as caught:
        predict(job, LATHE)
    assert [problem.code for problem in caught.value.problems] == [code]


def test_what_no_profile_says_is_named() -> None:
    assert predict(ONE, LATHE).assumed == ()
    bare: MachineProfile = replace(
        LATHE, chuck=replace(LATHE.chuck, jaw_length_mm=None, jaw_straight_fraction=None)
    )
    assert predict(ONE, bare).assumed == ("chuck.jaw_length_mm", "chuck.jaw_straight_fraction")


@pytest.mark.parametrize(
    ("phase_deg", "jaws", "thin", "high", "mechanism"),
    [
        (90.0, 3, True, True, Mechanism.SPRING_BACK),
        (210.0 + 5.0, 3, True, True, Mechanism.SPRING_BACK),
        (150.0, 3, True, False, Mechanism.WALL),
        (120.0, 3, True, None, None),  # a quarter of a lobe: Eq 3, or jaw 1 is marked wrongly
        (90.0 + 44.0 / 3, 3, True, True, Mechanism.SPRING_BACK),
        (90.0 + 46.0 / 3, 3, True, None, None),  # as far from the jaws as from the middle between two
        (90.0, 3, False, True, Mechanism.CONTACT),
        (150.0, 3, False, False, None),
        (180.0, 2, False, False, Mechanism.CONTACT),
    ],
)
def test_the_sign_at_the_jaws_tells_clamping_from_compliance(
    phase_deg: float, jaws: int, thin: bool, high: bool | None, mechanism: Mechanism | None
) -> None:
    found = diagnose(phase_deg=phase_deg, jaw_1_deg=90.0, jaws=jaws, thin=thin)
    assert (found.high_at_jaws, found.mechanism) == (high, mechanism)


def test_what_the_model_predicts_is_what_its_sign_is_taken_for() -> None:
    for job in (MODEL, replace(BAR, depth_of_cut_mm=0.5)):
        cut = predict(job, LATHE).cut
        assert cut.phase_deg is not None
        thin = job is MODEL
        seen = diagnose(phase_deg=cut.phase_deg, jaw_1_deg=job.jaw_1_deg, jaws=3, thin=thin)
        assert seen.mechanism is cut.mechanism
