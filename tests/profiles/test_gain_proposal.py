"""The plant behind a measured response, and gains for it: what goes in comes out, and the margins hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from profiles.arrays import complexes, floats
from profiles.axis.gain_proposal import ASKED_SENSITIVITY, identified_plant, proposed_gains
from profiles.axis.margins import loop_margins
from profiles.axis.sampled_loop import AxisPlant, loop_of
from profiles.axis.servo_gains import gains_from_variables
from profiles.store import load_machine

MACHINE = load_machine("lee-2001-lathe").machine
HZ = floats([10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0])


@pytest.mark.parametrize(
    ("heavier", "damping", "delay_ms"), [(1.0, 42.5, 0.0), (1.3, 30.0, 0.2), (0.8, 60.0, 0.5)]
)
def test_the_plant_of_a_response_is_the_one_that_made_it(heavier: float, damping: float, delay_ms: float) -> None:
    nominal = loop_of(MACHINE)
    true = AxisPlant(
        acceleration_per_v=nominal.plant.acceleration_per_v / heavier,
        damping_per_s=damping,
        delay_s=delay_ms / 1000.0,
    )
    rng = np.random.default_rng(1)
    noise = 1.0 + 2e-4 * (rng.normal(size=HZ.size) + 1j * rng.normal(size=HZ.size))
    found = identified_plant(nominal, HZ, complexes(replace(nominal, plant=true).closed(HZ) * noise))
    assert found is not None
    assert found.acceleration_per_v == pytest.approx(true.acceleration_per_v, rel=0.02)
    assert found.damping_per_s == pytest.approx(damping, abs=4.0)
    assert found.delay_s == pytest.approx(true.delay_s, abs=3e-5)
    assert identified_plant(nominal, HZ[:2], nominal.closed(HZ[:2])) is None


def test_proposed_gains_have_the_margins_in_the_whole_numbers_of_the_controller() -> None:
    loop = loop_of(MACHINE)
    found = proposed_gains(MACHINE, loop)
    assert found is not None and found.factor > 1.0
    variables = {**MACHINE.controller.variables, **found.settings}
    machine = replace(MACHINE, controller=replace(MACHINE.controller, variables=variables))
    assert gains_from_variables(machine) == found.gains
    after = loop_margins(loop_of(machine))
    assert after == found.after and after.stable
    assert after.gain_margin is not None and after.phase_margin_deg is not None
    assert (
        after.gain_margin >= 3.0 and after.phase_margin_deg >= 55.0 and after.sensitivity_peak <= ASKED_SENSITIVITY
    )
    assert (after.crossover_hz or 0.0) > (found.before.crossover_hz or 0.0)


def test_a_loop_that_is_too_fast_for_a_delay_is_slowed_down() -> None:
    late = replace(loop_of(MACHINE).plant, delay_s=0.0025)
    found = proposed_gains(MACHINE, replace(loop_of(MACHINE), plant=late))
    assert found is not None and found.factor < 1.0 and found.after.stable
