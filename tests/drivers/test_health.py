"""The health test on the simulated lathe: what it finds, what it refuses, and that it leaves all as it was."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.commissioning.reading import read_configuration, whole_card
from drivers.errors import RefusedError
from drivers.identification.health import (
    HealthRequest,
    HealthResult,
    as_table,
    check_health,
    from_table,
    health_problems,
)
from drivers.lathe.stop import StoppedError
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import load_machine
from profiles.strict_values import renamed
from tests.drivers.families import machine as machine  # both families
from tests.drivers.identification_bench import Stand, ready

DATE = "2001-11-30T14:05:00.000Z"


def checked(stand: Stand, **changes: float) -> HealthResult:
    return check_health(stand.rig, HealthRequest(**changes), stand.origin, DATE)


@pytest.mark.first(1)
def test_the_nominal_tool_is_as_its_model_and_everything_is_as_before(machine: MachineProfile) -> None:
    stand = ready(machine)
    before = read_configuration(stand.rig.client, stand.rig.dialect, whole_card(stand.rig.dialect))
    found = checked(stand)
    step, model = found.step, found.model
    count_um = machine.tool.count_um
    assert step.size_um == pytest.approx(25.0, abs=0.1)
    assert step.rise_ms == pytest.approx(model.step.rise_ms, abs=0.3)
    assert step.overshoot_percent == pytest.approx(model.step.overshoot_percent, abs=100 * 2 * count_um / 25.0)
    assert step.settling_ms == pytest.approx(model.step.settling_ms, abs=2.0)
    assert found.parabola.peak_um == pytest.approx(model.parabola.peak_um, abs=2 * count_um)
    assert found.parabola.rms_um == pytest.approx(model.parabola.rms_um, abs=count_um)
    # 40 Hz, by the sampled loop: tests/drivers/test_identifying.py has 30 and 50 Hz.
    assert found.sine.gain == pytest.approx(model.gain, rel=0.002)
    assert found.sine.phase_deg == pytest.approx(model.phase_deg, abs=0.2)
    assert 0.88 < model.gain < 0.99
    # The step in the samples that are kept; the tool is back at its zero, nothing of ours is left.
    assert max(found.reference_um) == pytest.approx(25.0, abs=0.05)
    after = read_configuration(stand.rig.client, stand.rig.dialect, whole_card(stand.rig.dialect))
    assert after.settings == before.settings and stand.rig.client.request("LIST PROG998") in (
        (),
        ("",),
        ("RET",),
    )
    snapshot = stand.rig.lathe.snapshot()
    assert abs(snapshot.tool.position) <= 2.0 and snapshot.at_rest and snapshot.loops_closed
    assert from_table(renamed(as_table(found), {})) == found


def test_a_heavier_tool_with_friction_is_seen_in_the_figures() -> None:
    machine = load_machine("lee-2001-lathe").machine
    true = ideal(machine)
    heavy = replace(true, moving_mass_kg=1.2 * true.moving_mass_kg, coulomb_friction_n=1.0)
    found = checked(ready(machine, heavy))
    # 20 % more mass needs 20 % more of the error that accelerates it.
    assert found.parabola.rms_um > 1.1 * found.model.parabola.rms_um
    assert abs(found.sine.phase_deg - found.model.phase_deg) > 2.0


@pytest.mark.parametrize(("step_um", "code"), [(51.0, "identify.amplitude"), (1.0, "identify.amplitude")])
def test_what_is_too_large_or_too_small_is_refused_before_anything_is_sent(step_um: float, code: str) -> None:
    machine = load_machine("lee-2001-lathe").machine
    assert [p.code for p in health_problems(HealthRequest(step_um=step_um), machine)] == [code]
    weak = replace(
        machine, controller=replace(machine.controller, variables={**machine.controller.variables, "I111": 300})
    )
    assert "I111" in {p.key for p in health_problems(HealthRequest(), weak)}


def test_with_the_drives_off_nothing_moves(machine: MachineProfile) -> None:
    stand = ready(machine)
    stand.rig.lathe.switch_off()
    stand.line.heard = b""
    with pytest.raises(RefusedError) as refused:
        checked(stand)
    assert refused.value.problems[0].code == "machine.not_enabled"
    assert not any("B998" in line or "OPEN" in line for line in stand.lines)


@pytest.mark.parametrize("after_s", [0.3, 1.3, 2.4])
def test_a_stop_ends_it_at_rest_with_the_drives_off_and_nothing_left(after_s: float) -> None:
    """During the rest before, in the step, in the parabola."""
    stand = ready(load_machine("lee-2001-lathe").machine)
    stop_at_s = stand.sim.now_s() + after_s
    wait = stand.clock.wait

    def stopping(seconds: float) -> None:
        wait(seconds)
        if stand.sim.now_s() >= stop_at_s and stand.stop.reason is None:
            stand.stop.stop("space")

    stand.clock.wait = stopping  # type: ignore[method-assign]
    with pytest.raises(ProblemError) as error:
        checked(stand)
    assert isinstance(error.value, StoppedError), error.value
    assert not stand.drives_on
    assert stand.rig.client.request("LIST PROG998") in ((), ("",), ("RET",))
