"""`console controller` and `console doctor`: what they print, write, and with which exit code."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from pytest import MonkeyPatch

import console as package
from console.cli.machine.doctor_checks import data_folder_checks
from console.text.catalogue import LANGUAGES, load
from console.text.checks import check_fields
from drivers.commissioning.backup import backup_text
from drivers.commissioning.check import Group
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.commissioning.proofs.bench import names_of
from drivers.commissioning.setting_names import Nature, keys
from drivers.commissioning.verification import StoppingDistance
from profiles.machine import SAFETY_DEVICES
from profiles.store import load_machine
from tests.console.commands import Console, answers, on_one, real
from tests.drivers.commissioned import Commissioned


@pytest.mark.parametrize("language", LANGUAGES)
def test_doctor_is_green(console: Console, card: Commissioned, language: str, data_folder: Path) -> None:
    said = console("doctor", "--lang", language)
    assert (said.code, said.err) == (0, "")
    assert "\n  ✗" not in said.out
    assert said.out.count("✓") > 20
    assert all(len(line) <= 80 for line in said.out.replace(str(data_folder), "/var/lib").splitlines())
    # A key without words shows itself.
    assert not re.search(r"check\.|setting\.|card\.[a-z]|remedy\.", said.out)


@pytest.mark.parametrize("language", LANGUAGES)
def test_doctor_is_red_on_a_card_at_factory_settings(console: Console, card: Commissioned, language: str) -> None:
    card.factory()
    said = console("doctor", "--lang", language)
    assert said.code == 1
    flat = " ".join(said.out.split())
    for word in ("I115", "0.25 counts/ms2 (50 mm/s2)", "192 rpm", "6.7136 mm, 2.098 s", "(I113)"):
        assert word in flat, word
    assert not re.search(r"check\.|setting\.|card\.[a-z]|remedy\.", said.out)


def test_doctor_says_what_would_help(console: Console, card: Commissioned) -> None:
    card.tell("I115=0.25")
    flat = " ".join(console("doctor").out.split())
    assert (
        "✗ deceleration after a stop of the tool (I115) is 0.25 counts/ms2 (50 mm/s2): the tool stops too slowly"
        " from lobe speed; expected 40 counts/ms2 (8000 mm/s2); set it at the controller with the drives"
        " killed: the console never writes limits"
    ) in flat


WHO_CHECKS = {
    "network": ("network_checksums", "holds", "the network checks its packets"),
    "controller": ("line_checksums", "holds", "the controller reports what it received"),
    "nobody": ("line_checksums", "warned", "shows only as wrong motion"),
}


@pytest.mark.parametrize("who", list(WHO_CHECKS))
def test_doctor_tells_who_checks(console: Console, card: Commissioned, monkeypatch: MonkeyPatch, who: str) -> None:
    """A controller that does not answer control-N is no reason not to work; it has to be known."""
    monkeypatch.setattr(card.link, "checks_bytes", who == "network")
    heard = card.line.receive
    if who == "nobody":
        monkeypatch.setattr(card.line, "receive", lambda data: heard(data.replace(b"\x0e", b"")))
    said = console("doctor", "--json")
    (found,) = [check for check in said.json["checks"] if check["code"].endswith("_checksums")]
    code, severity, told = WHO_CHECKS[who]
    assert (said.code, found["code"], found["outcome"]) == (0, code, severity)
    assert told in found["text"]


def test_doctor_writes_nothing_without_prove(console: Console, card: Commissioned) -> None:
    settings = dict(card.sim.controller.variables.settings())
    assert console("doctor").code == 0
    assert card.sim.controller.variables.settings() == settings
    written = [line for line in card.lines if re.search(r"=|->.", line) and not re.fullmatch(r"[#&\d?> -]+", line)]
    allowed = re.compile(r"I3=2 I6=1( I4=0)?( I64=1)?.*|I4=0|P1001=\d+ P1001.*|")
    assert [line for line in written if not allowed.fullmatch(line.strip("\x18\n "))] == []


@pytest.mark.long
def test_doctor_proves_when_asked_and_a_simulated_machine_leaves_no_record(
    console: Console, card: Commissioned, monkeypatch: MonkeyPatch, data_folder: Path
) -> None:
    """On a link that checks no bytes, so that the checksum of each line that moves comes first."""
    monkeypatch.setattr(card.link, "checks_bytes", False)
    said = console("doctor", "--prove", "--json")
    assert (said.code, stop_lines(said)) == (0, {})
    assert not (data_folder / "trilobe" / "stops").exists()
    proofs = {c["code"]: c["outcome"] for c in said.json["checks"] if c["group"] == "proofs"}
    assert proofs == {f"proof_{name}": "holds" for name in names_of(card.machine)}


def test_iron_is_not_moved_unnamed(console: Console, card: Commissioned, monkeypatch: MonkeyPatch) -> None:
    real(card, monkeypatch)
    said = console("doctor", "--prove")  # no terminal to ask at
    assert (said.code, "--yes" in said.err) == (1, True)
    answers(monkeypatch, "lee-2001")
    said = console("doctor", "--prove")
    assert said.code == 1
    assert "lee-2001-lathe" in said.err
    assert not any("J" in line or "OPEN" in line or "DEFINE" in line for line in card.lines)


def stop_lines(said: Any) -> dict[str, str]:
    """What is said of the stop record, by its code."""
    codes = {c["code"]: c["outcome"] for c in said.json["checks"]}
    return {code: severity for code, severity in codes.items() if code.startswith(("stops_", "stop_record"))}


@on_one
def test_iron_is_moved_when_its_name_is_typed_and_has_a_stop_record_until_it_stops_otherwise(
    console: Console, card: Commissioned, monkeypatch: MonkeyPatch, data_folder: Path
) -> None:
    real(card, monkeypatch)
    assert stop_lines(console("doctor", "--json")) == {"stops_no_record": "warned"}
    answers(monkeypatch, "lee-2001-lathe\n")
    proven = console("doctor", "--prove", "--json")
    assert "#2J/" in card.lines
    assert (proven.code, stop_lines(proven)) == (0, {"stop_record": "holds"})
    again = console("doctor", "--json")
    told = [check["code"] for check in again.json["checks"] if check["group"] == "proofs"]
    assert told == ["proofs_kept"], "the tests of this day are known without moving again"
    assert card.client.numbers("P1000") == (0.0,)  # nobody is left to own the machine
    (file,) = (data_folder / "trilobe" / "stops").iterdir()
    assert '"tcp:lathe:1"' in file.read_text(encoding="utf-8")
    card.tell("I219=0.2")
    said = console("doctor", "--json")
    assert stop_lines(said) == {"stops_other_settings": "warned"}
    card.tell("I219=0.1")
    # Ramps of the card that are longer than what was read back makes of them.
    bounds = "drivers.commissioning.proofs.stopping.after_abort"
    monkeypatch.setattr(bounds, lambda speed, rate, late_ms: StoppingDistance(0.0, 0.0))
    assert console("doctor", "--prove", "--yes").code == 1
    assert not file.exists()


@on_one
def test_a_machine_of_another_is_untouched(console: Console, card: Commissioned, monkeypatch: MonkeyPatch) -> None:
    real(card, monkeypatch)
    card.tell("P1000=77")
    said = console("doctor", "--prove", "--yes")
    assert said.code == 1
    assert not any(motor.amplifier_enabled for motor in card.sim.controller.motors.values())
    assert card.client.numbers("P1000") == (77.0,)


@pytest.mark.first(1)
def test_backup_then_diff(console: Console, card: Commissioned, tmp_path: Path) -> None:
    file = tmp_path / "card.pmac"
    assert console("controller", "backup", str(file)).code == 0
    assert console("controller", "diff", str(file)).code == 0
    card.tell("I116=400")
    said = console("controller", "diff", str(file))
    assert said.code == 1
    assert "400 counts/ms (80 mm/s), was 500 counts/ms (100 mm/s) (I116=500)" in " ".join(said.out.split())
    again = console("controller", "backup", str(file))
    assert (again.code, "exists" in again.err) == (1, True)
    other = "turbo" if card.dialect.name == "pmac" else "pmac"
    for text, word in (
        ("I116=400\n", ""),
        (backup_text(ControllerConfiguration(family=other, kind="K", version="1", settings={}), "D"), other),
    ):
        file.write_text(text, encoding="ascii")
        said = console("controller", "diff", str(file))
        assert said.code == 1 and word in said.err


def test_verify_tells_only_what_is_worth_telling(console: Console, card: Commissioned) -> None:
    said = console("controller", "verify")
    assert (said.code, "✓" in said.out) == (0, False)
    card.tell("I51=1")
    assert console("controller", "verify").code == 1
    checks = console("controller", "verify", "--json").json["checks"]
    assert [c["code"] for c in checks if c["outcome"] == "fails"] == ["compensation"]


@on_one
def test_apply_shows_first_and_sends_when_told(console: Console, card: Commissioned, data_folder: Path) -> None:
    card.tell("I130=600", "I115=20")
    card.line.heard = b""
    said = console("controller", "apply")
    assert (said.code, "I130=528   (now 600)" in said.out) == (0, True)
    assert card.client.numbers("I130", "I115") == (600.0, 20.0)
    folder = data_folder / "trilobe" / "backups"
    assert not folder.exists()
    said = console("controller", "apply", "--yes")
    assert said.code == 0
    assert card.client.numbers("I130", "I115") == (528.0, 20.0)
    (backup,) = folder.iterdir()
    assert "\nI130=600\n" in backup.read_text(encoding="utf-8")
    assert (folder.stat().st_mode & 0o777, backup.stat().st_mode & 0o777) == (0o700, 0o600)
    assert b"SAV" not in card.line.heard


def test_apply_writes_nothing_without_a_backup_nor_with_the_drives_on(
    console: Console, card: Commissioned, tmp_path: Path
) -> None:
    card.tell("I130=600")
    blocked = tmp_path / "blocked"
    blocked.mkdir()
    (blocked / "backups").write_text("", encoding="ascii")  # a file where the folder would be
    said = console("controller", "apply", "--yes", "--data", str(blocked))
    assert (said.code, str(blocked) in said.err, len(said.err.splitlines())) == (1, True, 1)
    assert "report" not in said.err  # it is no fault of the program
    card.tell("#1J/")
    said = console("controller", "apply", "--yes")
    assert (said.code, "#1" in said.err) == (1, True)
    assert card.client.numbers("I130") == (600.0,)


def test_what_is_not_said_right_is_wrong_usage_before_anything_is_started(console: Console) -> None:
    controller = (("controller", *rest) for rest in ((), ("backup",), ("diff",), ("mend",)))
    for words in (*controller, ("doctor", "x")):
        said = console(*words)
        assert (said.code, len(said.err.splitlines())) == (2, 1)
    said = console("doctor", "--link", "parallel:1")
    assert (said.code, "parallel:1" in said.err) == (1, True)


@pytest.mark.parametrize("language", LANGUAGES)
def test_everything_that_can_be_said_has_words(language: str) -> None:
    (folder,) = package.__path__
    files = (Path(folder) / "text" / language).glob("*.toml")
    words = {key for file in files for key in tomllib.loads(file.read_text(encoding="utf-8"))}
    sources = Path(package.__file__ or "").parents[1] / "drivers" / "commissioning"
    code = "\n".join(path.read_text(encoding="utf-8") for path in sources.rglob("*.py"))
    said = set(re.findall(r'(?:code=|about\(\s*|(?:_check|Check)\(\s*[\w.]+,\s*)"([a-z_]+)"', code))
    said |= set(re.findall(r'"(\w+)" if \w+ else "\w+"', code)) | set(re.findall(r'if \w+ else "(\w+)"', code))
    names = names_of(load_machine("lee-2001-lathe").machine)
    said |= {f"unproven_{name}" for name in names} | {f"proof_{name}" for name in names}
    said -= {"word", "own_time", "settings_hold", "timers_run"}  # these hold, or are none
    missing = {
        f"check.{name}" for name in said if f"check.{name}" not in words and f"check.{name}.holds" not in words
    }
    missing |= {f"setting.{key}{kind}" for key in keys() for kind in ("", ".effect")} - words
    missing |= {f"remedy.{nature}" for nature in Nature} | {f"configuration.group.{group}" for group in Group}
    missing |= {f"configuration.subject.{device}" for device in SAFETY_DEVICES}
    assert sorted(missing - words) == []
    assert len(said) > 40


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_signature_for_the_simulator_fails_on_iron(
    console: Console, card: Commissioned, monkeypatch: MonkeyPatch, language: str
) -> None:
    real(card, monkeypatch, signed_for="simulator")
    for command in (("doctor",), ("doctor", "--prove", "--yes"), ("controller", "verify")):
        said = console(*command, "--lang", language)
        assert said.code == 1, command
        assert [line for line in said.out.splitlines() if "✗" in line and "safety.signed_for" in line], command
    assert not any(motor.amplifier_enabled or motor.jogging for motor in card.sim.controller.motors.values())
    assert not any("J" in line or "OPEN" in line for line in card.lines)


@on_one
def test_unsigned_gains_are_not_written(console: Console, card: Commissioned, monkeypatch: MonkeyPatch) -> None:
    card.tell("I130=77")
    real(card, monkeypatch, signed_for="simulator")
    said = console("controller", "apply", "--yes")
    assert (said.code, said.out) == (1, "")
    assert "safety.signed_for" in said.err
    assert card.client.numbers("I130") == (77.0,)
    real(card, monkeypatch)
    assert console("controller", "apply", "--yes").code == 0
    assert card.client.numbers("I130") != (77.0,)


def test_doctor_tells_of_another_package_that_brings_the_command(
    console: Console, card: Commissioned, monkeypatch: MonkeyPatch, tmp_path: Path
) -> None:
    assert "use the command" not in console("doctor").out
    other = tmp_path / "console-0.9.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: console\nVersion: 0.9\n", encoding="ascii")
    (other / "entry_points.txt").write_text("[console_scripts]\nconsole = other:main\n", encoding="ascii")
    monkeypatch.syspath_prepend(str(tmp_path))
    said = console("doctor")
    assert "use the command trilobe" in " ".join(said.out.split())
    assert said.code == 0, "a warning stops nothing"


def said(data: Path, language: str = "en") -> list[tuple[str, str, str]]:
    fields = check_fields(data_folder_checks(data), load(language))
    return [(str(each["code"]), str(each["outcome"]), str(each["text"])) for each in fields]


CASES = {
    0o700: ("data_folder_private", "holds", "only its owner can write"),
    0o755: ("data_folder_private", "holds", "only its owner can write"),  # and everybody can read
    0o2770: ("data_folder_shared", "holds", "shared within the group"),
    0o2777: ("data_folder_open", "fails", "chmod o-rwx"),
    0o777: ("data_folder_open", "fails", "chmod o-rwx"),
    0o2750: ("data_folder_half", "warned", "chmod 2770"),
    0o770: ("data_folder_not_setgid", "warned", "chmod 2770"),
    0o3770: ("data_folder_sticky", "warned", "chmod -t"),
}


def test_rights_that_share_too_much_or_only_half_are_said_with_the_remedy(tmp_path: Path) -> None:
    for mode, (code, outcome, words) in CASES.items():
        tmp_path.chmod(mode)
        ((found, how, text),) = said(tmp_path)
        assert (found, how, words in text, str(tmp_path) in text) == (code, outcome, True, True), text
        assert re.search(r"GB free|\([d-][rwxstST-]{9} ", text), text
        ((_, _, korean),) = said(tmp_path, "ko")
        assert str(tmp_path) in korean and korean != text and "check." not in korean


def test_what_the_group_cannot_use_is_counted_and_the_first_named(tmp_path: Path) -> None:
    tmp_path.chmod(0o2770)
    (tmp_path / "jobs").mkdir()
    (tmp_path / "jobs").chmod(0o2770)
    for name, mode in (("a.toml", 0o660), ("b.toml", 0o640), ("c.toml", 0o600)):
        (tmp_path / "jobs" / name).touch()
        (tmp_path / "jobs" / name).chmod(mode)
    ((code, outcome, text),) = said(tmp_path)
    assert (code, outcome) == ("data_folder_closed", "warned")
    assert "2 files or folders, first jobs/b.toml" in text and "-exec chmod g+s '{}' +" in text


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_missing_folder_is_none_a_full_disk_is(tmp_path: Path, monkeypatch: MonkeyPatch, language: str) -> None:
    assert [each[:2] for each in said(tmp_path / "new", language)] == [("data_folder_missing", "noted")]

    class Full:
        f_bavail, f_frsize = 10, 4096

    tmp_path.chmod(0o700)
    monkeypatch.setattr(os, "statvfs", lambda _: Full)
    ((code, outcome, text),) = said(tmp_path, language)
    assert (code, outcome, "0.0 GB" in text) == ("data_folder_full", "warned", True)
    (tmp_path / "file").touch()
    assert [each[:2] for each in said(tmp_path / "file" / "data", language)] == [("data_folder_unusable", "fails")]
