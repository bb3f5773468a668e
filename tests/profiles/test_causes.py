"""What is left on a part: its causes, the null of the force, and the push of the cut."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.arrays import Floats, floats
from profiles.compensations.causes import Cause, CauseKind, causes
from profiles.compensations.force_null import (
    ExpectedForce,
    ForceNull,
    ForceNullReason,
    ForceRecord,
    Sign,
    force_null,
)
from profiles.compensations.next_version import AppliedPath
from profiles.compensations.part_harmonics import part_harmonics
from profiles.compensations.path import CutPath, target_path
from profiles.compensations.push import NO_PUSH, left_push
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine
from profiles.traces import Trace

ANGLE_DEG = np.arange(3600) / 10.0
FILTER_UPR = 50.0


def filed(jaws: int = 3) -> Job:
    """A lobe of 55 um p-p, its maximum 10 deg past jaw 1, which is at 40 deg of spindle."""
    job = load_job("lee-2001-experiment-1").job
    return replace(job, jaws=jaws, lobe_error_um_pp=55.0, lobe_phase_deg=50.0, lobe_past_jaw_deg=10.0, assumed=())


def lobe_um(job: Job, *, larger: float = 1.0, further_deg: float = 0.0) -> Floats:
    phase_deg = job.lobe_phase_deg + further_deg
    return floats(larger * 0.5 * job.lobe_error_um_pp * np.cos(job.jaws * np.radians(ANGLE_DEG - phase_deg)))


def said(
    left_um: Floats,
    job: Job,
    *,
    fraction: float = 1.0,
    noise_um: float = 0.1,
    tool_um: complex = 0j,
    placed: bool = True,
) -> tuple[Cause, ...]:
    """The causes of a part that has this left, after a cut by the model, with a gauge that has this noise."""
    noise = np.random.default_rng(4).normal(scale=noise_um, size=ANGLE_DEG.size)
    meta = MappingProxyType({"state": "free", "direction": "spindle", "start_mark": "spindle index"})
    trace = Trace(angle_deg=ANGLE_DEG, deviation_um=left_um + noise, meta=meta)
    target = target_path(job)
    cut = AppliedPath(path=CutPath(target=target, command=target), fraction=fraction, version=None)
    part = part_harmonics(trace, job, filter_upr=FILTER_UPR)
    return causes(part, cut, job, tool_um=tool_um, placed=placed)


@given(off_deg=st.floats(-50.0, 50.0), jaws=st.sampled_from([2, 3, 4]))
def test_a_jaw_that_is_elsewhere_is_named_with_its_angle(off_deg: float, jaws: int) -> None:
    job = filed(jaws)
    off_deg = off_deg * 3.0 / jaws
    if abs(off_deg) * jaws < 12.0:
        return
    first, *_ = said(lobe_um(job, further_deg=off_deg) - lobe_um(job), job)
    assert first.kind is CauseKind.ANGLE
    assert first.value == pytest.approx(off_deg, abs=0.5)


def test_a_jaw_or_a_lobe_that_stands_off_is_an_angle() -> None:
    job = filed()
    first, *_ = said(lobe_um(job, further_deg=25.0) - 0.5 * lobe_um(job), job, fraction=0.5)
    assert first.kind is CauseKind.ANGLE
    assert first.value == pytest.approx(25.0, abs=0.5)
    job = filed()
    first, *_ = said(lobe_um(job, further_deg=60.0) - lobe_um(job), job)
    assert first.kind is CauseKind.ANGLE
    assert first.value == pytest.approx(60.0)


def test_the_largest_cause_comes_first_and_a_tool_of_the_wrong_way_is_named() -> None:
    job = filed()
    for fraction in (0.5, 1.0):
        first, *_ = said(lobe_um(job) * (1.0 + fraction), job, fraction=fraction)
        assert first.kind is CauseKind.SIGN
        assert first.um_pp == pytest.approx(fraction * 110.0, rel=0.01)
    job = filed()
    at = np.radians(ANGLE_DEG)
    left_um = lobe_um(job, larger=1.1) - lobe_um(job) + 6.0 * np.cos(2.0 * (at - np.radians(job.jaw_1_deg + 30.0)))
    found = said(left_um + 0.3 * np.cos(7.0 * at), job)
    assert [each.kind for each in found] == [CauseKind.OVAL, CauseKind.FORCE]


@pytest.mark.parametrize("arrives", [0.0, 0.3, 0.5, 0.7])
def test_a_path_that_arrives_in_part_is_named_with_the_part(arrives: float) -> None:
    job = filed()
    first, *_ = said(lobe_um(job) * (1.0 - arrives), job)
    assert first.kind is CauseKind.ARRIVES
    assert first.value == pytest.approx(arrives, abs=0.01)


@pytest.mark.parametrize("percent", [-20.0, -10.0, 10.0, 20.0])
def test_another_chucking_force_is_named_with_its_difference(percent: float) -> None:
    job = filed()
    first, *_ = said(lobe_um(job, larger=1.0 + percent / 100.0) - lobe_um(job), job)
    assert first.kind is CauseKind.FORCE
    assert 100.0 * first.value == pytest.approx(percent, abs=0.5)


@pytest.mark.parametrize("jaw", [1, 2, 3])
def test_a_jaw_that_presses_harder_is_named_with_its_number(jaw: int) -> None:
    """A ring under one more radial force: harmonics 1 / (n^2 - 1)^2, with a maximum at that jaw once released."""
    job = filed()
    at = np.radians(ANGLE_DEG - job.jaw_1_deg - (jaw - 1) * 120.0)
    harder_um = sum(3.0 * (9.0 / (n**2 - 1) ** 2) * np.cos(n * at) for n in range(2, 12))
    first, *_ = said(harder_um, job)
    assert (first.kind, first.order, first.jaw) == (CauseKind.JAW, 2, jaw)
    assert first.value == pytest.approx(0.0, abs=0.5)


def test_an_oval_blank_other_orders_and_noise_are_called_so() -> None:
    job = filed()
    first, *_ = said(3.0 * np.cos(2.0 * np.radians(ANGLE_DEG - job.jaw_1_deg - 30.0)), job)
    assert (first.kind, first.order) == (CauseKind.OVAL, 2)
    assert first.um_pp == pytest.approx(6.0, abs=0.1)
    job = filed()
    at = np.radians(ANGLE_DEG)
    found = said(4.0 * np.cos(5.0 * at) + 2.0 * np.cos(6.0 * at), job)
    assert [(each.kind, each.order) for each in found] == [(CauseKind.HARMONIC, 5), (CauseKind.OVERTONE, 6)]
    (only,) = said(np.zeros(ANGLE_DEG.size), filed(), noise_um=2.0)
    assert only.kind is CauseKind.NOISE


def test_an_angle_is_named_where_it_is_certain_and_explains_more_than_the_height() -> None:
    """Turned by 0.46 deg and 10 % high: of 27.5 um that is 0.7 um across and 2.75 um along."""
    job = filed()
    first, *_ = said(lobe_um(job, larger=1.1, further_deg=0.46) - lobe_um(job), job)
    assert first.kind is CauseKind.FORCE and first.value == pytest.approx(0.1, abs=0.01)
    first, *_ = said(lobe_um(job, larger=1.02, further_deg=2.0) - lobe_um(job), job)
    assert first.kind is CauseKind.ANGLE and first.value == pytest.approx(2.0, abs=0.05)
    assert abs(first.value) > 2.0 * first.sd
    for seed_um in (0.15, 0.2):  # 0.1 um is what a lathe does not repeat
        off_um = seed_um * np.sin(3.0 * np.radians(ANGLE_DEG - job.lobe_phase_deg))
        assert all(each.kind is not CauseKind.ANGLE for each in said(off_um, job, noise_um=0.01))


def test_what_the_tool_has_hidden_of_the_lobe_is_not_left() -> None:
    """The lobe is 20 % high, 11 um p-p, and the tool went 8 um p-p too deep in phase with it: 3 um are left."""
    job = filed()
    there = np.exp(-3j * np.radians(job.lobe_phase_deg))
    left_um = (
        lobe_um(job, larger=1.2) - lobe_um(job) - 4.0 * np.cos(3.0 * np.radians(ANGLE_DEG - job.lobe_phase_deg))
    )
    found = {each.kind: each for each in said(left_um, job, tool_um=complex(4.0 * there))}
    assert found[CauseKind.FORCE].value == pytest.approx(0.2, abs=0.01)
    assert found[CauseKind.FORCE].um_pp == pytest.approx(3.0, abs=0.1)


def test_without_an_angle_the_lobe_is_judged_by_its_height_whatever_the_tool_did() -> None:
    """9.7 um p-p, at the very angle at which the tool would explain all of it: the trace cannot know."""
    job = filed()
    left_um = 4.85 * np.cos(3.0 * np.radians(ANGLE_DEG))
    (only,) = said(left_um, job, tool_um=-4.85 + 0j, placed=False)
    assert (only.kind, only.order) == (CauseKind.UNPLACED, 3)
    assert only.um_pp == pytest.approx(9.7, abs=0.05)


# The force of a half-stage cut against signals that are written down here: a mass, its friction, and a chip.
#
# A tool of 4.7 kg and 200 N s/m moves x = m + a cos(3 angle - p) um, angle = w t. Its motor has to give what
# moves the mass, 4/pi F of the fundamental of a dry friction F against the speed, and, from the face on, k (x -
# lobe): the force of the chip, in a surface that the jaws press in by the lobe.

CYCLE_S, HZ, LOBES = 0.000442, 1000.0 / 60.0, 3
MASS_KG, DAMPING, FRICTION_N = 4.7, 200.0, 3.0
WHOLE_UM, DEPTH_UM, K = 27.5 * cmath.exp(0.7j), 90.0, 0.03  # N/um
GIVES_WAY = 0.03j  # of its path a tool is pushed off by the cut
EXPECTED = ExpectedForce(
    lobes=LOBES,
    whole_um=WHOLE_UM,
    passive_n=2.7,
    mass_kg=MASS_KG,
    damping_n_s_per_m=DAMPING,
    cycle_s=CYCLE_S,
    turns_hz=HZ,
)


def waves(value: complex, lobe_rad: Floats) -> Floats:
    return np.asarray((value * np.exp(1j * lobe_rad)).real, dtype=np.float64)


def needed(path_um: complex, lobe_rad: Floats, backwards: bool) -> Floats:
    """The force that the motion itself needs, 1.5 cycles before it acts: M a + B v + F sign(v)."""
    omega = 2.0 * math.pi * LOBES * HZ * (-1.0 if backwards else 1.0)
    now_rad = lobe_rad + 1.5 * CYCLE_S * omega
    speed = waves(1e-6j * omega * path_um, now_rad)
    return np.asarray(
        MASS_KG * waves(-1e-6 * omega**2 * path_um, now_rad) + DAMPING * speed + FRICTION_N * np.sign(speed)
    )


def cut(
    *,
    lobe_um: complex = WHOLE_UM,
    stiffness: float = K,
    noise_um: float = 0.0,
    seed: int = 0,
    air_turns: float = 5.0,
    backwards: bool = False,
    gain: float = 1.0,
) -> ForceRecord:
    """A half stage: from `air_turns` before the face to 8 turns behind it, in a surface with a lobe."""
    turns = np.arange(-air_turns, 8.0, HZ * CYCLE_S)
    lobe_rad = 2.0 * math.pi * LOBES * (turns + 0.123) * (-1.0 if backwards else 1.0)
    path_um = 0.5 * WHOLE_UM
    pushed_um = path_um * (1.0 - GIVES_WAY)
    inside = turns >= 0.0
    infeed_um = np.where(inside, DEPTH_UM + waves(pushed_um, lobe_rad), 100.0 + waves(path_um, lobe_rad))
    omega = 2.0 * math.pi * LOBES * HZ * (-1.0 if backwards else 1.0)
    ahead_rad = lobe_rad + 1.5 * CYCLE_S * omega
    chip_n = stiffness * (DEPTH_UM + waves(pushed_um - lobe_um, ahead_rad))
    thrust_n = np.where(
        inside, needed(pushed_um, lobe_rad, backwards) + chip_n, needed(path_um, lobe_rad, backwards)
    )
    read_um = np.random.default_rng(seed).normal(0.0, 1.0, turns.size + 1) * noise_um
    # A derivative of what is read makes the noise of the output: 1.5 N rms of 0.3 um.
    noise_n = np.diff(read_um) * 1.5 / (0.3 * math.sqrt(2.0))
    return ForceRecord(
        angle_deg=np.degrees(lobe_rad) / LOBES,
        infeed_um=infeed_um + read_um[1:],
        thrust_n=gain * (thrust_n - noise_n),
        face_deg=360.0 * 0.123 * (-1.0 if backwards else 1.0),
    )


def found(**cutting: object) -> ForceNull:
    return force_null(cut(**cutting), EXPECTED)  # type: ignore[arg-type]


def turned(by_deg: float) -> complex:
    """The lobe, so many degrees of spindle further on."""
    return WHOLE_UM * cmath.exp(-1j * LOBES * math.radians(by_deg))


def test_what_lies_in_the_chip_of_a_right_and_a_wrong_compensation() -> None:
    said = found()
    assert (said.sign, said.alarms, said.why) == (Sign.AGREES, False, ForceNullReason.NONE)
    assert abs(said.force_n) == pytest.approx(K * 0.5 * abs(WHOLE_UM), rel=0.05)
    assert abs(said.ratio - 1.0) < 0.03
    assert abs(said.turned_deg) < 1.0
    assert abs(said.right_n - said.force_n) < 0.03
    said = found(lobe_um=-WHOLE_UM)
    assert (said.sign, said.alarms) == (Sign.WRONG_SIGN, True)
    assert abs(said.force_n) == pytest.approx(K * 1.5 * abs(WHOLE_UM), rel=0.05)
    assert abs(said.wrong_n - said.force_n) < 0.05


@pytest.mark.parametrize("by_deg", [-40.0, -20.0, 20.0, 30.0, 45.0])
def test_a_lobe_that_is_turned_is_found_with_its_angle(by_deg: float) -> None:
    said = found(lobe_um=turned(by_deg), noise_um=0.3)
    assert said.sign is Sign.TURNED
    assert said.turned_deg == pytest.approx(by_deg, abs=2.0 * said.turned_sd_deg)
    assert said.turned_sd_deg < 4.0


@pytest.mark.parametrize("by_deg", [0.0, 30.0])
def test_a_spindle_that_turns_backwards_is_no_other_lobe(by_deg: float) -> None:
    said = found(lobe_um=turned(by_deg), backwards=True)
    assert said.turned_deg == pytest.approx(by_deg, abs=1.5)


@pytest.mark.parametrize("gain", [0.8, 1.25])
def test_a_drive_that_is_stronger_than_its_profile_changes_no_verdict(gain: float) -> None:
    said = found(lobe_um=turned(30.0), gain=gain)
    assert said.sign is Sign.TURNED and said.turned_deg == pytest.approx(30.0, abs=2.0)


def test_the_standard_deviation_is_at_least_that_of_many_cuts() -> None:
    """Of forty cuts with a scale of 0.3 um rms; neighbouring turns share a reading, so that it is too wide."""
    cuts = [found(noise_um=0.3, seed=seed) for seed in range(40)]
    scatter_n = math.sqrt(float(np.var([each.force_n for each in cuts])) / 2.0)
    said_n = math.sqrt(float(np.mean([each.force_sd_n**2 for each in cuts])))
    assert 0.25 * said_n < scatter_n < said_n
    assert {each.sign for each in cuts} == {Sign.AGREES}


def test_without_a_chip_or_samples_there_is_no_verdict() -> None:
    for seed in range(20):
        said = found(lobe_um=0j, noise_um=0.3, seed=seed)
        assert (said.sign, said.why) == (Sign.UNKNOWN, ForceNullReason.ROUND)
    nothing = ForceRecord(angle_deg=np.empty(0), infeed_um=np.empty(0), thrust_n=np.empty(0), face_deg=0.0)
    assert force_null(nothing, EXPECTED).why is ForceNullReason.NOT_GATHERED
    assert force_null(cut(), replace(EXPECTED, whole_um=0j)).why is ForceNullReason.NOT_GATHERED


@pytest.mark.parametrize(
    ("cutting", "why"),
    [
        ({"stiffness": 0.0}, ForceNullReason.NO_FORCE),
        ({"stiffness": 0.0, "noise_um": 0.3}, ForceNullReason.NO_FORCE),
        ({"air_turns": 1.5}, ForceNullReason.NO_REFERENCE),
        ({"noise_um": 2.5}, ForceNullReason.NOISE),
        ({"lobe_um": 3.0 * WHOLE_UM}, ForceNullReason.TOO_LARGE),
    ],
)
def test_what_cannot_be_told_says_why(cutting: dict[str, object], why: ForceNullReason) -> None:
    said = found(**cutting)
    assert (said.sign, said.why, said.alarms) == (Sign.UNKNOWN, why, False)


# The push of the cut, found from a course of errors that is integrated here, step by step, from the loop.

FEED_MM_PER_S = 0.05 * 1000.0 / 60.0
STIFFNESS_N_PER_UM = 147.6e-6 * 54.5 * 11.45  # Kp times the thrust of a volt, of the published loop
INTEGRAL_S = 147.6 / 32.3
SAMPLES_S = 0.001


@pytest.fixture
def job() -> Job:
    return load_job("lee-2001-experiment-1").job


@pytest.fixture
def machine() -> MachineProfile:
    return load_machine("lee-2001-lathe").machine


def errors_um(force_n: float, made_up_um: float, per_um: float, at_mm: np.ndarray) -> np.ndarray:
    """How far the tool is out, by Euler steps: spring, integrator, a force that falls with the depth, and a path
    that makes up for `made_up_um` as its own model of the integrator says."""
    taken_n = model_um = 0.0
    places, found = [], []
    for step in range(round(8.4 / FEED_MM_PER_S / SAMPLES_S)):
        offset_um = made_up_um - model_um
        # force(depth) = spring * following error + integrator, with the tool `out` of its target
        out_um = (force_n - taken_n - STIFFNESS_N_PER_UM * offset_um) / (STIFFNESS_N_PER_UM + per_um)
        taken_n += STIFFNESS_N_PER_UM * (out_um + offset_um) / INTEGRAL_S * SAMPLES_S
        model_um += offset_um / INTEGRAL_S * SAMPLES_S
        places.append(step * SAMPLES_S * FEED_MM_PER_S - 4.2)  # from the first contact of a land of 0.4 mm
        found.append(out_um)
    return np.asarray(np.interp(at_mm, places, found))


def test_the_push_is_that_which_leaves_nothing(job: Job, machine: MachineProfile) -> None:
    at_mm = np.arange(-3.8, 3.9, 0.25)
    per_um = 2.96 / 100.0  # docs/plant.md: 2.96 N at 0.1 mm
    plain = errors_um(2.96, 0.0, per_um, at_mm)
    assert plain[0] > 20.0 and plain[-1] < 6.0
    push = left_push(job, machine, list(at_mm), list(plain + 3.0))  # 3 um of size are no push
    assert push.um == pytest.approx(2.96 / STIFFNESS_N_PER_UM, rel=0.01)
    assert push.in_middle_um == pytest.approx(float(errors_um(2.96, 0.0, per_um, np.array([0.0]))[0]), rel=0.01)
    assert np.abs(errors_um(2.96, push.um, per_um, at_mm)).max() < 0.5


def test_of_a_cut_that_is_short_against_the_decay_nothing_is_concluded(job: Job, machine: MachineProfile) -> None:
    """In 1.3 of 4.8 mm a tool that gives way by 2 um more and more looked like a push of several times that."""
    at_mm = np.arange(-3.8, -2.5, 0.02)
    drifting = 0.02 * np.random.default_rng(1).normal(size=len(at_mm)) - 2.0 * (at_mm + 3.8) / 1.3
    assert left_push(job, machine, list(at_mm), list(drifting)) == NO_PUSH


def test_what_does_not_stand_out_is_no_push(job: Job, machine: MachineProfile) -> None:
    at_mm = list(np.arange(-3.8, 3.9, 0.25))
    noise = list(np.random.default_rng(1).normal(0.0, 1.0, len(at_mm)))
    assert left_push(job, machine, at_mm, noise) == NO_PUSH
    assert left_push(job, machine, at_mm[:4], [20.0, 18.0, 16.0, 15.0]) == NO_PUSH
    stiff = replace(machine, tool=replace(machine.tool, gain_kp_v_per_m=766.0, gain_ki_v_per_m_s=15326.0))
    assert left_push(job, stiff, at_mm, [6.0 * np.exp(-(at + 4.2)) for at in at_mm]) == NO_PUSH
