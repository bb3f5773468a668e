"""`console controller restore` and `console tune`: what was goes back whole, a busy machine gets nothing."""

from __future__ import annotations

import io
import re
import signal
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pytest import MonkeyPatch

from console.cli.backups import way_back
from console.text.catalogue import LANGUAGES, load
from drivers.commissioning.reading import read_configuration
from drivers.errors import LinkError
from profiles.problem import Problem
from tests.console.commands import Console, answers, occupied, on_one, real
from tests.drivers.commissioned import Commissioned

SPOILED = (
    *("P7=9", "I130=100", "&2Q5=1", "M9=3", "DELETE PROG 5", "OPEN PROG 77 CLEAR", "X1", "CLOSE", "#1DELETE COMP"),
    *("OPEN PLC 3 CLEAR", "P1=1", "CLOSE", "OPEN PLC 25 CLEAR", "P900=1", "CLOSE", "M1->*", "&1"),
)


def body(file: Path) -> list[str]:
    return [line for line in file.read_text("utf-8").splitlines() if not re.match("; (date|sha256) ", line)]


@pytest.fixture
def backed_up(console: Console, card: Commissioned, tmp_path: Path) -> Path:
    card.tell("#1DEFINE COMP 4,#2,#1,40000", "1 2 -3 4", "OPEN PROG 5 CLEAR", "INC X5", "CLOSE")
    card.tell("OPEN PLC 3 CLEAR", "P2=P2+1", "CLOSE", "P7=1.25", "&2Q5=4", "M1->X:$700,24,S", "&1")
    file = tmp_path / "good.pmac"
    assert console("controller", "backup", str(file)).code == 0
    card.line.heard = b""
    return file


@pytest.mark.first(1)
def test_what_was_changed_comes_back_and_can_be_undone(
    console: Console, card: Commissioned, backed_up: Path, tmp_path: Path, data_folder: Path
) -> None:
    card.tell(*SPOILED)
    said = console("controller", "restore", str(backed_up))
    flat = " ".join(said.out.split())
    assert said.code == 0, said.out
    for words in ("PROG 77:1 is 'X1', was '-'", "P7 is '9', was '1.25'", "M9 is '3', was '0'", "&2Q5 is '1'"):
        assert words in flat, words
    assert "the controller now has what the backup has" in flat
    assert b"SAV" not in card.line.heard
    again = tmp_path / "again.pmac"
    assert console("controller", "backup", str(again)).code == 0
    assert body(again) == body(backed_up)
    (before,) = (data_folder / "trilobe" / "backups").iterdir()
    assert f"console controller restore {before}" in said.out
    assert console("controller", "restore", str(before)).code == 0
    assert card.client.numbers("P7", "I130", "M9") == (9.0, 100.0, 3.0)


@on_one
def test_what_it_has_is_not_sent(console: Console, card: Commissioned, backed_up: Path, data_folder: Path) -> None:
    said = console("controller", "restore", str(backed_up), "--json")
    assert (said.code, said.json["sent"], said.json["backup"], said.json["differences"]) == (0, 0, None, [])
    assert b"CLEAR" not in card.line.heard
    assert not (data_folder / "trilobe" / "backups").exists()


@on_one
@pytest.mark.parametrize("language", LANGUAGES)
def test_no_limit_of_0_is_restored(console: Console, card: Commissioned, tmp_path: Path, language: str) -> None:
    """0 is no limit on a PMAC: it is never written, whoever asks."""
    card.tell("I113=0")
    file = tmp_path / "open.pmac"
    assert console("controller", "backup", str(file)).code == 0
    card.tell("I113=5000", "P7=1")
    said = console("controller", "restore", str(file), "--lang", language)
    assert (said.code, "I113;" in said.out) == (1, True)
    assert card.client.numbers("I113", "P7") == (5000.0, 0.0)


@on_one
@pytest.mark.parametrize("answer", ["", "lathe\n"])
def test_nothing_is_sent_to_a_machine_whose_name_was_not_typed(
    console: Console, card: Commissioned, backed_up: Path, monkeypatch: MonkeyPatch, answer: str
) -> None:
    card.tell("P7=9")
    real(card, monkeypatch)
    if answer:
        answers(monkeypatch, answer)
    said = console("controller", "restore", str(backed_up))
    assert (said.code, "P7 is '9', was '1.25'" in said.out) == (1, True)
    assert ("Type the machine name (lee-2001-lathe)" in said.err) == bool(answer)
    assert card.client.numbers("P7") == (9.0,)
    assert console("controller", "restore", str(backed_up), "--yes").code == 0
    assert card.client.numbers("P7") == (1.25,)


@on_one
@pytest.mark.parametrize("why", ["drives", "owner", "gathering", "password", "type", "signature"])
def test_a_machine_that_is_not_free_is_refused(
    console: Console, card: Commissioned, backed_up: Path, monkeypatch: MonkeyPatch, why: str
) -> None:
    card.tell("P7=9")
    words = {
        "drives": "drives are enabled (#1)",
        "owner": "control",
        "gathering": "ENDGATHER",
        "password": "PROG 1000",
        "type": "type PMAC1, X1, this one is PMAC1, X2",
        "signature": "safety.signed_for",
    }
    if why == "type":
        connect = card.client.connect
        monkeypatch.setattr(card.client, "connect", lambda: (connect()[0], "PMAC1, X2"))
    elif not occupied(card, why, 1000):
        real(card, monkeypatch, signed_for="simulator")
    card.line.heard = b""
    said = console("controller", "restore", str(backed_up), "--yes")
    assert (said.code, words[why] in said.err) == (1, True), said.err
    assert b"CLEAR" not in card.line.heard and b"UNDEFINE" not in card.line.heard


def at_program_5(card: Commissioned, monkeypatch: MonkeyPatch, then: Callable[[], None]) -> None:
    """Let something happen when program 5 is about to be sent."""
    send = card.client.send

    def seen(line: str, *words: Any, **named: Any) -> None:
        if line.startswith("OPEN PROG5"):
            then()
        send(line, *words, **named)

    monkeypatch.setattr(card.client, "send", seen)


@on_one
def test_a_restore_that_is_cut_off_names_the_way_back(
    console: Console, card: Commissioned, backed_up: Path, monkeypatch: MonkeyPatch, data_folder: Path
) -> None:
    card.tell("P7=9")

    def torn() -> None:
        raise LinkError(Problem(code="link.lost", where="memory"))

    at_program_5(card, monkeypatch, torn)
    said = console("controller", "restore", str(backed_up))
    (before,) = (data_folder / "trilobe" / "backups").iterdir()
    assert said.code == 1
    assert re.search(r"part of the backup was restored: \d+ of \d+ lines", said.err)
    assert f"console controller restore {before}" in said.err


@on_one
def test_ctrl_c_while_it_sends_waits_for_the_last_line_and_names_the_way_back(
    console: Console, card: Commissioned, backed_up: Path, monkeypatch: MonkeyPatch, data_folder: Path
) -> None:
    card.tell("P7=9")
    at_program_5(card, monkeypatch, lambda: signal.raise_signal(signal.SIGINT))
    said = console("controller", "restore", str(backed_up))
    (before,) = (data_folder / "trilobe" / "backups").iterdir()
    assert said.code != 0
    assert f"console controller restore {before}" in said.err
    assert card.client.numbers("P7", "P1000") == (1.25, 0.0)


@on_one
def test_ctrl_c_while_it_reads_again_names_the_way_back_to_the_same_machine(
    console: Console, card: Commissioned, backed_up: Path, monkeypatch: MonkeyPatch, data_folder: Path
) -> None:
    card.tell("P7=9")
    readings = []

    def interrupted(*words: Any) -> Any:
        readings.append(words)
        if len(readings) == 2:
            signal.raise_signal(signal.SIGINT)
        return read_configuration(*words)

    monkeypatch.setattr(way_back, "read_configuration", interrupted)
    said = console("controller", "restore", str(backed_up), "--machine", "lee-2001-lathe")
    (before,) = (data_folder / "trilobe" / "backups").iterdir()
    assert said.code != 0 and len(readings) == 2
    assert f"console controller restore {before} --machine lee-2001-lathe" in said.err


class Terminal(io.StringIO):
    """What stands on the terminal of stderr."""

    encoding = "ascii"

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("language", LANGUAGES)
def test_how_far_a_reading_is_is_one_line(monkeypatch: MonkeyPatch, language: str) -> None:
    terminal, done = Terminal(), iter([0.0, 0.25, 0.5, 0.9])
    seen, enough = threading.Event(), 3

    def fraction() -> float:
        if terminal.getvalue().count("\r") >= enough:
            seen.set()
        return next(done, 0.95)

    monkeypatch.setattr("sys.__stderr__", terminal)
    monkeypatch.setattr(way_back, "PERIOD_S", 0.001)
    with way_back.show_reading_progress("configuration.reading", load(language), fraction):
        assert seen.wait(5.0)
    said = terminal.getvalue()
    assert said.isascii() and "\\r" not in said
    assert re.search(r"\r[^\r]*25 %[^\r]* s [^\r]*\r[^\r]*50 %", said)
    assert said.endswith(f"\r{' ' * 78}\r")


def test_without_a_terminal_nothing_is_shown(monkeypatch: MonkeyPatch) -> None:
    quiet = io.StringIO()
    monkeypatch.setattr("sys.__stderr__", quiet)
    with way_back.show_reading_progress("configuration.reading", load("en"), lambda: 0.5):
        pass
    assert quiet.getvalue() == ""


NAMES = ("I130", "I131", "I132", "I133")


def stands(card: Commissioned) -> list[float]:
    settings = card.sim.controller.variables.settings()
    return [settings[int(name[1:])] for name in NAMES]


@pytest.mark.first(1)
@on_one
@pytest.mark.parametrize("language", ["en", "ko"])
def test_gains_are_tried_and_back(console: Console, card: Commissioned, data_folder: Path, language: str) -> None:
    before = stands(card)
    shown = console("tune", "show", "--factor", "0.9", "--lang", language)
    assert shown.code == 0 and "I130  528 -> " in shown.out and not (data_folder / "trilobe" / "trials").exists()
    assert "10.87 um/N" in shown.out, "what the published gains yield at most"
    dry = console("tune", "apply", "--factor", "0.9", "--lang", language)
    assert (dry.code, stands(card)) == (0, before) and "--yes" in dry.out
    done = console("tune", "apply", "--factor", "0.9", "--yes", "--lang", language)
    # Kp times 0.9 squared.
    assert (done.code, stands(card)[0]) == (0, round(528 * 0.81))
    told = console("controller", "verify", "--lang", language)
    assert told.code == 1 and "console tune revert --yes" in " ".join(told.out.split())
    found = console("tune", "show", "--json").json["trial"]
    gains = {name: value for name, value in found["before"] if name in NAMES}
    assert gains == dict(zip(NAMES, before, strict=True)) and found["whole"]
    assert console("tune", "revert", "--yes", "--lang", language).code == 0
    assert stands(card) == before
    assert console("controller", "verify").code == 0
    assert console("tune", "revert", "--yes").code == 1


@on_one
@pytest.mark.parametrize("language", ["en", "ko"])
def test_an_unstated_filter_is_written_away(console: Console, card: Commissioned, language: str) -> None:
    card.tell("I136=-0.5", "I138=0.25")
    shown = console("tune", "show", "--lang", language)
    assert "I136 -0.5 (0), I138 0.25 (0)" in shown.out
    assert console("tune", "show", "--json").json["differing"]["I138"] == {"profile": 0.0, "found": 0.25}
    assert console("controller", "verify").code == 1
    assert console("controller", "apply", "--yes", "--lang", language).code == 0
    assert card.client.numbers("I136", "I138") == (0.0, 0.0)
    assert console("controller", "verify").code == 0
    assert "I136" not in console("tune", "show").out


@on_one
def test_an_applied_profile_ends_a_trial(console: Console, card: Commissioned, data_folder: Path) -> None:
    assert console("tune", "apply", "--factor", "0.9", "--yes").code == 0
    assert "on trial" in console("controller", "verify").out
    assert console("controller", "apply", "--yes").code == 0
    verified = console("controller", "verify")
    assert verified.code == 0 and "on trial" not in verified.out
    assert console("tune", "show", "--json").json["trial"] is None


@on_one
def test_gains_beyond_the_bounds_are_refused_with_the_number(console: Console, card: Commissioned) -> None:
    before = stands(card)
    for factor, word in (("2.4", "phase margin with these gains 42.1 deg"), ("9", "0.4..3")):
        said = console("tune", "apply", "--factor", factor, "--yes")
        assert said.code == 1 and word in said.err and stands(card) == before
    card.tell("#1J/")
    said = console("tune", "apply", "--factor", "0.9", "--yes")
    assert said.code == 1 and "#1" in said.err and stands(card) == before
