"""A console that is ended while another one works the machine: nothing that it sends touches what moves there.

The machine turns its spindle for console 4711. Time stands still where a test says, so that the signal comes at
just that word of the console under test.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from drivers.lathe.standing import NOBODY
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import OWNER
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.preloaded import Preloaded
from tests.signed_profile import signed_copy
from tests.system.patient_card import PatientCard, patient_card
from tests.system.run_over_link import Order, order

pytestmark = pytest.mark.system

ANOTHER = 4711
SPINDLE, CARRIAGE = 2, 3
ENDS_WITHIN_S = 20.0
STOPS = re.compile(rb"[\x01\x0b]")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Order:
    return order(tmp_path_factory.mktemp("beside"), 4.0)


def proven(made: Order, address: str) -> list[str]:
    """The words of a run on a machine whose stops were proven over this link."""
    made.prove_stops(address)
    return made.command(address, "--yes")[3:]


@pytest.fixture
def lathe(made: Order) -> SimulatedLathe:
    return SimulatedLathe(made.machine)


def turned_by_another(lathe: SimulatedLathe) -> None:
    """Let the spindle turn, as somebody's order."""
    client = PmacClient(MemoryLink(lathe.connect(), lathe), lathe)
    client.connect()
    client.request("#1J/#2J/#3J/")
    client.request(f"#2J+ P{OWNER}={ANOTHER}")


def is_another_s_and_turns(card: PatientCard) -> bool:
    spindle = card.lathe.controller.motors[SPINDLE]
    return spindle.jogging and spindle.amplifier_enabled and owner(card.lathe) == ANOTHER


def owner(lathe: SimulatedLathe) -> int:
    return int(lathe.controller.variables.get(VariableKind.P, OWNER))


def heard(card: PatientCard) -> bytes:
    return b"".join(data for _, data in card.words.said)


@contextmanager
def console(*words: str, unheard: tuple[PatientCard, bytes] | None = None) -> Iterator[subprocess.Popen[str]]:
    """Start the console, with a word of it that the card will not hear."""
    if unheard is not None and unheard[1]:
        unheard[0].will_not_hear(unheard[1])
    command = [sys.executable, "-m", "console", *words]
    with Preloaded(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def ended(card: PatientCard, process: subprocess.Popen[str], number: signal.Signals) -> str:
    """Send the signal, let time run on, and return what was said; the exit code is that of a failure."""
    process.send_signal(number)
    card.run_on()
    _, err = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 1
    assert "Traceback" not in err
    return err


PHASES = {
    "before it connects": b"",
    "while it connects": b"VERSION TYPE",
    "while it asks whose the machine is": b"P1000",
}


@pytest.mark.parametrize(
    ("phase", "number"), zip(PHASES, (signal.SIGHUP, signal.SIGINT, signal.SIGTERM), strict=True), ids=str
)
def test_a_run_that_ends_before_it_has_the_machine_stops_nobody(
    lathe: SimulatedLathe, made: Order, phase: str, number: signal.Signals
) -> None:
    turned_by_another(lathe)
    with (
        patient_card(lathe) as card,
        console(*proven(made, card.console), unheard=(card, PHASES[phase])) as process,
    ):
        assert process.stderr is not None
        process.stderr.readline()  # what the cut rests on: the signals are in hand by then
        if PHASES[phase]:
            card.until_it_is_said()
        err = ended(card, process, number)
        assert STOPS.search(heard(card)) is None, err
        assert is_another_s_and_turns(card)
        assert f"ended by {number.name}; this command was not moving anything" in err


def test_a_run_that_is_refused_stops_nobody_either(lathe: SimulatedLathe, made: Order) -> None:
    turned_by_another(lathe)
    with patient_card(lathe) as card, console(*proven(made, card.console)) as process:
        _out, err = process.communicate(timeout=ENDS_WITHIN_S)
        assert (process.returncode, f"number {ANOTHER}" in err) == (1, True)
        assert STOPS.search(heard(card)) is None
        assert is_another_s_and_turns(card)


def test_an_identification_that_ends_before_it_has_the_machine_stops_nobody(
    tmp_path: Path,
) -> None:
    machine = signed_copy("lee-2001-lathe", tmp_path)
    lathe = SimulatedLathe(load_machine(str(machine)).machine)
    turned_by_another(lathe)
    words = ("identify", "--machine", str(machine), "--data", str(tmp_path), "--yes")
    with (
        patient_card(lathe) as card,
        console(*words, "--link", card.console, unheard=(card, b"P1000")) as process,
    ):
        card.until_it_is_said()
        ended(card, process, signal.SIGINT)
        assert STOPS.search(heard(card)) is None
        assert is_another_s_and_turns(card)


def test_a_signal_in_the_middle_of_the_claim_is_a_stop_as_soon_as_it_is_answered(
    lathe: SimulatedLathe, made: Order
) -> None:
    with patient_card(lathe) as card, console(*proven(made, card.console), unheard=(card, b"P1000=")) as process:
        card.until_it_is_said()
        err = ended(card, process, signal.SIGTERM)
        assert "stopped (SIGTERM); the machine is at rest" in err
        assert owner(card.lathe) == NOBODY
        assert b"OPEN" not in heard(card), "nothing was loaded"


def test_a_run_that_has_the_machine_stops_what_it_moves(lathe: SimulatedLathe, made: Order) -> None:
    with patient_card(lathe) as card, console(*proven(made, card.console)) as process:
        card.until(lambda: lathe.controller.motors[CARRIAGE].jogging)
        err = ended(card, process, signal.SIGTERM)
        assert "stopped (SIGTERM); the machine is at rest" in err
        assert STOPS.search(heard(card)) is not None
        assert not any(motor.amplifier_enabled for motor in lathe.controller.motors.values())
        assert owner(card.lathe) == NOBODY
