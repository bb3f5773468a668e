"""Gains with a notch filter: as stiff as said, safe under every reading, and none where it is not worth it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest

from profiles.axis.loop_design import GainProposal, designed_gains
from profiles.axis.margins import loop_margins
from profiles.axis.notch import OTHER_READINGS, RESOLUTION, Notch, Reading, damped_pair, placed_notch
from profiles.axis.notch_design import LEAST_STIFFER, design_with_notch, fails_otherwise, lobe_yield
from profiles.axis.plant_fit import PlantFit
from profiles.axis.sampled_loop import SampledLoop
from profiles.axis.servo import sampled_response
from profiles.axis.servo_gains import (
    PidGains,
    gains_from_variables,
    meant_gains,
    notch_settings,
    variables_from_gains,
)
from profiles.axis.stiffness import lobe_stiffness
from tests.profiles.test_loop_design import BENDS, LOOP, MACHINE, NOMINAL, THRUST, fit_of

NOTCH = Notch(n1=-0.9375, n2=0.8125, d1=-0.125, d2=0.1875)
NOTCHED = replace(LOOP, gains=replace(LOOP.gains.scaled(1.0 / NOTCH.at_rest), notch=NOTCH))


def by_control(loop: SampledLoop) -> control.TransferFunction:
    """L from the published parts, each as a transfer function of python-control."""
    z = control.tf([1.0, 0.0], [1.0], loop.period_s)
    plant = control.sample_system(
        control.tf([loop.plant.acceleration_per_v], [1.0, loop.plant.damping_per_s, 0.0]), loop.period_s, "zoh"
    )
    for mode in loop.plant.modes:
        w = 2.0 * np.pi * mode.hz
        above = [mode.fraction * loop.plant.acceleration_per_v]
        bends = control.tf(above, [1.0, 2.0 * mode.damping_ratio * w, w**2])
        plant = plant + control.sample_system(bends, loop.period_s, "zoh")
    gains, lead = loop.gains, (1.0 - 1.0 / z) / loop.period_s
    pid = gains.kp_v_per_m + gains.ki_v_per_m_s / lead + gains.kd_v_s_per_m * lead
    notch = gains.notch
    filtered = (1.0 + notch.n1 / z + notch.n2 / z**2) / (1.0 + notch.d1 / z + notch.d2 / z**2)
    return control.minreal(plant * pid * filtered / z, 1e-9, verbose=False)


def stable_by_control(loop: SampledLoop) -> bool:
    poles = control.poles(control.feedback(by_control(loop), 1.0))
    # What cancels lies at the poles of the sampled parts, inside: none of it can be outside.
    return bool((np.abs(poles) < 1.0 + 1e-7).all())


@cache
def fit() -> PlantFit:
    return fit_of(replace(NOMINAL, modes=(BENDS,)))


@cache
def designs() -> tuple[GainProposal, GainProposal, GainProposal]:
    """Gains alone, with a first filter, and with one for a controller whose reading is known."""
    loop = replace(LOOP, plant=fit().plant)
    alone = designed_gains(MACHINE, loop, fit(), 50.0)
    first, proven = (design_with_notch(MACHINE, loop, fit(), 50.0, alone, proven=each) for each in (False, True))
    assert alone is not None and first is not None and proven is not None
    return alone, first, proven


def tuned(found: GainProposal) -> SampledLoop:
    return replace(LOOP, plant=fit().plant, gains=found.gains)


def test_the_opened_loop_with_a_filter_is_that_of_python_control() -> None:
    hz = np.array([5.0, 50.0, 120.0, 290.0, 310.0, 700.0])
    loop = replace(NOTCHED, plant=replace(NOMINAL, modes=(BENDS,)))
    wanted = by_control(loop)(np.exp(2j * np.pi * hz * loop.period_s))
    assert np.abs(loop.opened(hz) / wanted - 1.0).max() < 1e-6
    assert np.abs(loop.poles()).max() == pytest.approx(
        float(np.abs(control.poles(control.feedback(by_control(loop), 1.0))).max()), abs=1e-4
    )


@pytest.mark.parametrize("delay_s", [0.0001, 0.0006])
def test_a_delay_of_the_axis_is_in_what_a_step_is_compared_with(delay_s: float) -> None:
    hz = np.array([5.0, 20.0, 40.0, 80.0])
    loop = replace(NOTCHED, plant=replace(NOMINAL, delay_s=delay_s))
    z = np.exp(2j * np.pi * hz * loop.period_s)
    above, below = loop.closed_polynomials(delayed=True)
    assert np.abs(np.polyval(above, z) / np.polyval(below, z) / loop.closed(hz) - 1.0).max() < 0.01
    above, below = loop.force_polynomials()
    s = 2j * np.pi * hz
    pushed = NOMINAL.acceleration_per_v / (s * (s + NOMINAL.damping_per_s)) / (1.0 + loop.opened(hz))
    held = pushed * np.exp(-0.5 * s * loop.period_s)  # a force that is held is half a period late
    assert np.abs(np.polyval(above, z) / np.polyval(below, z) / held - 1.0).max() < 0.02


def test_what_a_cut_inverts_has_the_filter_of_the_profile() -> None:
    settings = {**variables_from_gains(MACHINE, NOTCHED.gains), **notch_settings(MACHINE, NOTCH)}
    controller = replace(MACHINE.controller, variables={**MACHINE.controller.variables, **settings})
    machine = replace(MACHINE, controller=controller)
    assert gains_from_variables(machine).notch == NOTCH
    plain = replace(LOOP, gains=gains_from_variables(machine))
    assert complex(sampled_response(machine, 50.0)) == pytest.approx(complex(plain.closed(50.0)), rel=1e-9)
    assert abs(complex(sampled_response(machine, 50.0)) - complex(sampled_response(MACHINE, 50.0))) > 0.01


def test_a_profile_states_gains_at_rest_and_the_filter_beside_them() -> None:
    n1, n2, d1, d2 = NOTCH.coefficients
    tool = replace(MACHINE.tool, notch_n1=n1, notch_n2=n2, notch_d1=d1, notch_d2=d2)
    meant = meant_gains(replace(MACHINE, tool=tool))
    at_rest = (1.0 - 0.9375 + 0.8125) / (1.0 - 0.125 + 0.1875)
    assert meant.kp_v_per_m * at_rest == pytest.approx(MACHINE.tool.gain_kp_v_per_m)
    assert meant.notch == NOTCH and meant.at_rest.kd_v_s_per_m == pytest.approx(MACHINE.tool.gain_kd_v_s_per_m)


@pytest.mark.parametrize("ratio", [0.05, 0.6, 1.3])
def test_zeros_are_the_sampled_roots_of_a_damped_oscillator(ratio: float) -> None:
    """z = exp(s T), s the roots of s^2 + 2 r w s + w^2."""
    w, period_s = 2.0 * np.pi * 300.0, 0.0004427
    wanted = np.poly(np.exp(np.roots([1.0, 2.0 * ratio * w, w**2]) * period_s))
    assert damped_pair(300.0, ratio, period_s) == pytest.approx(wanted[1:].tolist())


def test_coefficients_are_in_steps_that_print_exactly_in_ten_decimals() -> None:
    for each in placed_notch(300.0, 0.1, 450.0, 0.8, 0.0004427).coefficients:
        assert each % RESOLUTION == 0.0 and round(each, 10) == each and (each * 2**22).is_integer()


def test_a_first_filter_is_stiffer_and_stable_under_every_reading_by_python_control() -> None:
    alone, first, _ = designs()
    before, after = (lobe_stiffness(tuned(each), THRUST, 50.0) for each in (alone, first))
    assert after.most_um_per_n < 0.8 * before.most_um_per_n
    assert lobe_yield(tuned(first), 50.0) <= LEAST_STIFFER * lobe_yield(tuned(alone), 50.0)
    for plant in (fit().plant, *fit().others):
        for reading in Reading:
            gains = replace(first.gains, notch=first.gains.notch.read_as(reading))
            loop = replace(LOOP, plant=replace(plant, delay_s=0.0), gains=gains)
            assert stable_by_control(loop), (reading, plant)
    for reading in OTHER_READINGS:
        gains = replace(first.gains, notch=first.gains.notch.read_as(reading))
        assert loop_margins(replace(tuned(first), gains=gains)).sensitivity_peak <= 4.0


def test_where_the_reading_is_known_the_tool_is_five_times_as_stiff_and_other_readings_would_be_unstable() -> None:
    alone, _, proven = designs()
    before, after = (lobe_stiffness(tuned(each), THRUST, 50.0) for each in (alone, proven))
    assert after.most_um_per_n < 0.2 * before.most_um_per_n
    assert stable_by_control(tuned(proven)) and proven.after.sensitivity_peak <= 1.8
    reading = fails_otherwise(tuned(proven), proven.gains, (fit().plant,))
    assert reading is not None
    wrong = replace(proven.gains, notch=proven.gains.notch.read_as(Reading.NUMERATOR))
    assert not stable_by_control(replace(tuned(proven), gains=wrong)), "so it is not what is tried first"


def test_what_is_not_allowed_is_passed_over_for_the_next_stiffest() -> None:
    loop, (alone, _, stiffest) = replace(LOOP, plant=fit().plant), designs()

    def other(gains: PidGains) -> bool:
        return abs(gains.at_rest.kp_v_per_m / stiffest.gains.at_rest.kp_v_per_m - 1.0) > 0.02

    found = design_with_notch(MACHINE, loop, fit(), 50.0, alone, proven=True, allowed=other)
    assert found is not None and found.settings != stiffest.settings and other(found.gains)
    before, after = (lobe_stiffness(tuned(each), THRUST, 50.0) for each in (alone, found))
    assert after.most_um_per_n < 0.4 * before.most_um_per_n
    refused = design_with_notch(MACHINE, loop, fit(), 50.0, alone, proven=True, allowed=lambda _: False)
    assert refused is None


def test_an_axis_without_a_mode_gets_no_filter() -> None:
    rigid = fit_of(NOMINAL)
    loop = replace(LOOP, plant=rigid.plant)
    assert design_with_notch(MACHINE, loop, rigid, 50.0, None, proven=True) is None


def test_gains_scale_with_their_filter() -> None:
    gains = PidGains(kp_v_per_m=2.0, ki_v_per_m_s=0.0, kd_v_s_per_m=1.0, velocity_feedforward_v_s_per_m=1.0)
    assert replace(gains, notch=NOTCH).at_rest.kp_v_per_m == pytest.approx(2.0 * 0.875 / 1.0625)
    assert gains.at_rest is gains
