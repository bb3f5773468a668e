"""The push of the cut, found from a course of errors that is integrated here, step by step, from the loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from profiles.compensations.push import NO_PUSH, left_push
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

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
