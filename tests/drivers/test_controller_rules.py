"""What a controller has to be set to, its devices, and what a backup brings back."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from console.text.catalogue import load
from console.text.checks import check_lines
from drivers.commissioning.backup import backup_text, read_backup, typed_lines
from drivers.commissioning.card_state import CardState, state_checks
from drivers.commissioning.check import Check, Group
from drivers.commissioning.reading import Extent, read_configuration, whole_card
from drivers.commissioning.verification import after_abort, after_jog_stop
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.safety import safety_problems
from drivers.pmac.dialect import Dialect, FamilySetting
from drivers.pmac.trajectory.jog import JogSettings
from profiles.findings import Severity
from profiles.machine import SAFETY_DEVICES, MachineProfile, Safety
from tests.drivers.commissioned import Commissioned, commissioned
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine
from tests.drivers.test_backup_whole import PLC_TEXTS, TEXTS

FRESH = {"pmac": set(), "turbo": {"watchdog"}}
"""What a fresh card of the profile is warned of: on a Turbo the long watchdog, which a PMAC has no setting for."""


def found(card: Commissioned, code: str, variable: str = "") -> Check:
    checks = [check for check in card.findings() if check.code == code and variable in ("", check.variable)]
    assert len(checks) == 1, (code, [(c.code, c.variable) for c in card.findings()])
    return checks[0]


def test_a_fresh_card_of_the_profile_holds_in_every_group(machine: MachineProfile) -> None:
    findings = commissioned(machine).findings()
    assert {check.severity for check in findings} <= {Severity.WARNING}
    assert {check.code for check in findings} == FRESH[machine.controller.family]
    groups = [check.group for check in commissioned(machine).verify().checks]
    assert list(dict.fromkeys(groups)) == [group for group in Group if group not in (Group.PROOFS, Group.COMPUTER)]


@ON_ONE
@pytest.mark.parametrize(
    ("line", "code", "variable", "value", "wanted"),
    [
        # 0.25 counts/ms2 of 0.2 um; the lobe of 27.5 um at 50 Hz needs 137.5 (2 pi 0.05)^2 = 13.57.
        ("I115=0.25", "soft_abort", "I115", "0.25 counts/ms2 (50 mm/s2)", "40 counts/ms2 (8000 mm/s2)"),
        ("I115=0", "no_limit", "I115", "0 counts/ms2 (0 mm/s2)", "40 counts/ms2 (8000 mm/s2)"),
        ("I117=0", "no_limit", "I117", "0 counts/ms2 (0 mm/s2)", "422 counts/ms2 (84400 mm/s2)"),
        ("I111=0", "no_limit", "I111", "0 /16 counts (0 mm)", "12000 /16 counts (0.15 mm)"),
        ("I113=0", "no_limit", "I113", "0 counts (0 mm)", "375000 counts (75 mm)"),
        ("I314=0", "no_limit", "I314", "0 counts (0 mm)", "-5000 counts (-5 mm)"),
        ("I113=400000", "beyond_travel", "I113", "400000 counts (80 mm)", "375000 counts (75 mm)"),
        ("I216=32", "slow_spindle", "I216", "32 counts/ms (192 rpm)", "500 counts/ms (3000 rpm)"),
        ("I169=20480", "too_much_current", "I169", "20480 bits (71.562 A)", "10531 bits (36.798 A)"),
        ("I106=1", "following_on", "I106", "1", "0"),
        ("I123=0", "never_homes", "I123", "0 counts/ms (0 mm/s)", "-10 counts/ms (-2 mm/s)"),
        ("I120..121=0", "divides_by_zero", "I120", "0 ms", "100 ms"),
        ("I180=1", "closes_at_power_up", "I180", "1", "0"),
        ("I102=$C002 I202=$C002", "shared_output", "I202", "$C002", ""),
        ("I51=1", "compensation", "I51", "1", "0"),
        ("I130=529", "differs", "I130", "529", "528"),
        ("I222=32", "factory", "I222", "32 counts/ms (192 rpm)", "16.667 counts/ms (100 rpm)"),
        ("I15=1", "radians", "I15", "1", "0"),
        ("M26->Y:$FFC2,8", "hold_flag", "M26->", "Y:$FFC2,8", "*"),
        ("&1#1->2X", "axis", "#1->", "2X", "X"),
        ("#3->0", "axis", "#3->", "0", "Z"),
        ("&2#4->A", "axis", "#4->", "&2 A", "0"),
        ("I400=1", "unexpected_motors", "", "I400", "0"),
    ],
)
def test_what_breaks_a_rule_fails_by_name(
    machine: MachineProfile, line: str, code: str, variable: str, value: str, wanted: str
) -> None:
    card = commissioned(machine)
    card.tell(line)
    check = found(card, code, variable)
    assert (check.severity, check.variable) == (Severity.REFUSAL, variable)
    assert (check.found, check.wanted) == (value, wanted)


@pytest.mark.parametrize(("setting", "value", "code"), [(FamilySetting.SEGMENT_MS, 5, "segments")])
def test_settings_with_another_number_in_each_family(
    machine: MachineProfile, setting: FamilySetting, value: int, code: str
) -> None:
    card = commissioned(machine)
    index = card.dialect.index(setting)
    card.tell(f"I{index}={value}")
    assert found(card, code).variable == f"I{index}"


def test_blending_and_time_base_of_the_coordinate_system(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell(f"I{card.dialect.system_index(1, 92)}=1")
    assert found(card, "blending_off").severity is Severity.REFUSAL
    source = card.dialect.conversion_table.first_address + 9
    card.tell(f"I{card.dialect.system_index(1, 93)}=${source:X}")
    assert found(card, "led_by_master").severity is Severity.REFUSAL


def test_kill_modes_are_told_where_they_are_not_the_profiles(machine: MachineProfile) -> None:
    card = commissioned(machine)
    index = card.dialect.index(FamilySetting.FLAG_MODE, 1)
    card.tell(f"I{index}=$500000")
    codes = {check.code for check in card.findings() if check.variable == f"I{index}"}
    assert codes == {"differs", "fault_input_off"}
    card.tell(f"I{index}=$20000")
    codes = {check.code for check in card.findings() if check.variable == f"I{index}"}
    assert codes == {"differs", "kills_all", "switches_off"}
    card = commissioned(machine)
    for motor in (1, 2, 3):
        card.tell(f"I{card.dialect.index(FamilySetting.FLAG_MODE, motor)}=$400000")
    assert "kills_all" not in {check.code for check in card.findings()}


@pytest.mark.parametrize(("value", "permitted"), [(0, False), (1, False), (2, True), (3, True)])
def test_background_plcs_must_be_permitted(machine: MachineProfile, value: int, permitted: bool) -> None:
    stated = {name: each for name, each in machine.controller.variables.items() if name != "I5"}
    card = commissioned(replace(machine, controller=replace(machine.controller, variables=stated)))
    card.tell(f"I5={value}")
    if permitted:
        assert "plcs" not in {check.code for check in card.findings()}
    else:
        assert (found(card, "plcs").severity, found(card, "plcs").found) == (Severity.WARNING, str(value))


def test_background_plcs_that_the_card_does_not_permit_are_told_once(machine: MachineProfile) -> None:
    permitted = {**machine.controller.variables, "I5": 2}
    card = commissioned(replace(machine, controller=replace(machine.controller, variables=permitted)))
    card.tell("I5=0")
    (check,) = [each for each in card.findings() if each.variable == "I5"]
    assert (check.code, check.severity, check.wanted) == ("plcs", Severity.REFUSAL, "2")


def test_a_setting_that_two_rules_know_is_told_once_and_the_watchdog_of_a_turbo_in_ms(
    machine: MachineProfile,
) -> None:
    card = commissioned(machine)
    if card.dialect.watchdog.number is None:
        assert "watchdog" not in {check.code for check in card.verify().checks}
        return
    check = found(card, "watchdog")
    # 4095 cycles of 442.7 us; 226 of them are 100 ms.
    assert (check.facts["time"], check.wanted) == ("1812.9 ms", "226")
    card.tell("I40=226")
    assert "watchdog" not in {check.code for check in card.findings()}
    card = commissioned(machine)
    card.factory()
    failing = [
        c.variable for c in card.findings() if c.severity is Severity.REFUSAL and c.variable.startswith("I")
    ]
    assert sorted(failing) == sorted(set(failing))


def test_a_servo_time_that_is_not_that_of_the_machine(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("I10=1856853")
    check = found(card, "servo_time")
    # 1856853 / 8388608 ms.
    assert (check.found, check.facts["period"], check.wanted) == ("1856853", "221.354 us", "3713707")


def test_what_runs_beside_is_told(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("OPEN PLC5", "CLEAR", "P5=P5+1", "CLOSE", "#1DEFINE COMP 2,#2,#1,10000", "16 0")
    assert found(card, "plc_texts").found == "PLC 5"
    (table,) = [check for check in card.verify().checks if check.code == "table"]
    assert table.found.startswith("2,#2,#1,10000, 2, sha256 ")
    card = commissioned(machine)
    card.tell("#1J/", "#2J/", "#3J/", "OPEN PROG1", "CLEAR", "DWELL60000", "CLOSE", "&1B1R")
    card.sim.wait(0.05)
    assert found(card, "running").found == "&1"
    (drives,) = [check for check in card.verify().checks if check.code == "drives_on"]
    assert drives.found == "#1, #2, #3"


def test_an_encoder_that_is_converted_otherwise(machine: MachineProfile) -> None:
    card = commissioned(machine)
    table = card.dialect.conversion_table
    word = f"I{table.first_setting + 1}" if table.first_setting else f"WY:${table.first_address + 1:X},"
    card.tell(f"{word}={'$1'}" if table.first_setting else f"{word}$1")
    check = found(card, "encoder")
    assert (check.subject, check.found) == ("spindle", "$1")


@pytest.mark.parametrize(("guarded", "word"), [("P1003=1", ("jog", "조그")), ("P1003=2", ("program", "프로그램"))])
def test_what_was_ended_because_its_host_was_killed_is_told(
    machine: MachineProfile, guarded: str, word: tuple[str, str]
) -> None:
    """A cut, and an identification as well, run as a program: the controller does not know which."""
    card = commissioned(machine)
    heartbeat = Heartbeat(card.client, card.sim, machine)
    heartbeat.prepare()
    assert not [check for check in card.findings() if check.code == "heartbeat_lost"]
    card.tell(f"{heartbeat.cut('', 0.0)} {guarded}")
    card.sim.wait(5.0)  # nobody renews
    check = found(card, "heartbeat_lost", "P1004")
    assert check.severity is Severity.REFUSAL
    for language, said in zip(("en", "ko"), word, strict=True):
        row = " ".join(check_lines([check], load(language)))
        assert said in row and "console retract" in row
    heartbeat.loss_seen()
    assert not [check for check in card.findings() if check.code == "heartbeat_lost"]


def test_a_variable_of_that_number_means_nothing_without_our_heartbeat_nor_does_another_family(
    machine: MachineProfile,
) -> None:
    card = commissioned(machine)
    card.tell("P1004=2")
    assert not [check for check in card.findings() if check.code == "heartbeat_lost"]
    card = commissioned(machine)
    other = "turbo" if machine.controller.family == "pmac" else "pmac"
    card.machine = replace(machine, controller=replace(machine.controller, family=other))
    assert found(card, "family").wanted == other


def test_a_fault_of_a_motor_is_told(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("#1J/", "#2J/", "#3J/")
    card.sim.faults.inject("amplifier-fault", motor="tool")
    card.sim.wait(0.1)
    check = found(card, "motor_faults")
    assert (check.subject, check.found) == ("tool", "amplifier_fault")


@pytest.mark.parametrize("fault", ["servo_error", "abort_input"])
def test_a_fault_of_the_card_itself_is_told(machine: MachineProfile, fault: str) -> None:
    verification = commissioned(machine).verify()
    state = CardState(card=frozenset({fault}), systems={}, motors={})
    (check,) = [each for each in state_checks(state, verification.judged) if each.code == "card_faults"]
    assert (check.severity, check.found) == (Severity.REFUSAL, fault)


def test_a_card_at_factory_settings_is_told_what_that_does(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.factory()
    speed = found(card, "slow_spindle")
    assert speed.facts["rpm"] == "192"
    (tool,) = [check for check in card.findings() if check.code == "overrun" and check.subject == "tool"]
    # 32 counts/ms at 0.015625 counts/ms2 is 2.05 s; with the S-curve of 50 ms it is 2.1 s and 6.7 mm.
    assert tool.facts["ramp"] == "6.7136 mm, 2.098 s"
    assert tool.severity is Severity.REFUSAL
    codes = {check.code for check in card.findings()}
    assert {"factory", "no_limit", "slow_tool", "soft_abort", "too_much_current", "axis"} <= codes


def test_a_profile_is_shown_with_what_it_leaves_open_or_contradicts(machine: MachineProfile) -> None:
    card = commissioned(machine)
    card.tell("I103=$720", "I171=1000")
    (check,) = [c for c in card.verify().checks if c.code == "not_stated" and c.subject == "tool"]
    assert check.severity is Severity.NOTICE
    assert "I103 = $720" in check.found
    assert "I171 = 1000" in check.found
    tool = replace(machine.tool, gain_kp_v_per_m=200.0)
    card = commissioned(replace(machine, tool=tool))
    check = found(card, "profile_gains", "I130")
    # 10 V / 32768 of 5000 counts/mm are 1525.88 V/m, Ix08 is 96: 200 2^19 / (96 x 1525.88) = 715.8.
    assert (check.found, check.wanted) == ("528", "716")


def test_a_machine_that_is_signed_for_is_told_of_its_soft_published_loop(machine: MachineProfile) -> None:
    """3 N push this loop by 33 um: 10.9 um/N, the figure of docs/tuning.md."""
    signed = replace(machine, safety=replace(machine.safety, signed_for="machine"))
    check = found(commissioned(signed), "soft_loop")
    assert (check.severity, check.found, check.wanted) == (Severity.WARNING, "10.9 um/N", "<= 3 um/N")
    for language in ("en", "ko"):
        assert "10.9 um/N" in " ".join(check_lines([check], load(language)))
    stiff = replace(signed, tool=replace(signed.tool, gain_kp_v_per_m=766.0))
    codes = {each.code for card in (stiff, machine) for each in commissioned(card).findings()}
    assert "soft_loop" not in codes, "with designed gains, and on the paper's lathe"


def test_an_inverter_spindle_is_not_asked_for_what_it_has_not(machine: MachineProfile) -> None:
    spindle = replace(machine.spindle, drive="inverter", ramp_rpm_per_s=500.0, slip_rpm=30.0)
    controller = replace(machine.controller, axis_definitions=("#1->X", "#3->Z"))
    card = commissioned(replace(machine, spindle=spindle, controller=controller))
    card.tell("I216=32")
    assert {check.code for check in card.findings() if check.subject == "spindle"} == {"factory"}
    assert [c.subject for c in card.verify().checks if c.code == "overrun"] == ["tool", "carriage"]


def test_run_on_after_a_stop_by_hand_calculation() -> None:
    # 50 counts/ms, 55 ms late, at 40 counts/ms2: 2750 + 31.25 counts.
    abort = after_abort(50.0, 40.0, 55.0)
    assert (abort.counts, abort.time_ms) == pytest.approx((2781.25, 56.25))
    assert after_abort(50.0, 0.0, 55.0).counts == float("inf")
    # Ix20 = 100 ms at 50 counts/ms: 2500 counts; Ix19 = 0.25 makes it (50 / 0.25) + 25 = 225 ms.
    jog = after_jog_stop(JogSettings(acceleration=1.0, ta_ms=100.0, ts_ms=25.0, speed=50.0), 0.0)
    assert (jog.counts, jog.time_ms) == pytest.approx((2500.0, 100.0))
    slow = after_jog_stop(JogSettings(acceleration=0.25, ta_ms=100.0, ts_ms=25.0, speed=50.0), 0.0)
    assert slow.time_ms == pytest.approx(225.0)
    assert slow.counts == pytest.approx(50.0 * 225.0 / 2.0)


# What doctor says of the safety devices: how they are fitted, who signed, and what the card sees of them.

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


def test_devices_fail_unless_wired_signed_or_read(machine: MachineProfile) -> None:
    found = devices(machine, Safety())
    assert [(check.subject, check.severity) for check in found] == [
        (device, Severity.REFUSAL) for device in SAFETY_DEVICES
    ]
    safety = replace(WIRED, guard="not fitted", signed_by="Kim, 2026-03-01")
    told = {check.subject: check for check in devices(machine, safety)}
    assert (told["guard"].severity, told["guard"].found) == (Severity.NOTICE, "Kim, 2026-03-01")
    assert {check.severity for name, check in told.items() if name != "guard"} == {Severity.OK}
    check = devices(machine, replace(WIRED, inputs=("guard=open",)))[-1]
    assert (check.code, check.severity, check.found) == ("input_unreadable", Severity.REFUSAL, "guard=open")


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
def test_an_input_of_the_card_is_read(machine: MachineProfile, word: int, good: int, severity: Severity) -> None:
    safety = replace(WIRED, inputs=(f"guard->Y:$7F0,3={good}",))
    check = devices(machine, safety, f"WY:$7F0,{word}")[-1]
    assert (check.code, check.subject, check.severity) == ("input", "guard", severity)
    assert (check.found, check.wanted) == (str(word >> 3 & 1), str(good))


# A backup with values: sent to a fresh card by the client, and read again, it is the same text to the byte.

PROGRAMS, PLCS = 30, 20
DATE = "2026-03-01T12:00:00+00:00"


def filled(machine: MachineProfile, random: Random) -> Commissioned:
    """A card with something of everything, in every coordinate system."""
    card = commissioned(machine)
    dialect = card.dialect
    motors, systems, highest = dialect.motor_count, dialect.system_count, dialect.highest_index
    lines = ["I15=1", "I108=32", "I130=1999.5", f"P{highest}=-0.125", "P7=1/3", "P8=-2000000.25", f"M{highest}=3"]
    lines += ["M1->X:$700,24,S", "M2->Y:$10F0,8,4", "M3->D:$28", "M4->L:$1200", "M5->Y:$12A0,24", "M5=77", "M7=5"]
    lines += [f"P{random.randrange(1000)}={random.uniform(-1e6, 1e6):.6f}" for _ in range(40)]
    lines += ["UNDEFINE ALL"]
    lines += [f"&{n % systems + 1}#{n}->{100 * n}{'XYZ'[n // systems % 3]}+{n}" for n in range(1, motors + 1)]
    lines += [f"&{system}Q{system}={system}.5" for system in range(1, systems + 1)]
    for motor in (4, 3, 1):
        lines += [f"#{motor}DEFINE COMP 40,#2,#{motor},40000", *["1 2 3 -4 5 -60 7 0"] * 5]
    for number in (*range(1, PROGRAMS), 1000):
        lines += [f"OPEN PROG {number} CLEAR", *random.choices(TEXTS, k=12), "CLOSE"]
    for number in range(1, PLCS + 1):
        lines += [f"OPEN PLC {number} CLEAR", *random.choices(PLC_TEXTS, k=9), "CLOSE"]
    last = {"pmac": 0x9FFF, "turbo": 0x107FF}[dialect.name]
    lines += ["DEFINE UBUFFER 300", f"WX:${last - 299:X},$ABCDEF,1", f"WY:${last:X},$FFFFFF"]
    if dialect.kinematics is not None:
        lines += ["&3", "OPEN INVERSE CLEAR", "P4=Q7*100", "IF(Q10=1)", "ENDIF", "CLOSE"]
        lines += ["&16OPEN FORWARD CLEAR", "Q7=P4/100", "CLOSE", "&1"]
    card.tell(*lines)
    return card


def text_of(card: Commissioned, extent: Extent) -> str:
    return backup_text(read_configuration(card.client, card.dialect, extent), DATE)


def restored(machine: MachineProfile, text: str) -> Commissioned:
    """A fresh card to which our client has sent the text."""
    card = commissioned(machine)
    card.client.download(typed_lines(text))
    assert card.client.in_step
    return card


def part(dialect: Dialect) -> Extent:
    """Everything but most of what takes time: the definitions and settings of the factory."""
    every = range(200)
    return Extent(settings=(every,), pointers=(every,), motors=tuple(range(1, dialect.motor_count + 1)))


def test_text_of_programs_tables_and_systems_comes_back(machine: MachineProfile) -> None:
    first = filled(machine, Random(30))
    extent = part(first.dialect)
    text = text_of(first, extent)
    for kind, count in (("OPEN PROG", PROGRAMS), ("OPEN PLC", PLCS), ("; #", 3)):
        assert sum(line.startswith(kind) for line in text.splitlines()) == count
    assert {line.partition("#")[0] for line in text.splitlines() if line[0:1] == "&"} == {
        f"&{n}" for n in range(1, first.dialect.system_count + 1)
    }
    again = text_of(restored(machine, text), extent)
    tables = [line for line in text.splitlines() if line.startswith("; #")]
    assert [line for line in again.splitlines() if "sha256" not in line] == [
        line for line in text.splitlines() if "sha256" not in line and line not in tables
    ], "without the values the entries of tables are not kept"


@pytest.mark.long
def test_backup_restore_backup_is_identical(machine: MachineProfile) -> None:
    first = filled(machine, Random(31))
    extent = whole_card(first.dialect, values=True)
    text = text_of(first, extent)
    systems = first.dialect.system_count
    for line in ("P7=0.3333333333", "M7=5", f"&{systems}Q{systems}={systems}.5", "#4DEFINE COMP 40,#2,#4,40000"):
        assert f"\n{line}\n" in text
    assert "\nDEFINE UBUFFER 300\nWX:$" in text
    assert ("\n&3OPEN INVERSE\n" in text) == (first.dialect.kinematics is not None)
    assert text_of(restored(machine, text), extent) == text
    backup = read_backup(text, "file")
    assert backup_text(backup.configuration, backup.date) == text
