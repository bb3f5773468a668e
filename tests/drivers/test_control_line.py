"""What people do and see at a served lathe, asked for in a line of text or over the private channel."""

from __future__ import annotations

import json
import re

import pytest

from drivers.lathe.snapshot import AxisName
from drivers.simulator.__main__ import answer as answer_on_channel
from drivers.simulator.hosts.control_socket import answer
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench, JobMaker
from tests.drivers.test_spindle_drives import with_inverter

SECONDS_TO_800_RPM = 1.6
"""At 500 rpm/s."""


@pytest.fixture
def driven_by_hand(machine: MachineProfile) -> SimulatedLathe:
    machine = with_inverter(machine)
    return SimulatedLathe(machine, ideal(machine))


def speed_rpm(lathe: SimulatedLathe) -> float:
    """By the encoder, over a tenth of a second."""
    motor = lathe.controller.motors[2]
    before, began_s = motor.actual, lathe.now_s()
    lathe.wait(0.1)
    return (motor.actual - before) / 10_000 * 60 / (lathe.now_s() - began_s)


def asked(lathe: SimulatedLathe, **request: object) -> dict[str, object]:
    return answer_on_channel(lathe, json.dumps(request).encode() + b"\n")


@pytest.mark.parametrize("rpm", ["800", "-800", "8e2"])
def test_a_spindle_on_an_inverter_is_set_and_switched_off_in_a_line(
    driven_by_hand: SimulatedLathe, rpm: str
) -> None:
    assert answer(driven_by_hand, f"spindle {rpm}") == "ok\n"
    driven_by_hand.wait(SECONDS_TO_800_RPM + 0.1)
    assert speed_rpm(driven_by_hand) == pytest.approx(float(rpm), rel=0.02)
    assert answer(driven_by_hand, "spindle off") == "ok\n"
    driven_by_hand.wait(1.0)
    assert 0.0 < speed_rpm(driven_by_hand) / float(rpm) < 0.6


def test_a_spindle_on_an_inverter_is_set_and_switched_off_over_the_private_channel(
    driven_by_hand: SimulatedLathe,
) -> None:
    assert asked(driven_by_hand, do="spindle", rpm=800) == {}
    driven_by_hand.wait(SECONDS_TO_800_RPM + 0.1)
    assert speed_rpm(driven_by_hand) == pytest.approx(800, rel=0.02)
    assert asked(driven_by_hand, do="spindle", rpm=None) == {}
    driven_by_hand.wait(1.0)
    assert speed_rpm(driven_by_hand) < 480


@pytest.mark.parametrize("value", ["800", "off"])
def test_a_spindle_that_the_card_drives_is_not_set_by_hand(machine: MachineProfile, value: str) -> None:
    lathe = SimulatedLathe(machine)
    said = answer(lathe, f"spindle {value}")
    assert said.startswith(f"refused: spindle '{value}' is not possible; the controller drives this spindle")
    assert said.count("\n") == 1
    refused = asked(lathe, do="spindle", rpm=None if value == "off" else float(value))
    assert str(refused["refused"]).startswith("the controller drives this spindle")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("spindle 3001", "spindle '3001' is not possible; the spindle turns at most 3000 rpm"),
        ("spindle nan", "spindle 'nan' is not possible; the spindle turns at most 3000 rpm"),
        ("spindle fast", "spindle 'fast' is not possible; allowed: RPM | off"),
        ("spindle '8\u00e4\t'", "spindle '8\\xe4\\t' is not possible; allowed: RPM | off"),
        ("spindle", "command 'spindle' is not possible; allowed: list | help NAME"),
        ("spindle on at 800", "command 'spindle on at 800' is not possible"),
        ("collisions all", "command 'collisions all' is not possible"),
    ],
)
def test_what_is_no_speed_is_refused_in_one_line(driven_by_hand: SimulatedLathe, line: str, said: str) -> None:
    told = answer(driven_by_hand, line)
    assert told.startswith(f"refused: {said}")
    assert told.count("\n") == 1
    driven_by_hand.wait(1.0)
    assert speed_rpm(driven_by_hand) == 0.0


@pytest.mark.parametrize("request_", [{"rpm": "fast"}, {"rpm": [1]}, {}])
def test_a_request_without_a_speed_is_refused(driven_by_hand: SimulatedLathe, request_: dict[str, object]) -> None:
    assert "refused" in asked(driven_by_hand, do="spindle", **request_)
    driven_by_hand.wait(1.0)
    assert speed_rpm(driven_by_hand) == 0.0


def test_every_line_is_named_where_one_is_not_known(machine: MachineProfile) -> None:
    said = answer(SimulatedLathe(machine), "what?")
    words = (
        "list",
        "help NAME",
        "inject",
        "active",
        "clear",
        "power-cycle",
        "spindle RPM",
        "spindle off",
        "collisions",
    )
    assert all(word in said for word in words)


def test_collisions_are_told_with_place_angle_and_time(bench: Bench, experiment: JobMaker) -> None:
    """The tip is pressed 1.5 mm into the part that stands, past 1.128 mm: the cut with its lobe and 1 mm."""
    assert answer(bench.sim, "collisions") == "ok\n"
    bench.lathe.enable()
    bench.lathe.home()
    bench.sim.mount(experiment(1))
    bench.lathe.jog_to(AxisName.CARRIAGE, 174_000.0)
    bench.lathe.jog_to(AxisName.TOOL, (76.0 - 24.5) * 5000.0)
    *lines, verdict = answer(bench.sim, "collisions").splitlines()
    assert verdict == "ok"
    form = r"(\w+): radius (\d+\.\d{3}) mm, Z 174\.000 mm, (\d+\.\d\d) deg, at (\d+\.\d) ms"
    found = [re.fullmatch(form, line) for line in lines]
    assert [match and match[1] for match in found] == ["standing_part", "too_deep"]
    first, second = (match for match in found if match)
    assert float(first[2]) == pytest.approx(25.95, abs=0.02)
    assert float(second[2]) == pytest.approx(24.8725, abs=0.02)
    assert float(first[4]) < float(second[4]) < bench.sim.now_s() * 1000.0
