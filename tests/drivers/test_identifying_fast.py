"""Fast sines that a slow swing carries: what is commanded, and what is found up to 900 Hz."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.cutting.strategy import Strategy
from drivers.identification.excitation import CARRIER_HZ, carried_scales, carrier_hz
from drivers.simulator.plant.true_parameters import ideal
from profiles.axis.identification import frequency_response
from profiles.axis.sampled_loop import AxisPlant, FlexibleMode, loop_of
from profiles.axis.servo import sampled_response
from profiles.machine import MachineProfile
from tests.drivers.commissioned import ready
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine
from tests.drivers.test_identifying import found


@pytest.mark.parametrize("hz", [240.0, 450.0, 700.0, 900.0])
def test_points_of_a_millisecond_make_a_sine_and_nothing_of_its_image(hz: float) -> None:
    """By the discrete Fourier transform of cubics through 1000 points, a second, at 16 kHz."""
    from scipy.interpolate import CubicHermiteSpline

    position, velocity = carried_scales(0.002 * math.pi * hz)
    t, omega = np.arange(1001) / 1000.0, 2.0 * math.pi * hz
    cubics = CubicHermiteSpline(t, position * np.sin(omega * t), velocity * omega * np.cos(omega * t))
    size = 2.0 * np.abs(np.fft.rfft(cubics(np.arange(16_000) / 16_000.0))) / 16_000
    assert size[round(hz)] == pytest.approx(1.0, abs=1e-3)
    assert size[round(1000.0 - hz)] < 1e-3


def test_a_carrier_and_what_it_makes_of_friction_are_not_in_the_response(machine: MachineProfile) -> None:
    """A response of 0.01 under a swing with odd multiples, as dry friction makes them."""
    hz = 700.0
    slow_hz = carrier_hz(machine, hz)
    assert slow_hz is not None and slow_hz == pytest.approx(CARRIER_HZ, rel=0.05)
    t = np.arange(4518) * machine.controller.servo_period_ms / 1000.0
    slow = 2.0 * math.pi * slow_hz * t
    given = 10.0 * np.sin(2.0 * math.pi * hz * t) + 25.0 * np.sin(slow)
    answered = 0.1 * np.sin(2.0 * math.pi * hz * t - 1.0) + 25.0 * np.sin(slow - 0.5)
    for n in range(3, 31, 2):
        answered += 2.0 / n**3 * np.cos(n * slow)
    response = frequency_response(t, given, answered, hz, slow_hz)
    assert response.gain == pytest.approx(0.01, rel=0.01)
    assert response.phase_deg == pytest.approx(math.degrees(-1.0), abs=0.5)
    assert response.coherence > 0.999


@ON_ONE
def test_the_nominal_loop_is_found_up_to_900_hz(machine: MachineProfile) -> None:
    """Off by the steps of the encoder at most: a tenth of a count of 0.2 um."""
    identified = found(ready(machine), Strategy.PVT, 240.0, 450.0, 900.0, amplitude_um=20.0, periods=60)
    for point in identified.points:
        off = abs(
            cmath.rect(point.gain, math.radians(point.phase_deg))
            - complex(sampled_response(machine, point.frequency_hz))
        )
        assert off < point.gain_ci + 0.1 * machine.tool.count_um / point.amplitude_um
        assert point.amplitude_um == pytest.approx(20.0, rel=0.01)


@ON_ONE
def test_a_mode_and_a_lag_are_found_as_they_are(machine: MachineProfile) -> None:
    """A tool of 6 kg; with the mass of the profile its loop would be unstable."""
    tool = machine.tool
    true = replace(
        ideal(machine),
        moving_mass_kg=6.0,
        flexible_hz=300.0,
        flexible_damping=0.02,
        flexible_fraction=0.4,
        current_lag_s=4e-4,
    )
    plant = AxisPlant(
        acceleration_per_v=tool.loop_gain_n_per_v / 6.0,
        damping_per_s=tool.damping_n_s_per_m / 6.0,
        lag_s=4e-4,
        modes=(FlexibleMode(hz=300.0, damping_ratio=0.02, fraction=0.4),),
    )
    hz = (280.0, 320.0, 600.0)
    identified = found(ready(machine, true), Strategy.PVT, *hz, amplitude_um=10.0, periods=60)
    for point, target in zip(identified.points, loop_of(machine, plant).closed_loop(hz), strict=True):
        off = abs(cmath.rect(point.gain, math.radians(point.phase_deg)) - target)
        assert off < point.gain_ci + 0.1 * tool.count_um / point.amplitude_um
