"""A controller that falls silent in mid-cut, and a supervisor that kills the console ten seconds after SIGTERM."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

import pytest

from drivers.simulator.machine import SimulatedLathe
from tests.system.patient_card import PatientCard, patient_card
from tests.system.run_over_link import order

pytestmark = pytest.mark.system

AT_ONCE_S = 8.0
"""Until the first line: two looks that are not answered, on a computer that is busy."""

SUPERVISOR_S = 10.0


def stops(card: PatientCard) -> int:
    return sum(data.count(b"\x0b") for _, data in card.words.said)


def test_it_is_said_at_once_what_is_tried_and_a_sigterm_ends_it_in_time(tmp_path: Path) -> None:
    made = order(tmp_path, 4.0)
    lathe = SimulatedLathe(made.machine)
    with patient_card(lathe) as card, made.proven(card.console) as process:
        assert process.stderr is not None
        card.until(lambda: lathe.controller.systems[1].running)
        with card.hanging():
            card.run_on()
            silent_s = time.monotonic()
            said: list[str] = []
            for line in process.stderr:
                said.append(line)
                if "stopping" in line:
                    break
            assert "stopping" in said[-1]
            assert time.monotonic() - silent_s < AT_ONCE_S
            said.append(process.stderr.readline())
            assert "standstill not confirmed" in said[-1] and "no answer for" in said[-1]
            process.send_signal(signal.SIGTERM)
            came_s, count = time.monotonic(), stops(card)
            seconds = 0
            for line in process.stderr:
                said.append(line)
                seconds += "standstill not confirmed" in line
            process.wait()
            took_s = time.monotonic() - came_s
            assert took_s < SUPERVISOR_S
            assert process.returncode == 1
            assert seconds >= 4, "each second"
            assert stops(card) - count > 3.0 * took_s, "the stop goes on being sent"
            assert process.stdout is not None and json.loads(process.stdout.read())["exit_code"] == 1
            assert "press the emergency stop" in said[-1]
