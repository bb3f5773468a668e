"""Kept calibrations give what a profile leaves open, and one answer to how hard a part is clamped."""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from console.cli.judgement import span_fields, span_line
from console.session.data.calibrated_chuck import (
    CalibratedMachine,
    apply_calibrations,
    calibrated_or_stated,
    warnings_of,
)
from console.session.data.kept_files import machines_folder
from console.session.data.stop_records import record_path
from console.session.work import open_work
from console.text.catalogue import load
from console.text.catalogue import load as catalogue
from console.tui.lines import plain_text
from console.tui.pages.run_lines import summary_lines
from console.tui.pages.setup_lines import finding_lines, speed_lines
from drivers.commissioning.fingerprint import console_facts, read_fingerprint
from drivers.commissioning.stop_record import stop_key
from drivers.cutting.planning import Strategy, first_spindle_counts, plan_cut
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import as_simulated, ideal
from profiles.chucking.advice import ForceSpan, clamping_advice, force_span
from profiles.chucking.holding import holding_of
from profiles.findings import Severity
from profiles.job import Job
from profiles.least_squares import student
from profiles.machine import MachineProfile, real_machine_problems
from profiles.problem import ProfileError
from profiles.rules import check, lobe_as_found
from profiles.store import BUNDLED_MACHINES, load_job, load_machine
from tests.console.commands import Console, JobFile
from tests.console.test_calibration_steps import jaws
from tests.tui.page_stage import READY

EXPERIMENT = load_job("lee-2001-experiment-1")
JOB = EXPERIMENT.job
LOADED = load_machine("lee-2001-lathe")
LATHE = LOADED.machine
STATED = replace(LATHE, assumed=())
OPEN = replace(
    STATED,
    chuck=replace(
        LATHE.chuck,
        force_per_torque_n_per_n_m=None,
        force_sd_percent=None,
        jaw_stiffness_n_per_um=None,
        jaw_contact_exponent=None,
    ),
)
TORQUE = np.repeat([10.0, 20.0, 30.0, 40.0], 3)


@pytest.fixture
def data(data_folder: Path) -> Path:
    return data_folder / "trilobe"


def wrench(folder: Path, slope: float, offset_n: float, sd_n: float) -> str:
    force = offset_n + slope * TORQUE + np.random.default_rng(4).normal(0.0, sd_n, TORQUE.size)
    rows = [f"{t:g},{f:.3f}" for t, f in zip(TORQUE, force, strict=True)]
    path = folder / "wrench.csv"
    path.write_text("\n".join(["torque_n_m,force_n", *rows]))
    return str(path)


def with_calibrations(machine: MachineProfile, data: Path) -> CalibratedMachine:
    return apply_calibrations(replace(LOADED, machine=machine), data)


def warned(job: Job, machine: MachineProfile) -> set[str]:
    return {f.problem.key for f in lobe_as_found(job, machine) if f.severity is Severity.WARNING}


def test_what_is_open_comes_from_the_newest_calibrations(console: Console, tmp_path: Path, data: Path) -> None:
    assert with_calibrations(OPEN, data).machine == OPEN
    for words in ((wrench(tmp_path, 280.0, 0.0, 50.0),), (wrench(tmp_path, 300.0, 400.0, 60.0), "--affine")):
        said = console("calibrate", "chuck", *words, "--keep", "--json")
        assert said.code == 0
    assert set(said.json["found"]["profile"]) == {
        "force_per_torque_n_per_n_m",
        "force_offset_n",
        "force_sd_percent",
    }
    assert (
        console("calibrate", "chuck", jaws(tmp_path, length_mm=30.0, n_per_um=60.0, alpha=0.4), "--keep").code == 0
    )
    found = with_calibrations(OPEN, data)
    chuck = found.machine.chuck
    assert chuck.force_per_torque_n_per_n_m == pytest.approx(300.0, rel=0.02)
    assert chuck.force_offset_n == pytest.approx(400.0, abs=120.0)
    # 60 N of 400 + 300 x 25 N.
    assert chuck.force_sd_percent == pytest.approx(100 * 60 / 7900, rel=0.5)
    assert chuck.jaw_stiffness_n_per_um == pytest.approx(60.0, rel=0.02)
    assert chuck.jaw_contact_exponent == pytest.approx(0.4, abs=0.02)
    assert found.sources["force_offset_n"] == found.sources["force_sd_percent"] == said.json["date"]
    assert found.sources["jaw_stiffness_n_per_um"] > said.json["date"]
    assert found.sources["jaw_length_mm"] == "", "that one is the profile's own"
    # The profile says 40 mm of jaws; the deflections say 30.
    assert [(p.code, p.key) for p in found.warnings] == [("calibration.differs", "chuck.jaw_length_mm")]
    torque = clamping_advice(JOB, found.machine).torque_n_m
    assert torque == pytest.approx((1314.0 - 400.0) / 300.0, rel=0.15)
    assert clamping_advice(JOB, OPEN).torque_n_m is None


def test_a_prediction_says_where_what_it_knows_of_the_chuck_is_from(console: Console, tmp_path: Path) -> None:
    text = (BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if "force_per_torque" not in line]
    machine = tmp_path / "open.toml"
    machine.write_text("\n".join(kept), encoding="utf-8")
    words = ("predict", JOB.name, "--machine", str(machine), "--json")
    assert console(*words).json["clamping"]["torque_n_m"] is None
    wrench_words = (wrench(tmp_path, 300.0, 0.0, 50.0), "--machine", str(machine), "--keep", "--json")
    date = console("calibrate", "chuck", *wrench_words).json["date"]
    said = console(*words).json
    assert said["clamping"]["torque_n_m"] == pytest.approx(1314 / 300, rel=0.02)
    assert said["sources"]["chuck.force_per_torque_n_per_n_m"] == date
    assert said["sources"]["chuck.jaw_length_mm"] == "profile"
    told = console(*words[:-1])
    assert f"from the calibration of {date}: chuck.force_per_torque_n_per_n_m" in told.out


def test_what_a_profile_says_it_says_and_half_a_line_is_not_completed(
    console: Console, tmp_path: Path, data: Path
) -> None:
    """With a slope of its own the profile has no offset: that of another line would be of no line at all."""
    for name in ("lee-2001-lathe", "turbo-ethernet-lathe"):
        loaded = load_machine(name)
        plain = apply_calibrations(loaded, data)
        assert (plain.machine, plain.path, plain.sha256) == (loaded.machine, loaded.path, loaded.sha256)
        assert (plain.calibration_dates, plain.warnings) == ({}, ())
    for slope, told in ((377.0, []), (300.0, ["calibration.differs"])):
        assert console("calibrate", "chuck", wrench(tmp_path, slope, 0.0, 50.0), "--keep").code == 0
        found = with_calibrations(STATED, data)
        assert (found.machine, found.calibration_dates, set(found.sources.values())) == (STATED, {}, {""})
        assert [problem.code for problem in found.warnings] == told
    assert console("calibrate", "chuck", wrench(tmp_path, 300.0, 400.0, 60.0), "--affine", "--keep").code == 0
    only_slope: MachineProfile = replace(OPEN, chuck=replace(OPEN.chuck, force_per_torque_n_per_n_m=310.0))
    chuck = with_calibrations(only_slope, data).machine.chuck
    assert chuck.force_offset_n is None and chuck.force_sd_percent is not None


def test_an_assumed_value_gives_way_to_a_measured_one(console: Console, tmp_path: Path, data: Path) -> None:
    """The bundled lathe assumes 377 N/(N m) and 5 %; a line is one thing, and takes its offset along."""
    assert "chuck.force_per_torque_n_per_n_m" in LATHE.assumed
    told = console("calibrate", "chuck", wrench(tmp_path, 300.0, 400.0, 60.0), "--affine", "--keep", "--json")
    found = apply_calibrations(LOADED, data)
    chuck, profile = found.machine.chuck, told.json["found"]["profile"]
    assert {key: getattr(chuck, key) for key in profile} == profile
    assert chuck.force_offset_n == pytest.approx(400.0, abs=120.0)
    measured = {f"chuck.{key}" for key in profile}
    assert set(LATHE.assumed) - set(found.machine.assumed) == measured & set(LATHE.assumed)
    assert found.calibration_dates == dict.fromkeys(profile, told.json["date"])
    assert found.warnings == ()
    assert (found.path, found.sha256) == (LOADED.path, LOADED.sha256)
    # The slope as it is stated: then neither of the two is the calibration's, and it is told.
    half = replace(LATHE, assumed=tuple(name for name in LATHE.assumed if "torque" not in name))
    stays = with_calibrations(half, data)
    assert (stays.machine.chuck.force_per_torque_n_per_n_m, stays.machine.chuck.force_offset_n) == (377.0, None)
    assert [problem.code for problem in stays.warnings] == ["calibration.differs"]
    assert set(stays.calibration_dates) == {"force_sd_percent"}


def test_what_is_proven_does_not_look_at_calibrations(console: Console, tmp_path: Path, data: Path) -> None:
    """Stop record, what is ours on the card, and why a response is another one's: as without.

    The program is, but for the lobe along Z, which depends on the length of the jaws.
    """
    for table in (wrench(tmp_path, 300.0, 0.0, 50.0), jaws(tmp_path, length_mm=30.0, n_per_um=60.0, alpha=0.4)):
        assert console("calibrate", "chuck", table, "--keep").code == 0
    found = apply_calibrations(LOADED, data)
    assert found.machine.chuck != LATHE.chuck
    own, other = (replace(machine, chuck=LATHE.chuck, assumed=()) for machine in (LATHE, found.machine))
    assert own == other, "nothing but the chuck and what is assumed of it"
    sim = SimulatedLathe(LATHE)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    before, after = (
        (
            stop_key(client, machine, client.dialect),
            console_facts(machine, client.dialect),
            read_fingerprint(client, machine, client.dialect).configuration,
            real_machine_problems(machine),
            record_path(data, machine),
            first_spindle_counts(JOB, machine, Strategy.PVT),
            plan_cut(JOB, as_simulated(machine, None), Strategy.PVT).text,
        )
        for machine in (LATHE, found.machine)
    )
    assert before == after
    assert ideal(LATHE) == ideal(found.machine)


NOT_OURS: dict[str, Callable[[dict[str, Any]], object]] = {
    "not json": lambda record: None,
    "without": lambda record: record["found"].pop("profile"),
    "wild": lambda record: record["found"]["profile"].update(force_sd_percent=400.0),
    "of another": lambda record: record.update(subject="another lathe"),
}


@pytest.mark.parametrize("broken", NOT_OURS)
def test_a_broken_calibration_is_refused(console: Console, tmp_path: Path, data: Path, broken: str) -> None:
    assert console("calibrate", "chuck", wrench(tmp_path, 300.0, 0.0, 50.0), "--keep").code == 0
    (file,) = data.rglob("wrench-*.json")
    record = json.loads(file.read_text())
    NOT_OURS[broken](record)
    file.write_text("{" if broken == "not json" else json.dumps(record))
    code = "calibration.unusable" if broken == "wild" else "calibration.record"
    with pytest.raises(ProfileError, match=code):
        apply_calibrations(LOADED, data)
    for words in (("predict", JOB.name), ("preview", JOB.name), ("run", JOB.name, "--sim"), ("program", JOB.name)):
        said = console(*words)
        assert (said.code, said.out) == (1, "")
        assert str(file) in said.err and "remove the file" in said.err
    opened = calibrated_or_stated(LOADED, data)
    assert opened.machine == LATHE
    assert [problem.code for problem in opened.warnings] == ["calibration.not_used", code]
    assert opened.warnings[1].where == str(file)
    told = " ".join(
        plain_text(finding_lines(check(JOB, opened.machine), catalogue("en"), 60, 30, warnings_of(opened))).split()
    )
    assert "remove the file" in told and "NO chuck calibration is used" in told


def test_a_fit_that_is_no_whole_one_or_does_not_say_how_sure_it_is_is_none_of_ours(
    console: Console, tmp_path: Path, data: Path
) -> None:
    assert console("calibrate", "chuck", wrench(tmp_path, 377.0, 0.0, 50.0), "--keep").code == 0
    (file,) = data.rglob("wrench-*.json")
    record = json.loads(file.read_text())
    changes: list[dict[str, Any]] = [{"covariance": [1.0]}, {"covariance": [-1.0, 0.0, 1.0]}]
    changes += [{"sd_n": wrong} for wrong in ("much", "11.5", True)]
    for change in changes:
        file.write_text(json.dumps({**record, "found": {**record["found"], **change}}))
        with pytest.raises(ProfileError) as refused:
            apply_calibrations(LOADED, data)
        assert [problem.code for problem in refused.value.problems] == ["calibration.record"], change
    del record["found"]["slope_n_per_n_m"]
    file.write_text(json.dumps(record))
    with pytest.raises(ProfileError, match=r"calibration\.record"):
        with_calibrations(STATED, data)


def test_a_slope_that_is_hardly_known_is_told_and_an_impossible_scatter_is_not_kept(
    console: Console, tmp_path: Path, data: Path
) -> None:
    sure = console("calibrate", "chuck", wrench(tmp_path, 377.0, 0.0, 300.0))
    unsure = console("calibrate", "chuck", wrench(tmp_path, 377.0, 0.0, 3000.0))
    assert (sure.code, unsure.code) == (0, 0)
    assert "slope" not in sure.err and "force_sd_percent = " in sure.out
    assert "slope" in unsure.err and "<= 10 %" in unsure.err
    torque = np.repeat(np.linspace(10.0, 40.0, 4), 15)
    force = torque * 300.0 * np.where(np.arange(torque.size) % 2, 1.9, 0.1)
    path, rows = tmp_path / "wild.csv", (f"{t:g},{f:g}" for t, f in zip(torque, force, strict=True))
    path.write_text("\n".join(["torque_n_m,force_n", *rows]))
    said = console("calibrate", "chuck", str(path), "--keep")
    assert said.code == 1 and "chuck.force_sd_percent" in said.err
    assert list(data.rglob("wrench-*.json")) == [] and console("calibrate", "chuck", str(path)).code == 0


def test_a_lobe_is_kept_with_its_chuck_and_tool(console: Console, tmp_path: Path, data: Path) -> None:
    angle = np.arange(360.0)
    rng = np.random.default_rng(1)
    deviation = 27.5 * np.cos(3 * np.radians(angle - 92.0)) + rng.normal(0.0, 0.3, 360)
    rows = [f"{a:g},{d:.4f}" for a, d in zip(angle, deviation, strict=True)]
    head = ("# state: free", "# direction: spindle", "# start_mark: spindle index", "angle_deg,deviation_um")
    path = tmp_path / "trace.csv"
    path.write_text("\n".join([*head, *rows]))
    assert console("calibrate", "lobe", str(path), "--job", JOB.name, "--keep").code == 0
    kept = load_job(f"{JOB.name}-2", data / "jobs").job
    assert (kept.lobe_chuck, kept.lobe_tool) == (LATHE.chuck.name, LATHE.tool.name)
    chuck, tool = replace(LATHE.chuck, name="collet"), replace(LATHE.tool, name="CCMT")
    other = replace(LATHE, chuck=chuck, tool=tool)
    judged = {name: warned(kept, machine) for name, machine in (("own", LATHE), ("other", other))}
    assert judged == {"own": set(), "other": {"chuck.name", "tool.name"}}


def test_a_calibration_of_another_chuck_is_not_used(console: Console, tmp_path: Path, data: Path) -> None:
    """The newest of the chuck that is on counts; where there is none, what is known of another one is not it."""
    for slope in (300.0, 280.0):
        assert console("calibrate", "chuck", wrench(tmp_path, slope, 0.0, 50.0), "--keep").code == 0
    older, newer = sorted(data.rglob("wrench-*.json"))
    record = json.loads(newer.read_text())
    assert record["chuck"] == LATHE.chuck.name
    newer.write_text(json.dumps({**record, "chuck": "collet"}))
    found = apply_calibrations(LOADED, data)
    assert found.machine.chuck.force_per_torque_n_per_n_m == pytest.approx(300.0, rel=0.02)
    assert found.warnings == ()
    older.unlink()
    other = apply_calibrations(LOADED, data)
    assert other.machine == LATHE and other.calibration_dates == {}
    (told,) = other.warnings
    assert (told.code, told.value, told.limit) == ("calibration.other_chuck", '"collet"', f'"{LATHE.chuck.name}"')
    assert "NOT used" in catalogue("en").problem(told) and "collet" in catalogue("ko").problem(told)
    no_name = {key: value for key, value in record.items() if key != "chuck"}
    newer.write_text(json.dumps(no_name))
    assert apply_calibrations(LOADED, data).calibration_dates, (
        "kept before the name was: nobody says that it is of another"
    )


def test_the_force_of_a_clamping_is_as_sure_as_the_fit_says(console: Console, tmp_path: Path, data: Path) -> None:
    """By the 95 % band of one clamping of `calibrate chuck`, at the middle torque, over Student's t.

    The band is the widest of the kinds of scatter that the table does not rule out, the advice of the likeliest.
    """
    table = wrench(tmp_path, 300.0, 400.0, 60.0)
    kept = console("calibrate", "chuck", table, "--affine", "--torque", "25", "--keep", "--json").json
    band = kept["asked"]["torque 25"]
    job = replace(JOB, chucking_force_n=band["value"])
    advice = clamping_advice(job, apply_calibrations(LOADED, data).machine)
    sd_n = (band["high"] - band["value"]) / student(10)
    assert 0.9 * sd_n < advice.at_rest_sd_n <= sd_n * (1.0 + 1e-6)
    assert advice.at_rest_sd_n == pytest.approx(math.hypot(advice.scatter_sd_n, advice.line_sd_n))
    assert 0.0 < advice.line_sd_n < advice.scatter_sd_n
    assert clamping_advice(job, LATHE).line_sd_n == 0.0, "a line that is only stated"


def form(job: Job, machine: MachineProfile) -> str:
    return plain_text(speed_lines(job, machine, load("en"), 29, 7))


def arming(job: Job) -> str:
    work = replace(open_work(EXPERIMENT, LOADED), job=job)
    return plain_text(summary_lines(load("en"), READY, work, 0.0, 40))


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
        EXPERIMENT.job,
        chucking_force_n=force_n,
        spindle_speed_rpm=speed_rpm,
        wall_thickness_mm=wall_mm,
        depth_of_cut_mm=depth_mm,
        material=material,
    )
    (rule,) = [f for f in check(job, LOADED.machine) if f.problem.code == "rule.clamp_span"]
    said = span_fields(job, LOADED.machine)
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
    assert form_words in form(job, LOADED.machine)
    assert words in span_line(job, LOADED.machine, load("en"))
    inside = said["force_stands"] == "inside"
    assert f"{'✓ ' if inside else '✗ ' if holds else '✗ none: '}{form_words}" in arming(job)
    assert ("force window ✓" in form(job, LOADED.machine)) is inside


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
def test_where_no_force_holds(console: Console, job_file: JobFile, language: str, none: str, room: str) -> None:
    """A thin ring at a deep cut: what holds it bends its wall for good."""
    job = job_file(wall_thickness_mm="1.5", depth_of_cut_mm="0.5", cut_length_mm="0.5")
    loaded = load_job(str(job)).job
    span = force_span(loaded, LOADED.machine)
    assert span.empty
    least, most = f"{math.ceil(span.least_n)} N", f"{math.floor(span.most_n)} N"
    for command in ("preview", "predict"):
        said = console(command, str(job), "--lang", language).out
        (row,) = [line for line in said.splitlines() if none in line]
        assert row.index(least) < row.index(most)
        assert room in said
        assert f"{least.split()[0]} … {most.split()[0]}" not in said
    # What it advises does make room: a shallower cut, and longer jaws.
    assert not force_span(replace(loaded, depth_of_cut_mm=0.02), LOADED.machine).empty
    longer = replace(LOADED.machine.chuck, jaw_length_mm=3 * holding_of(LOADED.machine).jaw_length_mm)
    assert force_span(loaded, replace(LOADED.machine, chuck=longer)).most_n > span.most_n


def wrench_of_rule(folder: Path, off_n: float) -> str:
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
        "calibrate", "chuck", wrench_of_rule(tmp_path, 400.0), *close, "--keep", "--confirm", "200", "--json"
    ).json
    sd_share = 4.0 * math.sqrt(8 / 11) / 50
    line_sd_n = sd_share * 5000 * (1314 / 200) / math.sqrt(3 * (10**2 + 20**2 + 30**2 + 40**2))
    sd_n = math.hypot(1314 * sd_share, line_sd_n)
    most_n, words = 1970.2 * 0.05 / sd_share, f"6.57 N m ±{sd_n:.0f} N"
    data = data_folder / "trilobe"
    machine = apply_calibrations(load_machine("lee-2001-lathe", machines_folder(data)), data)
    shown = form(EXPERIMENT.job, machine.machine)
    assert f"621 … {most_n:.0f} N" in shown and words in shown
    work = open_work(EXPERIMENT, machine)
    assert f"621 … {most_n:.0f} N" in plain_text(summary_lines(load("en"), READY, work, 0.0, 40))
    seen = console("preview", str(job), *close, "--json").json
    assert seen["margins"]["force_most_n"] == pytest.approx(most_n, rel=1e-3)
    assert seen["margins"]["force_limit"] == "scatter"
    assert seen["calibrations"] == machine.calibration_dates
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


def test_a_contradiction_of_a_profile_is_told(console: Console, job_file: JobFile, tmp_path: Path) -> None:
    text = LOADED.path.read_text(encoding="utf-8").replace('  "chuck.force_per_torque_n_per_n_m",\n', "")
    own = tmp_path / "stated.toml"
    own.write_text(text, encoding="utf-8")
    machine, job = ("--machine", str(own)), str(job_file(cut_length_mm="0.5"))
    assert (
        console("calibrate", "chuck", wrench_of_rule(tmp_path, 30.0), *machine, "--keep", "--confirm", "200").code
        == 0
    )
    for command in ("preview", "predict", "program"):
        said = console(command, job, *machine, "--json")
        assert said.code == 0
        assert any("the profile is used" in warning for warning in said.json["warnings"])
