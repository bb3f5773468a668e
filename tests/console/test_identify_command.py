"""`console identify`: printed, kept to the last bit, refused; the loop of the tool as the controller has it."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import MonkeyPatch

from console.cli.machine.tool_tests import Teller
from console.session.data.health import kept_tests
from console.session.data.identified_responses import load, store
from console.session.signals import Interruption
from console.session.station.commands import CheckHealth, EnableDrives, Home, IdentifyTool, ReadLoop
from console.session.station.machine_connection import ConnectedMachine
from console.session.station.machine_control import MachineControl
from console.session.station.state import Activity
from console.text.catalogue import load as words
from drivers.cutting.strategy import Strategy
from drivers.identification.request import IdentificationRequest
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, ResponseOrigin, as_table, from_table
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import SAFETY_DEVICES, MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_machine
from tests.console.commands import Console, answers
from tests.console.consoles import MACHINE as MACHINE_NAME
from tests.console.consoles import station_of
from tests.console.floor import known, open_floor
from tests.drivers.commissioned import Stand, stand
from tests.drivers.test_identification_refused import disturb
from tests.signed_profile import signed_copy

ORIGIN = ResponseOrigin(
    machine="lee-2001-lathe",
    simulated=False,
    version="1.17",
    kind="PMAC1, X1",
    gains={"I130": 528.0, "I131": 4905.0, "I132": 4905.0, "I133": 811.0, "I134": 0.0, "I135": 0.0},
    servo_period_ms=0.4427083730697632,
)
POINT = IdentifiedPoint(
    frequency_hz=50.0,
    gain=0.8856,
    phase_deg=-51.7,
    gain_ci=0.0002,
    phase_ci_deg=0.015,
    coherence=0.99999,
    amplitude_um=25.0,
)
RESPONSE = IdentifiedResponse(
    origin=ORIGIN,
    path=Strategy.PVT,
    how="measured",
    delay_cycles=0,
    date="2001-11-30T14:05:00.000Z",
    points=(POINT,),
)


def test_what_was_kept_is_found_again_to_the_last_bit(tmp_path: Path) -> None:
    file = store(tmp_path, RESPONSE)
    assert file == tmp_path / "identified" / "lee-2001-lathe" / "pvt-20011130T140500000Z.json"
    assert load(file) == RESPONSE


@settings(max_examples=25)
@given(
    gain=st.floats(0.0, 10.0),
    phase_deg=st.floats(-180.0, 180.0),
    name=st.text(min_size=1, max_size=30),
    path=st.sampled_from([Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE]),
)
def test_any_response_survives_the_file(gain: float, phase_deg: float, name: str, path: Strategy) -> None:
    point = replace(POINT, gain=gain, phase_deg=phase_deg)
    response = replace(RESPONSE, origin=replace(ORIGIN, machine=name), path=path, points=(point, POINT))
    assert from_table(json.loads(json.dumps(as_table(response)))) == response


def test_nothing_is_overwritten_and_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    file = store(tmp_path, RESPONSE)
    (tmp_path / "in the way").mkdir()
    (tmp_path / "in the way" / "identified").write_text("", encoding="ascii")
    for folder, code in ((tmp_path, "file.exists"), (tmp_path / "in the way", "file.not_writable")):
        with pytest.raises(ProfileError) as refused:
            store(folder, replace(RESPONSE, points=()))
        assert refused.value.problems[0].code == code
    assert load(file) == RESPONSE
    table = as_table(RESPONSE)
    del table["points"][0]["coherence"]
    with pytest.raises(ProfileError):
        from_table(table)


@pytest.mark.parametrize("name", ["../../outside", "..", ".", "a/b", "lathe 2", "선반", "\x00"])
def test_a_machine_of_any_name_keeps_to_its_folder(tmp_path: Path, name: str) -> None:
    kept = replace(RESPONSE, origin=replace(ORIGIN, machine=name))
    file = store(tmp_path / "data", kept)
    assert file.parent.parent == tmp_path / "data" / "identified"
    assert load(file) == kept


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"null", b'{"schema": 1}', b"\xff", b"[" * 100_000],
)
def test_a_file_that_is_none_of_ours_is_named(tmp_path: Path, content: bytes) -> None:
    file = store(tmp_path, RESPONSE)
    file.write_bytes(content)
    with pytest.raises(ProfileError) as refused:
        load(file)
    (problem,) = refused.value.problems
    assert (problem.code, problem.where) == ("identify.file", str(file))


def changed(table: dict[str, Any], keys: tuple[str | int, ...], value: object) -> dict[str, Any]:
    inner: Any = table
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    return table


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("points", 0, "amplitude_um"), math.inf),
        (("points", 0, "amplitude_um"), 0.0),
        (("points", 0, "gain"), "0.9"),
        (("points", 0, "phase_deg"), math.nan),
        (("points", 0, "coherence"), True),
        (("points", 0, "more"), 1.0),
        (("origin", "simulated"), "false"),
        (("origin", "simulated"), 0),
        (("origin", "gains", "I130"), "528"),
        (("origin", "servo_period_ms"), 0.0),
        (("origin", "version"), 1.17),
        (("delay_cycles",), 2.7),
        (("delay_cycles",), "2"),
        (("how",), "guessed"),
        (("date",), 20011130),
    ],
)
def test_a_value_of_another_type_is_refused(tmp_path: Path, keys: tuple[str | int, ...], value: object) -> None:
    file = store(tmp_path, RESPONSE)
    table = changed(json.loads(file.read_text(encoding="utf-8")), keys, value)
    file.write_text(json.dumps(table), encoding="utf-8")
    with pytest.raises(ProfileError) as refused:
        load(file)
    assert [(p.code, p.where) for p in refused.value.problems] == [("identify.file", str(file))]


LANGUAGES = ("en", "ko")
SHORT = ("--frequencies", "30,70", "--periods", "8")
MACHINE = load_machine("lee-2001-lathe").machine


def true_position(machine: MachineProfile, monkeypatch: MonkeyPatch, data: Path) -> Stand:
    """Let the command take a simulated machine for one of iron, that somebody has signed for."""
    signed_copy(machine.name, data / "trilobe" / "machines")
    made = stand(machine)

    def reach(*_: object) -> ConnectedMachine:
        return ConnectedMachine(
            client=made.rig.client,
            lathe=made.rig.lathe,
            heartbeat=Heartbeat(made.rig.client, made.clock, machine),
            stop=made.stop,
            owning=MachineControl(made.rig.lathe, "tcp:lathe:1", data),
            clock=made.clock,
            address="tcp:lathe:1",
            shop=None,
            close=lambda: None,
        )

    monkeypatch.setattr("console.cli.machine.tool_tests.reach", reach)
    return made


def typed(text: str, monkeypatch: MonkeyPatch) -> None:
    answers(monkeypatch, text)


@pytest.mark.first(1)
@pytest.mark.parametrize(("strategy", "language"), [("pvt", "en"), ("cam", "ko"), ("timebase", "en")])
def test_the_table_is_printed_and_kept(console: Console, data_folder: Path, strategy: str, language: str) -> None:
    said = console("identify", "--sim", "--strategy", strategy, "--lang", language, *SHORT)
    assert (said.code, said.err) == (0, "")
    lines = said.out.splitlines()
    assert lines[0].startswith("SIM  lee-2001-lathe: PMAC1")
    rows = [line.split() for line in lines if re.match(r" +\d+ ", line)]
    assert [row[0] for row in rows] == ["30", "70"]
    # Gain and model side by side: 0.9811 and 0.7777, calculated apart from this code.
    for row, gain in zip(rows, (0.9811, 0.7777), strict=True):
        assert float(row[1]) == pytest.approx(gain, abs=0.002)
        assert float(row[6]) == pytest.approx(gain, abs=0.001)
    assert not re.search(r"identify\.[a-z]|help\.", said.out)
    (file,) = (data_folder / "trilobe" / "identified" / "lee-2001-lathe").iterdir()
    assert file.name.startswith(f"{strategy}-")
    assert load(file).path == strategy
    assert str(file) in said.out.replace("\n", "")
    assert all(len(line) <= 80 for line in lines if "kept" not in line and str(file) not in line)


def test_json_has_the_same_unrounded_with_what_it_holds_for(console: Console, data_folder: Path) -> None:
    said = console("identify", "--sim", "--json", "--strategy", "timebase", "--amplitude", "40", *SHORT)
    assert (said.code, said.err) == (0, "")
    found = said.json
    assert (found["machine"], found["simulated"], found["path"]) == ("lee-2001-lathe", True, "timebase")
    assert (found["how"], found["delay_cycles"]) == ("composed", 1)
    assert found["gains"]["I130"] == 528
    first = found["points"][0]
    assert first["frequency_hz"] == 30
    assert first["amplitude_um"] == pytest.approx(40.0, rel=1e-3)
    # One servo cycle of 0.4427 ms is 4.78 deg of 30 Hz.
    assert first["phase_deg"] == pytest.approx(-0.556 * 57.29578 - 4.781, abs=0.2)
    assert first["gain_difference_percent"] == pytest.approx(0.0, abs=0.2)
    assert first["phase_difference_deg"] == pytest.approx(0.0, abs=0.2)
    assert len(repr(first["gain"])) > 10
    kept = load(Path(found["file"]))
    assert [point.gain for point in kept.points] == [point["gain"] for point in found["points"]]
    assert found["doubtful_hz"] == []


def test_what_is_too_much_or_not_said_right_is_refused_in_a_line(console: Console, data_folder: Path) -> None:
    for too_much, told in (
        ("--amplitude 60", "60 um"),
        ("--amplitude 2", "2 um"),
        ("--frequencies 10,950", "950 Hz"),
        ("--periods 3", "periods: 3"),
        ("--amplitude 50 --frequencies 215", "I117"),
    ):
        said = console("identify", "--sim", *too_much.split())
        assert (said.code, said.out) == (1, "") and told in said.err
    assert not (data_folder / "trilobe" / "identified").exists()
    beside_sim = ("--link", "tcp:127.0.0.1:1")
    wrong = ("--strategy paper", "--frequencies 10,x", "--amplitude nan", "--periods 2.5", "--periods -4")
    for arguments in (*(each.split() for each in wrong), ("--frequencies", ""), beside_sim):
        said = console("identify", "--sim", *arguments)
        assert (said.code, len(said.err.splitlines())) == (2, 1)
    said = console("identify")
    assert (said.code, said.out) == (1, "") and "--sim" in said.err


def test_iron_is_not_moved_unnamed(console: Console, monkeypatch: MonkeyPatch, data_folder: Path) -> None:
    made = true_position(MACHINE, monkeypatch, data_folder)
    said = console("identify", "--link", "tcp:lathe:1", *SHORT)  # no terminal to ask at
    assert (said.code, "--yes" in said.err) == (1, True)
    typed("lee-2001\n", monkeypatch)
    said = console("identify", "--link", "tcp:lathe:1", *SHORT)
    assert (said.code, "lee-2001-lathe" in said.err) == (1, True)
    assert not made.drives_on
    assert not any(re.search(r"#\d+(J|HM)|OPEN|DEFINE", line) for line in made.lines)


def test_iron_is_moved_when_it_is_named(console: Console, monkeypatch: MonkeyPatch, data_folder: Path) -> None:
    made = true_position(MACHINE, monkeypatch, data_folder)
    typed("lee-2001-lathe\n", monkeypatch)
    said = console("identify", "--link", "tcp:lathe:1", "--json", *SHORT)
    assert said.code == 0
    assert (said.json["simulated"], len(said.json["points"])) == (False, 2)
    assert any(re.search(r"#1HM", line) for line in made.lines)
    assert not made.drives_on


@pytest.mark.parametrize("why", [*SAFETY_DEVICES, "drives"])
def test_iron_with_an_unknown_safety_device_or_enabled_drives_is_left_alone(
    console: Console, monkeypatch: MonkeyPatch, data_folder: Path, why: str
) -> None:
    changed: dict[str, Any] = {why: "unknown"} if why != "drives" else {}
    made = true_position(replace(MACHINE, safety=replace(MACHINE.safety, **changed)), monkeypatch, data_folder)
    if why == "drives":
        made.tell("#3J/")
    said = console("identify", "--link", "tcp:lathe:1", "--yes", *SHORT)
    assert said.code == 1 and (why in said.err or (why == "drives" and made.drives_on))
    assert made.drives_on is (why == "drives") and "Hz" not in said.out, "no head of a table without a row"
    assert not any(re.search(r"#\d+(J[^/]|HM)|OPEN|DEFINE", line) for line in made.lines)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_doubtful_point_is_marked(capsys: pytest.CaptureFixture[str], tmp_path: Path, language: str) -> None:
    request = IdentificationRequest(path=Strategy.PVT)
    teller = Teller(MACHINE, request, words(language), silent=False, interruption=Interruption())
    doubtful = replace(POINT, frequency_hz=70.0, coherence=0.94)
    teller.tell(POINT)
    teller.tell(doubtful)
    *head, first, second = capsys.readouterr().out.splitlines()
    assert "Hz" in " ".join(head)
    assert (first.endswith("!"), second.endswith("0.9400 !")) == (False, True)
    end = " ".join(teller.end(replace(RESPONSE, points=(POINT, doubtful)), tmp_path / "f"))
    assert "70 Hz" in end
    assert "0.95" in end


def test_a_reader_that_is_gone_stops_it(console: Console, monkeypatch: MonkeyPatch, data_folder: Path) -> None:
    made = true_position(MACHINE, monkeypatch, data_folder)

    def broken(*_: object, **__: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr("console.cli.machine.tool_tests.print", broken, raising=False)
    said = console("identify", "--link", "tcp:lathe:1", "--yes", *SHORT)
    assert said.code == 1
    assert made.stop.reason == "output closed"
    assert not made.drives_on


def test_the_gains_are_those_of_the_controller_whoever_has_written_them(tmp_path: Path) -> None:
    machine = load_machine(MACHINE_NAME).machine
    sim = SimulatedLathe(machine)
    owner = station_of(sim, tmp_path)
    owner.client.request("I130=600", lines=0)
    owner.client.request("I136=-1.5", lines=0)
    owner.client.request("I168=40", lines=0)
    loop = known(owner.do(ReadLoop()).tool_loop)
    assert (loop.gains["I130"], loop.gains["I131"], loop.unmodelled_settings) == (600.0, 4905.0, ("I168",))
    assert loop.gains["I136"] == -1.5, "the model has the notch filter"
    assert loop.servo_period_ms == pytest.approx(0.4427083730697632)
    assert loop.apply_to(machine).controller.variables["I130"] == 600.0
    # It may be read by a console that only observes, and writes nothing.
    observer = station_of(sim, tmp_path / "other", locking=False)
    assert not observer.state.controls
    observer.line.heard = b""
    assert observer.do(ReadLoop()).tool_loop is not None
    assert b"=" not in observer.line.heard


def test_the_tool_is_tested_and_identified_from_the_screen_as_by_the_commands(tmp_path: Path) -> None:
    owner = station_of(SimulatedLathe(load_machine(MACHINE_NAME).machine), tmp_path)
    owner.do(CheckHealth(step_um=25.0))
    assert (owner.refusals, owner.state.tested) == (["machine.not_enabled", "machine.not_homed"], "")
    owner.do(EnableDrives(), Home(), CheckHealth(step_um=60.0))
    assert owner.refusals == ["identify.amplitude"] and owner.state.activity is Activity.READY
    state = owner.do(CheckHealth(step_um=25.0))
    assert (owner.refusals, owner.alarms, state.activity) == ([], [], Activity.READY)
    (kept,) = kept_tests(tmp_path, MACHINE_NAME, 5)
    assert kept.result is not None and state.tested == kept.file.name == "health-000001.json"
    assert kept.result.sine.gain == pytest.approx(kept.result.model.gain, rel=0.002)
    assert state.snapshot is not None and state.snapshot.loops_closed and state.snapshot.at_rest


def test_a_stop_ends_a_test_and_leaves_the_machine_stopped_with_its_drives_off(tmp_path: Path) -> None:
    owner = station_of(SimulatedLathe(load_machine(MACHINE_NAME).machine), tmp_path)
    owner.do(EnableDrives(), Home())
    begun_s = owner.sim.now_s()
    seen: list[Activity] = []

    def stopping(snapshot: Snapshot) -> None:
        seen.append(owner.state.activity)
        if owner.sim.now_s() > begun_s + 1.6 and owner.stop.reason is None:
            owner.stop.stop("space")

    owner.looks.append(stopping)
    owner.do(CheckHealth(step_um=25.0))
    assert Activity.TESTING in seen
    owner.looks.remove(stopping)
    state = owner.look()
    assert state.stop is not None and state.stop.reason == "space" and state.stop.rest_s is not None
    assert state.activity is Activity.STOPPED and kept_tests(tmp_path, MACHINE_NAME, 5) == ()
    assert state.snapshot is not None and state.snapshot.loops_open
    assert owner.client.request("LIST PROG998") in ((), ("",), ("RET",))


@pytest.mark.first(1)
@pytest.mark.parametrize("command", [CheckHealth(step_um=25.0), IdentifyTool(path=Strategy.PVT)])
def test_nothing_is_kept_of_a_gain_that_changed(tmp_path: Path, command: CheckHealth | IdentifyTool) -> None:
    floor = open_floor(tmp_path, 1, "ideal", load_machine("lee-2001-lathe"), owned=True)
    floor.do(EnableDrives(), Home())
    disturb(floor.sim, (1.0, "I132=2452"))
    state = floor.do(command)
    (alarm,) = state.alarms
    assert (alarm.problem.code, alarm.problem.key) == ("measurement.changed", "I132")
    assert (alarm.problem.value, alarm.problem.limit) == ("2452", "4905")
    assert state.tested == "" and not [*tmp_path.glob("health/**/*.json"), *tmp_path.glob("identified/**/*.json")]
    assert state.snapshot is not None and state.snapshot.loops_open
