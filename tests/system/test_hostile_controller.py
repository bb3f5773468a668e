"""Every command that opens a link, at a controller that does not cooperate: it ends, says why, and moves nothing.

The controller is a small server of its own (`tests/hostile`), at a real socket or pseudo-terminal, that keeps
every byte it gets. It is hostile from its first byte on, after it was identified, or deep within what a command
reads. In the long tests they take turns; with HOSTILE=all in the environment each command has each way at each
depth.
"""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from console.text.catalogue import load
from drivers.commissioning.backup import backup_text
from drivers.commissioning.configuration import ControllerConfiguration
from profiles.store import load_machine
from tests.hostile.hostile_card import WAYS, HostileCard, Kind, hostile_card
from tests.preloaded import Preloaded
from tests.signed_profile import signed_copy
from tests.system.run_over_link import Order, order
from tests.terminal import Terminal

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

COMMANDS = {
    "doctor": ("doctor",),
    "doctor --prove": ("doctor", "--prove", "--yes"),
    "controller backup": ("controller", "backup", "{file}"),
    "controller verify": ("controller", "verify"),
    "controller diff": ("controller", "diff", "{file}"),
    "controller apply": ("controller", "apply", "--yes"),
    "controller restore": ("controller", "restore", "{file}", "--yes"),
    "controller download": ("controller", "download", "{file}", "--yes"),
    "tune show": ("tune", "show"),
    "tune apply": ("tune", "apply", "--yes"),
    "tune revert": ("tune", "revert", "--yes"),
    "identify": ("identify", "--yes"),
    "health": ("health", "--yes"),
    "retract": ("retract", "--yes"),
    "run": ("run", "{job}", "--yes"),
}
"""All that opens a link; `calibrate` and `learn` read files, `fault` and `instruct` speak to a simulator only."""

BACKED_UP = ControllerConfiguration(family="pmac", kind="PMAC1", version="1.17F", settings={130: 528.0})

FIRST_BYTE, IDENTIFIED, DEEP = 0, 6, 60
"""Honest lines before the first hostile one: a client is identified after four, and proven in step after six."""

DEPTHS = {FIRST_BYTE: "from the first byte", IDENTIFIED: "once identified", DEEP: "deep within"}
READ_DEEPLY = ("doctor", "controller backup", "controller verify")
ENDS_WITHIN_S = 60.0
"""However busy the computer: the longest wait is five seconds for a listing, twice."""

MOST_BYTES = 1_500_000_000
"""Of memory of its own that a command may ask for, libraries and the threads of numpy included."""

UNEXPECTED = tuple(load(language)("error.unexpected", value="").split(":")[0].strip() for language in ("en", "ko"))
SOME = (
    "silent",
    "partial: half",
    "garbled: foreign",
    "garbled: echo",
    "resetting: breaks",
    "flooding: text",
    "refusing: ERR003",
)
"""In the normal run; the whole product of the table is `long`."""


@dataclass(frozen=True, kw_only=True)
class Ended:
    """What a command has left behind."""

    code: int
    out: str
    err: str
    card: HostileCard


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Order:
    """The bundled lathe, signed for, with a short job."""
    folder = tmp_path_factory.mktemp("hostile")
    return replace(order(folder, 1.0), machine_file=signed_copy("lee-2001-lathe", folder))


@contextmanager
def served(site: Order, kind: Kind, depth: int, transport: str) -> Iterator[HostileCard]:
    machine = load_machine(str(site.machine_file)).machine
    with hostile_card(kind, transport, machine, depth) as card:
        yield card


def ended(site: Order, command: str, kind: Kind, depth: int, transport: str, language: str, folder: Path) -> Ended:
    """Run a command to its end."""
    with served(site, kind, depth, transport) as card:
        site.prove_stops(card.address)
        names = {"file": str(folder / "card.pmac"), "job": str(site.job_file)}
        if command == "controller diff":
            (folder / "card.pmac").write_text("; trilobe controller backup\n", encoding="utf-8")
        if command == "controller restore":
            (folder / "card.pmac").write_text(backup_text(BACKED_UP, "2026-03-01"), encoding="utf-8")
        if command == "controller download":
            (folder / "card.pmac").write_text("OPEN PROG 101 CLEAR\nX1\nCLOSE\n", encoding="utf-8")
        words = [word.format(**names) for word in COMMANDS[command]]
        options = ("--machine", str(site.machine_file), "--data", str(site.data), "--link", card.address)
        with Preloaded(
            [sys.executable, "-m", "console", *words, *options, "--lang", language],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            resource.prlimit(process.pid, resource.RLIMIT_DATA, (MOST_BYTES, MOST_BYTES))
            try:
                out, err = process.communicate(timeout=ENDS_WITHIN_S)
            finally:
                if process.poll() is None:
                    process.kill()
        return Ended(code=process.returncode, out=out, err=err, card=card)


def is_as_it_should(found: Ended, kind: Kind) -> None:
    """It failed in sentences with a cause and a remedy, and sent nothing that moves."""
    assert "Traceback" not in found.err and not any(each in found.err for each in UNEXPECTED), found.err
    said = [line for line in found.err.splitlines() if line.startswith("console: ")]
    if found.code == 0:
        assert kind.deceives, "it was done with a controller that did not answer"
    else:
        assert found.code == 1
        assert said or "✗" in found.out, "nothing says why"
        assert len(said) < 4 or kind.deceives, said
    for line in said:
        assert re.search(r"[;.,(:] .*\S", line.partition(": ")[2]), line
        assert "could not convert" not in line and "invalid literal" not in line
    assert found.card.moved_by == []
    assert found.card.lines, "it did not even ask"


def cells() -> list[object]:
    """All commands with all ways at all depths where that is asked for, else a part in which they take turns."""
    found: list[object] = []
    for number, command in enumerate(COMMANDS):
        depths = [depth for depth in DEPTHS if depth != DEEP or command in READ_DEEPLY]
        for place, kind in enumerate(WAYS):
            part = [depths[place // 3 % len(depths)]] if (place + number) % 3 == 0 else []
            for depth in depths if os.environ.get("HOSTILE") == "all" else part:
                turn = len(found)
                link, language = ("tcp", "serial")[turn // 2 % 2], ("en", "ko")[turn % 2]
                name = f"{command}, {DEPTHS[depth]}, {kind.name}, {link}, {language}"
                found.append(pytest.param(command, kind, depth, link, language, id=name))
    return found


@pytest.mark.long
@pytest.mark.parametrize(("command", "kind", "depth", "link", "language"), cells())
def test_a_command_ends_says_why_and_moves_nothing(
    site: Order, command: str, kind: Kind, depth: int, link: str, language: str, tmp_path: Path
) -> None:
    is_as_it_should(ended(site, command, kind, depth, link, language, tmp_path), kind)


@pytest.mark.parametrize("link", ["tcp", "serial"])
@pytest.mark.parametrize("kind", [kind for kind in WAYS if kind.name.startswith(SOME)], ids=lambda kind: kind.name)
@pytest.mark.first(2)
def test_a_check_ends_says_why_and_moves_nothing(site: Order, kind: Kind, link: str, tmp_path: Path) -> None:
    language = "en" if link == "tcp" else "ko"
    is_as_it_should(ended(site, "controller verify", kind, IDENTIFIED, link, language, tmp_path), kind)


@pytest.mark.long
def test_a_device_that_never_stops_sending_is_named_as_one(site: Order, tmp_path: Path) -> None:
    """Not as one that does not answer: who looks for a loose cable looks in the wrong place."""
    flood = next(kind for kind in WAYS if kind.name == "flooding: lines without an ACK")
    began_s = time.monotonic()
    found = ended(site, "doctor", flood, FIRST_BYTE, "tcp", "en", tmp_path)
    assert "is not a PMAC" in found.err
    assert time.monotonic() - began_s < ENDS_WITHIN_S / 2


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=[] if kind.name.startswith(SOME[:2]) else pytest.mark.long, id=kind.name)
        for kind in WAYS
    ],
)
def test_the_screens_begin_say_why_and_move_nothing(site: Order, kind: Kind, tmp_path: Path) -> None:
    """They stay: the page of the alarms says what is the case, or the program ends with one line and 1."""
    with served(site, kind, FIRST_BYTE, "tcp") as card:
        words = (
            "--machine",
            str(site.machine_file),
            "--data",
            str(tmp_path),
            "--link",
            card.address,
            "--lang",
            "en",
        )
        with Terminal([sys.executable, "-m", "console", *words], columns=100, rows=30) as screen:
            screen.wait_for(
                r"console: .*; |not a PMAC|no reply|closed|is lost|refused|no valid answer|does not answer",
                ENDS_WITHIN_S,
            )
            assert "Traceback" not in screen.text
        assert card.moved_by == []
