"""What a cut leaves by its force: the null of that at half the path, and the push of the cut."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from profiles.arrays import Floats
from profiles.compensations.force_null import (
    ExpectedForce,
    ForceNull,
    ForceNullReason,
    ForceRecord,
    Sign,
    force_null,
)
from profiles.compensations.push import NO_PUSH, left_push
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

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
