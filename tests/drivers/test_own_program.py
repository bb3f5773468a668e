"""What an interrupted measurement leaves in the controller is taken over; what is somebody else's stays."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import RefusedError
from drivers.identification.excitation import PROGRAM, PvtPath, axis_word
from drivers.identification.health import HealthMoves, health_text
from drivers.identification.identify import identify
from drivers.pmac.client import LINE_LIMIT
from drivers.pmac.programs.setup import is_signed, signed
from profiles.machine import MachineProfile
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine  # both families
from tests.drivers.identification_bench import Stand, ready
from tests.drivers.test_identification_refused import PVT

CODE = st.lists(st.sampled_from(["P1=1", "X(P1*2)", "PVT4", "DWELL20", "M26=0 P2=.50", "N10X1"]), max_size=12)


def body(text: str) -> list[str]:
    """What stands between CLEAR and CLOSE, without comments: an own reading of the text."""
    code = re.search(r"CLEAR\n(.*)\nCLOSE", text, re.DOTALL)
    assert code is not None
    return [line.split(";")[0].strip() for line in code[1].splitlines()]


@given(code=CODE, cut=st.integers(0, 15))
def test_a_program_is_known_in_whole_and_in_part(code: list[str], cut: int) -> None:
    lines = body(signed("\n".join(["P9=1", "CLOSE", "OPEN PROG 998", "CLEAR", *code, "CLOSE"])))
    assert lines[3:] == code
    assert is_signed([*lines, "RETURN"]) and is_signed([*lines[:cut], "RETURN"])


@given(code=CODE, place=st.integers(0, 11), other=st.sampled_from(["P1=2", "X0", "P3=3"]))
def test_a_changed_or_longer_program_is_not_ours(code: list[str], place: int, other: str) -> None:
    lines = body(signed("\n".join(["CLOSE", "OPEN PROG 998", "CLEAR", *code, "CLOSE"])))
    assert not is_signed([*lines, other])
    if place < len(code):
        assert not is_signed([*lines[: 3 + place], other, *lines[4 + place :]])
    assert not is_signed([*code, other])
    assert not is_signed([*lines[:3], other]), "our name over something short is not ours either"


def test_the_longest_of_our_programs_has_room_for_its_signature(machine: MachineProfile) -> None:
    moves = HealthMoves(step_um=3.0)
    text = health_text(machine, axis_word(machine, machine.tool.motor), moves, 0.0)
    assert max(map(len, text.splitlines())) < LINE_LIMIT and is_signed(body(text))


def left_whole(made: Stand) -> None:
    made.tell(*PvtPath(made.rig.machine, 3.0).sweep(20.0, 5).text.splitlines())


def left_in_part(made: Stand) -> None:
    made.tell("OPEN PROG998", "CLEAR", *body(PvtPath(made.rig.machine, 3.0).sweep(20.0, 5).text)[:6])
    made.tell("CLOSE")


@ON_ONE
@pytest.mark.parametrize("leave", [left_whole, left_in_part])
def test_what_a_lost_link_left_is_taken_over_and_erased(
    machine: MachineProfile, leave: Callable[[Stand], None]
) -> None:
    made = ready(machine)
    leave(made)
    assert made.sim.controller.programs[PROGRAM]
    assert identify(made.rig, PVT, made.origin, "D").points
    assert not made.sim.controller.programs[PROGRAM]


@ON_ONE
def test_one_line_more_is_somebody_s(machine: MachineProfile) -> None:
    made = ready(machine)
    text = PvtPath(made.rig.machine, 3.0).sweep(20.0, 5).text.removesuffix("CLOSE\n")
    made.tell(*text.splitlines(), "P900=1", "CLOSE")
    with pytest.raises(RefusedError) as refused:
        identify(made.rig, PVT, made.origin, "D")
    assert [problem.code for problem in refused.value.problems] == ["identify.in_use"]
    assert made.sim.controller.programs[PROGRAM]
