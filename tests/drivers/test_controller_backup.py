"""Backups of a controller, and settings that are applied to it."""

from __future__ import annotations

import re
import tracemalloc
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.commissioning.backup import END_OF_HEADER, TITLE, backup_text, read_backup
from drivers.commissioning.comparison import differences
from drivers.commissioning.configuration import AxisEntry, ControllerConfiguration, digest
from drivers.commissioning.gains import apply, gain_writes
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.commissioning.verification import checks_of
from drivers.errors import DriverError, RefusedError
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.reserved import MARKER
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from tests.drivers.commissioned import Commissioned, commissioned, of_family
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine

DATE = "2026-03-01T12:00:00+00:00"


def dressed(machine: MachineProfile) -> Commissioned:
    """A card with something of everything."""
    card = commissioned(machine)
    card.tell(
        "I104=$C00C",
        "I213=0",
        "I5=2",
        "M26->Y:$FFC2,8",
        "M70..71->D:$28",
        "M72->X:$700,0,24,S",
        "&2#4->2000A+10",
        "OPEN PLC3",
        "CLEAR",
        "P5=P5+1",
        "CLOSE",
        "OPEN PROG7",
        "CLEAR",
        "LINEAR F20 X10",
        "DWELL0",
        "CLOSE",
        "#1DEFINE COMP 4,#2,#1,10000",
        "16 32 48 0",
    )
    if card.dialect.conversion_table.first_setting is None:
        card.tell("WY:$724,$C014")
    else:
        card.tell("I8004=$78108")
    card.line.heard = b""
    return card


def read(card: Commissioned) -> ControllerConfiguration:
    return read_configuration(card.client, card.dialect, whole_card(card.dialect))


@pytest.fixture(scope="module")
def plain(machine: MachineProfile) -> ControllerConfiguration:
    """What is read of a card with something of everything."""
    return read(dressed(machine))


def test_what_was_read_is_in_the_file(plain: ControllerConfiguration) -> None:
    found = plain
    assert found.settings[104] == 0xC00C
    assert found.axes == {
        1: AxisEntry(1, "X"),
        2: AxisEntry(1, "Y"),
        3: AxisEntry(1, "Z"),
        4: AxisEntry(2, "2000A+10"),
    }
    assert found.pointers == {26: "Y:$FFC2,8", 70: "D:$28", 71: "D:$28", 72: "X:$700,24,S"}
    assert found.plcs == {3: ("P5=P5+1",)}
    assert found.programs == {7: ("LINEARF20X10", "DWELL0")}
    assert (found.tables[1].definition, found.tables[1].entry_count) == ("4,#2,#1,10000", 4)
    backup = read_backup(backup_text(found, DATE), "file")
    assert backup.configuration == found
    assert backup.date == DATE
    assert backup.configuration.fingerprint == found.fingerprint


def test_reading_asks_and_writes_nothing_but_the_marker_of_the_link(machine: MachineProfile) -> None:
    card = dressed(machine)
    before = dict(card.sim.controller.variables.settings())
    read(card)
    marker = re.compile(rf"P{MARKER}=\d+ P{MARKER}")
    assert [line for line in card.lines if "=" in line and not marker.fullmatch(line)] == []
    assert card.sim.controller.variables.settings() == before


def test_a_backup_can_be_sent_to_another_card(machine: MachineProfile, plain: ControllerConfiguration) -> None:
    kept = plain
    other = commissioned(machine)
    other.factory()
    for line in backup_text(kept, DATE).splitlines():
        typed = line.partition(";")[0].strip()
        if typed:
            other.tell(typed)
    again = read(other)
    # The entries of tables are made anew for each job, and not sent back.
    assert replace(again, tables=kept.tables) == kept
    assert not again.tables
    assert other.sim.controller.plcs.switches.enabled == frozenset()


@ON_ONE
def test_a_limit_of_zero_stands_on_a_line_of_its_own_and_says_so(machine: MachineProfile) -> None:
    text = backup_text(read(commissioned(machine)), DATE)
    assert "\nI213=0 ; no limit\nI214=0 ; no limit\n" in text
    zeros = [line for line in text.splitlines() if line.startswith("I") and line.endswith("=0") and ".." in line]
    limits = {f"I{motor}{number}" for motor in range(1, 9) for number in (11, 13, 14, 15, 16, 17, 19)}
    for line in zeros:
        first, last = line.removesuffix("=0").removeprefix("I").split("..")
        assert limits.isdisjoint(f"I{index}" for index in range(int(first), int(last) + 1)), line


def test_addresses_are_written_as_addresses(plain: ControllerConfiguration) -> None:
    assert "\nI104=$C00C\n" in backup_text(plain, DATE)


def test_the_form_in_which_the_card_answers_does_not_matter(
    machine: MachineProfile, plain: ControllerConfiguration
) -> None:
    card = dressed(machine)
    for form in (0, 1, 2, 3):
        card.tell(f"I9={form}")
        found = read(card)
        assert found.settings[9] == form
        assert {**found.settings, 9: plain.settings[9]} == plain.settings, form
        assert found.pointers == plain.pointers, form
        assert (found.programs, found.plcs) == (plain.programs, plain.plcs), form


def test_short_or_spaced_lines_differ_only_in_what_they_do(
    machine: MachineProfile, plain: ControllerConfiguration
) -> None:
    assert plain.programs == {7: ("LINEARF20X10", "DWELL0")}
    before = replace(plain, programs={7: ("LIN F20 X10", "DWE0")}, plcs={3: ("P5 = P5+1",)})
    assert differences(before, plain, machine) == []
    before = replace(plain, programs={7: ("LIN F20 X10", "DLY0")})
    (found,) = differences(before, plain, machine)
    assert (found.facts["what_changed"], found.found, found.wanted) == ("PROG 7:2", "DWELL0", "DLY0")


@ON_ONE
@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda text: text.replace("I116=500", "I116=5000"), "controller.backup_changed"),
        (lambda text: text + "I51=1\n", "controller.backup_changed"),
        (lambda text: text.partition("\n")[2], "controller.no_backup"),
        (lambda text: text.replace("; ----\n", ""), "controller.no_backup"),
        (
            lambda text: text.replace("family pmac", "family power").replace("family turbo", "x"),
            "controller.no_backup",
        ),
        (lambda text: "", "controller.no_backup"),
    ],
)
def test_what_is_no_unchanged_backup_is_refused(plain: ControllerConfiguration, change: object, code: str) -> None:
    text = backup_text(plain, DATE)
    assert callable(change)
    with pytest.raises(ProfileError) as refused:
        read_backup(change(text), "file")
    assert refused.value.problems[0].code == code


def test_somebody_who_enters_a_program_is_not_disturbed(machine: MachineProfile) -> None:
    card = commissioned(machine)
    stranger = card.sim.connect()
    stranger.receive(b"OPEN PROG 5\r")
    card.sim.wait(0.02)
    with pytest.raises(RefusedError) as refused:
        read(card)
    assert refused.value.problems[0].code == "controller.entering"


@ON_ONE
def test_what_a_password_hides_is_named(machine: MachineProfile) -> None:
    card = dressed(machine)
    card.tell("PASSWORD=abc", "SAVE")
    card.client.send("$$$")
    card.sim.wait(0.1)
    card.client.connect()
    found = read(card)
    assert "PLC 3" in found.locked
    assert read_backup(backup_text(found, DATE), "file").configuration == found


@ON_ONE
@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("I115=39", "I115"),
        ("I10=3713708", "I10"),
        ("&1#1->2X", "#1->"),
        ("M26->*", "M26->"),
        ("OPEN PLC3 CLEAR P5=P5+2 CLOSE", "PLC 3:1"),
        ("OPEN PROG7 DWELL1 CLOSE", "PROG 7:3"),
        ("#1DELETE COMP", "#1 COMP"),
    ],
)
def test_a_difference_is_named(
    machine: MachineProfile, plain: ControllerConfiguration, line: str, what: str
) -> None:
    card, before = dressed(machine), plain
    for part in line.replace(" CLEAR", "\rCLEAR").replace(" P5", "\rP5").replace(" DWELL", "\rDWELL").split("\r"):
        card.tell(*(["CLOSE"] if part == "CLOSE" else part.split(" CLOSE")[:1]))
    card.tell("CLOSE")
    found = differences(before, read(card), machine)
    assert [check.facts.get("what_changed") or check.variable for check in found] == [what]


def test_what_ordinary_work_changes_is_no_difference(
    machine: MachineProfile, plain: ControllerConfiguration
) -> None:
    card, before = dressed(machine), plain
    gather = card.dialect.gathering
    modal = card.dialect.system_index(1, 87)
    card.tell(f"I{modal}=20", f"I{gather.period}=3", f"I{gather.masks[0]}=1", "P7=3", "I6=1")
    now = read(card)
    assert differences(before, now, machine) == []
    assert now.fingerprint == before.fingerprint
    card.tell("I115=39")
    assert read(card).fingerprint != before.fingerprint


@ON_ONE
def test_a_difference_is_told_in_the_words_of_the_machine(machine: MachineProfile) -> None:
    card = commissioned(machine)
    before = read(card)
    card.tell("I115=0.25")
    (found,) = differences(before, read(card), machine)
    assert (found.setting, found.subject, found.variable) == ("abort_deceleration", "tool", "I115")
    # 0.25 counts/ms2 at 0.2 um a count.
    assert found.found == "0.25 counts/ms2 (50 mm/s2)"
    assert found.wanted == "40 counts/ms2 (8000 mm/s2)"
    assert found.facts["typed"] == "I115=40"


VALUES = st.one_of(
    st.just(0.0),
    st.integers(-(2**31), 2**31).map(float),
    st.decimals(-1000, 1000, places=6).map(float).map(lambda value: value + 0.0),
)


@given(
    settings=st.dictionaries(st.integers(0, 1023).filter(lambda index: index not in (3, 4, 6, 63, 64)), VALUES),
    family=st.sampled_from(sorted(DIALECTS)),
)
def test_any_settings_come_back(settings: dict[int, float], family: str) -> None:
    configuration = ControllerConfiguration(family=family, kind="K", version="1", settings=settings)
    assert read_backup(backup_text(configuration, DATE), "file").configuration == configuration


def test_both_families_are_there(machine: MachineProfile) -> None:
    assert {of_family(machine, name).controller.family for name in DIALECTS} == {"pmac", "turbo"}


@pytest.mark.parametrize(
    ("body", "told"),
    [
        (["I0..99999999=0"], ("I, M", "99999999", "1023")),
        (["M99999999->*"], ("I, M", "99999999", "1023")),
        (["WY:$0," + "0," * 5000 + "0"], ("characters", "10007", "1000")),
        ([f"WY:$0,{'0,' * 400}0"] * 30, ("WY", "8421", "8192")),
        ([""] * 300_001, ("lines", "300008", "300000")),
    ],
)
def test_a_backup_that_claims_more_than_a_card_has_is_refused(body: list[str], told: tuple[str, str, str]) -> None:
    """Its hash is right: only what is in it tells."""
    card = "; family pmac", "; type x", "; version 1", f"; date {DATE}", f"; sha256 {digest(body)}"
    tracemalloc.start()
    try:
        with pytest.raises(ProfileError) as refused:
            read_backup("\n".join([TITLE, *card, END_OF_HEADER, *body]) + "\n", "b.pmac")
        peak_mb = tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()
    (problem,) = refused.value.problems
    assert problem.code == "controller.backup_too_large"
    assert (problem.key, problem.value, problem.limit) == told
    assert peak_mb < 30.0


def test_a_long_program_in_a_backup_is_read_line_by_line() -> None:
    """A hundred thousand lines: each was once copied for the next, 10 GB in all."""
    body = ["OPEN PROG1", "CLEAR", *["X1"] * 100_000, "CLOSE"]
    card = "; family pmac", "; type x", "; version 1", f"; date {DATE}", f"; sha256 {digest(body)}"
    backup = read_backup("\n".join([TITLE, *card, END_OF_HEADER, *body]) + "\n", "b.pmac")
    assert backup.configuration.programs[1] == ("X1",) * 100_000


# What the console writes of a controller: gains and axis definitions of the profile, and never anything else.

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


def test_a_notch_filter_that_the_profile_does_not_state_is_written_away(machine: MachineProfile) -> None:
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
