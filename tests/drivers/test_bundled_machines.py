"""The bundled machines: one lathe behind two controllers, and nothing of them is left to guess."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.link.address import EthernetAddress, parse_address
from drivers.pmac.dialect import DIALECTS, Dialect, Setting
from drivers.pmac.settings import settings_with
from profiles.machine import MachineProfile
from profiles.store import list_machines, load_machine

PAPER, TURBO = "lee-2001-lathe", "turbo-ethernet-lathe"
KILL_MODE, ONLY_ITSELF = 0b11 << 21, 0b10 << 21
NO_TRAVEL_SWITCHES = 1 << 17

every_machine = pytest.mark.parametrize("name", [entry.name for entry in list_machines()])


def dialect_of(machine: MachineProfile) -> Dialect:
    return DIALECTS[machine.controller.family]


def test_the_turbo_moves_the_iron_of_the_paper() -> None:
    paper, turbo = load_machine(PAPER).machine, load_machine(TURBO).machine
    # Chuck and tool, too: it is one lathe, and a lobe that was found on it is that of both.
    names = ("tool", "spindle", "carriage", "chuck", "heartbeat", "safety")
    assert replace(turbo, **{name: getattr(paper, name) for name in names}) == turbo
    assert turbo.tool.name and turbo.chuck.name
    assert turbo.controller.axis_definitions == paper.controller.axis_definitions


def test_the_turbo_is_set_as_the_pmac_is() -> None:
    """Each setting of the PMAC has its place on a Turbo; the flags of a channel are another word there."""
    paper, turbo = load_machine(PAPER).machine, load_machine(TURBO).machine
    dialect = dialect_of(turbo)
    target = settings_with(paper.controller.variables, dialect)
    found = settings_with(turbo.controller.variables, dialect)
    flags = {dialect.index(Setting.FLAG_MODE, motor) for motor in (1, 2, 3)}
    differing = {
        index for index in target.keys() | found.keys() if target.get(index, 0.0) != found.get(index, 0.0)
    }
    assert differing == flags | {40}
    for index in flags:
        assert int(found[index]) >> 16 == int(target[index]) >> 16


def test_the_turbo_watchdog_trips_after_a_tenth_of_a_second() -> None:
    """Turbo Software Reference: 4096 servo cycles, 1.8 s, unless I40 says how many."""
    controller = load_machine(TURBO).machine.controller
    assert controller.variables["I40"] * controller.servo_period_ms == pytest.approx(100.0, abs=0.5)


def test_the_turbo_is_looked_for_where_its_board_leaves_the_factory() -> None:
    assert parse_address(load_machine(TURBO).machine.link) == EthernetAddress(host="192.6.94.5")


@every_machine
def test_a_fault_of_one_motor_leaves_the_tool_to_retract(name: str) -> None:
    machine = load_machine(name).machine
    dialect = dialect_of(machine)
    settings = settings_with(machine.controller.variables, dialect)
    axes = {axis: getattr(machine, axis).motor for axis in ("tool", "spindle", "carriage")}
    modes = {axis: int(settings[dialect.index(Setting.FLAG_MODE, motor)]) for axis, motor in axes.items()}
    assert {mode & KILL_MODE for mode in modes.values()} == {ONLY_ITSELF}
    assert {axis for axis, mode in modes.items() if mode & NO_TRAVEL_SWITCHES} == {"spindle"}


@every_machine
def test_no_device_is_unknown_and_the_signature_is_for_the_simulated_lathe(name: str) -> None:
    machine = load_machine(name).machine
    assert set(machine.safety.devices.values()) == {"not fitted"}
    assert "simulated" in machine.safety.signed_by
    assert {f"safety.{device}" for device in machine.safety.devices} <= set(machine.assumed)


@every_machine
def test_without_its_console_a_cut_takes_the_tool_out(name: str) -> None:
    machine = load_machine(name).machine
    assert machine.heartbeat.policy == "retract"
    # A turn at 100 rpm takes 600 ms; the way out of 2 mm at 10 mm/s 200 ms and its ramps.
    assert machine.heartbeat.grace_ms >= 600.0 + 200.0 + 2 * 100.0
