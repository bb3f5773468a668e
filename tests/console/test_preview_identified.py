"""What a preview says with an identified response, before its program is there, and which response is chosen."""

from __future__ import annotations

import cmath
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.cutting.planning import Strategy, plan_cut
from drivers.cutting.strategy import INVERTING
from drivers.identification.nominal import path_response
from drivers.identification.result import SCHEMA
from drivers.preview.band import predicted_band
from drivers.preview.outlook import outlook
from drivers.preview.preview import closed_form, preview
from drivers.preview.program_prediction import predict
from drivers.simulator.plant.which_lathe import with_one_lobe
from profiles.axis.response import ServoResponse, identified_response
from profiles.axis.servo import sampled_response
from profiles.compensations.path import CutPath, PathHarmonic
from profiles.findings import refusals
from profiles.lobe.along import holding_spread
from profiles.problem import ProblemError
from profiles.rules import check
from profiles.store import load_job, load_machine
from tests.console.commands import Console, JobFile
from tests.console.floor import known as given

EXPERIMENT = "lee-2001-experiment-1"
JOB = load_job(EXPERIMENT).job
MACHINE = load_machine("lee-2001-lathe").machine
SHORT = replace(JOB, cut_length_mm=1.0)

# A lathe that is not as its profile says: 10 % more mass and 10 % less thrust.
TRUE = replace(
    MACHINE,
    tool=replace(
        MACHINE.tool,
        moving_mass_kg=1.1 * MACHINE.tool.moving_mass_kg,
        amplifier_gain_a_per_v=0.9 * MACHINE.tool.amplifier_gain_a_per_v,
    ),
)


COMMAND_UM = 27.5 / abs(complex(sampled_response(TRUE, 50.0)))
"""What the tool is asked for, once its response is inverted."""


def point(frequency_hz: float, response: complex) -> dict[str, float]:
    return {
        "frequency_hz": frequency_hz,
        "gain": abs(response),
        "phase_deg": math.degrees(cmath.phase(response)),
        "gain_ci": 0.002,
        "phase_ci_deg": 0.13,
        "coherence": 0.999,
        "amplitude_um": 25.0,
    }


def file_of(folder: Path, path: str = "pvt", *frequencies_hz: float, **origin: object) -> Path:
    """A file as `console identify` keeps it, of the true lathe."""
    gains = {f"I{number}": MACHINE.controller.variables[f"I{number}"] for number in range(130, 136)}
    told = {"machine": MACHINE.name, "simulated": False, "version": "1.17", "kind": "PMAC1, X1", "gains": gains}
    period_ms = MACHINE.controller.servo_period_ms
    delay_s = {"pvt": 0.0, "cam": 1.0}[path] * period_ms / 1000.0
    points = [
        point(hz, complex(sampled_response(TRUE, hz)) * cmath.exp(-2j * math.pi * hz * delay_s))
        for hz in frequencies_hz or (10.0, 30.0, 50.0, 70.0)
    ]
    table = {
        "schema": SCHEMA,
        "origin": {**told, "servo_period_ms": period_ms, **origin},
        "path": path,
        "how": "measured",
        "delay_cycles": 0,
        "date": "2001-11-30T14:05:00.000Z",
        "points": points,
    }
    file = folder / "there.json"
    file.write_text(json.dumps(table), encoding="ascii")
    return file


def of_true_lathe(amplitude_um: float = COMMAND_UM) -> ServoResponse:
    here = point(50.0, complex(sampled_response(TRUE, 50.0)))
    names = ("frequency_hz", "gain", "phase_deg", "gain_ci", "phase_ci_deg")
    columns = {name: [here[name]] for name in names}
    return identified_response(**columns, amplitude_um=amplitude_um, name="there")


def test_the_true_lathe_leaves_a_trace_of_what_the_model_would_have_left() -> None:
    """9.1 um of 55 by the arithmetic of the inverse; nothing of it where the axis was identified."""
    by_model = predict(SHORT, TRUE, plan_cut(SHORT, MACHINE, Strategy.PVT))
    assert by_model.ront_um == pytest.approx(9.1, abs=0.2)
    plan = plan_cut(SHORT, MACHINE, Strategy.PVT, response=of_true_lathe())
    assert predict(SHORT, TRUE, plan).ront_um < 0.1
    # And so says the preview, which knows of the lathe by the response alone.
    assert predict(SHORT, MACHINE, plan, of_true_lathe()).ront_um < 0.1


def test_the_band_of_the_model_has_the_true_lathe_in_it_and_identification_narrows_it() -> None:
    by_model, found = preview(SHORT, MACHINE), preview(SHORT, MACHINE, Strategy.PVT, of_true_lathe())
    wide, narrow = (predicted_band(seen, Strategy.PVT) for seen in (by_model, found))
    assert wide is not None
    assert narrow is not None
    assert wide.low_um <= 9.1 <= wide.high_um
    assert wide.servo_um == pytest.approx(55.0 * path_response(Strategy.PVT, MACHINE).relative_95(50.0), rel=0.01)
    # 0.002 in 0.786, of 55 um
    assert narrow.servo_um == pytest.approx(55.0 * 0.0025, rel=0.1)
    assert (narrow.clamping_um, narrow.cutting_um) == (wide.clamping_um, wide.cutting_um)
    assert narrow.friction_um == pytest.approx(0.0, abs=0.01)
    assert predicted_band(by_model, Strategy.NONE).servo_um == pytest.approx(0.0, abs=1e-6)  # type: ignore[union-attr]


def test_what_may_be_friction_counts_where_the_cut_swings_further_than_what_was_identified() -> None:
    """The true lathe answers 0.2 off the profile. Were that friction, twice the swing would halve it."""
    seen = preview(SHORT, MACHINE, Strategy.PVT, of_true_lathe(COMMAND_UM / 2))
    band = given(predicted_band(seen, Strategy.PVT))
    off = abs(complex(sampled_response(MACHINE, 50.0)) / complex(sampled_response(TRUE, 50.0)) - 1.0)
    assert band.friction_um == pytest.approx(55.0 * 0.5 * off, rel=0.01)
    assert band.high_um > 0.5 * 55.0 * off


@pytest.mark.parametrize("path", ["pvt", "cam"])
def test_what_is_predicted_is_of_the_strategy_whose_path_was_identified(
    console: Console, tmp_path: Path, job_file: JobFile, path: str, data_folder: Path
) -> None:
    """By its file, and as the newest of those that `console identify` has kept."""
    file = file_of(tmp_path, path)
    if path == "cam":
        kept = data_folder / "trilobe" / "identified" / MACHINE.name
        kept.mkdir(parents=True)
        file = file.rename(kept / "cam-20011130T140500000Z.json")
    asked = str(file) if path == "pvt" else "newest"
    words = (str(job_file(cut_length_mm="1.0")), "--strategy", path, "--identified", asked)
    seen = console("preview", *words, "--json")
    assert seen.code == 0
    found = seen.json
    assert (found["strategy"], found["response"]["source"], found["response"]["name"]) == (
        path,
        "identified",
        file.name,
    )
    assert found["predicted"]["before"]["ront_um"] == pytest.approx(55.0)
    assert found["predicted"]["after"]["ront_um"] < 0.1
    assert found["predicted"]["forecast"]["ront_um"] == found["predicted"]["forecast"]["low_um"] == 2.0
    band = found["predicted"]["band"]
    assert [each["code"] for each in band["because"]] == [
        "band.servo.identified",
        "band.clamping",
        "band.cutting",
        "band.friction.identified",
        "band.spindle",
    ]
    assert band["low_um"] <= found["predicted"]["after"]["ront_um"] <= band["high_um"]
    way = {name: np.array(values) for name, values in found["trajectory"].items()}
    left_um = JOB.lobe_error_um_pp / 2 * np.cos(3 * np.radians(way["angle_deg"] - 90.0)) - way["path_um"]
    assert way["residual_um"] == pytest.approx(left_um - left_um.mean(), abs=1e-9)
    assert 2 * found["command"]["amplitude_um"] == pytest.approx(np.ptp(way["command_um"]), rel=0.01)


def test_the_highest_safe_speed_is_where_the_first_limit_is_reached(console: Console, job_file: JobFile) -> None:
    found = console("preview", str(job_file(cut_length_mm="1.0")), "--json").json
    fastest, margins = found["envelope"]["highest_safe_rpm"], found["margins"]
    at_job = found["envelope"]["at_job"]
    assert fastest == min(at_job["max_rpm"].values()) == at_job["max_rpm"][at_job["binding"]]
    assert {row["binding"] for row in found["envelope"]["rows"]} <= set(at_job["max_rpm"])
    assert not refusals(check(replace(JOB, spindle_speed_rpm=math.floor(fastest)), MACHINE))
    # 31.05 um at 50 Hz make 9.76 mm/s of 100, and 10.4 N rms of 400, mid-cut; its last steady turn is
    # 0.85 of the way to the end, where the lobe is largest
    at_end, _ = holding_spread(replace(JOB, cut_length_mm=1.0), MACHINE)["profile"]
    most = 1.0 + 0.85 * (at_end - 1.0)
    assert margins["velocity_mm_per_s_percent"] == pytest.approx(9.76 * most, abs=0.02)
    assert margins["force_rms_n_percent"] == pytest.approx(2.59 * most, abs=0.01)
    assert margins["voltage_v_percent"] is None
    assert 0.0 < margins["grip_n_percent"] < 100.0


def test_the_worst_section_is_in_the_preview_of_the_command(console: Console) -> None:
    """The printed program keeps one amplitude: at the ends of experiment 1 it leaves 39 and 21 um, mid-cut 28."""
    asked = ("preview", EXPERIMENT, "--strategy", "paper")
    found = console(*asked, "--json").json
    assert found["worst_section_z_mm"] == pytest.approx(22.2)
    assert found["worst_section_um_pp"] == pytest.approx(38.5, abs=0.5)
    sections = found["sections"]
    assert sections[0]["RONt_um"] == found["worst_section_um_pp"] and len(sections) >= 5
    assert sections[len(sections) // 2]["RONt_um"] == pytest.approx(28.1, abs=0.1)
    assert sections[-1]["RONt_um"] == pytest.approx(21.3, abs=0.5)
    assert sections[len(sections) // 2]["mean_um"] == 0.0
    assert found["predicted"]["section_z_mm"] == 26.0
    plain = found["predicted"]["before"]
    assert plain["worst_section_z_mm"] == pytest.approx(22.2)
    assert plain["worst_section_um_pp"] == pytest.approx(55.0 * 0.386 / 0.315, abs=2.0), "f_3 of the jaws' side"
    words = console(*asked).out
    assert "paper, section at Z 26.0 mm" in words
    assert re.search(r"worst section along the cut, with none +Z 22\.2 mm: 6\d", words)
    assert "Z 22.2 mm: 38.5 um" in console(*asked).out


def test_a_response_of_another_machine_path_or_band_is_refused(console: Console, tmp_path: Path) -> None:
    of_others: tuple[tuple[dict[str, Any], str], ...] = (
        ({"machine": "another"}, "identified with machine another, but here it is lee-2001-lathe"),
        ({"gains": {"I130": 400.0}}, "identified with I130 400, but here it is 528"),
        ({"kind": "TURBO PMAC2"}, "identified with controller TURBO PMAC2, but here it is pmac"),
    )
    asked = ("preview", EXPERIMENT, "--identified")
    for origin, said in of_others:
        refused = console(*asked, str(file_of(tmp_path, **origin)))
        assert refused.code == 1 and said in refused.err
    refused = console(*asked, str(file_of(tmp_path)), "--strategy", "none")
    assert (refused.code, "identified with strategy pvt, but here it is none" in refused.err) == (1, True)
    refused = console(*asked, str(file_of(tmp_path, "pvt", 10.0, 20.0, 30.0)))
    assert (refused.code, "50 Hz was not identified (identified: 10 … 30 Hz)" in refused.err) == (1, True)


def test_people_are_told_what_is_inverted_and_left(console: Console, tmp_path: Path, job_file: JobFile) -> None:
    shown = console("preview", str(job_file(cut_length_mm="1.0")), "--identified", str(file_of(tmp_path))).out
    for words in (
        "identified there.json, ± 0.2",
        "predicted error with pvt, section at Z 29.5 mm, with its band",
        "1400 rpm (invertible response)",
    ):
        assert words in shown


SHORT = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=1.0)

# A lathe that is not as its profile says: 10 % more mass and 10 % less thrust.


@pytest.mark.parametrize("strategy", [*INVERTING, Strategy.NONE])
def test_the_closed_form_says_what_the_program_says_afterwards(strategy: Strategy) -> None:
    """The second method: the program, walked through move by move, and its spectrum through the sampled loop."""
    machine = with_one_lobe(MACHINE)
    seen = preview(SHORT, machine, strategy)
    early, made = closed_form(outlook(SHORT, machine, strategy), strategy), seen.predictions[strategy]
    assert early is not None
    assert float(np.ptp(early.residual_um)) == pytest.approx(made.ront_um, abs=0.05)
    assert early.largest_stroke_um == pytest.approx(made.largest_stroke_um, abs=0.05)
    command_um = np.interp(early.angle_deg, made.angle_deg, made.command_um, period=360.0)
    # Both know the late servo cycle, 4.3 um; what is left are chords of the table and a time base in whole parts.
    assert np.abs(early.command_um - command_um).max() < 0.5
    assert early.lobe_frequency_hz == pytest.approx(made.lobe_frequency_hz)
    assert early.response.gain == pytest.approx(made.response.gain)
    assert early.demands["force_n"].percent == pytest.approx(made.demands["force_n"].percent, rel=0.01)


def test_an_inverse_of_another_axis_leaves_what_the_two_responses_are_apart() -> None:
    """E |1 - T / T_hat|: 9.1 um of 55 for a lathe with 10 % more mass and 10 % less thrust."""
    true, known = (complex(sampled_response(machine, 50.0)) for machine in (TRUE, MACHINE))
    seen = outlook(SHORT, TRUE, Strategy.PVT, path_response(Strategy.PVT, MACHINE))
    early = given(closed_form(seen, Strategy.PVT))
    assert float(np.ptp(early.residual_um)) == pytest.approx(55.0 * abs(1.0 - true / known), abs=0.05)
    assert float(np.ptp(early.residual_um)) == pytest.approx(9.1, abs=0.2)


def test_what_only_a_program_can_say_is_not_guessed() -> None:
    seen = outlook(SHORT, MACHINE, Strategy.CAM)
    assert closed_form(seen, Strategy.PAPER) is None
    # Its command would be another one than that of the strategy that was chosen.
    assert closed_form(seen, Strategy.PVT) is None


def test_a_learned_path_is_what_everything_is_of() -> None:
    """One wave more in the command, of 2 um: what it leaves is that wave as the loop answers to it."""
    model = outlook(SHORT, MACHINE, Strategy.CAM)
    path = CutPath(target=model.target, command=model.command.plus({6: 2.0 + 0.0j}))
    seen = preview(SHORT, MACHINE, Strategy.CAM, path=path)
    early = given(closed_form(outlook(SHORT, MACHINE, Strategy.CAM, path=path), Strategy.CAM))
    assert seen.command == path.command
    delay_s = MACHINE.controller.servo_period_ms / 1000.0
    answer = complex(sampled_response(MACHINE, 100.0)) * cmath.exp(-2j * math.pi * 100.0 * delay_s)
    extra = PathHarmonic.from_coefficient(6, -2.0 * answer).at_um(early.angle_deg)
    assert early.residual_um == pytest.approx(extra, abs=1e-6)
    assert seen.predictions[Strategy.CAM].ront_um == pytest.approx(float(np.ptp(extra)), abs=0.1)
    # The others are of the model, as they were.
    assert seen.predictions[Strategy.TIMEBASE].ront_um < 0.1
    with pytest.raises(ProblemError) as refused:
        raise preview(SHORT, MACHINE, Strategy.PVT, path=path).strategies[Strategy.PVT]  # type: ignore[misc]
    assert [problem.code for problem in refused.value.problems] == ["program.no_overtones"]


@pytest.mark.parametrize(("depth_mm", "error_um"), [(0.02, 55.0), (0.1, 300.0)])
def test_a_tool_that_leaves_the_part_leaves_what_it_does_not_reach(depth_mm: float, error_um: float) -> None:
    """Round where it is clamped, the part keeps all of the lobe where the path is out of it: A - depth of A."""
    job = replace(SHORT, depth_of_cut_mm=depth_mm, lobe_error_um_pp=error_um)
    out_um = error_um / 2 - 1000 * depth_mm
    machine = with_one_lobe(MACHINE)
    early = closed_form(outlook(job, machine), Strategy.PVT)
    made = preview(job, machine).predictions[Strategy.PVT]
    assert early is not None
    for left_um in (early.residual_um, made.residual_um):
        assert float(np.ptp(left_um)) == pytest.approx(out_um, abs=0.1)
        assert abs(float(np.mean(left_um))) < 1e-9
