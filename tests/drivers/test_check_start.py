"""Where a checked program starts: as the operator says, as a comment of its text says, or at home."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.cutting.planning import Strategy, plan_cut
from drivers.pmac.analysis.findings import Code
from drivers.pmac.analysis.program import check_program
from drivers.pmac.analysis.start import Source, read_start, start_comment
from drivers.pmac.axes import read_definitions
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import load_job

TEXT = "OPEN PROG 1\nABS TA100 TS20 TM2000\nX1000 Y0 Z500\nCLOSE\n"


def ways(text: str, machine: MachineProfile, start: dict[str, float] | None = None) -> list[float]:
    (move,) = check_program(text, machine, start=start).moves
    return [motor.commanded for motor in move.motors]


def test_without_a_word_all_motors_are_at_home(machine: MachineProfile) -> None:
    assert ways(TEXT, machine) == [1000, 0, 500]
    assert check_program(TEXT, machine).start.source is Source.HOME


def test_a_comment_of_the_text_says_where_it_starts(machine: MachineProfile) -> None:
    text = f"; mine\n; starts at X900 Z-20.5\n{TEXT}; starts at X1\n"
    assert ways(text, machine) == [100, 0, 520.5]
    start = check_program(text, machine).start
    assert (start.source, start.line, str(start)) == (Source.COMMENT, 2, "X900 Y0 Z-20.5")


@pytest.mark.parametrize(
    "comment", ["; starts at the surface", "; starts at X", "; starts at X5 of the part", "X1 ; starts at X5"]
)
def test_other_comments_say_nothing(machine: MachineProfile, comment: str) -> None:
    assert check_program(f"{TEXT}{comment}\n", machine).start.source is Source.HOME


def test_the_operator_counts_more_than_the_text(machine: MachineProfile) -> None:
    assert ways(f"; starts at X900 Z20\n{TEXT}", machine, {"X": 400}) == [600, 0, 500]


def test_positions_are_in_the_units_of_the_axes(machine: MachineProfile) -> None:
    """#1->5000X+10: X2 is 10010 counts. An axis that is not named is at home, 0 counts, X-0.002."""
    text = "&1\n#1->5000X+10\nOPEN PROG 1\nABS TA100 TS20 TM500\nX3\nCLOSE\n"
    assert ways(text, machine, {"X": 2}) == pytest.approx([5000, 0, 0])
    assert ways(text, machine, {"Y": 7}) == pytest.approx([15_010, 0, 0])
    assert check_program(text, machine).start.positions == pytest.approx({"X": -0.002, "Y": 0, "Z": 0})


@pytest.mark.parametrize(
    ("start", "code"), [({"U": 5.0}, "program.start_axis"), ({"X": 1e20}, "program.start_too_far")]
)
def test_a_start_that_cannot_be_is_refused(machine: MachineProfile, start: dict[str, float], code: str) -> None:
    with pytest.raises(ProblemError) as refused:
        check_program(TEXT, machine, start=start)
    assert [problem.code for problem in refused.value.problems] == [code]


@pytest.mark.parametrize("text", ["", "X", "X=", "X5", "X=1e5", "X=nan", "Q=1", "X=1,X=2", "X=1,,Y=2", "X=1;Y=2"])
def test_what_is_no_position_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        read_start(text)


def test_positions_are_read() -> None:
    assert read_start("x=240000, Y=-0.5,Z=+.25") == {"X": 240_000, "Y": -0.5, "Z": 0.25}


@pytest.mark.first(5)
@pytest.mark.parametrize("name", ["lee-2001-experiment-1", "lee-2001-experiment-2"])
@pytest.mark.parametrize("strategy", list(Strategy))
def test_the_programs_of_the_project_have_no_fault_where_they_start(
    machine: MachineProfile, name: str, strategy: Strategy
) -> None:
    plan = plan_cut(replace(load_job(name).job, cut_length_mm=0.5), machine, strategy)
    counts = {1: plan.tool_start, 2: plan.spindle_start, 3: plan.carriage_start}
    comment = start_comment(read_definitions(machine.controller.axis_definitions), counts)
    checked = check_program(f"{comment}\n{plan.text}", machine)
    assert [finding for finding in checked.findings if finding.severity is Severity.REFUSAL] == []
    assert Code.ENDS_DEEPER not in {finding.code for finding in checked.findings}


@pytest.mark.parametrize(
    ("line", "motors"),
    [
        ("UNDEFINE ALL", (4,)),
        ("&1 undef", (4,)),
        ("#2->0", (1, 2, 3, 4)),
        ("#2->0 #2->100Y", (1, 2, 3, 4)),
        ("", (1, 2, 3, 4)),
    ],
)
def test_axes_that_a_text_clears_are_gone(machine: MachineProfile, line: str, motors: tuple[int, ...]) -> None:
    text = f"{line}\n#4->W\nOPEN PROG 1 CLEAR\nTA10 TS0 TM20 W5\nCLOSE\n"
    assert check_program(text, machine).motors == motors
