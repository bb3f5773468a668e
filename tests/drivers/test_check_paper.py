"""Prog. 1 of Lee and Lee (2001) under the checker: the numbers that explain why half of the error was kept."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from drivers.pmac.analysis.findings import Code, ProgramFinding, Said, Value
from drivers.pmac.analysis.program import ProgramCheck, check_program
from drivers.pmac.programs.paper import paper_program
from drivers.pmac.programs.setup import cut_setup
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.store import load_job

ROOT = Path(__file__).parents[2]


@pytest.fixture
def printed() -> str:
    """The literal text, as the document quotes it."""
    section = (
        (ROOT / "docs/paper-program.md").read_text(encoding="utf-8").split("\n## The printed program\n", 1)[1]
    )
    return re.split(r"^```\w*\n", section, maxsplit=2, flags=re.MULTILINE)[1]


@pytest.fixture
def meant(printed: str) -> str:
    """The same with the move time that its comment names, 50 Hz."""
    return re.sub(r"P400=[^;]*", "P400=1000/(2*50) ", printed)


def of_code(checked: ProgramCheck, code: Code) -> list[ProgramFinding]:
    return [finding for finding in checked.findings if finding.code is code]


def said(checked: ProgramCheck, code: Said) -> Mapping[str, Value]:
    (sentence,) = [sentence for sentence in checked.explanation if sentence.code is code]
    return sentence.values


def test_the_stroke_of_the_printed_times_is_two_thirds(meant: str, machine: MachineProfile) -> None:
    """183.3 of 275 counts, 36.67 of 55 um; between 545.8 and 729.2 counts."""
    checked = check_program(meant, machine)
    (lost,) = of_code(checked, Code.STROKE_LOST)
    assert lost.values["made_counts"] == pytest.approx(183.333, abs=1e-3)
    assert lost.values["made_length"] == pytest.approx(36.667, abs=1e-3)
    assert lost.values["kept_percent"] == pytest.approx(66.667, abs=1e-3)
    assert lost.lines == (21, 23)
    points = {round(move.motors[0].reached, 1) for move in checked.moves[4:-3]}
    assert points == {545.8, 729.2}


def test_the_explanation_has_the_numbers_of_the_paper(meant: str, machine: MachineProfile) -> None:
    checked = check_program(meant, machine)
    assert said(checked, Said.TOLD) == pytest.approx({"length": 55, "unit": "um", "tm_ms": 10, "hz": 50})
    assert said(checked, Said.ACCELERATION_TIME) == pytest.approx({"ta_ms": 10, "ts_ms": 10, "used_ms": 20})
    slowed = said(checked, Said.SLOWED_DOWN)
    assert [slowed[key] for key in ("asked_hz", "hz", "asked_rpm", "rpm")] == pytest.approx([50, 25, 1000, 500])
    assert said(checked, Said.STROKE_MADE)["made_length"] == pytest.approx(36.667, abs=1e-3)
    assert said(checked, Said.LEFT_BY_BLENDING)["left_um"] == pytest.approx(18.33, abs=0.01)
    with_servo = said(checked, Said.LEFT_WITH_THE_SERVO)
    assert with_servo["left_um"] == pytest.approx(28, abs=0.5)
    assert with_servo["percent"] == pytest.approx(50, abs=1)
    assert said(checked, Said.TIMES_FOR_THE_SPEED) == {"tm_ms": 10, "ta_ms": 10, "ts_ms": 5}


def test_ts_5_keeps_the_speed_and_not_the_stroke(meant: str, machine: MachineProfile) -> None:
    """At 50 Hz the loop of section 4.2 has a gain of 0.885 and is 0.903 rad late; about 43 um stay."""
    checked = check_program(meant, machine, ts_ms=5)
    assert of_code(checked, Code.STRETCHED) == []
    (lost,) = of_code(checked, Code.STROKE_LOST)
    assert lost.values["kept_percent"] == pytest.approx(66.667, abs=1e-3)
    servo = said(checked, Said.LEFT_WITH_THE_SERVO)
    assert servo["gain"] == pytest.approx(0.885, abs=1e-3)
    assert servo["late_deg"] == pytest.approx(51.7, abs=0.1)
    assert servo["left_um"] == pytest.approx(43, abs=0.5)


def test_linear_ramps_lose_half_and_short_ones_little(meant: str, machine: MachineProfile) -> None:
    """1 - TA/(2 TM): 1/2 at TA10 TS0, 3/4 at TA5 TS0."""
    for ta_ms, kept in ((10, 50.0), (5, 75.0)):
        (lost,) = of_code(check_program(meant, machine, ta_ms=ta_ms, ts_ms=0), Code.STROKE_LOST)
        assert lost.values["kept_percent"] == pytest.approx(kept, abs=1e-6)


def test_times_that_are_advised_do_what_is_said(meant: str, machine: MachineProfile) -> None:
    advice = said(check_program(meant, machine), Said.TIMES_FOR_THE_STROKE)
    followed = check_program(meant, machine, ta_ms=float(advice["ta_ms"]), ts_ms=float(advice["ts_ms"]))
    (lost,) = of_code(followed, Code.STROKE_LOST)
    assert lost.values["kept_percent"] == pytest.approx(advice["percent"])
    assert of_code(followed, Code.STRETCHED) == of_code(followed, Code.STRETCHED_BY_ACCELERATION) == []


def test_the_stroke_that_is_advised_makes_up_for_the_loss(meant: str, machine: MachineProfile) -> None:
    longer = said(check_program(meant, machine), Said.STROKE_THAT_MAKES_UP)["longer_counts"]
    checked = check_program(re.sub(r"P500= 275", f"P500={longer}", meant), machine)
    assert of_code(checked, Code.STROKE_LOST)[0].values["made_counts"] == pytest.approx(275)


def test_the_printed_move_time_has_lost_its_power_of_ten(printed: str, machine: MachineProfile) -> None:
    checked = check_program(printed, machine)
    (tiny,) = of_code(checked, Code.TIME_BELOW_INTERRUPT)
    assert tiny.values["tm_ms"] == pytest.approx(1 / (2 * 103 * 50))
    assert said(checked, Said.TOLD_WITHOUT_TIME)["length"] == pytest.approx(55)
    assert said(checked, Said.SPEED_MADE) == pytest.approx({"hz": 25, "rpm": 500})


def test_the_wrapped_comments_are_refused_and_the_rest_is_looked_at(printed: str, machine: MachineProfile) -> None:
    checked = check_program(printed, machine)
    refused = of_code(checked, Code.LINE_REFUSED)
    assert [finding.lines for finding in refused] == [(22,), (24,)]
    assert {finding.values["number"] for finding in refused} == {4.0}
    assert len(checked.moves) > 10


def test_the_last_line_plunges_two_millimetres(printed: str, machine: MachineProfile) -> None:
    """From 500 counts by 10000: 10500, which is 9725 counts or 1.945 mm below the deepest point that was told."""
    checked = check_program(printed, machine)
    (plunge,) = of_code(checked, Code.PLUNGE)
    assert plunge.lines == (27,)
    assert plunge.values == pytest.approx({"counts": 10_000, "mm": 2.0, "deeper_mm": 1.945})
    assert checked.worst is Severity.REFUSAL


def test_the_loop_never_ends_and_the_zig_zag_is_one_sided(meant: str, machine: MachineProfile) -> None:
    checked = check_program(meant, machine)
    (endless,) = of_code(checked, Code.ENDLESS_LOOP)
    assert (endless.lines, endless.values["flags"]) == ((20,), "M26=1")
    executed = [place for place in checked.places if place == 21]
    assert endless.values["passes"] == len(executed)
    (one_sided,) = of_code(checked, Code.ONE_SIDED)
    assert one_sided.values == pytest.approx({"begins_counts": 500, "middle_counts": 637.5, "deeper_um": 27.5})


def test_a_sixth_of_a_turn_does_not_drift_but_a_whole_number_of_counts_does(
    meant: str, machine: MachineProfile
) -> None:
    """Six moves of 1666 counts are 4 short of a turn: 0.144 deg, and 139 turns until the lobe is 20 deg off."""
    assert of_code(check_program(meant, machine), Code.DRIFT) == []
    (drift,) = of_code(check_program(meant.replace("10000/6", "INT(10000/6)"), machine), Code.DRIFT)
    assert drift.values["lobes"] == 3
    assert drift.values["counts_per_turn"] == pytest.approx(-4, abs=1e-3)
    assert drift.values["deg_per_turn"] == pytest.approx(-0.144, abs=1e-4)
    assert drift.values["useless_after_turns"] == pytest.approx(139, abs=0.5)
    assert drift.values["useless_after_s"] == pytest.approx(2 * 8.3, abs=0.1)  # at 500 rpm


def test_the_mended_program_has_no_fault(machine: MachineProfile) -> None:
    job = load_job("lee-2001-experiment-1").job
    checked = check_program(paper_program(job, machine, cut_setup(job, machine, 0.0)), machine)
    assert [finding for finding in checked.findings if finding.severity is Severity.REFUSAL] == []
    assert of_code(checked, Code.ENDLESS_LOOP) == []
    assert of_code(checked, Code.STROKE_LOST)[0].values["made_length"] == pytest.approx(36.667, abs=1e-3)
    assert said(checked, Said.SLOWED_DOWN)["rpm"] == pytest.approx(500)
