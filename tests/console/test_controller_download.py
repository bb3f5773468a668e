"""`console controller download`: arrives as the card lists it, or nothing is sent; whose place a command takes."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pytest import MonkeyPatch

from console.session.station.machine_control import take_lock
from console.text.catalogue import LANGUAGES
from drivers.errors import LinkError
from profiles.problem import Problem
from tests.console.commands import Console, answers, occupied, on_one, real
from tests.console.consoles import logged
from tests.console.floor import known
from tests.drivers.commissioned import Commissioned

LIMITS = "#define SPEED 20\n#define READY P50\n"
TWO = """\
#include "limits.h"
OPEN PROG 101
CLEAR
inc          ; as it is typed
TA 100 TS 20 TM 500
x 1000 Y(P60*2)
dwe 20
X-1000
CLOSE
OPEN PROG 102 CLEAR
F SPEED
RET
CLOSE
OPEN PLC 5 CLEAR
IF (READY = 1)
P51 = SPEED
ENDI
CLOSE
"""
LISTED = {  # whole words, no blanks, the rest as typed, RETURN behind each (Software Reference, LIST)
    "LIST PROG101": ["INC", "TA100TS20TM500", "X1000Y(P60*2)", "DWE20", "X-1000", "RET"],
    "LIST PROG102": ["F20", "RET"],
    "LIST PLC5": ["IF(P50=1)", "P51=20", "ENDI", "RET"],
}


@pytest.fixture(autouse=True)
def profile(card: Commissioned, monkeypatch: MonkeyPatch) -> None:
    """The profile is that of the card, in both families."""
    loaded = SimpleNamespace(machine=card.machine, path="memory")
    monkeypatch.setattr("console.cli.backups.download_file.profile_of", lambda _: loaded)


@pytest.fixture
def own(tmp_path: Path) -> Callable[..., str]:
    def write(text: str, header: str = LIMITS) -> str:
        (tmp_path / "limits.h").write_text(header, encoding="utf-8")
        path = tmp_path / "mine.pmc"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


def listing(card: Commissioned, question: str) -> list[str]:
    return [line.strip() for line in card.client.question(question)]


def sent(card: Commissioned) -> str:
    return card.line.heard.decode("latin-1")


def flat(text: str) -> str:
    return " ".join(text.split())


def test_a_file_arrives_as_it_is_listed(console: Console, card: Commissioned, own: Callable[..., str]) -> None:
    card.tell("OPEN PROG 101 CLEAR", "X7", "X8", "CLOSE", "OPEN PLC 5 CLEAR", "P9=P9+1", "CLOSE", "I5=2")
    card.tell("ENABLE PLC 5")
    card.line.heard = b""
    said = console("controller", "download", own(TWO))
    assert said.code == 0, said.err
    assert {question: listing(card, question) for question in LISTED} == LISTED
    words = ("PROG 101: lines now 2, then 5", "PROG 102: new", "PLC 5 may be running", "you send SAVE")
    assert [each for each in words if each not in flat(said.out)] == []
    assert sent(card).index("DISABLE PLC 5\r") < sent(card).index("OPEN PLC5\r")
    assert "SAV" not in sent(card) and "ENABLE" not in sent(card)
    (before,) = card.client.numbers("P9")
    card.sim.wait(1.0)
    assert card.client.numbers("P9") == (before,)


@on_one
def test_what_was_replaced_comes_back_from_the_backup_that_it_names(
    console: Console, card: Commissioned, own: Callable[..., str], data_folder: Path
) -> None:
    card.tell("OPEN PROG 101 CLEAR", "X7", "X8", "CLOSE", "OPEN PLC 5 CLEAR", "P9=P9+1", "CLOSE")
    said = console("controller", "download", own(TWO))
    (kept,) = (data_folder / "trilobe" / "backups").iterdir()
    assert f"To undo: console controller restore {kept}" in said.out
    card.tell("OPEN PROG 103 CLEAR", "X9", "CLOSE")  # somebody else's, after the download
    diff = console("controller", "diff", str(kept))
    assert diff.code == 1 and "PROG 102:1" in diff.out and "PROG 103" not in diff.out
    assert console("controller", "restore", str(kept)).code == 0
    assert listing(card, "LIST PROG101") == ["X7", "X8", "RET"]
    assert listing(card, "LIST PLC5") == ["P9=P9+1", "RET"]
    assert listing(card, "LIST PROG103") == ["X9", "RET"]
    assert listing(card, "LIST PROG102") == ["RET"], "new in the file: erased as well"


@on_one
def test_what_is_there_already_is_not_sent_again(
    console: Console, card: Commissioned, own: Callable[..., str], data_folder: Path
) -> None:
    file = own(TWO)
    assert console("controller", "download", file).code == 0
    card.tell("OPEN PROG 102 CLEAR", "F21", "CLOSE")
    card.line.heard = b""
    said = console("controller", "download", file, "--json")
    assert (said.code, said.err) == (0, "")
    assert [each["name"] for each in said.json["buffers"] if each["sent"]] == ["PROG 102"]
    assert (said.json["sent"], said.json["differences"]) == (5, [])
    assert "OPEN PROG101" not in sent(card) and "OPEN PLC5" not in sent(card)
    card.line.heard = b""
    said = console("controller", "download", file)
    assert said.code == 0 and "nothing to send" in said.out
    assert "OPEN" not in sent(card)
    assert len(list((data_folder / "trilobe" / "backups").iterdir())) == 2


GOOD = "OPEN PROG 101 CLEAR\nX1\nCLOSE\n"
REFUSED = {
    "R": (GOOD + "&1B101R\n", "line 4: &1B101R stands outside"),
    "enable": (GOOD + "ENABLE PLC 5\n", "line 4: ENABLE PLC 5 stands outside"),
    "save": (GOOD + "SAVE\n", "line 4: SAVE stands outside"),
    "jog": ("#1J+\n" + GOOD, "line 1: #1J+ stands outside"),
    "value": ("P5=1\n" + GOOD, "line 1: P5=1 stands outside"),
    "definition": (GOOD + "M5->X:$700,24\n", "line 4: M5->X:$700,24 stands outside"),
    "axis": ("#1->X\n" + GOOD, "line 1: #1->X stands outside"),
    "behind close": ("OPEN PROG 101 CLEAR\nX1\nCLOSE R\n", "line 3: R stands outside"),
    "clear": (GOOD + "CLEAR\n", "line 4: CLEAR stands outside"),
    "reset": (GOOD + "$$$***\n", "line 4: $$$*** stands outside"),
    "in a buffer": ("OPEN PROG 101 CLEAR\nX1\n#1J+\nCLOSE\n", "line 3: the controller refuses"),
    "jog in a buffer": ("OPEN PROG 101 CLEAR\nX1 J+\nCLOSE\n", "line 2: the controller refuses"),
    "control": ('OPEN PROG 101 CLEAR\nX1\nSEND"\x01"\nCLOSE\n', "line 3: the controller refuses"),
    "korean": ('OPEN PROG 101 CLEAR\nX1\nSEND"가"\nCLOSE\n', "line 3: the controller refuses"),
    "plc 20": (GOOD + "OPEN PLC 20 CLEAR\nP1=1\nCLOSE\n", "line 4: PLC 20 belongs to the console"),
    "program 1": ("OPEN PROG 1 CLEAR\nX1\nCLOSE\n", "line 1: PROG 1 belongs to the console"),
    "owner": ("OPEN PROG 101 CLEAR\nX1 P1000=0\nCLOSE\n", "line 2: P1000 would be written"),
    "guard": (GOOD + "OPEN PLC 5 CLEAR\nP(1000+3)=0\nCLOSE\n", "line 5: P1003 would be written"),
    "by command": (
        'OPEN PLC 5 CLEAR\nCMD"P998..1001=0"\nCLOSE\n',
        "line 2: P998, P999, P1000, P1001 would be written",
    ),
    "no clear": ("OPEN PROG 101\nX1\nCLOSE\n", "line 1: PROG 101 is opened without CLEAR"),
    "cut off": ("OPEN PROG 101 CLEAR\nX1\n", "line 1: PROG 101 has no CLOSE"),
    "twice": (GOOD + GOOD, "line 4: PROG 101 is opened twice"),
    "long": (f"OPEN PROG 101 CLEAR\nP1=P1{'+P1' * 90}\nX1\nCLOSE\n", "line 2 is longer than 250 characters"),
    "wrong word": (
        "OPEN PROG 101 CLEAR\nX1\nCLOSE\nOPEN PLC 5 CLEAR\nX1\nCLOSE\n",
        "line 5: the controller refuses",
    ),
    "if": ("OPEN PLC 5 CLEAR\nIF(P1=1)\nCLOSE\n", "the controller could not run PLC 5"),
    "nothing": ("; only a comment\n", "there is no buffer"),
    "too far": ("OPEN PROG 101 CLEAR\nINC TM1000\nX99999999\nCLOSE\n", "line 3: motor 1 moves to 99999999 counts"),
}


@on_one
@pytest.mark.parametrize("why", REFUSED)
def test_a_refused_file_sends_none(
    console: Console, card: Commissioned, own: Callable[..., str], why: str
) -> None:
    text, words = REFUSED[why]
    card.line.heard = b""
    said = console("controller", "download", own(text), "--yes")
    assert said.code == 1 and words in flat(said.err), said.err
    assert card.line.heard == b""


@on_one
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_wrong_line_of_an_included_file_is_named_there(
    console: Console, card: Commissioned, own: Callable[..., str], language: str
) -> None:
    text = 'OPEN PROG 101 CLEAR\n#include "limits.h"\nCLOSE\n#include "limits.h"\n'
    card.line.heard = b""
    said = console("controller", "download", own(text, "TM500\nX1000 YY\n"), "--lang", language)
    assert said.code == 1 and card.line.heard == b""
    finding, refused = {
        "en": ("line 2 (limits.h:2):", "line 4, limits.h:1"),
        "ko": ("2행 (limits.h:2):", "행 4, limits.h:1:"),
    }[language]
    assert finding in said.err and refused in said.err


@on_one
@pytest.mark.parametrize("why", ["drives", "owner", "gathering", "password", "signature", "name"])
def test_a_machine_that_is_not_free_keeps_its_programs(
    console: Console, card: Commissioned, own: Callable[..., str], monkeypatch: MonkeyPatch, why: str
) -> None:
    words = {
        "drives": "drives are enabled (#1)",
        "owner": "control",
        "gathering": "ENDGATHER",
        "password": "PROG 1001",
        "signature": "safety.signed_for",
        "name": "machine name",
    }
    yes = ["--yes"]
    if why == "signature":
        real(card, monkeypatch, signed_for="simulator")
    elif not occupied(card, why, 1001):
        real(card, monkeypatch)
        yes = []
        answers(monkeypatch, "lathe\n")
    card.line.heard = b""
    said = console("controller", "download", own(GOOD.replace("101", "1001")), *yes)
    assert said.code == 1, said.out
    assert words[why] in said.err, said.err
    assert "OPEN" not in sent(card) and "CLEAR" not in sent(card)


def when_sent(card: Commissioned, monkeypatch: MonkeyPatch, line: str, then: Callable[[], str]) -> None:
    """Send something else in the place of a line."""
    send = card.client.send

    def seen(text: str, *words: Any, **named: Any) -> None:
        send(then() if text == line else text, *words, **named)

    monkeypatch.setattr(card.client, "send", seen)


@on_one
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_line_that_the_card_refuses_is_named_and_what_the_buffers_hold_is_read(
    console: Console,
    card: Commissioned,
    own: Callable[..., str],
    monkeypatch: MonkeyPatch,
    data_folder: Path,
    language: str,
) -> None:
    when_sent(card, monkeypatch, "F 20", lambda: "F 20 NONSENSE")
    said = console("controller", "download", own(TWO), "--lang", language)
    (kept,) = (data_folder / "trilobe" / "backups").iterdir()
    assert said.code == 1
    parts = {"en": "as in the file: PROG 101; in part: PROG 102; as before: PLC 5"}
    parts["ko"] = "파일과 같음: PROG 101; 일부만: PROG 102; 이전과 같음: PLC 5"
    assert parts[language] in said.err, said.err
    assert ("line 11 of" if language == "en" else "행 11 입니다") in said.err
    assert f"console controller restore {kept}" in said.err
    assert listing(card, "LIST PROG102") == ["RET"]
    assert card.client.numbers("P1000") == (0.0,)


@on_one
def test_a_link_that_is_lost_in_the_middle_leaves_word_of_what_is_there(
    console: Console, card: Commissioned, own: Callable[..., str], monkeypatch: MonkeyPatch
) -> None:
    torn = False
    when_sent(card, monkeypatch, "F 20", lambda: tear())
    listing_again = card.client.question

    def tear() -> str:
        nonlocal torn
        torn = True
        raise LinkError(Problem(code="link.lost", where="memory"))

    def question(*words: Any, **named: Any) -> tuple[str, ...]:
        if torn:
            raise LinkError(Problem(code="link.lost", where="memory"))
        return listing_again(*words, **named)

    monkeypatch.setattr(card.client, "question", question)
    said = console("controller", "download", own(TWO), "--json")
    assert said.code == 1
    assert "as in the file: PROG 101; in part: PROG 102; as before: PLC 5; it could not be read" in said.err
    codes = [error["code"] for error in said.json["errors"]]
    assert codes[-2:] == ["download.left_unread", "controller.restore_undo"]


@on_one
def test_a_card_that_keeps_something_else_is_found_out(
    console: Console, card: Commissioned, own: Callable[..., str], monkeypatch: MonkeyPatch
) -> None:
    when_sent(card, monkeypatch, "X-1000", lambda: "X-100")
    said = console("controller", "download", own(TWO))
    assert said.code == 1
    assert "PROG 101:5 is 'X-100', was 'X-1000'" in flat(said.out)


def test_kinematics_go_to_their_system(console: Console, card: Commissioned, own: Callable[..., str]) -> None:
    text = "&2 OPEN INVERSE\nCLEAR\nP1 = Q7*10\nCLOSE\n&2\nOPEN FORWARD CLEAR\nQ7=P1/10\nCLOSE\n"
    card.line.heard = b""
    said = console("controller", "download", own(text))
    if card.machine.controller.family == "pmac":
        assert said.code == 1 and card.line.heard == b""
        return
    assert said.code == 0, said.err
    assert listing(card, "&2LIST INVERSE") == ["P1=Q7*10", "RET"]
    assert listing(card, "&2LIST FORWARD") == ["Q7=P1/10", "RET"]


@on_one
def test_a_tab_is_sent_as_a_blank(console: Console, card: Commissioned, own: Callable[..., str]) -> None:
    """Control-I is a command of the card: it repeats the last line."""
    assert console("controller", "download", own(GOOD.replace("X1", "INC\tX1"))).code == 0
    assert b"\t" not in card.line.heard
    assert listing(card, "LIST PROG101") == ["INCX1", "RET"]


@on_one
@pytest.mark.parametrize("language", LANGUAGES)
def test_its_lines_fit_80_columns(
    console: Console, card: Commissioned, own: Callable[..., str], language: str, data_folder: Path
) -> None:
    from console.text.columns import cell_width

    said = console("controller", "download", own(TWO), "--lang", language)
    assert said.code == 0
    lines = [line for line in said.out.splitlines() if str(data_folder) not in line]
    assert all(cell_width(line) <= 80 for line in lines), lines
    assert not re.search(r"download\.|configuration\.", said.out)


ADDRESS = "tcp:lathe:1"
"""That of the real controller of these tests."""

DEAD = 4711
BACKUP = "backup"
COMMANDS = (
    ("doctor", "--prove", "--yes"),
    ("tune", "apply", "--factor", "0.9", "--yes"),
    ("controller", "apply", "--yes"),
    ("controller", "restore", BACKUP, "--yes"),
    ("controller", "download", GOOD, "--yes"),
)

every_command = pytest.mark.parametrize("words", COMMANDS, ids=lambda words: "-".join(words[:2]))


@pytest.fixture
def command(
    console: Console, card: Commissioned, monkeypatch: MonkeyPatch, tmp_path: Path, words: tuple[str, ...]
) -> Callable[[], Any]:
    """The command, for a real machine that has something to write: its filter differs from profile and backup."""
    backup, program = tmp_path / "whole.pmac", tmp_path / "own.pmc"
    assert console("controller", "backup", str(backup)).code == 0
    program.write_text(GOOD, "utf-8")
    files = {BACKUP: str(backup), GOOD: str(program)}
    real(card, monkeypatch)
    monkeypatch.setattr(card.client, "connect", lambda: ("1.17", "PMAC1, X1"))
    if words[0] == "controller":
        card.tell("I138=0.25")
    return lambda: console(*(files.get(word, word) for word in words))


def left_by(number: int, data: Path, *, dead: bool) -> Any:
    """What a console leaves in the lock of its computer; its lock too, unless it is dead."""
    lock = known(take_lock(data, ADDRESS))
    lock.keep(number)
    if dead:
        lock.close()
    return lock


@on_one
@every_command
def test_a_dead_console_is_replaced(card: Commissioned, command: Callable[[], Any], data_folder: Path) -> None:
    data = data_folder / "trilobe"
    left_by(DEAD, data, dead=True)
    card.tell(f"P1000={DEAD}")
    said = command()
    assert "control" not in said.err, said.err
    assert said.code == 0, said.out + said.err
    assert card.client.numbers("P1000") == (0.0,)
    (line,) = logged(data)
    assert line.startswith(f"{ADDRESS} in the place of a console that died: console {DEAD} -> console ")


@on_one
@every_command
@pytest.mark.parametrize("whose", ["running", "elsewhere"])
def test_a_console_that_may_be_alive_keeps_control(
    card: Commissioned, command: Callable[[], Any], data_folder: Path, whose: str
) -> None:
    data = data_folder / "trilobe"
    left_by(DEAD, data, dead=whose == "elsewhere")
    held = DEAD if whose == "running" else DEAD + 1
    card.tell(f"P1000={held}")
    said = command()
    assert (said.code, "control" in said.err) == (1, True), said.out + said.err
    assert card.client.numbers("P1000") == (float(held),)
    assert logged(data) == []
