"""One answer to how hard a part must and may be clamped, in form, preview and arming; a measured wrench counts."""

from __future__ import annotations

import json
import math
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from console.cli.judgement import span_fields, span_line
from console.session.data.calibrated_chuck import calibrated
from console.session.data.kept_files import machines_folder
from console.session.work import opened
from console.text.catalogue import load
from console.tui.lines import plain
from console.tui.pages.run_lines import summary_lines
from console.tui.pages.setup_lines import speed_lines
from profiles.chucking.advice import ForceSpan, force_span
from profiles.chucking.holding import holding_of
from profiles.findings import Severity
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.rules import check
from profiles.store import load_job, load_machine
from tests.console.commands import Console, JobFile
from tests.tui.page_stage import READY

JOB = "lee-2001-experiment-1"
LOADED, LATHE = load_job(JOB), load_machine("lee-2001-lathe")


def form(job: Job, machine: MachineProfile) -> str:
    return plain(speed_lines(job, machine, load("en"), 29, 7))


def arming(job: Job) -> str:
    work = replace(opened(LOADED, LATHE), job=job)
    return plain(summary_lines(load("en"), READY, work, 0.0, 40))


@given(
    force_n=st.floats(100.0, 6000.0),
    speed_rpm=st.floats(100.0, 3000.0),
    wall_mm=st.floats(1.0, 26.0),
    depth_mm=st.floats(0.02, 0.5),
    material=st.sampled_from(["Al", "S45C", "unobtainium"]),
)
def test_form_preview_and_arming_say_the_same_of_any_job(
    force_n: float, speed_rpm: float, wall_mm: float, depth_mm: float, material: str
) -> None:
    job = replace(
        LOADED.job,
        chucking_force_n=force_n,
        spindle_speed_rpm=speed_rpm,
        wall_thickness_mm=wall_mm,
        depth_of_cut_mm=depth_mm,
        material=material,
    )
    (rule,) = [f for f in check(job, LATHE.machine) if f.problem.code == "rule.clamp_span"]
    said = span_fields(job, LATHE.machine)
    least_n, most_n = said["force_least_n"], said["force_most_n"]
    assert isinstance(least_n, float) and isinstance(most_n, float)
    assert (rule.problem.value, rule.problem.limit) == (f"{least_n:.6g} N", f"<= {most_n:.6g} N")
    assert (said["force_stands"] == "none") is (rule.severity is Severity.WARNING)
    # In whole newtons that will do themselves, of which the lower is never the higher one.
    least, most = math.ceil(least_n), math.floor(most_n)
    holds = least_n <= most_n
    assume(not holds or least <= most)
    form_words = f"{least} … {most} N" if holds else f"≥ {least}, ≤ {most} N"
    words = f"{least} … {most} N" if holds else f"none holds: the cut needs {least} N, the most is {most} N"
    assert form_words in form(job, LATHE.machine)
    assert words in span_line(job, LATHE.machine, load("en"))
    inside = said["force_stands"] == "inside"
    assert f"{'✓ ' if inside else '✗ ' if holds else '✗ none: '}{form_words}" in arming(job)
    assert ("force window ✓" in form(job, LATHE.machine)) is inside


def test_a_span_between_two_whole_newtons_is_not_upside_down() -> None:
    span = ForceSpan(least_n=253.21, most_n=253.87, binding="wall", limits_n={})
    assert span.shown_n == ("253.3", "253.8")
    assert replace(span, least_n=253.2101, most_n=253.2102).shown_n == ("253.2101", "253.2102")


@pytest.mark.parametrize(
    ("language", "none", "room"),
    [
        ("en", "none holds: the cut needs", "grip over a greater length"),
        ("ko", "맞는 힘 없음", "더 길게 물리십시오"),
    ],
)
def test_where_no_force_holds_every_command_says_so_with_both_numbers_and_a_way_out(
    console: Console, job_file: JobFile, language: str, none: str, room: str
) -> None:
    """A thin ring at a deep cut: what holds it bends its wall for good."""
    job = job_file(wall_thickness_mm="1.5", depth_of_cut_mm="0.5", cut_length_mm="0.5")
    loaded = load_job(str(job)).job
    span = force_span(loaded, LATHE.machine)
    assert span.empty
    least, most = f"{math.ceil(span.least_n)} N", f"{math.floor(span.most_n)} N"
    for command in ("preview", "predict"):
        said = console(command, str(job), "--lang", language).out
        (row,) = [line for line in said.splitlines() if none in line]
        assert row.index(least) < row.index(most)
        assert room in said
        assert f"{least.split()[0]} … {most.split()[0]}" not in said
    # What it advises does make room: a shallower cut, and longer jaws.
    assert not force_span(replace(loaded, depth_of_cut_mm=0.02), LATHE.machine).empty
    longer = replace(LATHE.machine.chuck, jaw_length_mm=3 * holding_of(LATHE.machine).jaw_length_mm)
    assert force_span(loaded, replace(LATHE.machine, chuck=longer)).most_n > span.most_n


def wrench(folder: Path, off_n: float) -> str:
    """Clampings at 200 N/(N m), at each torque one on the line and one on each side of it.

    They are `off_n` off in the mean square, and less at the higher torques: nothing in it grows with the torque.
    """
    off = {10: 1.25 * off_n, 20: off_n, 30: off_n, 40: math.sqrt(0.4375) * off_n}
    rows = [f"{torque:g},{200 * torque + d}" for torque in off for d in (-off[torque], 0, off[torque])]
    path = folder / "wrench.csv"
    path.write_text("\n".join(["torque_n_m,force_n", *rows]))
    return str(path)


def test_a_measured_wrench_is_used_by_form_arming_preview_prediction_and_run(
    console: Console, data_folder: Path, close: tuple[str, str], job_file: JobFile, tmp_path: Path
) -> None:
    """Its scatter by hand: 400 N sqrt(8 / 11) are 341 N, 6.8 % of the 5000 N in its middle, and no more 5 %.

    And its line: at 6.57 N m it is sure to 341 N x 6.57 / sqrt(sum Tq^2), all by one standard deviation.
    """
    job = job_file(cut_length_mm="0.5")
    kept = console(
        "calibrate", "chuck", wrench(tmp_path, 400.0), *close, "--keep", "--confirm", "200", "--json"
    ).json
    sd_share = 4.0 * math.sqrt(8 / 11) / 50
    line_sd_n = sd_share * 5000 * (1314 / 200) / math.sqrt(3 * (10**2 + 20**2 + 30**2 + 40**2))
    sd_n = math.hypot(1314 * sd_share, line_sd_n)
    most_n, words = 1970.2 * 0.05 / sd_share, f"6.57 N m ±{sd_n:.0f} N"
    data = data_folder / "trilobe"
    machine = calibrated(load_machine("lee-2001-lathe", machines_folder(data)), data)
    shown = form(LOADED.job, machine.machine)
    assert f"621 … {most_n:.0f} N" in shown and words in shown
    work = opened(LOADED, machine)
    assert f"621 … {most_n:.0f} N" in plain(summary_lines(load("en"), READY, work, 0.0, 40))
    seen = console("preview", str(job), *close, "--json").json
    assert seen["margins"]["force_most_n"] == pytest.approx(most_n, rel=1e-3)
    assert seen["margins"]["force_limit"] == "scatter"
    assert seen["calibrations"] == machine.used
    predicted = console("predict", str(job), *close, "--json").json["clamping"]
    assert predicted["maximum_n"] == seen["margins"]["force_most_n"]
    assert predicted["torque_n_m"] == pytest.approx(1314 / 200)
    sds_n = [predicted[f"{name}_sd_n"] for name in ("at_rest", "scatter", "line")]
    assert sds_n == pytest.approx([sd_n, 1314 * sd_share, line_sd_n])
    said = console("run", str(job), "--sim", *close, "--strategy", "none")
    assert said.code == 0, said.err
    told = next(line for line in said.out.splitlines() if "6.57 N m at the wrench" in line)
    assert f"safe: 621 … {most_n:.0f} N" in told
    assert said.out.splitlines().index(told) == 1, "before anything is done to a part"
    database = sqlite3.connect(data / "records.sqlite3")
    events = dict(database.execute("SELECT kind, data FROM events").fetchall())
    database.close()
    of_wrench = ("force_per_torque_n_per_n_m", "force_offset_n", "force_sd_percent")
    assert json.loads(events["planned"])["calibrations"] == dict.fromkeys(of_wrench, kept["date"])
    assert json.loads(events["result"])["clamping"]["force_most_n"] == predicted["maximum_n"]


def test_a_contradiction_of_what_a_profile_states_is_told_by_what_judges_a_job(
    console: Console, job_file: JobFile, tmp_path: Path
) -> None:
    text = LATHE.path.read_text(encoding="utf-8").replace('  "chuck.force_per_torque_n_per_n_m",\n', "")
    own = tmp_path / "stated.toml"
    own.write_text(text, encoding="utf-8")
    machine, job = ("--machine", str(own)), str(job_file(cut_length_mm="0.5"))
    assert console("calibrate", "chuck", wrench(tmp_path, 30.0), *machine, "--keep", "--confirm", "200").code == 0
    for command in ("preview", "predict", "program"):
        said = console(command, job, *machine, "--json")
        assert said.code == 0
        assert any("the profile is used" in warning for warning in said.json["warnings"])
