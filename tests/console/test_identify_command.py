"""`console identify`: what it prints and keeps, what it refuses, and whom it asks."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.cli.machine.identify_report import Teller
from console.session.data.identified import load
from console.session.signals import Interruption
from console.session.station.owning import Owning
from console.session.station.reaching import Reached
from console.text.catalogue import load as words
from drivers.cutting.strategy import Strategy
from drivers.identification.request import IdentificationRequest
from drivers.lathe.heartbeat import Heartbeat
from profiles.machine import SAFETY_DEVICES, MachineProfile
from profiles.store import load_machine
from tests.console.commands import Console, answers
from tests.console.test_identified_store import POINT, RESPONSE
from tests.drivers.identification_bench import Stand, stand
from tests.signed_profile import signed_copy

LANGUAGES = ("en", "ko")
SHORT = ("--frequencies", "30,70", "--periods", "8")
MACHINE = load_machine("lee-2001-lathe").machine


def true_position(machine: MachineProfile, monkeypatch: pytest.MonkeyPatch, data: Path) -> Stand:
    """Let the command take a simulated machine for one of iron, that somebody has signed for."""
    signed_copy(machine.name, data / "trilobe" / "machines")
    made = stand(machine)

    def reach(*_: object) -> Reached:
        return Reached(
            client=made.rig.client,
            lathe=made.rig.lathe,
            heartbeat=Heartbeat(made.rig.client, made.clock, machine),
            stop=made.stop,
            owning=Owning(made.rig.lathe, "tcp:lathe:1", data),
            clock=made.clock,
            address="tcp:lathe:1",
            shop=None,
            close=lambda: None,
        )

    monkeypatch.setattr("console.cli.machine.identify_run.reach", reach)
    return made


def typed(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
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


@pytest.mark.parametrize(
    ("arguments", "met"),
    [
        (("--amplitude", "60"), "60 um"),
        (("--amplitude", "2"), "2 um"),
        (("--frequencies", "10,300"), "300 Hz"),
        (("--periods", "3"), "periods: 3"),
        (("--amplitude", "50", "--frequencies", "215"), "I117"),
    ],
)
def test_what_is_too_much_is_refused_in_a_line(
    console: Console, data_folder: Path, arguments: tuple[str, ...], met: str
) -> None:
    said = console("identify", "--sim", *arguments)
    assert (said.code, said.out) == (1, "")
    assert met in said.err
    assert not (data_folder / "trilobe" / "identified").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("--strategy", "paper"),
        ("--frequencies", "10,x"),
        ("--frequencies", ""),
        ("--amplitude", "nan"),
        ("--periods", "2.5"),
        ("--periods", "-4"),
        ("--link", "tcp:127.0.0.1:1"),  # beside --sim
    ],
)
def test_what_is_not_said_right_is_wrong_usage(console: Console, arguments: tuple[str, ...]) -> None:
    said = console("identify", "--sim", *arguments)
    assert (said.code, len(said.err.splitlines())) == (2, 1)


def test_without_an_address_nothing_is_started(console: Console) -> None:
    said = console("identify")
    assert (said.code, said.out) == (1, "")
    assert "--sim" in said.err


def test_iron_is_not_moved_without_its_name(
    console: Console, monkeypatch: pytest.MonkeyPatch, data_folder: Path
) -> None:
    made = true_position(MACHINE, monkeypatch, data_folder)
    said = console("identify", "--link", "tcp:lathe:1", *SHORT)  # no terminal to ask at
    assert (said.code, "--yes" in said.err) == (1, True)
    typed("lee-2001\n", monkeypatch)
    said = console("identify", "--link", "tcp:lathe:1", *SHORT)
    assert (said.code, "lee-2001-lathe" in said.err) == (1, True)
    assert not made.drives_on
    assert not any(re.search(r"#\d+(J|HM)|OPEN|DEFINE", line) for line in made.lines)


def test_iron_is_moved_when_its_name_is_typed_and_left_with_its_drives_off(
    console: Console, monkeypatch: pytest.MonkeyPatch, data_folder: Path
) -> None:
    made = true_position(MACHINE, monkeypatch, data_folder)
    typed("lee-2001-lathe\n", monkeypatch)
    said = console("identify", "--link", "tcp:lathe:1", "--json", *SHORT)
    assert said.code == 0
    assert (said.json["simulated"], len(said.json["points"])) == (False, 2)
    assert any(re.search(r"#1HM", line) for line in made.lines)
    assert not made.drives_on


@pytest.mark.parametrize("device", SAFETY_DEVICES)
def test_iron_with_an_unknown_safety_device_is_not_moved(
    console: Console, monkeypatch: pytest.MonkeyPatch, data_folder: Path, device: str
) -> None:
    changed: dict[str, Any] = {device: "unknown"}
    made = true_position(replace(MACHINE, safety=replace(MACHINE.safety, **changed)), monkeypatch, data_folder)
    said = console("identify", "--link", "tcp:lathe:1", "--yes", *SHORT)
    assert (said.code, device in said.err) == (1, True)
    assert not made.drives_on
    assert not any(re.search(r"#\d+(J|HM)|OPEN|DEFINE", line) for line in made.lines)


def test_drives_that_are_on_are_left_alone(
    console: Console, monkeypatch: pytest.MonkeyPatch, data_folder: Path
) -> None:
    made = true_position(MACHINE, monkeypatch, data_folder)
    made.tell("#3J/")
    said = console("identify", "--link", "tcp:lathe:1", "--yes", *SHORT)
    assert (said.code, said.out.count("\n") < 7) == (1, True)
    assert made.drives_on and "Hz" not in said.out, "no head of a table without a row"
    assert not any(re.search(r"#\d+HM|OPEN", line) for line in made.lines)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_point_of_low_coherence_is_marked(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, language: str
) -> None:
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


def test_a_reader_that_is_gone_stops_the_machine(
    console: Console, monkeypatch: pytest.MonkeyPatch, data_folder: Path
) -> None:
    made = true_position(MACHINE, monkeypatch, data_folder)

    def broken(*_: object, **__: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr("console.cli.machine.identify_report.print", broken, raising=False)
    said = console("identify", "--link", "tcp:lathe:1", "--yes", *SHORT)
    assert said.code == 1
    assert made.stop.reason == "output closed"
    assert not made.drives_on
