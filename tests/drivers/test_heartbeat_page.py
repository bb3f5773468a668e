"""The page about the heartbeat: the PLC that it quotes is the one that is sent, and its bounds hold."""

from __future__ import annotations

import re
from pathlib import Path

from drivers.pmac.dialect import PMAC
from drivers.pmac.heartbeat.plc import Policy, plc_lines, plc_text
from profiles.machine import MachineProfile

PAGE = (Path(__file__).parents[2] / "docs" / "heartbeat.md").read_text(encoding="utf-8")


def quoted() -> str:
    section = PAGE.split("\n## The PLC\n", 1)[1]
    return re.split(r"^```\w*\n", section, maxsplit=2, flags=re.MULTILINE)[1]


def test_the_quoted_plc_is_the_generated_one(machine: MachineProfile) -> None:
    assert quoted() == plc_text(machine, PMAC, Policy.RETRACT)


def test_what_is_sent_is_the_quoted_text_without_its_comments(machine: MachineProfile) -> None:
    code = [line.partition(";")[0].strip() for line in quoted().splitlines()]
    assert tuple(line for line in code if line) == plc_lines(machine, PMAC, Policy.RETRACT)


def test_every_variable_that_the_plc_keeps_is_explained() -> None:
    used = set(re.findall(r"\bP10\d\d\b", quoted()))
    assert used == set(re.findall(r"\bP10\d\d\b", PAGE.split("\n## The PLC\n", 1)[0])) - {"P1000", "P1001"}
