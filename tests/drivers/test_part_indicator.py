"""The indicator on the simulated part: what it shows of a clamping, by formulas of a ring, and what is its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.store import load_job, load_machine

MACHINE = load_machine("lee-2001-lathe").machine
JOB = load_job("lee-2001-experiment-1").job


def shown(true: TrueParameters, job: Job = JOB, clampings: int = 1) -> list[ClampReadings]:
    lathe, found = SimulatedLathe(MACHINE, true), []
    for _ in range(clampings):
        lathe.mount(job)
        found.append(lathe.indicate())
    return found


def wave(readings: ClampReadings, order: int) -> complex:
    """Return an order of the spring-back by a sum over equal angles."""
    angle = np.radians(readings.angle_deg)
    sprung = np.array(readings.finger_um) - np.array(readings.full_um)
    return complex(2.0 * np.mean(sprung * np.exp(-1j * order * angle)))


def test_an_ideal_lathe_shows_the_lobe_at_rest_of_a_ring_that_is_not_yet_cut() -> None:
    (found,) = shown(ideal(MACHINE))
    # E 55 um p-p at 1000 rpm, where 3 jaws of 0.2 kg at 35 mm lose 3 * 0.2 * 0.035 * (1000 pi / 30)^2 = 230.3 N.
    loss_n = 3 * 0.2 * 0.035 * (1000 * np.pi / 30) ** 2
    at_rest = 27.5 * 1314.0 / (1314.0 - loss_n)
    assert abs(wave(found, 3)) == pytest.approx(at_rest * (2.4 / 2.5) ** 3, rel=1e-6)
    assert abs(wave(found, 2)) < 1e-9 and abs(wave(found, 1)) < 1e-9
    assert np.degrees(np.angle(wave(found, 3))) / -3 == pytest.approx(JOB.lobe_phase_deg % 120 - 120, abs=1e-6)


def test_two_clampings_differ_by_their_force_and_the_blank_drops_out() -> None:
    true = replace(
        ideal(MACHINE), clamping_force_spread=0.05, blank_oval_um_pp=20.0, blank_run_out_um=40.0, seed=5
    )
    lobes = [abs(wave(each, 3)) for each in shown(true, clampings=40)]
    assert np.std(np.log(lobes)) == pytest.approx(0.05, rel=0.3), "at rest in proportion to all of the force"
    assert all(abs(wave(each, 2)) < 1e-9 for each in shown(true, clampings=3))
    raw = np.array(shown(true)[0].finger_um)
    assert np.ptp(raw) > 20.0, "run-out and oval of the blank are in the readings"


def test_the_realistic_dial_has_graduations_play_and_noise_and_finger_tight_is_no_zero_force() -> None:
    true = plant_named("realistic", MACHINE, 4)
    (found,) = shown(true)
    assert found.simulated and found.graduation_um == 1.0 and found.finger_force_n in (60.0, 70.0)
    assert all(value == round(value) for value in (*found.finger_um, *found.full_um))
    assert len(found.angle_deg) == 32 and found.places == 16
    once, back = np.array(found.full_um[:16]), np.array(found.full_um[16:][::-1])
    assert 0.5 < np.std(once - back) < 5.0, "the play pulls both ways"


def test_places_from_jaw_1_turn_with_the_chuck() -> None:
    true = replace(ideal(MACHINE), jaw_1_deg=200.0)
    lathe = SimulatedLathe(MACHINE, true)
    with pytest.raises(RuntimeError):
        lathe.indicate()
    lathe.mount(JOB)
    found = lathe.indicate(12)
    assert found.from_jaw_1 and found.full_um[0] == pytest.approx(min(found.full_um))
    assert np.angle(wave(found, 3)) == pytest.approx(0.0, abs=1e-9)
