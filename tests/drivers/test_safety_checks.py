"""What doctor says of the safety devices: how they are fitted, who signed, and what the card sees of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.commissioning.check import Check, Group
from drivers.lathe.safety import safety_problems
from profiles.findings import Severity
from profiles.machine import SAFETY_DEVICES, MachineProfile, Safety
from tests.drivers.commissioned import commissioned
from tests.drivers.families import machine as machine  # both families

WIRED = Safety(
    emergency_stop="wired",
    safe_torque_off="wired",
    guard="wired",
    enabling_device="wired",
    chuck_closed="wired",
    key_removed="wired",
    spindle_permit="wired",
)


def devices(machine: MachineProfile, safety: Safety, *lines: str) -> list[Check]:
    card = commissioned(replace(machine, safety=safety))
    card.tell(*lines)
    return [check for check in card.verify().checks if check.group is Group.SAFETY]


def test_a_profile_that_says_nothing_fails_for_each_device(machine: MachineProfile) -> None:
    found = devices(machine, Safety())
    assert [(check.subject, check.severity) for check in found] == [
        (device, Severity.REFUSAL) for device in SAFETY_DEVICES
    ]


def test_what_is_wired_holds_and_what_is_signed_for_is_told_with_the_name(machine: MachineProfile) -> None:
    safety = replace(WIRED, guard="not fitted", signed_by="Kim, 2026-03-01")
    found = {check.subject: check for check in devices(machine, safety)}
    assert (found["guard"].severity, found["guard"].found) == (Severity.NOTICE, "Kim, 2026-03-01")
    assert {check.severity for name, check in found.items() if name != "guard"} == {Severity.OK}


@pytest.mark.parametrize("nobody", ["", "   ", "-", "\u3164", "2026-03-01"])
def test_what_is_not_fitted_needs_a_name(machine: MachineProfile, nobody: str) -> None:
    unsigned = replace(WIRED, guard="not fitted", signed_by=nobody)
    (check,) = [c for c in devices(machine, unsigned) if c.subject == "guard"]
    assert (check.code, check.severity) == ("device_unsigned", Severity.REFUSAL)
    (problem,) = safety_problems(replace(machine, safety=unsigned), {})
    assert (problem.code, problem.key) == ("safety.not_signed", "safety.guard")
    assert safety_problems(replace(machine, safety=replace(unsigned, signed_by="김 2026-03-01")), {}) == ()


@pytest.mark.parametrize(
    ("word", "good", "severity"),
    [(8, 1, Severity.OK), (7, 1, Severity.REFUSAL), (8, 0, Severity.REFUSAL), (7, 0, Severity.OK)],
)
def test_an_input_that_the_card_sees_is_read(
    machine: MachineProfile, word: int, good: int, severity: Severity
) -> None:
    safety = replace(WIRED, inputs=(f"guard->Y:$7F0,3={good}",))
    check = devices(machine, safety, f"WY:$7F0,{word}")[-1]
    assert (check.code, check.subject, check.severity) == ("input", "guard", severity)
    assert (check.found, check.wanted) == (str(word >> 3 & 1), str(good))


def test_an_input_that_cannot_be_read_fails(machine: MachineProfile) -> None:
    check = devices(machine, replace(WIRED, inputs=("guard=open",)))[-1]
    assert (check.code, check.severity, check.found) == ("input_unreadable", Severity.REFUSAL, "guard=open")
