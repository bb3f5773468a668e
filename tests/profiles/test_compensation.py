"""The compensation, the bounds of its path, its trim, and what repeats of it."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.axis.stiffness import held_back_um
from profiles.compensations.change import OrderState
from profiles.compensations.learning import coefficient_of, next_trim_um
from profiles.compensations.order_steps import RepeatHistory
from profiles.compensations.path import (
    AlongCut,
    CutPath,
    LobedPath,
    PathHarmonic,
    axial_terms,
    chord_error,
    chord_scale,
    compensated_depth_um,
    delay_response,
    free_state_lobe,
    invert,
    lobe_frequency_hz,
    misalignment,
    path_problems,
    removed_depth_um,
    residual_um_pp,
    spindle_speed_rpm,
    target_path,
)
from profiles.compensations.trim_response import TrimResponse
from profiles.job import Job
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine

ONE = load_job("lee-2001-experiment-1").job
TURN_DEG = np.arange(0.0, 360.0, 0.25)


@pytest.mark.parametrize(("jaws", "factor"), [(2, 30), (3, 20), (4, 15), (6, 10)])
def test_eq_4(jaws: int, factor: float) -> None:
    assert spindle_speed_rpm(50.0, jaws) == factor * 50
    assert lobe_frequency_hz(factor * 50.0, jaws) == 50


def test_the_rule_of_eqs_6_10_and_11() -> None:
    theta = np.radians(TURN_DEG)
    for depth, amplitude in ((100, 27.5), (60, 16.5)):
        plain = removed_depth_um(TURN_DEG, a0_um=depth, a1_um=amplitude)
        np.testing.assert_allclose(plain, depth + amplitude * np.sin(3 * theta), atol=1e-12)
        path = compensated_depth_um(TURN_DEG, a0_um=depth, a1_um=amplitude)
        np.testing.assert_allclose(path, depth - amplitude * np.sin(3 * theta), atol=1e-12)
    values = removed_depth_um([0.0, 30.0, 60.0], a0_um=10, a1_um=2, b1_um=3)
    np.testing.assert_allclose(values, [7, 12, 13], atol=1e-12)
    path = compensated_depth_um([0.0, 30.0, 60.0], a0_um=10, a1_um=2, b1_um=3)
    np.testing.assert_allclose(path, [13, 8, 7], atol=1e-12)
    # The paper's plain cut takes most at 30 deg, so its part is high at 90 deg.
    assert ONE.lobe_phase_deg == 90
    expected = compensated_depth_um(TURN_DEG, a0_um=100, a1_um=27.5)
    np.testing.assert_allclose(target_path(ONE).at_um(TURN_DEG), expected, atol=1e-9)
    lobe = free_state_lobe(ONE).at_um(TURN_DEG)
    assert lobe.shape == TURN_DEG.shape
    assert free_state_lobe(ONE).at_um(ONE.lobe_phase_deg) == lobe.max() == 27.5
    np.testing.assert_allclose(target_path(ONE).at_um(TURN_DEG) - 100, lobe, atol=1e-12)


@given(st.integers(2, 12), st.floats(-360, 360), st.floats(0, 1000))
def test_a_lobe_repeats_with_the_jaws_at_its_peak_to_peak(jaws: int, phase: float, error: float) -> None:
    job = replace(ONE, jaws=jaws, lobe_phase_deg=phase, lobe_error_um_pp=error)
    lobe = free_state_lobe(job).at_um(phase + np.arange(0, 360, 360 / (2 * jaws)))
    np.testing.assert_allclose(lobe, np.tile([error / 2, -error / 2], jaws), atol=1e-9)


@pytest.mark.parametrize(
    ("gain", "phase_rad", "amplitude_um", "lobe_lead_deg"),
    [(0.74546, -0.78226, 36.89, 44.82), (0.884, -0.241, 31.11, 13.81)],
)
def test_the_command_of_experiment_1(
    gain: float, phase_rad: float, amplitude_um: float, lobe_lead_deg: float
) -> None:
    command = invert(target_path(ONE), cmath.rect(gain, phase_rad))
    assert command.amplitude_um == pytest.approx(amplitude_um, abs=0.005)
    assert command.phase_deg == pytest.approx(ONE.lobe_phase_deg - lobe_lead_deg / 3, abs=0.005)
    assert command.mean_um == 100


@given(st.floats(0.125, 20), st.floats(-math.pi, math.pi), st.integers(2, 12), st.floats(-360, 360))
def test_an_axis_undoes_its_inverse(gain: float, phase: float, lobes: int, crest: float) -> None:
    target = LobedPath(mean_um=100, amplitude_um=20, lobes=lobes, phase_deg=crest)
    command = invert(target, cmath.rect(gain * 1.0001, phase))
    # The axis makes the sine larger by its gain and later by its lag.
    moved = replace(
        command,
        amplitude_um=command.amplitude_um * gain * 1.0001,
        phase_deg=command.phase_deg - math.degrees(phase) / lobes,
    )
    np.testing.assert_allclose(moved.at_um(TURN_DEG), target.at_um(TURN_DEG), atol=1e-6)


@pytest.mark.parametrize("response", [0j, 0.1249 + 0j, complex("nan")])
def test_an_axis_that_hardly_moves_has_no_inverse(response: complex) -> None:
    with pytest.raises(ProfileError) as caught:
        invert(target_path(ONE), response)
    assert caught.value.problems[0].code == "response.too_small"


@pytest.mark.parametrize(
    ("angle_deg", "of_55", "of_33"),
    [(0.05, 0.14, 0.09), (0.25, 0.72, 0.43), (1, 2.88, 1.73), (5, 14.36, 8.61), (20, 55, 33), (60, 110, 66)],
)
def test_alignment_error(angle_deg: float, of_55: float, of_33: float) -> None:
    c = misalignment(angle_deg, 3)
    assert residual_um_pp(55, c) == pytest.approx(of_55, abs=0.006)
    assert residual_um_pp(33, c) == pytest.approx(of_33, abs=0.006)


@pytest.mark.parametrize(
    ("percent", "degrees", "left"), [(1, 0, 0.0100), (2, 1, 0.0267), (5, 5, 0.1024), (10, 10, 0.2084)]
)
def test_an_identified_response_that_is_a_little_wrong(percent: float, degrees: float, left: float) -> None:
    c = cmath.rect(1 + percent / 100, math.radians(degrees))
    assert residual_um_pp(1, c) == pytest.approx(left, abs=6e-3 * left + 5e-5)


def test_a_sine_through_eq_9_and_through_the_measured_servo() -> None:
    for error, eq9, measured in ((55, 38.8, 14.0), (33, 23.3, 8.4)):
        assert residual_um_pp(error, cmath.rect(0.74546, -0.78226)) == pytest.approx(eq9, abs=0.05)
        assert residual_um_pp(error, cmath.rect(0.884, -0.241)) == pytest.approx(measured, abs=0.05)


@pytest.mark.parametrize("points", [8, 24, 46])
def test_chords_through_raised_points_keep_the_amplitude_and_their_error(points: int) -> None:
    """By straight lines of numpy; the fundamental of unraised ones at 24 points is 0.9943 of the sine."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48_001)[:-1]
    knots = np.linspace(0.0, 2.0 * np.pi, points + 1)
    lines = np.interp(angle, knots, chord_scale(points) * np.cos(knots))
    assert 2.0 * np.mean(lines * np.cos(angle)) == pytest.approx(1.0, abs=1e-5)
    assert np.abs(lines - np.cos(angle)).max() == pytest.approx(chord_error(points), rel=1e-3)
    assert chord_scale(24) == pytest.approx(1.0 / 0.99430, abs=1e-4)


def test_a_delay_turns_the_response_and_leaves_its_gain() -> None:
    """One servo cycle of 442.7 us at 50 Hz: 0.1391 rad, 2.66 deg of the spindle with three lobes."""
    late = delay_response(complex(0.5, -0.5), 50.0, 442.7e-6)
    assert abs(late) == pytest.approx(abs(complex(0.5, -0.5)))
    assert cmath.phase(late) == pytest.approx(-math.pi / 4 - 0.1391, abs=1e-4)
    assert math.degrees(0.1391) / 3 == pytest.approx(2.66, abs=0.01)


@given(
    mean_um=st.floats(-200.0, 200.0),
    harmonics=st.lists(st.tuples(st.floats(0.0, 60.0), st.floats(-360.0, 360.0)), min_size=3, max_size=3),
    growth=st.floats(-0.1, 0.1),
    by_deg=st.floats(-720.0, 720.0),
    past_middle_mm=st.floats(-20.0, 20.0),
)
def test_a_turned_path_has_at_the_turned_angle_what_it_had_before(
    mean_um: float, harmonics: list[tuple[float, float]], growth: float, by_deg: float, past_middle_mm: float
) -> None:
    lobe, *others = (
        PathHarmonic(lobes=n, amplitude_um=a, phase_deg=c) for n, (a, c) in zip((3, 6, 9), harmonics, strict=True)
    )
    path = LobedPath(
        mean_um=mean_um,
        amplitude_um=lobe.amplitude_um,
        lobes=3,
        phase_deg=lobe.phase_deg,
        overtones=tuple(others),
        along=AlongCut(half_length_mm=10.0, orders=((3, (growth, 0.1)), (6, (0.2,))), mean_um=(5.0 * growth,)),
        axial=axial_terms({(0, 1): 2.0, (2, 1): 1.0 + 0.5j, (3, 2): growth * 1j}),
    )
    turned = path.turn_by(by_deg)
    before_um = path.at_um(TURN_DEG, past_middle_mm)
    np.testing.assert_allclose(turned.at_um(TURN_DEG + by_deg, past_middle_mm), before_um, atol=1e-7)
    command = path.plus({3: 1.0 + 1.0j})
    both = CutPath(target=path, command=command).turn_by(by_deg)
    assert both.target == turned
    np.testing.assert_allclose(
        both.command.at_um(TURN_DEG), path.plus({3: 1.0 + 1.0j}).turn_by(by_deg).at_um(TURN_DEG)
    )


# A learned path that is no correction of its cut is refused, whoever wrote its file.

WANTED = LobedPath(mean_um=100.0, amplitude_um=27.5, lobes=3, phase_deg=90.0)
LAG = cmath.rect(0.885, -0.9)
PATH = CutPath(target=WANTED, command=invert(WANTED, LAG))


MACHINE = load_machine("lee-2001-lathe").machine
RING = load_job("lee-2001-experiment-1").job


def codes(path: CutPath, job: Job = RING) -> list[str]:
    target = WANTED if job is RING else target_path(job)
    found = path_problems(path, target, lambda _: LAG, lambda n: held_back_um(MACHINE, job, n))
    return [problem.code for problem in found]


def test_what_learning_does_is_let_through() -> None:
    """As on the realistic lathe: friction asks for a fifth more, the cut for 25 um of mean, overtones for one."""
    nine = PathHarmonic(lobes=9, amplitude_um=0.9, phase_deg=5.0)
    command = replace(PATH.command, amplitude_um=36.7, mean_um=125.0, overtones=(nine,))
    assert codes(CutPath(target=replace(WANTED, amplitude_um=28.9), command=command)) == []
    half = CutPath(target=replace(WANTED, amplitude_um=13.75), command=replace(PATH.command, amplitude_um=15.5))
    assert codes(half) == []


@pytest.mark.parametrize(
    "target",
    [
        {"mean_um": 500.0},
        {"amplitude_um": 1000.0},
        {"phase_deg": 30.0},
        {"lobes": 4},
        {"overtones": (PathHarmonic(lobes=6, amplitude_um=100.0, phase_deg=0.0),)},
        {"overtones": (PathHarmonic(lobes=3, amplitude_um=100.0, phase_deg=0.0),)},
        {"mean_um": float("nan")},
    ],
)
def test_what_is_another_cut_is_refused(target: dict[str, object]) -> None:
    other = replace(WANTED, **target)  # type: ignore[arg-type]
    for path in (
        CutPath(target=other, command=invert(other, LAG)),
        CutPath(target=WANTED, command=invert(other, LAG)),
    ):
        assert codes(path) != []


def test_friction_may_hold_a_tool_by_what_its_loop_gives_way() -> None:
    """7.545 um/N at 10 Hz by the paper's gains, 1.755 um/N at 50 Hz in the simulated loop; 5 N."""
    slow = replace(RING, spindle_speed_rpm=200.0)
    assert held_back_um(MACHINE, slow, 3) == pytest.approx(1.2732 * 5.0 * 7.545, rel=0.01)
    assert held_back_um(MACHINE, RING, 3) == pytest.approx(1.2732 * 5.0 * 1.755, rel=0.01)
    assert held_back_um(MACHINE, slow, 15) == pytest.approx(1.2732 / 5.0 * 5.0 * 1.755, rel=0.01)
    assert [held_back_um(MACHINE, RING, n) for n in (2, 5, 6)] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(("held_um", "told"), [(17.3, []), (60.0, ["path.beyond"])])
def test_a_small_slow_lobe_may_be_told_much_more_than_it_is_to_do(held_um: float, told: list[str]) -> None:
    """3 N hold a tool by (4/pi) 3 N 4.51 um/N = 17.2 um at 20 Hz, in which two jaws want 5.2 um."""
    job = load_job("two-jaw-tube").job
    target = target_path(job)
    held = target.plus({2: held_um * 1j * target.harmonics[0].coefficient / target.amplitude_um})
    assert codes(CutPath(target=target, command=invert(held, LAG)), job) == told
    misread = CutPath(target=held, command=invert(held, LAG))
    assert codes(misread, job) == ["path.beyond"], "what is wanted of the tool has no friction"


@pytest.mark.parametrize(
    ("order", "oval_um", "command", "told"),
    [
        (2, 14.0, 2.2, []),
        (2, 14.0, 3.0, ["path.beyond"]),
        (2, 30.0, 1.0, ["path.beyond"]),
        (3, 14.0, 1.0, ["path.beyond"]),
    ],
)
def test_one_harder_jaw_may_make_more_oval(order: int, oval_um: float, command: float, told: list[str]) -> None:
    """A ring is (35/3)^2 = 136 times softer to an oval than to six lobes: 10 % more on one jaw makes 2.7 lobes."""
    job = replace(RING, jaws=6, lobe_jaws=6, lobe_error_um_pp=12.0)
    target = target_path(job)
    wanted, asked = (target.plus({order: k * oval_um * 1j}) for k in (1.0, command))
    found = codes(CutPath(target=wanted, command=invert(asked, LAG)), job)
    assert sorted(set(found)) == told


# A trim on a tool that friction holds back: it converges as on a free one, and stays within its bounds.

NOMINAL = cmath.rect(0.9, -0.6)


def left_um(true: complex, batches: int, *, adapts: bool, jump_at: int = -1) -> list[float]:
    """Return the error of each batch of a cut whose tool follows a trim by `true`; it comes into the part once."""
    rng, response, trim, found = np.random.default_rng(4), TrimResponse(nominal=NOMINAL), 0j, []
    disturbance = 2.0 + 1.0j
    for batch in range(batches):
        if batch == jump_at:
            disturbance += 3.0
        error = disturbance - true * trim + complex(*rng.normal(0.0, 0.05, 2))
        response = response.add_batch(trim, error)
        trim = next_trim_um(trim, error, response.value if adapts else NOMINAL, 0.7, 100.0)
        found.append(abs(error))
    return found


def test_the_response_is_trimmed_within_bounds() -> None:
    held_back = 0.35 * NOMINAL * cmath.rect(1.0, 0.3)
    slow, quick = (left_um(held_back, 7, adapts=adapts) for adapts in (False, True))
    assert slow[-1] > 0.3, "0.75 of the error is left by each batch"
    assert quick[-1] < 0.15
    rng = np.random.default_rng(5)
    response = TrimResponse(nominal=NOMINAL)
    for _ in range(200):
        response = response.add_batch(complex(*rng.normal(0.0, 5.0, 2)), complex(*rng.normal(0.0, 5.0, 2)))
        factor = response.value / NOMINAL
        assert 0.3 - 1e-9 <= abs(factor) <= 1.5 + 1e-9
        assert abs(cmath.phase(factor)) <= 1.048


@pytest.mark.parametrize("jump_at", [2, 4])
def test_a_tool_that_follows_is_trimmed_as_before_also_where_it_comes_into_the_part(jump_at: int) -> None:
    found = left_um(NOMINAL, jump_at + 5, adapts=True, jump_at=jump_at)
    assert found[jump_at] > 2.0 and found[-1] < 0.15


# Which orders of a row of parts repeat, whatever was learned of them meanwhile.

BEGUN = CutPath(target=WANTED.plus({2: 1.0 + 0j}), command=WANTED.plus({2: 1.5 + 0j, 5: 0.3j}))


def seen(order: int, *parts_um: complex) -> RepeatHistory:
    found = RepeatHistory(begun=BEGUN)
    for each in parts_um:
        found = found.add_part({order: each})
    return found


def test_an_order_has_to_stand_out_of_its_scatter_over_three_parts() -> None:
    """1 + 0.2 j, 1, 1 - 0.2 j: 3 abs(mean)^2 = 3, of F(2, 4; 95 %) = 6.94 times 0.05. At three angles it is 0."""
    third = np.exp(2j * np.pi * np.arange(3) / 3)
    assert seen(5, 1.0 + 0.2j, 1.0 + 0j, 1.0 - 0.2j).varying(3) == frozenset()
    assert seen(5, *third).varying(3) == {5}
    assert seen(5, *third[:2]).varying(3) == frozenset(), "two parts are no evidence"
    assert seen(5, *(0.2 * third)).varying(3) == frozenset(), "no lathe repeats 0.2 um"
    assert seen(6, *third).varying(3) == frozenset(), "the chuck holds each part alike"


def test_what_friction_makes_of_another_motion_after_a_step_is_not_told_by_the_parts_before() -> None:
    """Twice a turn steps with the fourth part; from the fifth on the tool moves otherwise."""
    five = seen(5, 1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0)
    assert five.varying(3) == {5}
    assert five.varying(3, {2: OrderState(since=3), 5: OrderState()}) == frozenset()
    assert five.varying(3, {0: OrderState(since=3)}) == {5}, "a step of the size is no other motion"


def test_what_is_withdrawn_is_as_the_first_part_had_it_and_the_rest_as_learned() -> None:
    learned = CutPath(
        target=WANTED.plus({2: 4.0 + 0j, 7: 1j}), command=WANTED.plus({2: 6.0 + 0j, 5: 2.0 + 0j, 7: 2j})
    )
    found = RepeatHistory(begun=BEGUN)
    assert found.target_moved_um(learned, 2) == pytest.approx(3.0)
    assert found.command_moved_um(learned, 5) == pytest.approx(2.0 - 0.3j)
    back = found.withdrawn(learned, (2, 5))
    assert coefficient_of(back.target, 2) == pytest.approx(1.0)
    assert coefficient_of(back.command, 2) == pytest.approx(1.5)
    assert coefficient_of(back.command, 5) == pytest.approx(0.3j)
    assert coefficient_of(back.target, 7) == pytest.approx(1j)
    assert coefficient_of(back.command, 7) == pytest.approx(2j)
    assert coefficient_of(back.target, 3) == pytest.approx(coefficient_of(WANTED, 3))
