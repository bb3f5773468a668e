"""What is compared before each cut: what a stranger changes is named, what the console does is no change."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.commissioning.fingerprint import Fingerprint, fingerprint_problems, ours, read_fingerprint
from drivers.cutting.planning import plan_cut
from drivers.cutting.strategy import Strategy
from drivers.lathe.heartbeat import Heartbeat
from drivers.pmac.program_load import load_program
from profiles.machine import MachineProfile
from profiles.store import load_job
from tests.drivers.commissioned import Commissioned, commissioned
from tests.drivers.families import machine as machine  # both families


def taken(card: Commissioned, since: Fingerprint | None = None) -> Fingerprint:
    return read_fingerprint(card.client, card.machine, card.dialect, since)


def told(card: Commissioned, before: Fingerprint) -> list[tuple[str, str, str, str]]:
    """What is said of a card, once by a whole reading and once by the quick one: the same."""
    own = ours(card.machine, card.dialect)
    whole = fingerprint_problems(before, taken(card), own)
    assert fingerprint_problems(before, taken(card, before), own) == whole
    return [(p.code.removeprefix("fingerprint."), p.key, p.value, p.limit) for p in whole]


@pytest.fixture(scope="module")
def before(machine: MachineProfile) -> Fingerprint:
    """That of a card to which nothing was done."""
    return taken(commissioned(machine))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("I116=400", ("changed", "I116", "400 counts/ms (80 mm/s)", "500 counts/ms (100 mm/s)")),
        ("I51=1", ("changed", "I51", "1", "0")),
        ("#3->100Z", ("changed", "#3->", "&1 100Z", "&1 Z")),
        ("#2->0", ("gone", "#2->", "", "&1 Y")),
        ("#4->A", ("appeared", "#4->", "&1 A", "")),
        ("I400=1", ("changed", "I400", "1", "0")),
        ("M26->Y:$FFC2,3", ("appeared", "M26->", "Y:$FFC2,3", "")),
    ],
)
def test_what_a_stranger_writes_is_named_with_both_values(
    machine: MachineProfile, before: Fingerprint, line: str, said: tuple[str, str, str, str]
) -> None:
    card = commissioned(machine)
    card.tell(line)
    assert told(card, before) == [said]


def test_a_stranger_who_sends_programs_and_plcs_is_found(machine: MachineProfile, before: Fingerprint) -> None:
    card = commissioned(machine)
    card.tell("OPEN PLC3 CLEAR", "P1=1", "CLOSE", "OPEN PROG7 CLEAR", "X1", "CLOSE")
    assert [(code, key) for code, key, _, _ in told(card, before)] == [
        ("appeared", "PLC 3"),
        ("appeared", "PROG 7"),
    ]
    again = taken(card)
    card.tell("OPEN PLC3 CLEAR", "P1=2", "CLOSE")
    assert [(code, key) for code, key, _, _ in told(card, again)] == [("changed", "PLC 3")]
    card.tell("DELETE PLC3")
    assert [(code, key) for code, key, _, _ in told(card, again)] == [("gone", "PLC 3")]


def test_a_strangers_table_is_found_by_its_entries(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("#3DEFINE COMP 2,#2,#3,10000", "16 0")
    before = taken(card)
    card.tell("#3DELETE COMP", "#3DEFINE COMP 2,#2,#3,10000", "32 0")
    assert [(code, key) for code, key, _, _ in told(card, before)] == [("changed", "#3 COMP")]


def test_a_conversion_that_is_turned_to_another_encoder_is_found(
    machine: MachineProfile, before: Fingerprint
) -> None:
    card = commissioned(machine)
    table = card.dialect.conversion_table
    if table.first_setting is None:
        card.tell(f"WY:${table.first_address:X},$C004")
        name = f"Y:${table.first_address:X}"
    else:
        name = f"I{table.first_setting}"
        card.tell(f"{name}={table.channels[1]}")
    assert [(code, key) for code, key, _, _ in told(card, before)] == [("changed", name)]


def test_another_card_is_found(
    machine: MachineProfile, before: Fingerprint, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = commissioned(machine)
    card.update_firmware(monkeypatch)
    assert told(card, before) == [("changed", "VERSION", "9.99", before.configuration.version)]


@pytest.mark.parametrize(
    ("machine", "strategy"),
    [*(("pmac", each) for each in Strategy), ("turbo", Strategy.CAM), ("turbo", Strategy.TIMEBASE)],
    indirect=["machine"],
)
@pytest.mark.first(2)
def test_what_the_console_does_for_a_cut_is_no_change(
    machine: MachineProfile, before: Fingerprint, strategy: Strategy
) -> None:
    card = commissioned(machine)
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.5)
    plan = plan_cut(job, machine, strategy)
    Heartbeat(card.client, card.sim, machine).prepare()
    load_program(card.client, plan.program, card.dialect)
    card.tell(*plan.restore, "P1000=77", "P11=3", "M26=1", f"I{card.dialect.system_index(1, 87)}=10")
    assert told(card, before) == []


def test_nothing_is_written_and_the_second_reading_is_short(machine: MachineProfile) -> None:
    card = commissioned(machine)
    before = taken(card)
    whole = len(card.line.heard)
    card.line.heard = b""
    taken(card, before)
    assert not any("=" in line and not line.startswith("P1001=") for line in card.lines)
    # At 38400 baud a character takes 0.26 ms; the host's half of the line stays below half a second.
    assert len(card.line.heard) < min(whole / 2, 1900)
