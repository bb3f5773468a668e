"""Gains and filters that are designed, and the envelope of a tool."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from profiles.axis.envelope import envelope, envelope_row, first_beyond
from profiles.axis.loop_design import GainProposal, designed_gains, softer, unseen_hz
from profiles.axis.margins import loop_margins
from profiles.axis.notch import OTHER_READINGS, RESOLUTION, Notch, SignConvention, damped_pair, placed_notch
from profiles.axis.notch_design import LEAST_STIFFER, design_with_notch, fails_otherwise, lobe_yield
from profiles.axis.plant_fit import LoopPoint, PlantFit, fitted_plant
from profiles.axis.sampled_loop import AxisPlant, FlexibleMode, SampledLoop, loop_of, profile_plant
from profiles.axis.servo import eq9_response, sampled_response, tool_compliance_um_per_n
from profiles.axis.servo_gains import (
    PidGains,
    gains_from_variables,
    meant_gains,
    notch_settings,
    variables_from_gains,
)
from profiles.axis.stiffness import lobe_stiffness, tripping_friction_n
from profiles.machine import ONE_LOBE, MachineProfile
from profiles.store import load_job, load_machine
from tests.profiles.test_margins import opened_by_control

if TYPE_CHECKING:
    import control

MACHINE = load_machine("lee-2001-lathe").machine
LOOP, NOMINAL = loop_of(MACHINE), profile_plant(MACHINE)
THRUST = MACHINE.tool.loop_gain_n_per_v
SLOW = (25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 95.0)
FAST = (60.0, 75.0, 90.0, 105.0, 120.0, 135.0, 150.0, 165.0, 180.0, 195.0, 210.0, 225.0)
BENDS = FlexibleMode(hz=300.0, damping_ratio=0.02, fraction=0.4)


def opened(true: AxisPlant, gains: PidGains, hz: float, more_damping_per_s: float = 0.0) -> complex:
    """The opened loop at one frequency, one period late, with backward differences.

    Hold and sampling by their definition: the sum of P(s) / s over all aliases of s, times (1 - 1/z) / T.
    """
    period_s, a = LOOP.period_s, true.acceleration_per_v
    s = 2j * np.pi * (hz + np.arange(-400, 401) / period_s)
    plant = a / (s * (s + true.damping_per_s + more_damping_per_s))
    for mode in true.modes:
        omega = 2.0 * math.pi * mode.hz
        plant = plant + mode.fraction * a / (s**2 + 2.0 * mode.damping_ratio * omega * s + omega**2)
    z = np.exp(2j * np.pi * hz * period_s)
    slope = (1.0 - 1.0 / z) / period_s
    sampled = slope * np.sum(plant / s)
    back = gains.kp_v_per_m + gains.ki_v_per_m_s / slope + gains.kd_v_s_per_m * slope
    return complex(sampled * back / z * np.exp(-2j * np.pi * hz * true.delay_s))


def points(
    true: AxisPlant,
    hz: tuple[float, ...],
    amplitude_um: float,
    *,
    friction_n: float = 0.0,
    gains: PidGains = LOOP.gains,
) -> list[LoopPoint]:
    """Responses of the loop with 0.5 % of noise; friction as 4 F / (pi X w) of damping, iterated."""
    found, rng = [], np.random.default_rng(3)
    for f in hz:
        response = 1.0 + 0.0j
        for _ in range(40 if friction_n else 1):
            moved_m_s = amplitude_um * 1e-6 * abs(response) * 2.0 * math.pi * f
            more = 4.0 * friction_n / (math.pi * moved_m_s) * true.acceleration_per_v / THRUST
            loop = opened(true, gains, f, more)
            response = 0.5 * response + 0.5 * loop / (1.0 + loop) if friction_n else loop / (1.0 + loop)
        noise = 1.0 + 0.005 * complex(rng.normal(), rng.normal())
        point = LoopPoint(
            gains=gains, hz=f, response=response * noise, gain_ci=0.01 * abs(response), amplitude_um=amplitude_um
        )
        found.append(point)
    return found


@cache
def fit_of(true: AxisPlant, *, friction_n: float = 0.0, fast: tuple[float, ...] = FAST) -> PlantFit:
    slow = points(true, SLOW, 50.0, friction_n=friction_n)
    found = fitted_plant(LOOP, slow + points(true, fast, 35.0, friction_n=friction_n))
    assert found is not None
    return found


def by_control(loop: SampledLoop) -> tuple[bool, float]:
    """Return stability and sensitivity peak of a loop without an extra delay, by python-control."""
    import control

    other = opened_by_control(loop)
    system = control.ss(other)  # whose `feedback` is no state space with every version of what it rests on
    poles = np.linalg.eigvals(system.A - system.B @ system.C / (1.0 + system.D))
    at = np.exp(2j * np.pi * np.geomspace(0.5, 0.999 * loop.nyquist_hz, 4000) * loop.period_s)
    return bool((np.abs(poles) < 1.0).all()), float((1.0 / np.abs(1.0 + other(at))).max())


def test_mass_friction_and_delay_come_out_of_two_amplitudes_or_gains() -> None:
    true = AxisPlant(acceleration_per_v=NOMINAL.acceleration_per_v / 1.1, damping_per_s=34.0, delay_s=2e-4)
    found = fit_of(true, friction_n=3.0)
    assert found.holds and found.plant.modes == ()
    assert found.plant.acceleration_per_v == pytest.approx(true.acceleration_per_v, rel=0.03)
    assert found.plant.delay_s == pytest.approx(2e-4, abs=4e-5)
    assert THRUST * found.friction_v == pytest.approx(3.0, abs=1.0)
    assert fitted_plant(LOOP, points(true, SLOW[:4], 50.0)) is None, "too few frequencies"
    half = replace(LOOP.gains, kp_v_per_m=0.5 * LOOP.gains.kp_v_per_m)
    both = fitted_plant(LOOP, points(NOMINAL, SLOW, 50.0) + points(NOMINAL, FAST, 35.0, gains=half))
    assert both is not None and both.holds
    assert both.plant.acceleration_per_v == pytest.approx(NOMINAL.acceleration_per_v, rel=0.02)


@pytest.mark.first(1)
@pytest.mark.parametrize("fraction", [0.4, 0.05, -0.1])
def test_a_mode_above_the_measured_frequencies_is_found(fraction: float) -> None:
    """Nothing above 225 Hz was measured; it bends at 300 Hz, and what it does below shows it."""
    found = fit_of(replace(NOMINAL, modes=(replace(BENDS, fraction=fraction),)))
    (mode,) = found.plant.modes
    assert mode.hz == pytest.approx(300.0, rel=0.08)
    assert mode.fraction == pytest.approx(fraction, rel=0.4)


def test_gains_for_a_rigid_axis_are_five_times_as_stiff_within_the_margins() -> None:
    """10.9 um/N of the published gains; 8 N of friction trip those (150 um of following error), and not these."""
    found = designed_gains(MACHINE, LOOP, fit_of(NOMINAL), 50.0)
    assert found is not None
    tuned = replace(LOOP, gains=found.gains)
    stable, peak = by_control(tuned)
    assert stable and peak <= 1.85
    margins = loop_margins(tuned)
    assert (margins.phase_margin_deg or 0.0) >= 44.0 and (margins.gain_margin or 0.0) >= 2.4
    before, after = lobe_stiffness(LOOP, THRUST, 50.0), lobe_stiffness(tuned, THRUST, 50.0)
    assert after.most_um_per_n < before.most_um_per_n / 4.5
    assert tripping_friction_n(before, 150.0) < 8.0 < 25.0 < tripping_friction_n(after, 150.0)
    variables = {**MACHINE.controller.variables, **found.settings}
    machine = replace(MACHINE, controller=replace(MACHINE.controller, variables=variables))
    assert gains_from_variables(machine) == found.gains, "in the whole numbers of the controller"


@pytest.mark.parametrize(("heavier", "delay_s"), [(1.06, 0.0), (0.94, 3e-5)])
def test_the_margins_hold_on_an_axis_that_is_not_quite_the_fitted_one(heavier: float, delay_s: float) -> None:
    found = designed_gains(MACHINE, LOOP, fit_of(NOMINAL), 50.0)
    assert found is not None
    plant = replace(NOMINAL, acceleration_per_v=NOMINAL.acceleration_per_v / heavier, delay_s=delay_s)
    margins = loop_margins(replace(LOOP, gains=found.gains, plant=plant))
    assert margins.stable and margins.sensitivity_peak <= 2.0


def test_the_design_for_a_rigid_axis_would_make_one_that_bends_oscillate_and_is_not_proposed() -> None:
    """By python-control: unstable with the gains for the rigid axis, stable with those for the axis that bends."""
    bent = replace(NOMINAL, modes=(BENDS,))
    rigid = designed_gains(MACHINE, LOOP, fit_of(NOMINAL), 50.0)
    assert rigid is not None and by_control(replace(LOOP, plant=bent, gains=rigid.gains))[0] is False
    fit = fit_of(bent)
    found = designed_gains(MACHINE, replace(LOOP, plant=fit.plant), fit, 50.0)
    assert found is not None
    stable, peak = by_control(replace(LOOP, plant=bent, gains=found.gains))
    assert stable and peak <= 2.0
    assert by_control(replace(LOOP, plant=bent))[1] > 3.0, "which the published gains do not even have"


def test_responses_without_a_mode_refuse_faster_gains_and_softer_ones_have_less() -> None:
    known, slow = fit_of(NOMINAL), fitted_plant(LOOP, points(NOMINAL, SLOW, 50.0))
    assert slow is not None
    faster = replace(LOOP.gains, kp_v_per_m=600.0, ki_v_per_m_s=6000.0, kd_v_s_per_m=3.4)
    hidden = unseen_hz(LOOP, faster, slow)
    assert hidden is not None and hidden > 95.0
    assert unseen_hz(LOOP, faster, known) is None
    # What would be hidden there really makes it oscillate: the smallest mode that 95 Hz does not show by 5 %.
    fraction = 0.05 * ((300.0 / 95.0) ** 2 - 1.0)
    bent = replace(NOMINAL, modes=(FlexibleMode(hz=300.0, damping_ratio=0.02, fraction=fraction),))
    assert by_control(replace(LOOP, plant=bent, gains=faster))[0] is False
    half = replace(LOOP.gains, kp_v_per_m=0.5 * LOOP.gains.kp_v_per_m, kd_v_s_per_m=0.5 * LOOP.gains.kd_v_s_per_m)
    assert softer(LOOP, half) and softer(LOOP, LOOP.gains)
    assert not softer(LOOP, replace(LOOP.gains, kd_v_s_per_m=1.1 * LOOP.gains.kd_v_s_per_m))


# Gains with a notch filter: as stiff as said, safe under every reading, and none where it is not worth it.

NOTCH = Notch(n1=-0.9375, n2=0.8125, d1=-0.125, d2=0.1875)
NOTCHED = replace(LOOP, gains=replace(LOOP.gains.scale_gains(1.0 / NOTCH.at_rest), notch=NOTCH))


def notch_by_control(loop: SampledLoop) -> control.TransferFunction:
    """L from the published parts, each as a transfer function of python-control."""
    import control

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
    import control

    poles = control.poles(control.feedback(notch_by_control(loop), 1.0))
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
    import control

    hz = np.array([5.0, 50.0, 120.0, 290.0, 310.0, 700.0])
    loop = replace(NOTCHED, plant=replace(NOMINAL, modes=(BENDS,)))
    wanted = notch_by_control(loop)(np.exp(2j * np.pi * hz * loop.period_s))
    assert np.abs(loop.open_loop(hz) / wanted - 1.0).max() < 1e-6
    assert np.abs(loop.poles()).max() == pytest.approx(
        float(np.abs(control.poles(control.feedback(notch_by_control(loop), 1.0))).max()), abs=1e-4
    )


@pytest.mark.parametrize("delay_s", [0.0001, 0.0006])
def test_a_delay_of_the_axis_is_in_what_a_step_is_compared_with(delay_s: float) -> None:
    hz = np.array([5.0, 20.0, 40.0, 80.0])
    loop = replace(NOTCHED, plant=replace(NOMINAL, delay_s=delay_s))
    z = np.exp(2j * np.pi * hz * loop.period_s)
    above, below = loop.closed_polynomials(delayed=True)
    assert np.abs(np.polyval(above, z) / np.polyval(below, z) / loop.closed_loop(hz) - 1.0).max() < 0.01
    above, below = loop.force_polynomials()
    s = 2j * np.pi * hz
    pushed = NOMINAL.acceleration_per_v / (s * (s + NOMINAL.damping_per_s)) / (1.0 + loop.open_loop(hz))
    held = pushed * np.exp(-0.5 * s * loop.period_s)  # a force that is held is half a period late
    assert np.abs(np.polyval(above, z) / np.polyval(below, z) / held - 1.0).max() < 0.02


def test_a_profile_has_its_filter_in_what_a_cut_inverts_and_at_rest() -> None:
    settings = {**variables_from_gains(MACHINE, NOTCHED.gains), **notch_settings(MACHINE, NOTCH)}
    controller = replace(MACHINE.controller, variables={**MACHINE.controller.variables, **settings})
    machine = replace(MACHINE, controller=controller)
    assert gains_from_variables(machine).notch == NOTCH
    plain = replace(LOOP, gains=gains_from_variables(machine))
    assert complex(sampled_response(machine, 50.0)) == pytest.approx(complex(plain.closed_loop(50.0)), rel=1e-9)
    assert abs(complex(sampled_response(machine, 50.0)) - complex(sampled_response(MACHINE, 50.0))) > 0.01
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


def test_a_filter_scales_with_its_gains_and_an_axis_without_a_mode_gets_none() -> None:
    for each in placed_notch(300.0, 0.1, 450.0, 0.8, 0.0004427).coefficients:
        assert each % RESOLUTION == 0.0 and round(each, 10) == each and (each * 2**22).is_integer()
    rigid = fit_of(NOMINAL)
    loop = replace(LOOP, plant=rigid.plant)
    assert design_with_notch(MACHINE, loop, rigid, 50.0, None, proven=True) is None
    gains = PidGains(kp_v_per_m=2.0, ki_v_per_m_s=0.0, kd_v_s_per_m=1.0, velocity_feedforward_v_s_per_m=1.0)
    assert replace(gains, notch=NOTCH).at_rest.kp_v_per_m == pytest.approx(2.0 * 0.875 / 1.0625)
    assert gains.at_rest is gains


def test_a_first_filter_is_stiffer_and_stable_under_every_reading_by_python_control() -> None:
    alone, first, _ = designs()
    before, after = (lobe_stiffness(tuned(each), THRUST, 50.0) for each in (alone, first))
    assert after.most_um_per_n < 0.8 * before.most_um_per_n
    assert lobe_yield(tuned(first), 50.0) <= LEAST_STIFFER * lobe_yield(tuned(alone), 50.0)
    for plant in (fit().plant, *fit().others):
        for reading in SignConvention:
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
    wrong = replace(proven.gains, notch=proven.gains.notch.read_as(SignConvention.NUMERATOR))
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


# How fast a lobe may be cut: tabulated speeds for each limit of the paper's tool axis with three jaws.

JOB = load_job("lee-2001-experiment-1").job
LATHE = load_machine("lee-2001-lathe").machine

TABLE = """
5    | 28500 | 15301 | 28542 | 22507 | 16282 | 11078
16.5 | 15688 | 8423  | 15711 | 12390 | 10905 | 7396
27.5 | 12152 | 6524  | 12170 | 9597  | 9179  | 6210
50   | 9012  | 4838  | 9025  | 7117  | 7494  | 5050
100  | 6372  | 3420  | 6381  | 5032  | 5911  | 3955
200  | 4505  | 2417  | 4511  | 3558  | 4645  | 3073
500  | 2848  | 1527  | 2852  | 2250  | 3346  | 2158
1000 | 2013  | 1077  | 2015  | 1591  | 2581  | 1611
"""
ROWS = [[float(word) for word in line.split("|")] for line in TABLE.strip().splitlines()]


def with_bus(volts: float | None) -> MachineProfile:
    return replace(LATHE, tool=replace(LATHE.tool, bus_voltage_v=volts))


@pytest.mark.parametrize("row", ROWS, ids=[f"{row[0]:g} um" for row in ROWS])
def test_speeds(row: list[float]) -> None:
    amplitude_um, *speeds = row
    high, low = (envelope_row(with_bus(volts), amplitude_um, 3).rpm for volts in (300.0, 100.0))
    names = ("peak_thrust", "heat", "current", "encoder_acceleration", "voltage")
    met = [*(high[name] for name in names), low["voltage"]]
    assert met == pytest.approx(speeds, rel=2e-4, abs=1.0)


@pytest.mark.parametrize(("share", "rpm"), [(0.02, 29), (0.05, 69), (0.10, 126), (0.20, 230), (0.50, 590)])
def test_a_plain_sine_through_eq_9(share: float, rpm: float) -> None:
    hz = first_beyond(lambda f: np.abs(1 - eq9_response(LATHE, f)), share, 1000.0)
    assert hz is not None
    assert 20 * hz == pytest.approx(rpm, abs=0.6)


def test_the_job_stands_in_the_envelope_of_its_tool() -> None:
    """At 50 Hz 27.5 um need 13 of 2000 N: nothing of the motor binds, but how far the command runs ahead does."""
    even = replace(LATHE, chuck=replace(LATHE.chuck, lobe_along=ONE_LOBE))
    found = envelope(JOB, even)
    assert "voltage" not in found.at_job.rpm
    assert found.at_job.binding == "following_error"
    assert found.percent["following_error"] == pytest.approx(100_000 / found.at_job.rpm["following_error"])
    assert found.percent["peak_thrust"] == pytest.approx(100 * 1000 / 12152, rel=1e-3)
    assert found.plain_sine_rpm is not None and found.plain_sine_rpm < 150
    six = envelope(replace(JOB, jaws=6), even)
    assert six.at_job.rpm["heat"] == pytest.approx(found.at_job.rpm["heat"] / 2)
    assert envelope(replace(JOB, lobe_error_um_pp=0.0), even).plain_sine_rpm is None
    pushed = tool_compliance_um_per_n(LATHE, [10.0, 50.0])
    assert np.abs(pushed) == pytest.approx([7.545, 1.4951], abs=5e-4)
    assert np.degrees(np.angle(pushed[1])) == pytest.approx(-124.2, abs=0.05)
    proportional = replace(LATHE, tool=replace(LATHE.tool, gain_ki_v_per_m_s=0.0))
    assert tool_compliance_um_per_n(proportional, 0.0) == pytest.approx(10.857, abs=5e-4)
