"""What the console writes of a controller: gains and axis definitions of the profile, and never anything else."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from drivers.commissioning.gains import apply, gain_writes
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.commissioning.verification import checks_of
from drivers.errors import DriverError, RefusedError
from profiles.machine import MachineProfile
from tests.drivers.commissioned import Commissioned, commissioned
from tests.drivers.families import machine as machine  # both families

GAIN = re.compile(r"I[1-3]3[0-5]=[\d.]+")
AXIS = re.compile(r"&1#[1-3]->[A-Z]")
QUESTION = re.compile(r"I\d+|#\d->|[\d#&? ]+|P1004|P1001=\d+ P1001|\?\?\?")


def writes_of(card: Commissioned) -> list[str]:
    return [write.line for write in gain_writes(card.verify().judged)]


def test_a_card_of_the_profile_needs_nothing(machine: MachineProfile) -> None:
    card = commissioned(machine)
    assert writes_of(card) == []


def test_a_factory_card_gets_gains_and_axes_and_nothing_else(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.factory()
    writes = gain_writes(card.verify().judged)
    before = read_configuration(card.client, card.dialect, whole_card(card.dialect))
    card.line.heard = b""
    assert apply(card.client, card.dialect, writes) == len(writes) == 13
    sent = [line for line in card.lines if "=" in line or re.search(r"->.", line)]
    sent = [line for line in sent if not QUESTION.fullmatch(line)]
    assert [line for line in sent if not GAIN.fullmatch(line) and not AXIS.fullmatch(line)] == []
    assert b"SAV" not in card.line.heard
    now = read_configuration(card.client, card.dialect, whole_card(card.dialect))
    changed = {i for i in now.settings if now.settings[i] != before.settings[i]}
    # I135 and I234 are at the factory what the profile wants.
    assert changed == {130, 131, 132, 133, 134, 230, 231, 232, 233, 235}
    assert {motor: axis.text for motor, axis in now.axes.items()} == {1: "X", 2: "Y", 3: "Z"}
    assert writes_of(card) == []


def test_limits_that_are_wrong_stay_as_they_are(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("I115=0", "I113=0", "I111=0", "I169=30000", "I125=0", "I101=0", "I163=1")
    assert writes_of(card) == []


def test_a_notch_filter_of_the_tool_that_the_profile_does_not_state_is_written_away(
    machine: MachineProfile,
) -> None:
    """A cut inverts the loop without it; one of another motor is that motor's own."""
    card = commissioned(machine)
    card.tell("I136=-0.5", "I138=0.25", "I336=-0.5")
    checks = [each for each in card.verify().checks if each.subject == "tool"]
    assert {each.variable for each in checks if each.code == "differs"} == {"I136", "I138"}
    told = [each.found for each in checks if each.code == "not_stated"]
    assert not [found for found in told if "I136" in found or "I138" in found], "told once, as what is written"
    writes = gain_writes(card.verify().judged)
    assert [(each.line, each.found) for each in writes] == [("I136=0", "-0.5"), ("I138=0", "0.25")]
    apply(card.client, card.dialect, writes)
    assert card.client.numbers("I136", "I138", "I336") == (0.0, 0.0, -0.5)
    assert [each for each in card.verify().checks if each.code == "differs"] == []


def test_nothing_is_sent_while_a_drive_is_on(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("I130=600")
    writes = gain_writes(card.verify().judged)
    card.tell("#3J/")
    card.line.heard = b""
    with pytest.raises(RefusedError) as refused:
        apply(card.client, card.dialect, writes)
    assert (refused.value.problems[0].code, refused.value.problems[0].value) == ("controller.drives_on", "#3")
    assert [line for line in card.lines if not QUESTION.fullmatch(line)] == []


def test_nothing_is_sent_while_a_program_runs(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell(
        "I130=600", "UNDEFINE ALL", "&2#8->X", "I800=1", "#8J/", "OPEN PROG1", "CLEAR", "DWELL60000", "CLOSE"
    )
    writes = gain_writes(card.verify().judged)
    card.tell("&2B1R")
    card.sim.wait(0.05)
    with pytest.raises(RefusedError):
        apply(card.client, card.dialect, writes)
    assert card.client.numbers("I130") == (600.0,)


def test_a_value_that_the_card_does_not_keep_ends_it(machine: MachineProfile) -> None:
    profile = replace(
        machine, controller=replace(machine.controller, variables=dict(machine.controller.variables))
    )
    profile.controller.variables["I234"] = 3  # type: ignore[index]  # Ix34 of the card is 0 or 1: it becomes 1
    card = commissioned(profile)
    card.tell("I234=0", "I235=5")
    writes = gain_writes(card.verify().judged)
    assert [write.line for write in writes] == ["I234=3", "I235=32000"]
    with pytest.raises(DriverError) as refused:
        apply(card.client, card.dialect, writes)
    problem = refused.value.problems[0]
    assert (problem.code, problem.key, problem.value, problem.limit) == (
        "controller.not_taken",
        "I234=3",
        "1",
        "3",
    )
    assert card.client.numbers("I235") == (5.0,)


def test_a_profile_that_contradicts_itself_is_not_applied(machine: MachineProfile) -> None:
    card = commissioned(replace(machine, tool=replace(machine.tool, gain_kd_v_s_per_m=5.0)))
    card.tell("I230=1")
    with pytest.raises(RefusedError) as refused:
        gain_writes(card.verify().judged)
    assert {problem.key for problem in refused.value.problems} == {"I131", "I132"}


def test_gains_of_the_card_are_told_in_volts_per_metre(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("I130=1056")
    (check,) = [each for each in checks_of(card.verify().judged) if each.code == "gains_mean"]
    # Twice 528, which is 147.5 V/m.
    assert check.facts["kp"] == "295.04 V/m"
